"""The words that go with the numbers: closing lines, front page, warnings, strictness."""

import base64
import copy
import io
from pathlib import Path

import docutils.core
import docutils.nodes
import numpy as np
import pytest
from matplotlib.image import imread, imsave
from snakemake.utils import validate

from addvc.errors import AddvcError, grey_words
from addvc.report.doubts import strain_warnings
from addvc.report.page_tables import (
    convergence_table,
    convergence_words,
    network_words,
    results_table,
)
from addvc.report.sentences import (
    REASONS,
    bridge_words,
    noise_words,
    state_words,
    strut_words,
)
from addvc.report.thumbnail import thumbnail
from addvc.report.words import (
    check_verdicts,
    closing_lines,
    front_page,
    linked,
    micro_name,
    warnings,
)

CONFIG = {
    "case": "foam-2_b",
    "porosity": 0.96,
    "scans": {"reference": "scans/*.tif", "states": ["2/_a_/|x|"], "voxel_size_um": 6.67},
    "micro": {"methods": ["eq10"]},
}
validate(CONFIG, str(Path(__file__).parents[2] / "workflow/schemas/config.schema.yaml"))
SCANS = {
    "scans": [
        {"path": path, "shape": [72, 84, 72], "dtype": "uint8", "fingerprint": "ab" * 32}
        for path in ("scans/reference.tif", "/data/state_1/slice*.tif", "scans/*.tif", "2/_a_/|x|")
    ],
    "bin": 1,
}
MESH = {
    "nodes": 283, "cells": 1112, "mean_edge": 12.06, "mean_volume": 147.5, "min_dihedral": 10.2,
    "ultimate_error": 2.1e-3, "ultimate_converged": True,
    "kept_fraction": 0.99, "voxel_kept_fraction": 0.98,
}  # fmt: skip
ERROR = {"median": 0.0325, "p95": 0.0838, "rms": 0.045}


def found(converged=True, valid=1.0, error=ERROR):
    """What is said of one mesh in one state."""
    return {
        "converged": converged,
        "start": "meso23",
        "iterations": 4 if converged else 40,
        "last_step": 4.2e-4 if converged else 0.31,
        "residual_std": 0.56,
        "residual_mean": -0.5,
        "valid_nodes": valid,
        "l_e": 23.0,
        "l_l": None,
        "weight": None,
        "refused": None,
        "seconds": 0.3,
        "error": error,
    }


def state(number, verdict, **micro):
    """One state: the meso mesh is always in order."""
    return {
        "state": number,
        "label": f"{number}.4 %",
        "strain": 0.011 * number,
        "start": "zero",
        "micro_start": "freeform",
        "candidates": [],
        "verdict": verdict,
        "meso12": found(error=micro.get("error", ERROR)),
        "micro": found(**micro),
        "uncertainty": {"rms": 0.07},
        "struts": None,
    }


def summary(*states):
    return {
        "case": "foam-2_b",
        "methods": {"micro": "eq10"},
        "results": ["meso12", "micro"],
        "cell_size": 27.98,
        "threshold": 49.06,
        "porosity": 0.96,
        "noise": 1.0,
        "voxel_size_um": 20.01,
        "meshes": {"meso12": MESH, "micro": MESH},
        "states": list(states),
        "cost": {"volume": {"jobs": 2, "cpu_s": 1.0, "wall_s": 2.0, "max_rss_mb": 99.0},
                 "micro_dvc": {"jobs": 1, "cpu_s": 9.0, "wall_s": 9.0, "max_rss_mb": 300.0}},
        "versions": {"addvc": "0.1.0", "numpy": "2.1", "commit": "ab12"},
    }  # fmt: skip


GOOD = state(1, "converged")
DOUBTFUL = state(2, "flagged", valid=0.8)
ENDLESS = state(3, "flagged", converged=False)
LOST = state(4, "failed", converged=False, valid=0.2)
UNKNOWN = state(5, "failed", converged=False, valid=0.0)  # left the image: no number in the file
UNKNOWN["micro"] |= {"residual_std": None, "residual_mean": None, "last_step": None}
REAL = state(6, "converged", error=None)
ALL = (GOOD, DOUBTFUL, ENDLESS, LOST, UNKNOWN)


