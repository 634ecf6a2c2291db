# The first page, the report, the words at the end of a run.


rule front_page:
    input:
        summary=R + "/summary.json",
        scans=R + "/input.json",
    output:
        page=R + "/report/front.rst",
        config=R + "/report/config.json",
    log:
        R + "/logs/front_page/all.log",
    benchmark:
        R + "/benchmarks/front_page/all.tsv"
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
        R + "/summary.json",
        R + "/report/front.rst",


rule report:
    input:
        FIGURES,
        page=R + "/report/front.rst",
        config=R + "/report/config.json",
        captions=sorted(map(str, (WORKFLOW / "report").glob("*.rst"))),
    output:
        R + "/report.html",
    log:
        R + "/logs/report/all.log",
    benchmark:
        R + "/benchmarks/report/all.tsv"
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
        R + "/summary.json",
    output:
        R + "/verdicts.txt",
    log:
        R + "/logs/verdicts/all.log",
    benchmark:
        R + "/benchmarks/verdicts/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600),
        runtime=10,
    params:
        code=code("report/verdicts.py"),
        folder=R,
        strict=config["strict"],
    script:
        "../scripts/report/verdicts.py"
