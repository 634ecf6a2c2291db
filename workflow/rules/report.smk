# The first page, the report, what to look around in, the words at the end of a run.

LOOK_AROUND = [
    *expand(f"{R}/fields/{{mesh}}.pvd", mesh=RESULTS),
    *([f"{R}/scene.html"] if STATES else []),
]

CAPTIONS = sorted(map(str, (WORKFLOW / "report").glob("*.rst")))


# Its commit is that of the last thing the report shows that was made.
rule front_page:
    input:
        FIGURES,
        CAPTIONS,
        picture=[f"{R}/figures/more_struts.png"] if STATES else [],
        summary=f"{R}/summary.json",
        scans=f"{R}/input.json",
        hashes=f"{R}/input_hashes.json",
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
        entries=ENTRIES,
    script:
        "../scripts/report/front_page.py"


rule series:
    input:
        f"{R}/input.json",
        fields=fields(*RESULTS),
    output:
        series=expand(f"{R}/fields/{{mesh}}.pvd", mesh=RESULTS),
        meaning=f"{R}/fields/fields.json",
    log:
        f"{R}/logs/series/all.log",
    benchmark:
        f"{R}/benchmarks/series/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600, 0.1),
        runtime=5,
    params:
        code=code("report/series.py"),
        states=STATES,
        strain=config["fields"]["strain"],
    script:
        "../scripts/report/series.py"


if STATES:

    rule scene:
        input:
            SPECIMEN,
            smooth(0),
            meshes("micro"),
            struts(),
            template=str(WORKFLOW / "report/scene.html"),
        output:
            f"{R}/scene.html",
        log:
            f"{R}/logs/scene/all.log",
        benchmark:
            f"{R}/benchmarks/scene/all.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, 10.0),
            runtime=15,
        params:
            code=code("report/scene.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/report/scene.py"


rule captions:
    input:
        CAPTIONS,
    output:
        f"{R}/figures/captions.md",
    log:
        f"{R}/logs/captions/all.log",
    benchmark:
        f"{R}/benchmarks/captions/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600),
        runtime=5,
    params:
        code=code("report/captions.py"),
        entries=ENTRIES,
    script:
        "../scripts/report/captions.py"


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
        stylesheet=str(WORKFLOW / "report/report.css"),
        captions=CAPTIONS,
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
