import os
import sys
import time
from pathlib import Path

import yaml
from snakemake.exceptions import WorkflowError
from snakemake.utils import validate

WORKFLOW = Path(str(workflow.current_basedir)).parent
sys.path.insert(0, str(WORKFLOW / "src"))

from addvc import config as settings
from addvc import studies
from addvc.config_check import check_config
from addvc.errors import AddvcError, error_in
from addvc.provenance import code_hash

STARTED = time.time()
SCHEMA = WORKFLOW / "schemas/config.schema.yaml"


def images_words(config):
    """What the images of a case are; of scans after a look at each."""
    if "scans" in config:
        from addvc.images.scans_check import check_headers  # slow to load

        words = check_headers(config)
        if truth := settings.truth_file(config):
            from addvc.analysis.truth import check_truth

            check_truth(truth, len(settings.state_labels(config)))
        return words
    twin, states = config["twin"], len(settings.state_labels(config))
    return f"a synthetic test, {twin['size']}, seed {twin['seed']}, of {states} states"


def checked_config(config):
    """The configuration with its defaults; WorkflowError says which keys are wrong, and the remedy."""
    try:
        schema = yaml.safe_load(SCHEMA.read_text())
        warnings = check_config(config, schema)
        if settings.case_kind(config) == "twin":
            config.setdefault("twin", {})
        validate(config, str(SCHEMA))
        states = list(settings.state_labels(config))
        if states:
            studies.studied_state(config, states)
        if workflow.is_main_process:
            for words in warnings:
                print(f"WARNING: {words}", file=sys.stderr)
            print(
                f"addvc: case {config['case']}: {images_words(config)}; "
                f"results go to results/{config['case']}/, the last is report.html",
                file=sys.stderr,
            )
        return [settings.scan_files(path) for path in settings.scan_paths(config)]
    except AddvcError as error:
        case = config.get("case", "(none)")
        raise WorkflowError(f"Configuration of case {case}: {error}") from error


SCAN_FILES = checked_config(config)
HELD = any(files[0].lower().endswith(settings.WHOLE) for files in SCAN_FILES)
SCAN_MEMORY = 6.0 if HELD else 1.0
CASE = config["case"]
KIND = settings.case_kind(config)
R = f"results/{CASE}"
AXIS = settings.loading_axis(config)
LABELS = settings.state_labels(config)
STATES = list(LABELS)
MESO = settings.meso_names(config)
FINEST = MESO[-1]
METHODS = settings.micro_names(config)
MICRO = list(METHODS)
EQUILIBRIUM = config["struts"]["equilibrium"] and KIND != "virtual"  # waves are in none
STRUT_RESULTS = {  # results that struts are measured on, and how their columns end
    MICRO[0]: "",
    **({f"{MICRO[0]}_raw": "_raw"} if EQUILIBRIUM else {}),
    FINEST: "_meso",
}
NETWORK = settings.network_names(config)
RESULTS = [*MESO, *NETWORK, *MICRO]  # all that is measured on, coarse to fine
EARLIER = ["previous", "extrapolated", "composed"]  # starts that need the state before
FREEFORM = ["freeform"] if "freeform" in config["meso"]["candidates"] else []
# All that a truth, where known, is compared with.
JUDGED = [*MESO, *NETWORK, *FREEFORM, *MICRO]
TRUTH = settings.truth_file(config) if KIND == "scans" else None
if KIND == "virtual":
    TRUTH = f"{R}/truth/virtual.json"
    SCANS = f"{R}/scans"
if KIND == "twin":  # kept by its options, so that cases share it
    TWIN_MOTION, TWIN_SCANS = settings.twin_parts(config)
    MOTION_FOLDER = settings.twin_folder(TWIN_MOTION)
    TRUTH = f"{MOTION_FOLDER}/motion.h5"
    NETWORKS = expand(f"{MOTION_FOLDER}/network_state{{state}}.vtu", state=[0, *STATES])
    SCANS = f"{settings.twin_folder(TWIN_SCANS)}/scans"
HAS_TRUTH = TRUTH is not None
ENV = "../../envs/addvc.yaml"


wildcard_constraints:
    state=r"\d+",
    mesh="|".join(RESULTS),
    meso="|".join(MESO),
    micro="|".join(MICRO),
    candidate="zero|platens",
    field="|".join(["freeform", *EARLIER]),


