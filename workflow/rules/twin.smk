# Where images come from when they are not the user's: the twin, or virtual states of a real scan.

if KIND == "twin":

    rule twin_foam:
        output:
            f"{MOTION_FOLDER}/foam.h5",
        log:
            f"{R}/logs/twin_foam/all.log",
        benchmark:
            f"{R}/benchmarks/twin_foam/all.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(800, 3.0),
            runtime=20,
        params:
            code=code("twin/twin_foam.py"),
            twin=TWIN_MOTION,
        script:
            "../scripts/twin/twin_foam.py"

    rule twin_mechanics:
        input:
            f"{MOTION_FOLDER}/foam.h5",
        output:
            motion=TRUTH,
            history=f"{MOTION_FOLDER}/history.csv",
            networks=NETWORKS,
        log:
            f"{R}/logs/twin_mechanics/all.log",
        benchmark:
            f"{R}/benchmarks/twin_mechanics/all.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, 3.0),
            runtime=240,
        params:
            code=code("twin/twin_mechanics.py"),
            twin=TWIN_MOTION,
        script:
            "../scripts/twin/twin_mechanics.py"

    rule twin_scan:
        input:
            foam=f"{MOTION_FOLDER}/foam.h5",
            motion=TRUTH,
        output:
            f"{SCANS}/state{{state}}.tif",
        log:
            f"{R}/logs/twin_scan/state{{state}}.log",
        benchmark:
            f"{R}/benchmarks/twin_scan/state{{state}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, 3.0),
            runtime=30,
        params:
            code=code("twin/twin_scan.py"),
            twin=TWIN_SCANS,
        script:
            "../scripts/twin/twin_scan.py"


if KIND == "virtual":

    rule virtual_field:
        output:
            f"{R}/truth/virtual.json",
        log:
            f"{R}/logs/virtual_field/all.log",
        benchmark:
            f"{R}/benchmarks/virtual_field/all.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(800, 3.0),
            runtime=10,
        params:
            code=code("twin/virtual_field.py"),
            virtual=config["virtual"],
            axis=AXIS,
        script:
            "../scripts/twin/virtual_field.py"

    rule virtual_scan:
        input:
            field=f"{R}/truth/virtual.json",
            files=SCAN_FILES[0],
        output:
            f"{SCANS}/state{{state}}.tif",
        log:
            f"{R}/logs/virtual_scan/state{{state}}.log",
        benchmark:
            f"{R}/benchmarks/virtual_scan/state{{state}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, 12.0),
            runtime=60,
        params:
            code=code("twin/virtual_scan.py"),
            virtual=config["virtual"],
            settings=settings.scan_settings(config, 0),
            scan=scan_path(0),
        script:
            "../scripts/twin/virtual_scan.py"
