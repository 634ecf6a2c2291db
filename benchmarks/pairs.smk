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


rule variant:
    input:
        f"{R}/study_{{case}}.json",
    output:
        f"{R}/variants/{{case}}_{{variant}}.json",
    log:
        f"{R}/logs/variant/{{case}}_{{variant}}.log",
    benchmark:
        f"{R}/benchmarks/variant/{{case}}_{{variant}}.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=30,
    params:
        code=code("variant.py"),
        changes=lambda wildcards: config["variants"][wildcards.case][wildcards.variant],
        folder="results/{case}",
    script:
        "scripts/variant.py"