def code(script):
    """Hash of a script of workflow/scripts and of the modules that it uses."""
    return code_hash(WORKFLOW / "scripts" / script)


def section(name, *keys):
    """The keys of a section of the configuration that a rule reads, so that a change reruns it."""
    return {key: config[name][key] for key in keys if key in config[name]}


def memory(least, per_input=3.0):
    """Megabytes: `least`, or `per_input` times the size of the inputs; more at each attempt."""
    return lambda wildcards, input, attempt: int(
        attempt * max(least, 600, per_input * input.size_mb)
    )


def memory_by_largest(least, per_file):
    """The same by the largest input: of jobs that hold few of their images at a time."""
    return lambda wildcards, input, attempt: int(
        attempt * max(least, 600, per_file * max(input.size_files_mb, default=0))
    )


def own_scan(state):
    """Whether the scan of a state is made by the workflow."""
    return KIND == "twin" or (KIND == "virtual" and state > 0)


def scan_path(state):
    """The path of a scan as the configuration has it: a file, a folder or a pattern."""
    if own_scan(state):
        return f"{SCANS}/state{state}.tif"
    return settings.scan_paths(config)[state]


def scan_input(state):
    """The files of a scan."""
    return [scan_path(state)] if own_scan(state) else SCAN_FILES[state]


def grey_reference(wildcards):
    """What the grey levels of a state are brought to, where they are."""
    if config["images"]["grey"] == "none" or wildcards.state == "0":
        return {}
    return {"reference": f"{R}/volumes/volume0.h5"}


def fields_of(wildcards):
    """Candidates of a state that are defined everywhere, so that any mesh may start from them; the one
    of the wildcard `field` alone, where there is one."""
    if "field" in wildcards.keys():
        return [wildcards.field]
    later = EARLIER if int(wildcards.state) > 1 else []
    return [
        name for name in config["meso"]["candidates"] if name in ["freeform", *later]
    ]


def field_files(wildcards):
    """What these candidates are made from (`addvc.correlation.candidates`)."""
    names, before = fields_of(wildcards), int(wildcards.state) - 1
    files = {}
    if "freeform" in names:
        files["freeform"] = f"{R}/dvc/freeform_state{wildcards.state}.h5"
    if set(names) & set(EARLIER):
        files["previous"] = f"{R}/dvc/{FINEST}_state{before}.h5"
        files["finest"] = f"{R}/geometry/{FINEST}.vtu"
        files["deformed_before"] = f"{R}/volumes/smooth{before}.h5"
    if "composed" in names:
        files["step"] = f"{R}/dvc/step_state{wildcards.state}.h5"
    return files


def pyramid_files(wildcards):
    """The starts by the pyramid, and the grid that one of them is on."""
    files = {
        name: f"{R}/dvc/start-{name}_state{wildcards.state}.h5"
        for name in config["meso"]["candidates"]
        if name in ["zero", "platens"]
    }
    if "platens" in files:
        files |= {"grid": f"{R}/geometry/grid.vtu", "lines": f"{R}/geometry/grid.json"}
    return files


def mesh_of_candidate(wildcards):
    """`zero` starts on the coarsest mesh, `platens` on the grid."""
    name = "grid" if wildcards.candidate == "platens" else MESO[0]
    return f"{R}/geometry/{name}.vtu"


def of_state(pattern, names):
    """Files of one state, one for each name: `{mesh}` in the pattern, `{state}` left to the rule."""
    return expand(f"{R}/{pattern}", mesh=names, state="{state}")


def on_micro(names):
    """The displacements of results at the nodes of the micro mesh, in one state."""
    parts = [name if name in MICRO else f"{name}_on_micro" for name in names]
    return of_state("dvc/{mesh}_state{state}.h5", parts)


def starts_on_micro(wildcards):
    """The candidate starts of micro DVC at its nodes."""
    names = [FINEST, *fields_of(wildcards)]
    return [f"{R}/dvc/{name}_on_micro_state{wildcards.state}.h5" for name in names]


def mesh_of(name):
    """The file of the mesh of a result."""
    return f"{R}/geometry/{settings.mesh_name(name)}.vtu"


def method_of(wildcards):
    """The method of a micro result."""
    return METHODS[wildcards.micro]
