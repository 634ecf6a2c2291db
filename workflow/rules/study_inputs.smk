# What the rules of studies.smk read and write for each variant.

if STATES:
    VARIANTS = {
        (variant.study, variant.name): variant
        for variant in [*studies.ablation(), *studies.sensitivity(config)]
    }
    STUDIED = {
        "ablation": STATES,
        "sensitivity": [studies.studied_state(config, STATES)],
    }
    V = f"{R}/{{study}}/{{variant}}"
    V_LOGS = f"{R}/logs/studies/{{study}}/{{variant}}"
    V_TIMES = f"{R}/{{study}}/benchmarks/{{variant}}"

    wildcard_constraints:
        study="|".join(STUDIED),
        variant="|".join(name for _, name in VARIANTS).replace(".", r"\."),

    def variant_of(wildcards):
        """The change that the wildcards `study` and `variant` name."""
        return VARIANTS[wildcards.study, wildcards.variant]

    def own(file):
        """One of the files of a variant, as an output."""
        return f"{V}/{studies.FILES[file]}"

    def given(file):
        """One of the files of a variant, its own or that of the case, as an input."""
        return lambda wildcards: variant_of(wildcards).path(
            file, R, config, wildcards.get("state", "")
        )

    def torn_on(wildcards):
        """The main result of the state, which tells what is torn, where a variant has its mesh."""
        mesh = given("classes")(wildcards)
        same = mesh == f"{R}/geometry/micro.vtu"
        return f"{R}/dvc/{MICRO[0]}_state{wildcards.state}.h5" if same else []

    def method_of_variant(wildcards):
        """The method of micro DVC."""
        return variant_of(wildcards).method

    def changed(*keys):
        """Keys of the section `micro` under the change of a variant."""
        return lambda wildcards: variant_of(wildcards).section(
            section("micro", *keys)
        )

    def rows(study):
        """The figures of every variant of a study."""
        return [
            f"{R}/{study}/{name}/state{state}.json"
            for of, name in VARIANTS
            for state in STUDIED[study]
            if of == study
        ]

    def of_study(name, shows):
        """A figure or table of a study, with its caption."""
        return entry(name, Path(name).stem, "Studies", shows)

    def starts_on_variant(wildcards):
        """The candidate starts of micro DVC at the nodes of a variant's mesh."""
        folder = V.format(**wildcards)
        return [path.replace(R, folder, 1) for path in starts_on_micro(wildcards)]
