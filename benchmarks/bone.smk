# A real scan compressed on the computer; only where `bone: {scan: FILE}` is given.

if config["bone"].get("scan"):

    rule bone:
        input:
            config["bone"]["scan"],
        output:
            expand(
                f"{R}/made/bone/{{name}}", name=[*CASES["bone"]["made"], "config.yaml"]
            ),
        log:
            f"{R}/logs/bone.log",
        benchmark:
            f"{R}/benchmarks/bone.tsv"
        threads: workflow.cores
        resources:
            mem_mb=6000,
            runtime=60,
        params:
            code=code("bone.py"),
            bone=config["bone"],
        script:
            "scripts/bone.py"
