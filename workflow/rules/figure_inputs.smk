# What figures read and how they enter the report; the rules are in figures.smk.

FIGURE_CASE = {
    "root": R,
    "labels": LABELS,
    "meso": MESO,
    "micro": MICRO,
    "voxel_um": settings.voxel_size_um(config)
    * settings.scan_settings(config, 0)["bin"],
}
FIGURES = []
ENTRIES = []  # of the page of captions, in the order of the rules
CHAPTERS = {  # the order of the paper, then what is beyond it; snakemake sorts them
    "Specimen": "1 Specimen",
    "Meshes": "2 Meshes",
    "Mesoscale DVC": "3 Mesoscale DVC",
    "Microscale DVC": "4 Microscale DVC",
    "Tables": "5 Tables",
    "Struts": "6 Beyond the paper: struts",
    "Quality": "7 Beyond the paper: quality",
    "Synthetic test": "8 Beyond the paper: the synthetic test",
    "Studies": "9 Beyond the paper: studies",
}
SPECIMEN = [f"{R}/geometry/specimen.json", f"{R}/geometry/threshold.json"]


def smooth(*states):
    """Blurred volumes of states, 0 for the reference."""
    return expand(f"{R}/volumes/smooth{{state}}.h5", state=states)


def meshes(*names):
    """Meshes with their figures."""
    return expand(
        f"{R}/geometry/{{mesh}}.{{suffix}}", mesh=names, suffix=["vtu", "json"]
    )


def solutions(*names):
    """What correlation found on meshes, in every state."""
    return expand(f"{R}/dvc/{{mesh}}_state{{state}}.h5", mesh=names, state=STATES)


def residuals(*names):
    """Residuals at the Gauss points of the micro mesh, in every state."""
    return expand(
        f"{R}/analysis/residual_{{mesh}}_state{{state}}.h5", mesh=names, state=STATES
    )


def fields(*names):
    """Fields with the validity of each node, in every state; of `micro` that of the struts too."""
    struts = f"{R}/struts_state{{state}}.json" if MICRO[0] in names else []
    return [
        *expand(f"{R}/fields/{{mesh}}_state{{state}}.vtu", mesh=names, state=STATES),
        *expand(struts, state=STATES),
    ]


def struts():
    """What the struts of the default micro method and of the finest meso mesh undergo."""
    return [
        f"{R}/geometry/struts.h5",
        *expand(f"{R}/struts_state{{state}}.csv", state=STATES),
        *solutions(FINEST, MICRO[0]),
        *fields(MICRO[0]),
    ]


def struts_truth(suffix):
    """Struts against the truth, where there is one."""
    name = f"{R}/analysis/struts_truth_state{{state}}.{suffix}"
    return expand(name, state=STATES) if HAS_TRUTH else []


def uncertainty():
    """What the noise leaves uncertain in every state."""
    name = f"{R}/analysis/uncertainty_state{{state}}.{{suffix}}"
    return expand(name, state=STATES, suffix=["h5", "json"])


def uncertainty_truth():
    """Errors against their uncertainty, where there is a truth."""
    name = f"{R}/analysis/uncertainty_truth_state{{state}}.json"
    return expand(name, state=STATES) if HAS_TRUTH else []


def cells():
    """Strain of cells, and its bands, in every state; the truth of both, where there is one."""
    names = ["cells", *(["analysis/cells_truth"] if HAS_TRUTH else [])]
    return expand(
        f"{R}/{{name}}_state{{state}}.{{suffix}}",
        name=names,
        state=STATES,
        suffix=["csv", "json"],
    )


def shown(name, number, category, shows):
    """A figure or table of the report and of the list of all figures."""
    files = entry(name, number, category, shows)
    FIGURES.extend(map(str, files))
    ENTRIES.append(
        {
            "file": Path(files[-1]).name,
            "title": title(number, shows),
            "caption": str(WORKFLOW / f"report/{number}.rst"),
        }
    )
    return files


def title(number, shows):
    """`Fig. 3: states`, of the paper; what it shows alone, beyond it."""
    words = number.replace("fig0", "Fig. ").replace("fig", "Fig. ")
    words = words.replace("table", "Table ")
    return shows if number.startswith("more") else f"{words}: {shows}"


def entry(name, number, category, shows):
    """The files of a figure or table, the last with its place in the report and its caption.

    A table is a CSV, and a page (.html) that the report shows. One label only: of a chapter with two
    figures snakemake's report would make a switch of the second label, and fail on it.
    """
    page = name.replace(".csv", ".html")
    found = report(
        f"{R}/figures/{page}",
        category=CHAPTERS[category],
        caption=f"../report/{number}.rst",
        labels={"figure": title(number, shows)},
    )
    return [found] if page == name else [f"{R}/figures/{name}", found]


def drawing(name):
    """The vector version of a figure of curves, beside its picture in the report."""
    FIGURES.append(f"{R}/figures/{name}.svg")
    return FIGURES[-1]


# What Fig. 15 to 17 read: both displacements on the struts, and how far to trust them.
CARRIED = [
    *SPECIMEN,
    f"{R}/geometry/cell_size.json",
    *meshes("micro"),
    *solutions(FINEST, MICRO[0]),
    *fields(MICRO[0]),
    *expand(f"{R}/dvc/{FINEST}_on_micro_state{{state}}.h5", state=STATES),
]
