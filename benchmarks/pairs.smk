# Pairs of images that are harder than a loaded network: made here, measured by the workflow.


rule pair:
    output:
        expand(
            f"{R}/made/{{{{case}}}}/{{name}}",
            name=["state0.tif", "state1.tif", "motion.h5"],
        ),
    log:
        f"{R}/logs/pair/{{case}}.log",
    benchmark:
        f"{R}/benchmarks/pair/{{case}}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        code=code("pair.py"),
        pair=lambda wildcards: config["pairs"][wildcards.case],
    script:
        "scripts/pair.py"


rule l_e:
    input:
        f"{R}/study_{{case}}.json",
    output:
        f"{R}/l_e/{{case}}_{{l_e}}.json",
    log:
        f"{R}/logs/l_e/{{case}}_{{l_e}}.log",
    benchmark:
        f"{R}/benchmarks/l_e/{{case}}_{{l_e}}.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=30,
    params:
        code=code("l_e.py"),
        folder="results/{case}",
    script:
        "scripts/l_e.py"
