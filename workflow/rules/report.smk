# The first page, the report, the words at the end of a run.


rule front_page:
    input:
        summary=f"{R}/summary.json",
        scans=f"{R}/input.json",
    output:
        page=f"{R}/report/front.rst",
        config=f"{R}/report/config.json",
    log:
        f"{R}/logs/front_page/all.log",
    benchmark:
        f"{R}/benchmarks/front_page/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600),
        runtime=10,
    params:
        code=code("report/front_page.py"),
        config=config,
    script:
        "../scripts/report/front_page.py"


rule figures:
    input:
        FIGURES,
        f"{R}/summary.json",
        f"{R}/report/front.rst",


rule report:
    input:
        FIGURES,
        page=f"{R}/report/front.rst",
        config=f"{R}/report/config.json",
        captions=sorted(map(str, (WORKFLOW / "report").glob("*.rst"))),
    output:
        f"{R}/report.html",
    log:
        f"{R}/logs/report/all.log",
    benchmark:
        f"{R}/benchmarks/report/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500),
        runtime=20,
    params:
        code=code("report/report.py"),
        snakefile=workflow.main_snakefile,
        target="figures",
    script:
        "../scripts/report/report.py"


rule verdicts:
    input:
        f"{R}/summary.json",
    output:
        f"{R}/verdicts.txt",
    log:
        f"{R}/logs/verdicts/all.log",
    benchmark:
        f"{R}/benchmarks/verdicts/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600),
        runtime=10,
    params:
        code=code("report/verdicts.py"),
        folder=lambda wildcards, output: str(Path(output[0]).parent),
        strict=config["strict"],
    script:
        "../scripts/report/verdicts.py"
