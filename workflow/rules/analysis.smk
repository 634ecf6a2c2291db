# What the displacement says: residuals, strain, validity, errors, the numbers in one file.


rule residual:
    input:
        mesh=f"{R}/geometry/micro.vtu",
        shell=f"{R}/geometry/shell.h5",
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        fields=on_micro(RESULTS),
    output:
        arrays=of_state("analysis/residual_{mesh}_state{state}.h5", RESULTS),
        statistics=of_state("analysis/residual_{mesh}_state{state}.json", RESULTS),
    log:
        f"{R}/logs/residual/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/residual/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1200, 10.0),
        runtime=10,
    params:
        code=code("analysis/residual.py"),
    script:
        "../scripts/analysis/residual.py"


rule image_noise:
    input:
        specimen=f"{R}/geometry/specimen.json",
        threshold=f"{R}/geometry/threshold.json",
        reference=f"{R}/volumes/smooth0.h5",
        deformed=expand(f"{R}/volumes/smooth{{state}}.h5", state=STATES),
    output:
        f"{R}/analysis/image_noise.json",
    log:
        f"{R}/logs/image_noise/all.log",
    benchmark:
        f"{R}/benchmarks/image_noise/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory_by_largest(1000, 20.0),
        runtime=10,
    params:
        code=code("analysis/image_noise.py"),
        states=STATES,
        moves=KIND == "virtual",  # what is in the void moves with the solid
    script:
        "../scripts/analysis/image_noise.py"


rule platen_faces:
    input:
        reference=f"{R}/volumes/volume0.h5",
        deformed=expand(f"{R}/volumes/volume{{state}}.h5", state=STATES),
    output:
        f"{R}/analysis/platens.json",
    log:
        f"{R}/logs/platen_faces/all.log",
    benchmark:
        f"{R}/benchmarks/platen_faces/all.tsv"
    priority: 10  # it tells of scans in a wrong order
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory_by_largest(800, 10.0),
        runtime=10,
    params:
        code=code("analysis/platen_faces.py"),
        axis=AXIS,
        states=STATES,
    script:
        "../scripts/analysis/platen_faces.py"


rule field:
    input:
        meshes=[mesh_of(name) for name in RESULTS],
        micro=f"{R}/geometry/micro.vtu",
        solutions=of_state("dvc/{mesh}_state{state}.h5", RESULTS),
        residuals=of_state("analysis/residual_{mesh}_state{state}.h5", RESULTS),
        threshold=f"{R}/geometry/threshold.json",
        uncertainty=f"{R}/analysis/uncertainty_state{{state}}.h5",
    output:
        of_state("fields/{mesh}_state{state}.vtu", RESULTS),
    log:
        f"{R}/logs/field/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/field/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1200, 10.0),
        runtime=10,
    params:
        code=code("analysis/field.py"),
        names=RESULTS,
        strain=config["fields"]["strain"],
        uncertain=MICRO[0],
    script:
        "../scripts/analysis/field.py"


rule warp:
    input:
        mesh=f"{R}/geometry/micro.vtu",
        region=f"{R}/geometry/region.json",
        threshold=f"{R}/geometry/threshold.json",
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        fields=on_micro([FINEST, *MICRO]),
    output:
        f"{R}/analysis/warp_state{{state}}.json",
    log:
        f"{R}/logs/warp/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/warp/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1200, 15.0),
        runtime=30,
    params:
        code=code("analysis/warp.py"),
        names=[FINEST, *MICRO],
    script:
        "../scripts/analysis/warp.py"