def sections(text):
    """Title -> text of the sections of a page, by docutils."""
    tree = docutils.core.publish_doctree(text, settings_overrides={"report_level": 5})
    return {part[0].astext(): part.astext() for part in tree.findall(docutils.nodes.section)}


def test_the_network_fit_has_a_row_beside_its_mesh():
    """With its weight, or what is told where it is as it was."""
    fit = {"weight": 1e5, "start": None}
    taken = GOOD | {"meso12-network": found() | fit | {"error": ERROR | {"rms": 0.021}}}
    same = DOUBTFUL | {"meso12-network": found() | {"weight": None, "refused": "no loads help"}}
    given = summary(taken, same) | {"results": ["meso12", "meso12-network", "micro"]}
    told = "\n".join(network_words(given))
    assert (
        "meso12-network: meso12 near equilibrium" in told
        and "- 2.4 %: a copy, since no loads help." in told
    )
    assert "the same" not in network_words(
        summary(taken) | {"results": ["meso12", "meso12-network", "micro"]}
    )
    assert network_words(summary(GOOD)) == []
    rows = [
        line for line in results_table(given) if line.strip(" *-").startswith(("meso", "micro"))
    ]
    assert [row.strip(" *-") for row in rows[:3]] == ["meso12", "meso12-network", "micro"]
    table = "\n".join(convergence_table(given))
    assert "w = 1.0e+05" in table and "w is the weight of equilibrium" in convergence_words(given)
    assert "0.021" in "\n".join(results_table(given))


# --------------------------------------------------------------------------- closing lines


@pytest.mark.parametrize(("alone", "warned"), [(0.36, True), (0.38, False), (None, False)])
def test_a_residual_far_above_the_noise_has_a_warning(alone, warned):
    told = " ".join(warnings(summary(GOOD | {"noise_std": alone})))
    assert ("1.6 times that of noise alone (at most 1.5)" in told) == warned


@pytest.mark.parametrize(
    ("alone", "shortest", "words"),
    [(0.523, True, "the shortest that may be chosen"), (0.9, False, "far below that of noise"),
     (0.523, False, None)],
)  # fmt: skip
def test_a_result_that_follows_the_noise_has_a_warning(alone, shortest, words):
    micro = GOOD["micro"] | {"shortest_l_e": shortest, "l_e": 2.9}
    told = " ".join(warnings(summary(GOOD | {"noise_std": alone, "micro": micro})))
    assert ("follows the noise" in told) == (words is not None) and (words or "") in told


@pytest.mark.parametrize(("share", "warned"), [(0.0, False), (0.01, False), (0.022, True)])
def test_elements_turned_inside_out_have_a_warning(share, warned):
    folded = GOOD | {"meso12": GOOD["meso12"] | {"inverted": share}}
    told = " ".join(warnings(summary(folded)))
    assert ("meso12 2.2% (at most 1%)" in told) == warned == ("Fig. 10" in told)


def test_torn_bridges_have_a_warning_with_their_places():
    torn = GOOD | {"micro": GOOD["micro"] | {"torn": [[25.4, 37.2, 53.2], [1, 2, 3]]}}
    (told,) = warnings(summary(torn))
    assert "State 1, micro: 2 bridges" in told and "25, 37, 53; 1, 2, 3" in told


@pytest.mark.parametrize(
    ("count", "words"), [(1, "1 strut that"), (91, "91 struts that"), (0, None)]
)
def test_bridges_are_counted_on_the_front_page(count, words):
    counts = {"stubs": 0, "necks": 0, "welds": 0, "bridges": count}
    told = front_page(summary(GOOD) | {"topology": counts}, CONFIG, SCANS)
    assert ("mesh.mend" in told) == bool(words)
    assert words is None or words in told


