# From the files of the scanner to the volumes that everything works on.


# Scans that must agree before any work: all of them, or the one that the others come from.
GIVEN = [0] if KIND == "virtual" else [0, *STATES]


rule check_input:
    input:
        [scan_input(state) for state in GIVEN],
    output:
        f"{R}/input.json",
    log:
        f"{R}/logs/check_input/all.log",
    benchmark:
        f"{R}/benchmarks/check_input/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 3.0),
        runtime=20,
    params:
        code=code("scans/check_input.py"),
        settings=settings.scan_settings(config, 0),
        voxel_size_um=settings.voxel_size_um(config),
        scans=[scan_path(state) for state in GIVEN],
    script:
        "../scripts/scans/check_input.py"


rule input_hashes:
    input:
        f"{R}/input.json",
        scans=[scan_input(state) for state in [0, *STATES]],
    output:
        f"{R}/input_hashes.json",
    log:
        f"{R}/logs/input_hashes/all.log",
    benchmark:
        f"{R}/benchmarks/input_hashes/all.tsv"
    priority: 10  # it tells copies apart
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600, 0.0),
        runtime=60,
    params:
        code=code("scans/input_hashes.py"),
        scans={scan_path(state): scan_input(state) for state in [0, *STATES]},
    script:
        "../scripts/scans/input_hashes.py"


# Of its scan alone, so that another list of states, or voxel size, remakes no volume. Not of input.json as
# `ancient`: Snakemake then sees no other change of what comes after a check that is done again.
rule volume:
    input:
        lambda wildcards: scan_input(int(wildcards.state)),
    output:
        f"{R}/volumes/volume{{state}}.h5",
    log:
        f"{R}/logs/volume/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/volume/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1000, SCAN_MEMORY),
        runtime=60,
    params:
        code=code("scans/volume.py"),
        settings=lambda wildcards: settings.scan_settings(config, int(wildcards.state)),
        scan=lambda wildcards: scan_path(int(wildcards.state)),
    script:
        "../scripts/scans/volume.py"


rule smooth:
    input:
        unpack(grey_reference),
        volume=f"{R}/volumes/volume{{state}}.h5",
    output:
        f"{R}/volumes/smooth{{state}}.h5",
    log:
        f"{R}/logs/smooth/state{{state}}.log",
    benchmark:
        f"{R}/benchmarks/smooth/state{{state}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 3.0),
        runtime=10,
    params:
        code=code("scans/smooth.py"),
        images=config["images"],
        axis=AXIS,
    script:
        "../scripts/scans/smooth.py"


rule specimen:
    input:
        f"{R}/volumes/volume0.h5",
    output:
        f"{R}/geometry/specimen.json",
    log:
        f"{R}/logs/specimen/all.log",
    benchmark:
        f"{R}/benchmarks/specimen/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 6.0),
        runtime=10,
    params:
        code=code("scans/specimen.py"),
        axis=AXIS,
        platens=config.get("scans", {}).get("platens", "auto"),
        outline=config.get("scans", {}).get("specimen", "auto"),
    script:
        "../scripts/scans/specimen.py"
