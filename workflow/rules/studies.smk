# What micro DVC owes to its ingredients and to its parameters. Not part of the main run:
# `./addvc run ablation`, `./addvc run sensitivity`. The rules are those of the main run, in folders
# of each variant's own (`addvc.studies`), of which what the tables do not need is not kept.

if STATES:

    rule varied_threshold:
        input:
            smooth=f"{R}/volumes/smooth0.h5",
            specimen=f"{R}/geometry/specimen.json",
            threshold=f"{R}/geometry/threshold.json",
        output:
            own("threshold"),
        log:
            f"{R}/logs/varied_threshold/{{study}}_{{variant}}.log",
        benchmark:
            f"{R}/{{study}}/benchmarks/varied_threshold/{{variant}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(800, 4.0),
            runtime=10,
        params:
            code=code("studies/varied_threshold.py"),
            factor=lambda wildcards: variant_of(wildcards).factor,
            porosity=config["porosity"],
        script:
            "../scripts/studies/varied_threshold.py"

    use rule solid as variant_solid with:
        input:
            smooth=f"{R}/volumes/smooth0.h5",
            specimen=f"{R}/geometry/specimen.json",
            threshold=given("threshold"),
            reference=rules.solid.input.reference,
        output:
            solid=temp(own("solid")),
            region=own("region"),
            bridges=own("bridges"),
        log:
            f"{V_LOGS}/solid.log",
        benchmark:
            f"{V_TIMES}/solid.tsv"
        params:
            mesh=lambda wildcards: variant_of(wildcards).mesh(
                section("mesh", "min_kept", "mend", "size")
            ),

    use rule surface as variant_surface with:
        input:
            solid=given("solid"),
            threshold=given("threshold"),
        output:
            temp(own("surface")),
        log:
            f"{V_LOGS}/surface.log",
        benchmark:
            f"{V_TIMES}/surface.tsv"

    use rule micro_mesh as variant_mesh with:
        input:
            solid=given("solid"),
            surface=given("surface"),
            threshold=given("threshold"),
            region=given("region"),
        output:
            mesh=temp(own("mesh")),
            figures=own("figures"),
        log:
            f"{V_LOGS}/micro_mesh.log",
        benchmark:
            f"{V_TIMES}/micro_mesh.tsv"
        params:
            mesh=lambda wildcards: variant_of(wildcards).mesh(config["mesh"]),

    use rule penalised_nodes as variant_nodes with:
        input:
            mesh=given("mesh"),
            region=given("region"),
        output:
            own("classes"),
        log:
            f"{V_LOGS}/penalised_nodes.log",
        benchmark:
            f"{V_TIMES}/penalised_nodes.tsv"

    use rule shell as variant_shell with:
        input:
            mesh=given("classes"),
            reference=f"{R}/volumes/smooth0.h5",
            threshold=given("threshold"),
        output:
            temp(own("shell")),
        log:
            f"{V_LOGS}/shell.log",
        benchmark:
            f"{V_TIMES}/shell.tsv"

    use rule transfer as variant_transfer with:
        input:
            meshes=[mesh_of(FINEST)],
            micro=given("classes"),
            solutions=[f"{R}/dvc/{FINEST}_state{{state}}.h5"],
        output:
            temp(f"{V}/dvc/{FINEST}_on_micro_state{{state}}.h5"),
        log:
            f"{V_LOGS}/transfer_state{{state}}.log",
        benchmark:
            f"{V_TIMES}/transfer_state{{state}}.tsv"

    use rule field_on_micro as variant_field with:
        input:
            unpack(field_files),
            mesh=given("classes"),
            reference=f"{R}/volumes/smooth0.h5",
            deformed=f"{R}/volumes/smooth{{state}}.h5",
        output:
            temp(f"{V}/dvc/{{field}}_on_micro_state{{state}}.h5"),
        log:
            f"{V_LOGS}/{{field}}_on_micro_state{{state}}.log",
        benchmark:
            f"{V_TIMES}/{{field}}_on_micro_state{{state}}.tsv"

    use rule micro_start as variant_start with:
        input:
            mesh=given("classes"),
            reference=f"{R}/volumes/smooth0.h5",
            deformed=f"{R}/volumes/smooth{{state}}.h5",
            threshold=given("threshold"),
            cell_size=f"{R}/geometry/cell_size.json",
            candidates=starts_on_variant,
        output:
            temp(own("start")),
        log:
            f"{V_LOGS}/micro_start_state{{state}}.log",
        benchmark:
            f"{V_TIMES}/micro_start_state{{state}}.tsv"

    use rule factor as variant_factor with:
        input:
            mesh=given("classes"),
            shell=given("shell"),
            reference=f"{R}/volumes/smooth0.h5",
            cell_size=f"{R}/geometry/cell_size.json",
        output:
            temp(own("factor")),
        log:
            f"{V_LOGS}/factor.log",
        benchmark:
            f"{V_TIMES}/factor.tsv"
        params:
            method=method_of_variant,
            micro=changed("l_k", "l_l", "l_e", "period", "nu"),

    use rule micro_dvc as variant_dvc with:
        input:
            mesh=given("classes"),
            shell=given("shell"),
            reference=f"{R}/volumes/smooth0.h5",
            deformed=f"{R}/volumes/smooth{{state}}.h5",
            threshold=given("threshold"),
            bridges=given("bridges"),
            factor=given("factor"),
            start=given("start"),
        output:
            own("solution"),
        log:
            f"{V_LOGS}/micro_dvc_state{{state}}.log",
        benchmark:
            f"{V_TIMES}/micro_dvc_state{{state}}.tsv"
        params:
            method=method_of_variant,
            blur=config["images"]["blur"],
            micro=changed(
                "tolerance",
                "max_iterations",
                "nu",
                "l_e",
                "robust",
                "rotated",
                "stages",
                "mending",
            ),

    use rule residual as variant_residual with:
        input:
            mesh=given("classes"),
            shell=given("shell"),
            reference=f"{R}/volumes/smooth0.h5",
            deformed=f"{R}/volumes/smooth{{state}}.h5",
            fields=[own("solution")],
        output:
            arrays=[temp(own("residual"))],
            statistics=[own("statistics")],
        log:
            f"{V_LOGS}/residual_state{{state}}.log",
        benchmark:
            f"{V_TIMES}/residual_state{{state}}.tsv"

    if HAS_TRUTH:

        use rule truth_error as variant_error with:
            input:
                mesh=given("classes"),
                fields=[own("solution")],
                torn=torn_on,
                truth=TRUTH,
            output:
                [own("error")],
            log:
                f"{V_LOGS}/truth_error_state{{state}}.log",
            benchmark:
                f"{V_TIMES}/truth_error_state{{state}}.tsv"

    rule variant:
        input:
            **({"error": given("error")} if HAS_TRUTH else {}),
            mesh=given("classes"),
            figures=given("figures"),
            threshold=given("threshold"),
            cell_size=f"{R}/geometry/cell_size.json",
            solution=given("solution"),
            residual=given("residual"),
        output:
            f"{V}/state{{state}}.json",
        log:
            f"{R}/logs/variant/{{study}}_{{variant}}_state{{state}}.log",
        benchmark:
            f"{R}/{{study}}/benchmarks/variant/{{variant}}_state{{state}}.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(1200, 10.0),
            runtime=10,
        params:
            code=code("studies/variant.py"),
            change=lambda wildcards: vars(variant_of(wildcards)),
            micro=changed("l_k", "l_l", "l_e", "period", "nu"),
            mesh=lambda wildcards: variant_of(wildcards).mesh(config["mesh"]),
            axis=AXIS,
        script:
            "../scripts/studies/variant.py"

    rule more_ablation:
        input:
            rows("ablation"),
        output:
            table=of_study("more_ablation.csv", "figures of every method and state"),
            pictures=[
                of_study("more_ablation.png", "ingredients of micro DVC"),
                f"{R}/figures/more_ablation.svg",
            ],
        log:
            f"{R}/logs/more_ablation/all.log",
        benchmark:
            f"{R}/ablation/benchmarks/more_ablation/all.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=5,
        params:
            code=code("studies/more_ablation.py"),
            labels=LABELS,
        script:
            "../scripts/studies/more_ablation.py"

    rule more_sensitivity:
        input:
            rows("sensitivity"),
        output:
            table=of_study("more_sensitivity.csv", "figures of every value"),
            pictures=[
                of_study("more_sensitivity.png", "parameters of micro DVC"),
                f"{R}/figures/more_sensitivity.svg",
            ],
        log:
            f"{R}/logs/more_sensitivity/all.log",
        benchmark:
            f"{R}/sensitivity/benchmarks/more_sensitivity/all.tsv"
        conda:
            ENV
        threads: 1
        resources:
            mem_mb=memory(600, 1.0),
            runtime=5,
        params:
            code=code("studies/more_sensitivity.py"),
            label=LABELS[STUDIED["sensitivity"][0]],
        script:
            "../scripts/studies/more_sensitivity.py"

    rule ablation:
        input:
            rules.more_ablation.output,

    rule sensitivity:
        input:
            rules.more_sensitivity.output,