def test_sigma_of_noise_alone_stands_beside_that_of_the_residual():
    known = GOOD | {"noise_std": 0.523}
    assert "sigma(r) 0.56 (noise alone 0.52), 4 it" in closing_lines(summary(known), "results/a")
    page = front_page(summary(known, DOUBTFUL), CONFIG, SCANS)
    assert "noise alone, grey levels" in page and "Gauss points of the micro mesh" in page
    assert "noise alone" not in closing_lines(summary(GOOD), "results/a")
    rows = results_table(summary(known, DOUBTFUL))
    assert [row.strip() for row in rows].count("- 0.523") == 2, "each mesh of the one state"
    assert "noise of both images alone would leave 0.52" in page


@pytest.mark.parametrize(
    ("one", "words"),
    [
        (GOOD, "1 (1.4 %; 1.1% compression measured): converged; sigma(r) 0.56, 4 iterations, 100.0% "
               "of nodes valid, error median 0.033, p95 0.084 voxel"),
        (DOUBTFUL, "2 (2.4 %; 2.2% compression measured): measured, with doubtful places; "),
        (ENDLESS, "3 (3.4 %; 3.3% compression measured): measured, with doubtful places; sigma(r) 0.56"),
        (LOST, "4 (4.4 %; 4.4% compression measured): FAILED: not to be used; sigma(r) 0.56, 40 "
               "iterations, 20.0% of nodes valid"),
        (UNKNOWN, "5 (5.4 %; 5.5% compression measured): FAILED: not to be used; sigma(r) unknown, 40"),
    ],
)  # fmt: skip
def test_closing_lines_tell_the_verdict_of_each_state(one, words):
    lines = closing_lines(summary(GOOD, one), "results/foam").splitlines()
    assert lines[0] == "addvc: case foam-2_b is done; results are in results/foam/"
    assert ("on the first page" in lines[-2]) == (warnings(summary(GOOD, one)) != ["None."])
    assert len(lines) == 4 + ("on the first page" in lines[-2])
    assert words in lines[2]
    assert lines[-1].endswith("results/foam/report.html")


def test_closing_lines_tell_how_many_struts_are_flagged():
    flags = {"broken": 8, "residual": 15, "equilibrium": 0, "shape": 0}
    struts = {"valid": 341, "flagged": 23, "flags": flags, "bending_share": 0.7}
    lines = closing_lines(summary(GOOD | {"struts": struts}), "results/foam")
    assert "23 of 364 struts flagged: 8 broken by the threshold, 15 in doubt" in lines
    struts |= {"valid": 364, "flagged": 0, "flags": dict.fromkeys(flags, 0)}
    assert "0 of 364 struts flagged, " in closing_lines(summary(GOOD | {"struts": struts}), "r")
    assert "struts" not in closing_lines(summary(GOOD | {"struts": None}), "results/foam")


def test_without_a_truth_no_error_is_told():
    assert "error" not in closing_lines(summary(REAL), "results/foam")


def test_the_first_micro_method_speaks():
    both = summary(GOOD)
    both["meshes"] = {"meso12": MESH, "micro": MESH, "micro-eq10": MESH}
    both["states"][0] = GOOD | {"micro-eq10": found(valid=0.123)}
    assert micro_name(both) == "micro"
    assert "12.3%" not in closing_lines(both, "results/foam")


# ------------------------------------------------------------------------------ front page


@pytest.mark.parametrize("states", [ALL, (GOOD,), (REAL,), ()], ids=["all", "good", "real", "none"])
def test_the_front_page_is_valid(states):
    text = front_page(summary(*states), CONFIG, SCANS)
    tree = docutils.core.publish_doctree(text, settings_overrides={"report_level": 5})
    loud = [node for node in tree.findall(docutils.nodes.system_message) if node["level"] >= 2]
    assert [node.astext() for node in loud] == []


def test_the_front_page_has_its_parts_in_order():
    parts = list(sections(front_page(summary(*ALL), CONFIG, SCANS)))
    assert parts == ["Warnings and failures", "What next", "Residual and error of each mesh",
                     "Convergence", "Meshes", "Methods, to paste", "Scans", "Configuration",
                     "Cost", "Versions"]  # fmt: skip


