# Each case: the workflow's results beside B-spline registration by elastix.

CASES = config["cases"]
CASE_TABLES = [f"{R}/{case['table']}.csv" for case in CASES.values()]
COLUMNS = [
    *("state", "tool", "rms", "rms_normal", "median", "p95", "within_1_voxel"),
    *("cpu_ratio", "settings"),
]
PREFIX = {case["table"]: name for name, case in CASES.items()}


wildcard_constraints:
    case="|".join(CASES),
    table="|".join(PREFIX),
    state=r"\d+",
    spacing=r"\d+",
    variant=r"\w+",
    settings="|".join(config["elastix"]["settings"]),


def runs_of(table):
    """Runs of elastix for a table: state, spacing, settings."""
    return [
        {"state": state, "tool": f"elastix {spacing}", "settings": name}
        for state in CASES[PREFIX[table]]["states"]
        for spacing in config["elastix"]["spacings"]
        for name in config["elastix"]["settings"]
    ]


def found_by_runs(wildcards):
    """The files of `runs_of`, in its order."""
    return [
        f"{R}/elastix/{PREFIX[wildcards.table]}_state{run['state']}"
        f"_{run['tool'].split()[1]}_{run['settings']}.json"
        for run in runs_of(wildcards.table)
    ]


def varied(wildcards):
    """Runs of micro DVC with other keys."""
    case = PREFIX[wildcards.table]
    names = config["variants"].get(case, [])
    return [f"{R}/variants/{case}_{name}.json" for name in names]


rule study:
    input:
        config=lambda wildcards: CASES[wildcards.case]["configfile"],
        made=lambda wildcards: [
            f"{R}/made/{wildcards.case}/{name}"
            for name in CASES[wildcards.case].get("made", [])
        ],
    output:
        f"{R}/study_{{case}}.json",
    log:
        f"{R}/logs/study/{{case}}.log",
    benchmark:
        f"{R}/benchmarks/study/{{case}}.tsv"
    threads: workflow.cores
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        code=code("study.py"),
        workflow=folder_hash(TOP / "workflow"),
        schema=str(BENCHMARKS.parent / "workflow/schemas/config.schema.yaml"),
        states=lambda wildcards: CASES[wildcards.case]["states"],
    script:
        "scripts/study.py"


rule elastix:
    input:
        f"{R}/study_{{case}}.json",
    output:
        f"{R}/elastix/{{case}}_state{{state}}_{{spacing}}_{{settings}}.json",
    log:
        f"{R}/logs/elastix/{{case}}_state{{state}}_{{spacing}}_{{settings}}.log",
    benchmark:
        f"{R}/benchmarks/elastix/{{case}}_state{{state}}_{{spacing}}_{{settings}}.tsv"
    threads: workflow.cores
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        code=code("elastix.py"),
        folder="results/{case}",
        settings=lambda wildcards: config["elastix"]["settings"][wildcards.settings],
    script:
        "scripts/elastix.py"


rule compare:
    input:
        peers=found_by_runs,
        varied=varied,
        study=lambda wildcards: f"{R}/study_{PREFIX[wildcards.table]}.json",
    output:
        table=f"{R}/{{table}}.csv",
        all=f"{R}/{{table}}_settings.csv",
    log:
        f"{R}/logs/compare/{{table}}.log",
    benchmark:
        f"{R}/benchmarks/compare/{{table}}.tsv"
    threads: 1
    resources:
        mem_mb=600,
        runtime=10,
    params:
        code=code("compare.py"),
        folder=lambda wildcards: f"results/{PREFIX[wildcards.table]}",
        states=lambda wildcards: CASES[PREFIX[wildcards.table]]["states"],
        runs=lambda wildcards: runs_of(wildcards.table),
        columns=COLUMNS,
    script:
        "scripts/compare.py"
