# Cell size, threshold, surface and meshes: Fig. 4 to 9.


rule cell_size:
    input:
        volume=f"{R}/volumes/volume0.h5",
        specimen=f"{R}/geometry/specimen.json",
    output:
        f"{R}/geometry/cell_size.json",
    log:
        f"{R}/logs/cell_size/all.log",
    benchmark:
        f"{R}/benchmarks/cell_size/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 6.0),
        runtime=10,
    params:
        code=code("geometry/cell_size.py"),
        geometry=config["geometry"],
    script:
        "../scripts/geometry/cell_size.py"


rule threshold:
    input:
        smooth=f"{R}/volumes/smooth0.h5",
        specimen=f"{R}/geometry/specimen.json",
    output:
        f"{R}/geometry/threshold.json",
    log:
        f"{R}/logs/threshold/all.log",
    benchmark:
        f"{R}/benchmarks/threshold/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 4.0),
        runtime=10,
    params:
        code=code("geometry/threshold.py"),
        geometry=config["geometry"],
        porosity=config["porosity"],
    script:
        "../scripts/geometry/threshold.py"


rule solid:
    input:
        smooth=f"{R}/volumes/smooth0.h5",
        specimen=f"{R}/geometry/specimen.json",
        threshold=f"{R}/geometry/threshold.json",
        reference=(
            f"{R}/volumes/volume0.h5" if config["mesh"]["mend"] == "bridge" else []
        ),
        profile=(
            f"{R}/geometry/meso_residual.json"
            if "height" in config["micro"]["region"]
            else []
        ),
    output:
        solid=f"{R}/geometry/solid.h5",
        region=f"{R}/geometry/region.json",
        bridges=f"{R}/geometry/bridges.json",
    log:
        f"{R}/logs/solid/all.log",
    benchmark:
        f"{R}/benchmarks/solid/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 5.0),
        runtime=10,
    params:
        code=code("geometry/solid.py"),
        micro=section("micro", "region"),
        sides=config.get("scans", {}).get("sides", "auto"),
        mesh=section("mesh", "min_kept", "mend", "size"),
    script:
        "../scripts/geometry/solid.py"


rule surface:
    input:
        solid=f"{R}/geometry/solid.h5",
        threshold=f"{R}/geometry/threshold.json",
    output:
        f"{R}/geometry/surface.vtu",
    log:
        f"{R}/logs/surface/all.log",
    benchmark:
        f"{R}/benchmarks/surface/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1200, 6.0),
        runtime=10,
    params:
        code=code("geometry/surface.py"),
    script:
        "../scripts/geometry/surface.py"


rule micro_mesh:
    input:
        solid=f"{R}/geometry/solid.h5",
        surface=f"{R}/geometry/surface.vtu",
        threshold=f"{R}/geometry/threshold.json",
        region=f"{R}/geometry/region.json",
    output:
        mesh=f"{R}/geometry/micro_mesh.vtu",
        figures=f"{R}/geometry/micro.json",
    log:
        f"{R}/logs/micro_mesh/all.log",
    benchmark:
        f"{R}/benchmarks/micro_mesh/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(3000, 20.0),
        runtime=120,
    params:
        code=code("geometry/micro_mesh.py"),
        mesh=config["mesh"],
    script:
        "../scripts/geometry/micro_mesh.py"


rule penalised_nodes:
    input:
        mesh=f"{R}/geometry/micro_mesh.vtu",
        region=f"{R}/geometry/region.json",
    output:
        f"{R}/geometry/micro.vtu",
    log:
        f"{R}/logs/penalised_nodes/all.log",
    benchmark:
        f"{R}/benchmarks/penalised_nodes/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1200, 30.0),
        runtime=10,
    params:
        code=code("geometry/penalised_nodes.py"),
        micro=section("micro", "sides"),
    script:
        "../scripts/geometry/penalised_nodes.py"


rule meso_mesh:
    input:
        specimen=f"{R}/geometry/specimen.json",
        cell_size=f"{R}/geometry/cell_size.json",
    output:
        mesh=f"{R}/geometry/{{meso}}.vtu",
        figures=f"{R}/geometry/{{meso}}.json",
    log:
        f"{R}/logs/meso_mesh/{{meso}}.log",
    benchmark:
        f"{R}/benchmarks/meso_mesh/{{meso}}.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 3.0),
        runtime=60,
    params:
        code=code("geometry/meso_mesh.py"),
        meso=section("meso", "sizes", "margin"),
    script:
        "../scripts/geometry/meso_mesh.py"


rule platen_grid:
    input:
        volume=f"{R}/volumes/volume0.h5",
        specimen=f"{R}/geometry/specimen.json",
    output:
        mesh=f"{R}/geometry/grid.vtu",
        lines=f"{R}/geometry/grid.json",
    log:
        f"{R}/logs/platen_grid/all.log",
    benchmark:
        f"{R}/benchmarks/platen_grid/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 3.0),
        runtime=10,
    params:
        code=code("geometry/platen_grid.py"),
        grid=config["grid"],
    script:
        "../scripts/geometry/platen_grid.py"


rule strut_frame:
    input:
        threshold=f"{R}/geometry/threshold.json",
        reference=f"{R}/volumes/volume0.h5",
        blurred=f"{R}/volumes/smooth0.h5",
        region=f"{R}/geometry/region.json",
    output:
        f"{R}/geometry/frame.h5",
    log:
        f"{R}/logs/strut_frame/all.log",
    benchmark:
        f"{R}/benchmarks/strut_frame/all.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 15.0),
        runtime=60,
    params:
        code=code("geometry/strut_frame.py"),
    script:
        "../scripts/geometry/strut_frame.py"
