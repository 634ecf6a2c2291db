# Figures and tables: one rule each, from results on disk to results/CASE/figures.


rule fig03:
    input:
        SPECIMEN,
        smooth(0, *STATES),
    output:
        shown("fig03_states.png", "fig03", "Specimen", "specimen in each state"),
    log:
        f"{R}/logs/figures/fig03.log",
    benchmark:
        f"{R}/benchmarks/figures/fig03.tsv"
    priority: 10  # the one that shows a wrong shape, axis or threshold
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory_by_largest(2000, 24.0),
        runtime=15,
    params:
        code=code("figures/fig03.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/fig03.py"


rule fig04:
    input:
        SPECIMEN,
        f"{R}/geometry/cell_size.json",
        f"{R}/volumes/volume0.h5",
    output:
        shown("fig04_cell_size.png", "fig04", "Specimen", "cell size"),
        drawing("fig04_cell_size"),
    log:
        f"{R}/logs/figures/fig04.log",
    benchmark:
        f"{R}/benchmarks/figures/fig04.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(800, 4.0),
        runtime=10,
    params:
        code=code("figures/fig04.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/fig04.py"


rule fig05:
    input:
        SPECIMEN,
        meshes(*MESO),
    output:
        shown("fig05_meso_meshes.png", "fig05", "Meshes", "meso meshes"),
    log:
        f"{R}/logs/figures/fig05.log",
    benchmark:
        f"{R}/benchmarks/figures/fig05.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 10.0),
        runtime=10,
    params:
        code=code("figures/fig05.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/fig05.py"


rule fig06:
    input:
        SPECIMEN,
        smooth(0),
        f"{R}/geometry/grid.vtu",
    output:
        shown("fig06_platen_grid.png", "fig06", "Meshes", "platen grid"),
    log:
        f"{R}/logs/figures/fig06.log",
    benchmark:
        f"{R}/benchmarks/figures/fig06.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 12.0),
        runtime=10,
    params:
        code=code("figures/fig06.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/fig06.py"


rule fig07:
    input:
        SPECIMEN,
        f"{R}/volumes/volume0.h5",
    output:
        shown("fig07_blur.png", "fig07", "Specimen", "effect of the blur"),
    log:
        f"{R}/logs/figures/fig07.log",
    benchmark:
        f"{R}/benchmarks/figures/fig07.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(1500, 4.0),
        runtime=10,
    params:
        code=code("figures/fig07.py"),
        case=FIGURE_CASE,
        sigma=config["images"]["blur"],
    script:
        "../scripts/figures/fig07.py"


rule fig08:
    input:
        SPECIMEN,
        smooth(0),
        f"{R}/geometry/cell_size.json",
        f"{R}/geometry/region.json",
        meshes("micro"),
    output:
        shown("fig08_region.png", "fig08", "Meshes", "region and its mesh"),
    log:
        f"{R}/logs/figures/fig08.log",
    benchmark:
        f"{R}/benchmarks/figures/fig08.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(2000, 15.0),
        runtime=10,
    params:
        code=code("figures/fig08.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/fig08.py"


rule fig09:
    input:
        SPECIMEN,
        smooth(0),
        meshes("micro"),
    output:
        shown("fig09_penalised.png", "fig09", "Meshes", "penalised nodes"),
    log:
        f"{R}/logs/figures/fig09.log",
    benchmark:
        f"{R}/benchmarks/figures/fig09.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(2000, 15.0),
        runtime=10,
    params:
        code=code("figures/fig09.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/fig09.py"


rule fig14:
    input:
        SPECIMEN,
        smooth(0),
        f"{R}/geometry/cell_size.json",
        f"{R}/geometry/micro.vtu",
    output:
        shown(
            "fig14_local_region.png",
            "fig14",
            "Microscale DVC",
            "slab of Fig. 15 to 17",
        ),
    log:
        f"{R}/logs/figures/fig14.log",
    benchmark:
        f"{R}/benchmarks/figures/fig14.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(2000, 15.0),
        runtime=15,
    params:
        code=code("figures/fig14.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/fig14.py"


rule more_topology:
    input:
        SPECIMEN,
        smooth(0),
        meshes("micro"),
        f"{R}/geometry/topology.json",
    output:
        table=shown(
            "more_topology.csv", "more_topology", "Tables", "each stub, neck and weld"
        ),
        picture=shown(
            "more_topology.png", "more_topology", "Meshes", "stubs, necks and welds"
        ),
    log:
        f"{R}/logs/figures/more_topology.log",
    benchmark:
        f"{R}/benchmarks/figures/more_topology.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(2000, 15.0),
        runtime=10,
    params:
        code=code("figures/more_topology.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/more_topology.py"


rule table1:
    input:
        SPECIMEN,
        f"{R}/input.json",
    output:
        shown("table1_acquisition.csv", "table1", "Tables", "scans"),
    log:
        f"{R}/logs/figures/table1.log",
    benchmark:
        f"{R}/benchmarks/figures/table1.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600, 1.0),
        runtime=5,
    params:
        code=code("figures/table1.py"),
        case=FIGURE_CASE,
        config={
            key: config[key] for key in ("scans", "twin", "virtual") if key in config
        },
    script:
        "../scripts/figures/table1.py"


rule table2:
    input:
        SPECIMEN,
        f"{R}/input.json",
        f"{R}/geometry/cell_size.json",
        meshes(*MESO, "micro"),
        solutions(*MESO, *MICRO),
        fields(*MICRO),
        expand(f"{R}/analysis/ultimate_{{mesh}}.json", mesh=[*MESO, *MICRO]),
    output:
        shown("table2_parameters.csv", "table2", "Tables", "parameters"),
    log:
        f"{R}/logs/figures/table2.log",
    benchmark:
        f"{R}/benchmarks/figures/table2.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600, 1.0),
        runtime=5,
    params:
        code=code("figures/table2.py"),
        case=FIGURE_CASE,
        config={key: config[key] for key in ("images", "meso", "micro")},
        methods=settings.micro_names(config),
    script:
        "../scripts/figures/table2.py"


rule more_ultimate:
    input:
        expand(f"{R}/analysis/ultimate_{{mesh}}.json", mesh=[*MESO, *MICRO]),
    output:
        shown("more_ultimate.png", "more_ultimate", "Quality", "ultimate error"),
        drawing("more_ultimate"),
    log:
        f"{R}/logs/figures/more_ultimate.log",
    benchmark:
        f"{R}/benchmarks/figures/more_ultimate.tsv"
    conda:
        ENV
    threads: 1
    resources:
        mem_mb=memory(600, 1.0),
        runtime=5,
    params:
        code=code("figures/more_ultimate.py"),
        case=FIGURE_CASE,
    script:
        "../scripts/figures/more_ultimate.py"


if STATES:

    rule fig10:
        input:
            SPECIMEN,
            smooth(0),
            meshes(*MESO),
            solutions(*MESO),
        output:
            shown(
                "fig10_meso_deformed.png",
                "fig10",
                "Mesoscale DVC",
                "deformed meshes, sigma(r)",
            ),
        log:
            f"{R}/logs/figures/fig10.log",
        benchmark:
            f"{R}/benchmarks/figures/fig10.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, 10.0),
            runtime=15,
        params:
            code=code("figures/fig10.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/fig10.py"

    rule fig11:
        input:
            SPECIMEN,
            smooth(0),
            meshes(FINEST),
            solutions(FINEST),
        output:
            shown(
                "fig11_meso_displacement.png", "fig11", "Mesoscale DVC", "displacement"
            ),
        log:
            f"{R}/logs/figures/fig11.log",
        benchmark:
            f"{R}/benchmarks/figures/fig11.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1500, 10.0),
            runtime=15,
        params:
            code=code("figures/fig11.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/fig11.py"

    rule fig12:
        input:
            f"{R}/analysis/image_noise.json",
            residuals(FINEST, *MICRO),
            solutions(FINEST, *MICRO),
            fields(*MICRO),
        output:
            shown(
                "fig12_histograms.png",
                "fig12",
                "Microscale DVC",
                "histograms of the residual",
            ),
            drawing("fig12_histograms"),
        log:
            f"{R}/logs/figures/fig12.log",
        benchmark:
            f"{R}/benchmarks/figures/fig12.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1000, 4.0),
            runtime=10,
        params:
            code=code("figures/fig12.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/fig12.py"

    rule fig13:
        input:
            SPECIMEN,
            smooth(0),
            meshes("micro"),
            residuals(FINEST, *MICRO),
            solutions(FINEST, *MICRO),
            fields(*MICRO),
        output:
            shown("fig13_residual_maps.png", "fig13", "Microscale DVC", "residual maps"),
        log:
            f"{R}/logs/figures/fig13.log",
        benchmark:
            f"{R}/benchmarks/figures/fig13.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(2000, 6.0),
            runtime=15,
        params:
            code=code("figures/fig13.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/fig13.py"

    rule fig15:
        input:
            CARRIED,
            smooth(0),
        output:
            shown(
                "fig15_fields.png",
                "fig15",
                "Microscale DVC",
                "displacement and strain",
            ),
        log:
            f"{R}/logs/figures/fig15.log",
        benchmark:
            f"{R}/benchmarks/figures/fig15.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(2000, 10.0),
            runtime=15,
        params:
            code=code("figures/fig15.py"),
            case=FIGURE_CASE,
            strain=config["fields"]["strain"],
        script:
            "../scripts/figures/fig15.py"

    rule fig16:
        input:
            CARRIED,
            smooth(0, *STATES),
            expand(f"{R}/analysis/warp_state{{state}}.json", state=STATES),
        output:
            shown(
                "fig16_warp.png",
                "fig16",
                "Microscale DVC",
                "reference on the deformed image",
            ),
        log:
            f"{R}/logs/figures/fig16.log",
        benchmark:
            f"{R}/benchmarks/figures/fig16.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory_by_largest(2000, 24.0),
            runtime=15,
        params:
            code=code("figures/fig16.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/fig16.py"

    rule fig17:
        input:
            CARRIED,
            smooth(0, *STATES),
            f"{R}/geometry/region.json",
        output:
            shown("fig17_zoom.png", "fig17", "Microscale DVC", "close-ups"),
        log:
            f"{R}/logs/figures/fig17.log",
        benchmark:
            f"{R}/benchmarks/figures/fig17.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory_by_largest(2000, 24.0),
            runtime=15,
        params:
            code=code("figures/fig17.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/fig17.py"

    rule more_struts:
        input:
            SPECIMEN,
            smooth(0),
            struts(),
        output:
            shown("more_struts.png", "more_struts", "Struts", "network of struts"),
        log:
            f"{R}/logs/figures/more_struts.log",
        benchmark:
            f"{R}/benchmarks/figures/more_struts.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(2000, 10.0),
            runtime=15,
        params:
            code=code("figures/more_struts.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_struts.py"

    rule more_bending:
        input:
            struts(),
            struts_truth("csv"),
        output:
            shown("more_bending.png", "more_bending", "Struts", "bending or stretching"),
            drawing("more_bending"),
        log:
            f"{R}/logs/figures/more_bending.log",
        benchmark:
            f"{R}/benchmarks/figures/more_bending.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 2.0),
            runtime=10,
        params:
            code=code("figures/more_bending.py"),
            case=FIGURE_CASE,
            truth=HAS_TRUTH,
        script:
            "../scripts/figures/more_bending.py"

    rule more_uncertainty:
        input:
            SPECIMEN,
            smooth(0),
            meshes("micro"),
            solutions(FINEST, MICRO[0]),
            fields(MICRO[0]),
            f"{R}/geometry/struts.h5",
            uncertainty(),
            uncertainty_truth(),
        output:
            shown("more_uncertainty.png", "more_uncertainty", "Quality", "uncertainty"),
        log:
            f"{R}/logs/figures/more_uncertainty.log",
        benchmark:
            f"{R}/benchmarks/figures/more_uncertainty.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(2000, 6.0),
            runtime=15,
        params:
            code=code("figures/more_uncertainty.py"),
            case=FIGURE_CASE,
            truth=HAS_TRUTH,
        script:
            "../scripts/figures/more_uncertainty.py"

    rule more_localisation:
        input:
            SPECIMEN,
            smooth(0),
            solutions(FINEST, MICRO[0]),
            fields(MICRO[0]),
            cells(),
        output:
            shown(
                "more_localisation.png",
                "more_localisation",
                "Struts",
                "strain of cells and its bands",
            ),
            drawing("more_localisation"),
        log:
            f"{R}/logs/figures/more_localisation.log",
        benchmark:
            f"{R}/benchmarks/figures/more_localisation.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 2.0),
            runtime=10,
        params:
            code=code("figures/more_localisation.py"),
            case=FIGURE_CASE,
            truth=HAS_TRUTH,
        script:
            "../scripts/figures/more_localisation.py"

    rule more_convergence:
        input:
            solutions(*MESO, *MICRO),
            fields(*MICRO),
        output:
            shown("more_convergence.png", "more_convergence", "Quality", "convergence"),
            drawing("more_convergence"),
        log:
            f"{R}/logs/figures/more_convergence.log",
        benchmark:
            f"{R}/benchmarks/figures/more_convergence.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=10,
        params:
            code=code("figures/more_convergence.py"),
            case=FIGURE_CASE,
            tolerance={name: config[name]["tolerance"] for name in ("meso", "micro")},
        script:
            "../scripts/figures/more_convergence.py"


if STATES:

    rule more_starts:
        input:
            solutions(MICRO[0]),
            fields(MICRO[0]),
            expand(
                f"{R}/dvc/{{name}}_state{{state}}.h5",
                name=["start", *MESO[1:], "micro_start"],
                state=STATES,
            ),
        output:
            shown("more_starts.csv", "more_starts", "Tables", "starts that were tried"),
        log:
            f"{R}/logs/figures/more_starts.log",
        benchmark:
            f"{R}/benchmarks/figures/more_starts.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=5,
        params:
            code=code("figures/more_starts.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_starts.py"

    rule more_warp:
        input:
            solutions(FINEST, *MICRO),
            fields(*MICRO),
            expand(f"{R}/analysis/warp_state{{state}}.json", state=STATES),
        output:
            shown("more_warp.csv", "more_warp", "Tables", "overlap with the image"),
        log:
            f"{R}/logs/figures/more_warp.log",
        benchmark:
            f"{R}/benchmarks/figures/more_warp.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=5,
        params:
            code=code("figures/more_warp.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_warp.py"


if STATES and settings.chooses(config["micro"], METHODS[MICRO[0]]):

    rule more_cutoff:
        input:
            SPECIMEN,
            smooth(0),
            solutions(MICRO[0]),
            fields(MICRO[0]),
        output:
            shown("more_cutoff.png", "more_cutoff", "Quality", "choice of l_E"),
            drawing("more_cutoff"),
        log:
            f"{R}/logs/figures/more_cutoff.log",
        benchmark:
            f"{R}/benchmarks/figures/more_cutoff.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=10,
        params:
            code=code("figures/more_cutoff.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_cutoff.py"


if STATES and HAS_TRUTH:

    rule more_error:
        input:
            smooth(0),
            solutions(*JUDGED),
            fields(*MICRO),
            expand(
                f"{R}/analysis/error_{{mesh}}_state{{state}}.json",
                mesh=JUDGED,
                state=STATES,
            ),
        output:
            table=shown(
                "more_error.csv", "more_error", "Tables", "errors against the truth"
            ),
            pictures=[
                shown(
                    "more_error.png",
                    "more_error",
                    "Quality",
                    "error against the truth",
                ),
                drawing("more_error"),
            ],
        log:
            f"{R}/logs/figures/more_error.log",
        benchmark:
            f"{R}/benchmarks/figures/more_error.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=10,
        params:
            code=code("figures/more_error.py"),
            case=FIGURE_CASE,
            names=JUDGED,
        script:
            "../scripts/figures/more_error.py"

    rule more_struts_truth:
        input:
            struts(),
            struts_truth("csv"),
            struts_truth("json"),
        output:
            table=shown(
                "more_struts_truth.csv",
                "more_struts_truth",
                "Tables",
                "figures of struts against the truth",
            ),
            pictures=[
                shown(
                    "more_struts_truth.png",
                    "more_struts_truth",
                    "Struts",
                    "struts against the truth",
                ),
                drawing("more_struts_truth"),
            ],
        log:
            f"{R}/logs/figures/more_struts_truth.log",
        benchmark:
            f"{R}/benchmarks/figures/more_struts_truth.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 2.0),
            runtime=10,
        params:
            code=code("figures/more_struts_truth.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_struts_truth.py"

    rule more_difficulty:
        input:
            f"{R}/analysis/difficulty.json",
        output:
            shown(
                "more_difficulty.csv",
                "more_difficulty",
                "Tables",
                "how hard the test is",
            ),
        log:
            f"{R}/logs/figures/more_difficulty.log",
        benchmark:
            f"{R}/benchmarks/figures/more_difficulty.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=5,
        params:
            code=code("figures/more_difficulty.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_difficulty.py"


if STATES and KIND == "twin":

    rule more_twin_check:
        input:
            f"{R}/analysis/twin_check.json",
        output:
            shown(
                "more_twin_check.csv",
                "more_twin_check",
                "Tables",
                "checks of the twin",
            ),
        log:
            f"{R}/logs/figures/more_twin_check.log",
        benchmark:
            f"{R}/benchmarks/figures/more_twin_check.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=5,
        params:
            code=code("figures/more_twin_check.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_twin_check.py"

    rule more_twin_scans:
        input:
            SPECIMEN,
            expand(f"{R}/volumes/volume{{state}}.h5", state=[0, *STATES]),
        output:
            shown("more_twin_scans.png", "more_twin_scans", "Synthetic test", "scans"),
        log:
            f"{R}/logs/figures/more_twin_scans.log",
        benchmark:
            f"{R}/benchmarks/figures/more_twin_scans.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1000, 3.0),
            runtime=10,
        params:
            code=code("figures/more_twin_scans.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_twin_scans.py"

    rule more_twin_network:
        input:
            smooth(0),
            networks=NETWORKS[1:],
        output:
            shown(
                "more_twin_network.png",
                "more_twin_network",
                "Synthetic test",
                "network of beams",
            ),
        log:
            f"{R}/logs/figures/more_twin_network.log",
        benchmark:
            f"{R}/benchmarks/figures/more_twin_network.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(2000, 20.0),
            runtime=15,
        params:
            code=code("figures/more_twin_network.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_twin_network.py"

    rule more_twin_mechanics:
        input:
            SPECIMEN,
            history=f"{MOTION_FOLDER}/history.csv",
        output:
            shown(
                "more_twin_mechanics.png",
                "more_twin_mechanics",
                "Synthetic test",
                "mechanics",
            ),
            drawing("more_twin_mechanics"),
        log:
            f"{R}/logs/figures/more_twin_mechanics.log",
        benchmark:
            f"{R}/benchmarks/figures/more_twin_mechanics.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=10,
        params:
            code=code("figures/more_twin_mechanics.py"),
            case=FIGURE_CASE,
        script:
            "../scripts/figures/more_twin_mechanics.py"
