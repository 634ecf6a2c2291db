# Micro DVC: section 3.3, Eq. 10, 11, appendix A.


rule transfer:
    input:
        meshes=[mesh_of(name) for name in MESO],
        micro=f"{R}/geometry/micro.vtu",
        solutions=of_state("dvc/{mesh}_state{state}.h5", MESO),
    output:
        on_micro(MESO),
    log:
        f"{R}/logs/transfer/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/transfer/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1000, 20.0),
        runtime=10,
    params:
        code=code("micro/transfer.py"),
    script:
        "../scripts/micro/transfer.py"


if NETWORK:

    use rule transfer as transfer_network with:
        input:
            meshes=[mesh_of(name) for name in NETWORK],
            micro=f"{R}/geometry/micro.vtu",
            solutions=of_state("dvc/{mesh}_state{state}.h5", NETWORK),
        output:
            on_micro(NETWORK),
        log:
            f"{R}/logs/transfer_network/state{{state}}.log",
        benchmark:
            f"{R}/benchmarks/transfer_network/state{{state}}.tsv"


rule field_on_micro:
    input:
        unpack(field_files),
        mesh=f"{R}/geometry/micro.vtu",
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
    output:
        f"{R}/dvc/{{field}}_on_micro_state{{state}}.h5",
    log:
        f"{R}/logs/field_on_micro/{{field}}_state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/field_on_micro/{{field}}_state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600, 10.0),
        runtime=10,
    params:
        code=code("micro/field_on_micro.py"),
        axis=AXIS,
    script:
        "../scripts/micro/field_on_micro.py"


rule micro_start:
    input:
        mesh=f"{R}/geometry/micro.vtu",
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        threshold=f"{R}/geometry/threshold.json",
        cell_size=f"{R}/geometry/cell_size.json",
        candidates=starts_on_micro,
    output:
        f"{R}/dvc/micro_start_state{{state}}.h5",
    log:
        f"{R}/logs/micro_start/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/micro_start/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1200, 10.0),
        runtime=10,
    params:
        code=code("micro/micro_start.py"),
        names=lambda wildcards: [FINEST, *fields_of(wildcards)],
        micro=section(
            "micro",
            "l_k",
            "l_l",
            "l_e",
            "period",
            "nu",
            "robust",
        ),
        axis=AXIS,
    script:
        "../scripts/micro/micro_start.py"


rule shell:
    input:
        mesh=f"{R}/geometry/micro.vtu",
        reference=f"{R}/volumes/smooth0.h5",
        threshold=f"{R}/geometry/threshold.json",
    output:
        f"{R}/geometry/shell.h5",
    log:
        f"{R}/logs/shell/all.log",
    benchmark:
        f"{R}/benchmarks/shell/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 40.0),
        runtime=20,
    params:
        code=code("micro/shell.py"),
        width=config["micro"]["shell"],
    script:
        "../scripts/micro/shell.py"


rule factor:
    input:
        mesh=f"{R}/geometry/micro.vtu",
        shell=f"{R}/geometry/shell.h5",
        reference=f"{R}/volumes/smooth0.h5",
        cell_size=f"{R}/geometry/cell_size.json",
    output:
        f"{R}/dvc/{{micro}}_factor.h5",
    log:
        f"{R}/logs/factor/{{micro}}.log",
    benchmark:
        f"{R}/benchmarks/factor/{{micro}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(4000, 100.0),
        runtime=120,
    params:
        code=code("micro/factor.py"),
        method=method_of,
        micro=section("micro", "l_k", "l_l", "l_e", "period", "nu"),
        axis=AXIS,
    script:
        "../scripts/micro/factor.py"


rule micro_dvc:
    input:
        mesh=f"{R}/geometry/micro.vtu",
        shell=f"{R}/geometry/shell.h5",
        reference=f"{R}/volumes/smooth0.h5",
        deformed=f"{R}/volumes/smooth{{state}}.h5",
        threshold=f"{R}/geometry/threshold.json",
        bridges=f"{R}/geometry/bridges.json",
        factor=f"{R}/dvc/{{micro}}_factor.h5",
        start=f"{R}/dvc/micro_start_state{{state}}.h5",
    output:
        f"{R}/dvc/{{micro}}_state{{state}}.h5",
    log:
        f"{R}/logs/micro_dvc/{{micro}}_state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/micro_dvc/{{micro}}_state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(2500, 10.0),
        runtime=120,
    params:
        code=code("micro/micro_dvc.py"),
        method=method_of,
        blur=config["images"]["blur"],
        micro=section(
            "micro",
            "tolerance",
            "max_iterations",
            "nu",
            "l_e",
            "robust",
            "rotated",
            "stages",
            "mending",
        ),
    script:
        "../scripts/micro/micro_dvc.py"


rule micro_ultimate_error:
    input:
        **({"solution": f"{R}/dvc/{{micro}}_state{STATES[0]}.h5"} if STATES else {}),
        mesh=f"{R}/geometry/micro.vtu",
        shell=f"{R}/geometry/shell.h5",
        reference=f"{R}/volumes/smooth0.h5",
        threshold=f"{R}/geometry/threshold.json",
        factor=f"{R}/dvc/{{micro}}_factor.h5",
        bridges=f"{R}/geometry/bridges.json",
    output:
        f"{R}/analysis/ultimate_{{micro}}.json",
    log:
        f"{R}/logs/micro_ultimate_error/{{micro}}.log",
    benchmark:
        f"{R}/benchmarks/micro_ultimate_error/{{micro}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 3.0),
        runtime=60,
    params:
        code=code("micro/ultimate_error.py"),
        method=method_of,
        nu=config["micro"]["nu"],
        ultimate_error=config["ultimate_error"],
        images=section("images", "blur"),
    script:
        "../scripts/micro/ultimate_error.py"
