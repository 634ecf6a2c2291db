# Initialisation and meso DVC: section 3.2, Eq. 6, 7, 9.

# What a correlation on a mesh takes, over the size of both images: most of it holds its voxels.
VOXELS = 8.0 if config["meso"]["clear"] > 0 else 30.0


rule start:
    input:
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        mesh=mesh_of_candidate,
        lines=f"{R}/geometry/grid.json",
        figures=f"{R}/geometry/{MESO[0]}.json",
    output:
        f"{R}/dvc/start-{{candidate}}_state{{state}}.h5",
    log:
        f"{R}/logs/start/{{candidate}}_state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/start/{{candidate}}_state{{state}}.tsv"
    wildcard_constraints:
        candidate="zero|platens",
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 4.0),
        runtime=60,
    params:
        code=code("meso/start.py"),
        meso=section("meso", "pyramid_levels", "max_iterations"),
        axis=AXIS,
    script:
        "../scripts/meso/start.py"


rule freeform:
    input:
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        cell_size=f"{R}/geometry/cell_size.json",
    output:
        f"{R}/dvc/freeform_state{{state}}.h5",
    log:
        f"{R}/logs/freeform/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/freeform/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 10.0),
        runtime=60,
    params:
        code=code("meso/freeform.py"),
        freeform=config["freeform"],
        axis=AXIS,
    script:
        "../scripts/meso/freeform.py"


use rule freeform as freeform_step with:
    input:
        reference=lambda wildcards: f"{R}/volumes/smooth{int(wildcards.state) - 1}.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        cell_size=f"{R}/geometry/cell_size.json",
    output:
        f"{R}/dvc/step_state{{state}}.h5",
    log:
        f"{R}/logs/freeform_step/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/freeform_step/state{{state}}.tsv"


rule best_start:
    input:
        unpack(field_files),
        unpack(pyramid_files),
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        mesh=f"{R}/geometry/{MESO[0]}.vtu",
        figures=f"{R}/geometry/{MESO[0]}.json",
    output:
        f"{R}/dvc/start_state{{state}}.h5",
    log:
        f"{R}/logs/best_start/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/best_start/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, VOXELS),
        runtime=20,
    params:
        code=code("meso/best_start.py"),
        candidates=config["meso"]["candidates"],
        names=fields_of,
        meso=section("meso", "l_l", "tolerance", "max_iterations", "clear"),
        axis=AXIS,
    script:
        "../scripts/meso/best_start.py"


rule meso_dvc:
    input:
        unpack(field_files),
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        meshes=expand(f"{R}/geometry/{{mesh}}.vtu", mesh=MESO),
        figures=expand(f"{R}/geometry/{{mesh}}.json", mesh=MESO),
        start=f"{R}/dvc/start_state{{state}}.h5",
        threshold=f"{R}/geometry/threshold.json",
    output:
        of_state("dvc/{mesh}_state{state}.h5", MESO),
    log:
        f"{R}/logs/meso_dvc/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/meso_dvc/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, VOXELS),
        runtime=60,
    params:
        code=code("meso/meso_dvc.py"),
        meso=section("meso", "l_l", "tolerance", "max_iterations", "clear"),
        blur=config["images"]["blur"],
        meshes=MESO,
        names=fields_of,
        axis=AXIS,
    script:
        "../scripts/meso/meso_dvc.py"


if NETWORK:

    rule network:
        input:
            frame=f"{R}/geometry/frame.h5",
            micro=f"{R}/geometry/micro.vtu",
            mesh=f"{R}/geometry/{FINEST}.vtu",
            figures=f"{R}/geometry/{FINEST}.json",
            threshold=f"{R}/geometry/threshold.json",
            reference=f"{R}/volumes/smooth0.h5",
            deformed=f"{R}/volumes/smooth{{state}}.h5",
            solution=f"{R}/dvc/{FINEST}_state{{state}}.h5",
        output:
            of_state("dvc/{mesh}_state{state}.h5", NETWORK),
        log:
            f"{R}/logs/network/state{{state}}.log",
        benchmark:
            f"{R}/benchmarks/network/state{{state}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, VOXELS),
            runtime=240,
        params:
            code=code("meso/network.py"),
            meso=section("meso", "l_l", "tolerance", "max_iterations", "clear"),
            blur=config["images"]["blur"],
            micro=section("micro", "nu", "robust"),
            axis=AXIS,
        script:
            "../scripts/meso/network.py"


rule meso_profile:
    input:
        mesh=f"{R}/geometry/{FINEST}.vtu",
        threshold=f"{R}/geometry/threshold.json",
        reference=f"{R}/volumes/smooth0.h5",
        deformed=expand(f"{R}/volumes/smooth{{state}}.h5", state=STATES),
        solutions=expand(f"{R}/dvc/{FINEST}_state{{state}}.h5", state=STATES),
    output:
        f"{R}/geometry/meso_residual.json",
    log:
        f"{R}/logs/meso_profile/all.log",
    benchmark:
        f"{R}/benchmarks/meso_profile/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1000, 12.0),
        runtime=20,
    params:
        code=code("meso/meso_profile.py"),
        axis=AXIS,
    script:
        "../scripts/meso/meso_profile.py"


rule meso_ultimate_error:
    input:
        **({"solution": f"{R}/dvc/{{meso}}_state{STATES[0]}.h5"} if STATES else {}),
        reference=f"{R}/volumes/smooth0.h5",
        threshold=f"{R}/geometry/threshold.json",
        mesh=f"{R}/geometry/{{meso}}.vtu",
        figures=f"{R}/geometry/{{meso}}.json",
    output:
        f"{R}/analysis/ultimate_{{meso}}.json",
    log:
        f"{R}/logs/meso_ultimate_error/{{meso}}.log",
    benchmark:
        f"{R}/benchmarks/meso_ultimate_error/{{meso}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 2 * VOXELS),
        runtime=60,
    params:
        code=code("meso/ultimate_error.py"),
        meso=section("meso", "l_l", "tolerance", "max_iterations", "clear"),
        coarsest=lambda wildcards: wildcards.meso == MESO[0],
        axis=AXIS,
        ultimate_error=config["ultimate_error"],
        images=section("images", "blur"),
    script:
        "../scripts/meso/ultimate_error.py"