def test_the_front_page_holds_a_picture_and_says_what_next(tmp_path):
    imsave(tmp_path / "figure.png", np.linspace(0, 1, 3000).reshape(30, 100))
    page = front_page(summary(*ALL), CONFIG, SCANS, thumbnail(tmp_path / "figure.png"))
    (image,) = docutils.core.publish_doctree(page).findall(docutils.nodes.image)
    kind, _, data = image["uri"].partition(",")
    assert kind == "data:image/jpeg;base64"
    assert imread(io.BytesIO(base64.b64decode(data)), format="jpg").shape == (270, 900, 3)
    assert "struts_state5.csv" in sections(page)["What next"]
    assert "scans.states" in sections(front_page(summary(), CONFIG, SCANS))["What next"]


def test_figures_that_a_page_names_are_linked_as_snakemake_s_report_knows_them():
    entries = [
        {"file": "fig01_states.png", "title": "Fig. 1: states"},
        {"file": "more_bending.png", "title": "bending or stretching"},
    ]
    page = linked('See Fig. 1, not Fig. 11; "bending or stretching" and bending.', entries)
    targets = "".join(
        f"\n.. _{entry['file']}: javascript:show('{n}')" for n, entry in enumerate(entries)
    )
    tree = docutils.core.publish_doctree(
        page + "\n" + targets, settings_overrides={"report_level": 5}
    )
    found = [(node.astext(), node["refuri"]) for node in tree.findall(docutils.nodes.reference)]
    assert found == [("Fig. 1", "javascript:show('0')"),
                     ('"bending or stretching"', "javascript:show('1')")]  # fmt: skip


def test_the_front_page_answers_first():
    head = front_page(summary(*ALL), CONFIG, SCANS).split("Warnings and failures")[0]
    assert "5 loading states" in head
    assert "28.0 voxels (560 micrometres)" in head
    assert "State 1 (1.4 %; 1.1% compression measured): **converged**" in head
    assert (
        "State 2 (2.4 %; 2.2% compression measured): **measured, with doubtful places**, 80.0% of"
        in head
    )
    assert (
        "State 4 (4.4 %; 4.4% compression measured): **FAILED: not to be used**, 20.0% of" in head
    )


def test_an_extension_or_a_falling_strain_is_warned_of():
    """A wrong axis, the states in another order, the reference among them: all have a sign."""
    states = [dict(one, state=n, strain=strain) for n, (one, strain) in
              enumerate(zip((GOOD, GOOD, GOOD), (0.28, 0.03, 0.05), strict=True), start=1)]  # fmt: skip
    told = " ".join(strain_warnings({"states": states}))
    assert "falls from 28.0% to 3.0% in state 2" in told and "order of loading" in told
    states[1]["strain"], states[0]["strain"] = -0.4, -0.4
    told = " ".join(strain_warnings({"states": states}))
    assert "longer, by 40.0% in state 1" in told and "loading_axis" in told
    assert not strain_warnings({"states": [dict(GOOD, state=1, strain=0.0)]})
    for strains, told in (({"x": -0.01, "y": 0.01, "z": 0.05}, "most along z, by 5.0%"),
                          ({"x": -0.02, "y": 0.05, "z": 0.01}, "")):  # fmt: skip
        state = dict(GOOD, state=1, strain=strains["y"], strain_axes=strains)
        assert told in "".join(strain_warnings({"states": [state]}))
        assert bool(strain_warnings({"states": [state]})) == bool(told)
    assert state_words(states[1] | {"label": "state 2"}) == "2 (40.0% extension measured)"


def test_a_state_says_how_well_its_nodes_are_known():
    found = noise_words({"uncertainty": {"rms": 0.0641}}, 20.0)
    assert "0.064 voxel (1.3 micrometres)" in found
    assert noise_words({"uncertainty": {}}, 20.0) == ""