if HAS_TRUTH:

    rule truth_error:
        input:
            mesh=f"{R}/geometry/micro.vtu",
            fields=on_micro(JUDGED),
            torn=f"{R}/dvc/{MICRO[0]}_state{{state}}.h5",
            truth=TRUTH,
        output:
            of_state("analysis/error_{mesh}_state{state}.json", JUDGED),
        log:
            f"{R}/logs/truth_error/state{{state}}.log",
        benchmark:
            f"{R}/benchmarks/truth_error/state{{state}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1200, 10.0),
            runtime=10,
        params:
            code=code("analysis/truth_error.py"),
        script:
            "../scripts/analysis/truth_error.py"

    rule uncertainty_truth:
        input:
            mesh=f"{R}/geometry/micro.vtu",
            field=f"{R}/fields/{MICRO[0]}_state{{state}}.vtu",
            uncertainty=f"{R}/analysis/uncertainty_state{{state}}.h5",
            truth=TRUTH,
        output:
            f"{R}/analysis/uncertainty_truth_state{{state}}.json",
        log:
            f"{R}/logs/uncertainty_truth/state{{state}}.log",
        benchmark:
            f"{R}/benchmarks/uncertainty_truth/state{{state}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1200, 10.0),
            runtime=10,
        params:
            code=code("analysis/uncertainty_truth.py"),
        script:
            "../scripts/analysis/uncertainty_truth.py"

    rule struts_truth:
        input:
            struts=f"{R}/geometry/struts.h5",
            mesh=f"{R}/geometry/micro.vtu",
            table=f"{R}/struts_state{{state}}.csv",
            solution=f"{R}/dvc/{MICRO[0]}_state{{state}}.h5",
            truth=TRUTH,
        output:
            table=f"{R}/analysis/struts_truth_state{{state}}.csv",
            figures=f"{R}/analysis/struts_truth_state{{state}}.json",
        log:
            f"{R}/logs/struts_truth/state{{state}}.log",
        benchmark:
            f"{R}/benchmarks/struts_truth/state{{state}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, 10.0),
            runtime=60,
        params:
            code=code("analysis/struts_truth.py"),
            nu=config["micro"]["nu"],
            results=STRUT_RESULTS,
        script:
            "../scripts/analysis/struts_truth.py"

    rule cells_truth:
        input:
            mesh=f"{R}/geometry/micro.vtu",
            cell_size=f"{R}/geometry/cell_size.json",
            table=f"{R}/cells_state{{state}}.csv",
            notes=f"{R}/cells_state{{state}}.json",
            truth=TRUTH,
        output:
            table=f"{R}/analysis/cells_truth_state{{state}}.csv",
            figures=f"{R}/analysis/cells_truth_state{{state}}.json",
        log:
            f"{R}/logs/cells_truth/state{{state}}.log",
        benchmark:
            f"{R}/benchmarks/cells_truth/state{{state}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1000, 10.0),
            runtime=60,
        params:
            code=code("analysis/cells_truth.py"),
            axis=AXIS,
        script:
            "../scripts/analysis/cells_truth.py"

    rule difficulty:
        input:
            mesh=f"{R}/geometry/micro.vtu",
            meso=expand(f"{R}/geometry/{{mesh}}.vtu", mesh=MESO),
            reference=f"{R}/volumes/smooth0.h5",
            deformed=expand(f"{R}/volumes/smooth{{state}}.h5", state=STATES),
            truth=TRUTH,
        output:
            f"{R}/analysis/difficulty.json",
        log:
            f"{R}/logs/difficulty/all.log",
        benchmark:
            f"{R}/benchmarks/difficulty/all.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(2500, 20.0),
            runtime=60,
        params:
            code=code("analysis/difficulty.py"),
            meso=MESO,
            states=STATES,
        script:
            "../scripts/analysis/difficulty.py"


if KIND == "twin":

    rule twin_check:
        input:
            scans=[scan_path(state) for state in [0, *STATES]],
            truth=TRUTH,
            threshold=f"{R}/geometry/threshold.json",
            cell_size=f"{R}/geometry/cell_size.json",
        output:
            f"{R}/analysis/twin_check.json",
        log:
            f"{R}/logs/twin_check/all.log",
        benchmark:
            f"{R}/benchmarks/twin_check/all.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, 25.0),
            runtime=60,
        params:
            code=code("analysis/twin_check.py"),
            twin=TWIN_SCANS,
        script:
            "../scripts/analysis/twin_check.py"


