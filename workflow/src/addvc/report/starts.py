"""Beyond the paper: every start that was tried, for the meso and for the micro correlation."""

from collections.abc import Iterable

from addvc.correlation.store import load_notes
from addvc.report.case import Case
from addvc.report.tables import write_tables

FIGURES = {
    "residual_std": ("σ(r) (grey levels)", "{:.4g}"),
    "outside": ("Points outside of the image", "{:d}"),
    "factors": ("Scale factors along x, y, z (Eq. 6)", "{}"),
    "robust_std": ("Robust residual (grey levels)", "{:.4g}"),
    "elastic_strain": ("Elastic strain, rms (–)", "{:.4f}"),
    "score": ("Score (grey levels²)", "{:.4g}"),
}


def starts(case: Case, outputs: Iterable[str]) -> None:
    """A row for each candidate of each state: the meso meshes, coarse to fine, then micro DVC."""
    rows = [["State", "Start of", "Candidate", "Taken", *(name for name, _ in FIGURES.values())]]
    for state in case.states:
        files = {case.meso[0]: "start"} | {name: name for name in case.meso[1:]}
        for result, file in (files | {"micro": "micro_start"}).items():
            notes = load_notes(case.path(f"dvc/{file}_state{state}.h5"))
            rows += [
                [case.title(state, case.micro[0]), result, *_row(one, notes["best"])]
                for one in notes["candidates"]
            ]
    write_tables(outputs, rows)


def _row(candidate: dict, best: str) -> list[str]:
    """Name, whether it was taken, and what was measured of it."""
    name = candidate["candidate"]
    values = []
    for key, (_, form) in FIGURES.items():
        value = candidate.get(key)
        if isinstance(value, list):
            value = " / ".join(f"{one:.3f}" for one in value)
        values.append("–" if value is None else form.format(value))
    return [name, "yes" if name == best else "no", *values]