def test_the_front_page_tells_of_a_band():
    band = {"normal": [0, 1, 0], "thickness": 24.6, "angle": 23.9, "flatness": 0.4,
            "factor": 1.5, "band_strain_share": 0.225, "bands": 3,
            "band_volume_share": 0.131, "mean_strain": -0.123}  # fmt: skip
    told = front_page(summary(GOOD | {"cells": band}), CONFIG, SCANS)
    assert (
        "Largest of 3 bands of over 1.5 times the mean strain of cells, 12.3%: 13% of the volume, with "
        "22% of the compression, 25 voxels" in told
    )
    assert "24 degrees" in told
    lump = front_page(summary(GOOD | {"cells": band | {"flatness": 0.9}}), CONFIG, SCANS)
    assert "a lump" in lump and "24 degrees" not in lump
    assert "times the mean" not in front_page(
        summary(GOOD | {"cells": dict.fromkeys(band)}), CONFIG, SCANS
    )


def test_the_front_page_says_of_which_part_it_is():
    slab = {"axis": 1, "low": 40.0, "high": 90.0, "radius": 35.0, "bounds": None}
    told = front_page(summary(GOOD) | {"region": slab}, CONFIG, SCANS)
    assert "of a part of the specimen** (40.0 to 90.0 voxels along y, within 35.0" in told
    assert "part of the specimen" not in front_page(summary(GOOD), CONFIG, SCANS)


def test_a_share_of_bending_stands_beside_what_was_measured():
    """The noise alone says little of it: what equilibrium takes off says more."""
    struts = {"valid": 75, "flagged": 5, "flags": dict.fromkeys(REASONS, 0), "bending_share": 0.8,
              "bending_share_std": 0.006, "bending_share_raw": 0.83, "bridged": 20}  # fmt: skip
    told = strut_words(struts)
    assert "80% of the energy of 75 valid struts" in told
    assert (
        "83% as measured, before equilibrium takes noise off; noise" in told and "by 0.6%" in told
    )
    given = summary(GOOD | {"struts": struts}) | {"topology": {"bridges": 22}}
    assert (
        "22 struts that" in bridge_words(given)[1]
        and "25% of the struts have" in bridge_words(given)[1]
    )


def test_what_jobs_have_warned_of_is_on_the_first_page():
    told = warnings(summary(REAL) | {"said": ["smooth 2: this scan has void of 47.27"]})
    assert "- Smooth 2: this scan has void of 47.27." in told


def test_methods_that_were_not_run_are_not_spoken_of():
    counts = {"stubs": 3, "necks": 0, "welds": 0, "bridges": 0}
    given = summary(GOOD) | {"topology": counts}
    for method, has in (("eq10", True), ("corotational", False)):
        told = front_page(given | {"methods": {"micro": method}}, CONFIG, SCANS)
        told = told.split("Methods, to paste")[0]
        assert ("eq10" in told) == has and ("Elastic energy (`corotational`)" in told) != has


def test_the_front_page_leads_to_the_scene_and_to_paraview():
    head = front_page(summary(GOOD), CONFIG, SCANS).split("Warnings and failures")[0]
    links = docutils.core.publish_doctree(head).findall(docutils.nodes.reference)
    assert [link["refuri"] for link in links] == ["scene.html", "fields/micro.pvd"]
    assert "scene.html" not in front_page(summary(), CONFIG, SCANS)


def test_the_front_page_tells_the_cost():
    head = front_page(summary(GOOD), CONFIG, SCANS).split("Warnings and failures")[0]
    assert "0.2 minutes of CPU" in head and "9 s a job of micro DVC" in head and "0.3 GB" in head


def test_the_tables_of_the_front_page_hold_the_numbers():
    parts = sections(front_page(summary(*ALL), CONFIG, SCANS))
    assert "0.033" in parts["Residual and error of each mesh"]
    assert "3.1e-01\n\nNO" in parts["Convergence"]
    assert "2.10e-03" in parts["Meshes"]
    assert parts["Cost"].index("micro_dvc") < parts["Cost"].index("volume")
    assert "methods:" in parts["Configuration"]
    for row in SCANS["scans"]:
        assert row["path"] in parts["Scans"]
    hashed = SCANS | {"sha256": {"2/_a_/|x|": "cd" * 32}}
    scans = sections(front_page(summary(*ALL), CONFIG, hashed))["Scans"]
    assert f"{'cd' * 32}  2/_a_/|x|" in scans


def test_without_a_truth_there_are_no_columns_of_errors():
    parts = sections(front_page(summary(REAL), CONFIG, SCANS))
    assert "error" not in parts["Residual and error of each mesh"].split("\n", 2)[2]