rule strut_partition:
    input:
        solid=f"{R}/geometry/solid.h5",
        threshold=f"{R}/geometry/threshold.json",
        reference=f"{R}/volumes/volume0.h5",
        mesh=f"{R}/geometry/micro.vtu",
    output:
        struts=f"{R}/geometry/struts.h5",
        picture=f"{R}/geometry/struts.vtu",
    log:
        f"{R}/logs/strut_partition/all.log",
    benchmark:
        f"{R}/benchmarks/strut_partition/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 10.0),
        runtime=60,
    params:
        code=code("analysis/strut_partition.py"),
    script:
        "../scripts/analysis/strut_partition.py"


rule topology:
    input:
        solid=f"{R}/geometry/solid.h5",
        bridges=f"{R}/geometry/bridges.json",
        threshold=f"{R}/geometry/threshold.json",
        mesh=f"{R}/geometry/micro.vtu",
        struts=f"{R}/geometry/struts.h5",
        starts=expand(f"{R}/dvc/micro_start_state{{state}}.h5", state=STATES),
        solutions=expand(f"{R}/dvc/{MICRO[0]}_state{{state}}.h5", state=STATES),
    output:
        f"{R}/geometry/topology.json",
    log:
        f"{R}/logs/topology/all.log",
    benchmark:
        f"{R}/benchmarks/topology/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 15.0),
        runtime=60,
    params:
        code=code("analysis/topology.py"),
        states=STATES,
    script:
        "../scripts/analysis/topology.py"


rule noise_draws:
    input:
        mesh=f"{R}/geometry/micro.vtu",
        reference=f"{R}/volumes/smooth0.h5",
        shell=f"{R}/geometry/shell.h5",
        factor=f"{R}/dvc/{MICRO[0]}_factor.h5",
        threshold=f"{R}/geometry/threshold.json",
        solution=f"{R}/dvc/{MICRO[0]}_state{{state}}.h5",
        bridges=f"{R}/geometry/bridges.json",
    output:
        f"{R}/dvc/{MICRO[0]}_noise_state{{state}}.h5",
    log:
        f"{R}/logs/noise_draws/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/noise_draws/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 3.0),
        runtime=30,
    params:
        code=code("analysis/noise_draws.py"),
        blur=config["images"]["blur"],
        method=METHODS[MICRO[0]],
        nu=config["micro"]["nu"],
    script:
        "../scripts/analysis/noise_draws.py"


rule uncertainty:
    input:
        noise=f"{R}/dvc/{MICRO[0]}_noise_state{{state}}.h5",
        struts=f"{R}/geometry/struts.h5",
    output:
        arrays=f"{R}/analysis/uncertainty_state{{state}}.h5",
        figures=f"{R}/analysis/uncertainty_state{{state}}.json",
    log:
        f"{R}/logs/uncertainty/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/uncertainty/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 6.0),
        runtime=10,
    params:
        code=code("analysis/uncertainty.py"),
    script:
        "../scripts/analysis/uncertainty.py"


rule struts:
    input:
        frame=f"{R}/geometry/frame.h5" if EQUILIBRIUM else [],
        noise=f"{R}/dvc/{MICRO[0]}_noise_state{{state}}.h5",
        struts=f"{R}/geometry/struts.h5",
        bridges=f"{R}/geometry/bridges.json",
        field=f"{R}/fields/{MICRO[0]}_state{{state}}.vtu",
        meso=f"{R}/dvc/{FINEST}_on_micro_state{{state}}.h5",
    output:
        table=f"{R}/struts_state{{state}}.csv",
        notes=f"{R}/struts_state{{state}}.json",
    log:
        f"{R}/logs/struts/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/struts/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 15.0),
        runtime=60,
    params:
        code=code("analysis/struts.py"),
        nu=config["micro"]["nu"],
        micro=section("micro", "rotated"),
        method=METHODS[MICRO[0]],
        results=STRUT_RESULTS,
    script:
        "../scripts/analysis/struts.py"


