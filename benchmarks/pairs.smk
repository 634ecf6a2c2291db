# Pairs of images that are harder than a loaded network: made here, measured by the workflow.


rule strut:
    output:
        expand(f"{R}/made/strut/{{name}}", name=CASES["strut"]["made"]),
    log:
        f"{R}/logs/strut.log",
    benchmark:
        f"{R}/benchmarks/strut.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        code=code("strut.py"),
        strut=config["pairs"]["strut"],
    script:
        "scripts/strut.py"


rule band:
    output:
        expand(f"{R}/made/band/{{name}}", name=CASES["band"]["made"]),
    log:
        f"{R}/logs/band.log",
    benchmark:
        f"{R}/benchmarks/band.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        code=code("band.py"),
        band=config["pairs"]["band"],
    script:
        "scripts/band.py"


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