# -------------------------------------------------------------------------------- warnings


def test_nothing_to_warn_of_is_said_so():
    assert warnings(summary(GOOD, REAL)) == ["None."]
    parts = sections(front_page(summary(GOOD, REAL), CONFIG, SCANS))
    assert parts["Warnings and failures"].endswith("None.")


@pytest.mark.parametrize(
    ("one", "words"),
    [
        (DOUBTFUL, ["State 2", "20"]),
        (ENDLESS, ["State 3, micro", "40 iterations", "3.1e-01"]),
        (LOST, ["State 4 could not be registered"]),
    ],
    ids=["doubtful", "endless", "lost"],
)
def test_a_state_that_is_not_converged_has_a_warning(one, words):
    found = "\n".join(warnings(summary(GOOD, one)))
    assert "None." not in found and "State 1" not in found
    for word in words:
        assert word in found


def test_what_is_wrong_with_micro_dvc_is_told_before_other_meshes():
    one = GOOD | {"meso12": found(converged=False), "micro": found(converged=False)}
    told = [line for line in warnings(summary(one)) if "did not end" in line]
    assert ["micro:" in line for line in told] == [True, False]


def test_a_network_fit_that_did_not_end_has_a_warning_of_its_own():
    """None where the displacement is as it was: its mesh has one then."""
    lost = found(converged=False) | {"weight": 1e5}
    names = {"results": ["meso12", "meso12-network", "micro"]}
    told = " ".join(warnings(summary(GOOD | {"meso12-network": lost}) | names))
    assert "meso12-network: the loop did not end" in told and "starts from meso12" in told
    same = found(converged=False) | {"refused": "no loads help"}
    told = " ".join(warnings(summary(GOOD | {"meso12-network": same}) | names))
    assert "did not end" not in told


@pytest.mark.parametrize(
    ("weight", "refused", "warned"), [(1e4, "x", True), (1e4, None, False), (None, "x", False)]
)
def test_struts_in_an_equilibrium_that_the_images_do_not_show_have_a_warning(
    weight, refused, warned
):
    one = GOOD | {
        "meso12-network": found() | {"refused": refused},
        "equilibrium": {"weight": weight, "refused": None},
    }
    names = {"results": ["meso12", "meso12-network", "micro"]}
    told = " ".join(warnings(summary(one) | names))
    assert ("Compare the columns `_raw`" in told) == warned


def test_a_meso_loop_that_did_not_end_has_a_warning():
    one = copy.deepcopy(GOOD)
    one["meso12"] = found(converged=False)
    assert "State 1, meso12: the loop did not end, after 40 iterations" in warnings(summary(one))[0]


@pytest.mark.parametrize(("flagged", "warned"), [(9, False), (15, True)])
def test_many_flagged_struts_have_a_warning(flagged, warned):
    one = GOOD | {"struts": {"valid": 100, "flagged": flagged, "bending_share": 0.7}}
    text = "\n".join(warnings(summary(one)))
    assert (f"State 1: {flagged} of {100 + flagged} struts (at most 10 %)" in text) == warned


@pytest.mark.parametrize(
    ("notes", "words"),
    [
        (
            {"refused": "unseen", "carrying": 0.31},
            ("31% of the nodes", "at least 50%", "mesh.size"),
        ),
        (
            {"refused": "harm", "misfit": 0.41, "bound": 0.15},
            ("0.410 voxel (at most 0.150)", "hinge"),
        ),
    ],
)
def test_struts_that_are_not_in_equilibrium_have_a_warning(notes, words):
    case = {"weight": None, "carrying": 0.9, "nodes": 700, "frame_nodes": 90} | notes
    (text,) = warnings(summary(GOOD | {"equilibrium": case}))
    assert "State 1: struts are as measured" in text and "null" in text and "trust" in text
    for word in words:
        assert word in text


@pytest.mark.parametrize("notes", [None, {"weight": 1e4, "refused": None}])
def test_struts_in_equilibrium_and_those_that_should_not_be_have_no_warning(notes):
    assert warnings(summary(GOOD | {"equilibrium": notes})) == ["None."]


