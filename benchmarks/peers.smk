# The default twin: the workflow's results beside B-spline registration by elastix.

SEEDS = {int(seed): study for seed, study in config["seeds"].items()}
TWIN_STATES = [1, 2, 3, 4]
PEER_TABLES = expand(f"{R}/peers_{{seed}}.csv", seed=SEEDS)
COLUMNS = [
    "state",
    "tool",
    "rms",
    "rms_normal",
    "median",
    "p95",
    "within_1_voxel",
    "cpu_ratio",
    "settings",
]
RUNS = [
    {"state": state, "tool": f"elastix {spacing}", "settings": name}
    for state in TWIN_STATES
    for spacing in config["peers"]["spacings"]
    for name in config["peers"]["settings"]
]


wildcard_constraints:
    seed=r"\d+",
    spacing=r"\d+",
    settings="|".join(config["peers"]["settings"]),


def study(wildcards):
    """The folder of the case of a seed."""
    return f"results/{SEEDS[int(wildcards.seed)]['case']}"


rule study:
    input:
        lambda wildcards: SEEDS[int(wildcards.seed)]["configfile"],
    output:
        f"{R}/study_{{seed}}.json",
    log:
        f"{R}/logs/study/{{seed}}.log",
    benchmark:
        f"{R}/benchmarks/study/{{seed}}.tsv"
    threads: workflow.cores
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        case=study,
    shell:
        "snakemake --configfile {input} --cores {threads} --nolock {params.case}/summary.json"
        " {params.case}/report/config.json >{log} 2>&1 && cp {params.case}/summary.json {output}"


rule elastix:
    input:
        f"{R}/study_{{seed}}.json",
    output:
        f"{R}/elastix/{{seed}}_state{{state}}_{{spacing}}_{{settings}}.json",
    log:
        f"{R}/logs/elastix/{{seed}}_state{{state}}_{{spacing}}_{{settings}}.log",
    benchmark:
        f"{R}/benchmarks/elastix/{{seed}}_state{{state}}_{{spacing}}_{{settings}}.tsv"
    threads: workflow.cores
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        code=code("elastix.py"),
        folder=study,
        settings=lambda wildcards: config["peers"]["settings"][wildcards.settings],
    script:
        "scripts/elastix.py"


rule peers:
    input:
        study=f"{R}/study_{{seed}}.json",
        peers=[
            f"{R}/elastix/{{seed}}_state{run['state']}_{run['tool'].split()[1]}_{run['settings']}.json"
            for run in RUNS
        ],
    output:
        table=f"{R}/peers_{{seed}}.csv",
        all=f"{R}/peers_{{seed}}_settings.csv",
    log:
        f"{R}/logs/peers/{{seed}}.log",
    benchmark:
        f"{R}/benchmarks/peers/{{seed}}.tsv"
    threads: 1
    resources:
        mem_mb=600,
        runtime=10,
    params:
        code=code("peers.py"),
        folder=study,
        states=TWIN_STATES,
        runs=RUNS,
        columns=COLUMNS,
    script:
        "scripts/peers.py"