rule cells:
    input:
        mesh=f"{R}/geometry/micro.vtu",
        cell_size=f"{R}/geometry/cell_size.json",
        field=f"{R}/fields/{MICRO[0]}_state{{state}}.vtu",
    output:
        table=f"{R}/cells_state{{state}}.csv",
        notes=f"{R}/cells_state{{state}}.json",
    log:
        f"{R}/logs/cells/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/cells/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1000, 10.0),
        runtime=60,
    params:
        code=code("analysis/cells.py"),
        axis=AXIS,
    script:
        "../scripts/analysis/cells.py"


# What the summary does not wait for, and whose cost it hence leaves out.
APART = [
    "scene",
    "series",
    "input_hashes",
    "struts_truth",
    "cells_truth",
    "uncertainty_truth",
    "difficulty",
]


# What has no part in this configuration: an earlier one may have left its cost and its warnings.
UNUSED = [
    *([] if FREEFORM else ["freeform"]),
    *([] if EQUILIBRIUM or NETWORK else ["strut_frame"]),
    *([] if NETWORK else ["network", "transfer_network"]),
    *([] if HAS_TRUTH else ["truth_error"]),
    *([] if "height" in config["micro"]["region"] else ["meso_profile"]),
]


rule summary:
    input:
        f"{R}/input.json",
        f"{R}/geometry/cell_size.json",
        f"{R}/geometry/threshold.json",
        expand(f"{R}/geometry/{{mesh}}.json", mesh=[*MESO, "micro"]),
        f"{R}/geometry/topology.json",
        f"{R}/geometry/region.json",
        expand(f"{R}/analysis/ultimate_{{mesh}}.json", mesh=[*MESO, *MICRO]),
        expand(
            f"{R}/dvc/{{name}}_state{{state}}.h5",
            name=["start", "micro_start", *FREEFORM],
            state=STATES,
        ),
        expand(f"{R}/dvc/{{mesh}}_state{{state}}.h5", mesh=RESULTS, state=STATES),
        expand(f"{R}/fields/{{mesh}}_state{{state}}.vtu", mesh=RESULTS, state=STATES),
        expand(
            f"{R}/analysis/residual_{{mesh}}_state{{state}}.json",
            mesh=RESULTS,
            state=STATES,
        ),
        expand(
            f"{R}/analysis/error_{{mesh}}_state{{state}}.json",
            mesh=JUDGED,
            state=STATES,
        )
        if HAS_TRUTH
        else [],
        expand(
            f"{R}/{{name}}_state{{state}}.json",
            name=["struts", "cells", "analysis/warp", "analysis/uncertainty"],
            state=STATES,
        ),
        f"{R}/analysis/image_noise.json",
        f"{R}/analysis/platens.json",
        **({"twin_check": f"{R}/analysis/twin_check.json"} if KIND == "twin" else {}),
    output:
        f"{R}/summary.json",
    log:
        f"{R}/logs/summary/all.log",
    benchmark:
        f"{R}/benchmarks/summary/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 3.0),
        runtime=10,
    params:
        code=code("analysis/summary.py"),
        case=CASE,
        folder=lambda wildcards, output: str(Path(output[0]).parent),
        states=LABELS,
        scope={
            "meshes": [*MESO, *MICRO],
            "results": RESULTS,
            "methods": METHODS,
            "region": config["micro"]["region"] or "all",
            "finest": FINEST,
            "axis": AXIS,
            "truth": HAS_TRUTH,
            "freeform": bool(FREEFORM),
            "blur": config["images"]["blur"],
            "bin": settings.scan_settings(config, 0)["bin"],
            "apart": [*APART, *UNUSED],
        },
    script:
        "../scripts/analysis/summary.py"
