# What the displacement says: residuals, strain, validity, errors, the numbers in one file.


def on_micro(wildcards):
    """The displacement of a result at the nodes of the micro mesh."""
    middle = "_on_micro" if wildcards.mesh in MESO else ""
    return f"{R}/dvc/{wildcards.mesh}{middle}_state{wildcards.state}.h5"


def mesh_of(wildcards):
    """The mesh of a result: every micro method shares one."""
    name = wildcards.mesh if wildcards.mesh in MESO else "micro"
    return f"{R}/geometry/{name}.vtu"


rule residual:
    input:
        mesh=R + "/geometry/micro.vtu",
        reference=R + "/volumes/smooth0.h5",
        deformed=R + "/volumes/smooth{state}.h5",
        field=on_micro,
    output:
        arrays=R + "/analysis/residual_{mesh}_state{state}.h5",
        statistics=R + "/analysis/residual_{mesh}_state{state}.json",
    log:
        R + "/logs/residual/{mesh}_state{state}.log",
    benchmark:
        R + "/benchmarks/residual/{mesh}_state{state}.tsv"
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


rule field:
    input:
        mesh=mesh_of,
        micro=R + "/geometry/micro.vtu",
        solution=R + "/dvc/{mesh}_state{state}.h5",
        residual=R + "/analysis/residual_{mesh}_state{state}.h5",
        threshold=R + "/geometry/threshold.json",
    output:
        R + "/fields/{mesh}_state{state}.vtu",
    log:
        R + "/logs/field/{mesh}_state{state}.log",
    benchmark:
        R + "/benchmarks/field/{mesh}_state{state}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1200, 10.0),
        runtime=10,
    params:
        code=code("analysis/field.py"),
    script:
        "../scripts/analysis/field.py"


if HAS_TRUTH:

    rule truth_error:
        input:
            mesh=R + "/geometry/micro.vtu",
            field=on_micro,
            truth=TRUTH,
        output:
            R + "/analysis/error_{mesh}_state{state}.json",
        log:
            R + "/logs/truth_error/{mesh}_state{state}.log",
        benchmark:
            R + "/benchmarks/truth_error/{mesh}_state{state}.tsv"
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


rule summary:
    input:
        R + "/input.json",
        R + "/geometry/cell_size.json",
        R + "/geometry/threshold.json",
        expand(R + "/geometry/{mesh}.json", mesh=[*MESO, "micro"]),
        expand(R + "/analysis/ultimate_{mesh}.json", mesh=[*MESO, *MICRO]),
        expand(R + "/dvc/start_state{state}.h5", state=STATES),
        expand(R + "/dvc/{mesh}_state{state}.h5", mesh=[*MESO, *MICRO], state=STATES),
        expand(
            R + "/fields/{mesh}_state{state}.vtu", mesh=[*MESO, *MICRO], state=STATES
        ),
        expand(
            R + "/analysis/residual_{mesh}_state{state}.json",
            mesh=[*MESO, *MICRO],
            state=STATES,
        ),
        expand(
            R + "/analysis/error_{mesh}_state{state}.json",
            mesh=[*MESO, *MICRO],
            state=STATES,
        )
        if HAS_TRUTH
        else [],
    output:
        R + "/summary.json",
    log:
        f"{R}/logs/summary/all.log",
    benchmark:
        R + "/benchmarks/summary/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 3.0),
        runtime=10,
    params:
        code=code("analysis/summary.py"),
        case=CASE,
        folder=R,
        meshes=[*MESO, *MICRO],
        states=LABELS,
        finest=FINEST,
        axis=AXIS,
        truth=HAS_TRUTH,
    script:
        "../scripts/analysis/summary.py"
