# Initialisation and meso DVC: section 3.2, Eq. 6, 7, 9.


def mesh_of_candidate(wildcards):
    """`zero` starts on the coarsest mesh, `platens` on the grid."""
    name = "grid" if wildcards.candidate == "platens" else MESO[0]
    return f"{R}/geometry/{name}.vtu"


def coarser(wildcards):
    """The mesh before this one; the coarsest starts from itself."""
    return MESO[max(MESO.index(wildcards.meso) - 1, 0)]


def start_of(wildcards):
    """The best start for the coarsest mesh, the coarser solution for the others."""
    if wildcards.meso == MESO[0]:
        return f"{R}/dvc/start_state{wildcards.state}.h5"
    return f"{R}/dvc/{coarser(wildcards)}_state{wildcards.state}.h5"


rule start:
    input:
        reference=R + "/volumes/smooth0.h5",
        deformed=R + "/volumes/smooth{state}.h5",
        mesh=mesh_of_candidate,
        lines=R + "/geometry/grid.json",
        figures=f"{R}/geometry/{MESO[0]}.json",
    output:
        R + "/dvc/start-{candidate}_state{state}.h5",
    log:
        R + "/logs/start/{candidate}_state{state}.log",
    benchmark:
        R + "/benchmarks/start/{candidate}_state{state}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 30.0),
        runtime=60,
    params:
        code=code("meso/start.py"),
        meso=section("meso", "pyramid_levels", "max_iterations"),
        axis=AXIS,
    script:
        "../scripts/meso/start.py"


rule rescale:
    input:
        reference=R + "/volumes/smooth0.h5",
        deformed=R + "/volumes/smooth{state}.h5",
        start=R + "/dvc/start-{candidate}_state{state}.h5",
        grid=R + "/geometry/grid.vtu",
        lines=R + "/geometry/grid.json",
        mesh=f"{R}/geometry/{MESO[0]}.vtu",
    output:
        R + "/dvc/rescaled-{candidate}_state{state}.h5",
    log:
        R + "/logs/rescale/{candidate}_state{state}.log",
    benchmark:
        R + "/benchmarks/rescale/{candidate}_state{state}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 30.0),
        runtime=10,
    params:
        code=code("meso/rescale.py"),
    script:
        "../scripts/meso/rescale.py"


rule best_start:
    input:
        reference=R + "/volumes/smooth0.h5",
        deformed=R + "/volumes/smooth{state}.h5",
        candidates=expand(
            R + "/dvc/rescaled-{candidate}_state{{state}}.h5",
            candidate=config["meso"]["candidates"],
        ),
        mesh=f"{R}/geometry/{MESO[0]}.vtu",
        figures=f"{R}/geometry/{MESO[0]}.json",
    output:
        R + "/dvc/start_state{state}.h5",
    log:
        R + "/logs/best_start/state{state}.log",
    benchmark:
        R + "/benchmarks/best_start/state{state}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 30.0),
        runtime=10,
    params:
        code=code("meso/best_start.py"),
        names=config["meso"]["candidates"],
        meso=section("meso", "l_l", "tolerance", "max_iterations"),
        axis=AXIS,
    script:
        "../scripts/meso/best_start.py"


rule meso_dvc:
    input:
        reference=R + "/volumes/smooth0.h5",
        deformed=R + "/volumes/smooth{state}.h5",
        mesh=R + "/geometry/{meso}.vtu",
        figures=R + "/geometry/{meso}.json",
        coarser=lambda wildcards: f"{R}/geometry/{coarser(wildcards)}.vtu",
        start=start_of,
    output:
        R + "/dvc/{meso}_state{state}.h5",
    log:
        R + "/logs/meso_dvc/{meso}_state{state}.log",
    benchmark:
        R + "/benchmarks/meso_dvc/{meso}_state{state}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 30.0),
        runtime=60,
    params:
        code=code("meso/meso_dvc.py"),
        meso=section("meso", "l_l", "tolerance", "max_iterations"),
        coarsest=lambda wildcards: wildcards.meso == MESO[0],
        axis=AXIS,
    script:
        "../scripts/meso/meso_dvc.py"


rule meso_ultimate_error:
    input:
        reference=R + "/volumes/smooth0.h5",
        mesh=R + "/geometry/{meso}.vtu",
        figures=R + "/geometry/{meso}.json",
    output:
        R + "/analysis/ultimate_{meso}.json",
    log:
        R + "/logs/meso_ultimate_error/{meso}.log",
    benchmark:
        R + "/benchmarks/meso_ultimate_error/{meso}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 30.0),
        runtime=60,
    params:
        code=code("meso/ultimate_error.py"),
        meso=section("meso", "l_l", "tolerance", "max_iterations"),
        coarsest=lambda wildcards: wildcards.meso == MESO[0],
        axis=AXIS,
        ultimate_error=config["ultimate_error"],
    script:
        "../scripts/meso/ultimate_error.py"