@pytest.mark.parametrize(("kept", "warned"), [(0.91, False), (0.85, True)])
def test_solid_that_was_left_out_has_a_warning(kept, warned):
    case = summary(GOOD)
    case["meshes"]["micro"] = MESH | {"kept_fraction": kept, "voxel_kept_fraction": 1.0}
    text = "\n".join(warnings(case))
    assert ("15% of the segmented solid" in text and "lower mesh.size" in text) == warned


CHECK = {"name": "residual under the truth at 3.4 %", "value": 8.125, "unit": "grey level",
         "low": 4.69, "high": 6.2, "passed": False, "remedy": "lower twin.step"}  # fmt: skip


@pytest.mark.parametrize("checks", [None, {"count": 20, "failed": []}])
def test_a_twin_that_passes_its_checks_has_no_warning(checks):
    case = summary(GOOD) | {"twin_checks": checks}
    assert warnings(case) == ["None."]
    assert "synthetic" not in closing_lines(case, "results/foam")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, "is 8.125 grey level (at least 4.69, at most 6.2); lower twin.step."),
        ({"low": None, "unit": "–"}, "is 8.125 (at most 6.2); lower twin.step."),
        ({"value": None, "high": None}, "is unknown grey level (at least 4.69); lower twin.step."),
    ],
)
def test_a_check_of_the_twin_that_fails_has_a_warning(change, words):
    case = summary(GOOD) | {"twin_checks": {"count": 20, "failed": [CHECK | change]}}
    (text,) = warnings(case)
    assert text.endswith(f"claims to be: {CHECK['name']} {words}")
    assert "1 of 20 checks of the synthetic test" in closing_lines(case, "results/foam")
    assert words in sections(front_page(case, CONFIG, SCANS))["Warnings and failures"]


# ------------------------------------------------------------------------------ strictness


def test_strict_makes_a_failed_state_an_error():
    with pytest.raises(AddvcError, match=r"1 of 3 states failed \(4\.4 %; at most 0\).*strict: f"):
        check_verdicts(summary(GOOD, DOUBTFUL, LOST), strict=True)


def test_only_strict_and_only_a_failed_state():
    check_verdicts(summary(GOOD, LOST), strict=False)
    check_verdicts(summary(GOOD, DOUBTFUL, ENDLESS), strict=True)


@pytest.mark.parametrize(
    "value, words",
    [(16000.44, "16000.4"), (-12.0, "-12.0"), (1.5, "1.50"), (1.27e-5, "1.27e-05"), (0.0, "0")],
)
def test_grey_levels_of_any_unit_are_told(value, words):
    assert grey_words(value) == words


def test_an_unknown_grey_level_is_told_as_such():
    assert grey_words(None) == "unknown"


def test_a_page_is_made_where_figures_are_unknown():
    """nan is null in a file: no table and no sentence stumbles over one."""
    none = dict.fromkeys(ERROR)
    lost = state(1, "flagged", error=none) | {"uncertainty": {"rms": None}}
    lost["micro"] |= {"residual_std": None, "residual_mean": None, "last_step": None}
    assert "unknown" in front_page(summary(lost), CONFIG, SCANS)
    assert "median unknown" in closing_lines(summary(lost), "results/foam")


def test_small_grey_levels_are_not_rounded_to_nothing():
    small = copy.deepcopy(GOOD) | {"noise_std": 3.5e-4}
    small["micro"]["residual_std"] = 4.1e-4
    page = front_page(summary(small), CONFIG, SCANS)
    assert "0.00041" in page and "0.00035" in page


def test_a_gap_that_opens_is_an_extension_by_the_platens_too():
    pulled = GOOD | {
        "strain": -0.02,
        "label": "state 1",
        "platens": {"strain": -0.021, "apart": 0.0},
    }
    assert state_words(pulled) == "1 (2.0% extension measured, 2.1% by the platens)"
    odd = pulled | {"platens": {"strain": 0.01, "apart": 0.0}}
    assert state_words(odd) == "1 (2.0% extension measured, 1.0% by the platens)"
