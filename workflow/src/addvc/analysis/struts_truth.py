"""Measured struts against a known truth: for judging only.

Two errors are told apart. `field`: the true displacement of the micro nodes goes through the same
strut model, so that what differs from the measured one is the error of correlation. `beams`: what
the beams of the twin undergo by their own mechanics, so that what differs from `field` is the error of
the strut model. Shares are of bending, stretching and torsion in both; the twin's shear is left out.
"""

from collections.abc import Callable

import numpy as np

from addvc.analysis.noise import rms
from addvc.analysis.strut_energy import KINDS
from addvc.analysis.strut_table import Measured, mechanics
from addvc.analysis.struts import Strut
from addvc.analysis.truth import Judge
from addvc.twin.store import load_struts
from addvc.twin.truth import Truth

OVERLAP = 0.9
"""Share of the centre line that must be in one beam for a strut to be that of the twin."""

LOADED = 1e-3
"""Energy per volume, over the mean, below which a strut carries no load and its share says nothing."""

WRONG = 1.0
"""Error of a strut, voxels, from which on it should be flagged."""

COMPARED = ("bending_share", "axial_strain")
FIELD, BEAMS = "_field", "_beams"
"""Added to the names of the columns of both truths."""


def matched(struts: list[Strut], truth: Truth) -> np.ndarray:
    """The strut (n,) of the twin that each measured one follows, -1 where it is no single one."""
    found = np.full(len(struts), -1)
    for number, strut in enumerate(struts):
        near = truth.strut(strut.points)[0]
        most = np.bincount(near).argmax()
        if np.mean(near == most) >= OVERLAP:
            found[number] = most
    return found


def true_columns(
    struts: list[Strut], points: np.ndarray, truth: Judge, path: str, state: int, nu: float
) -> dict[str, np.ndarray]:
    """Columns of both truths, a row a measured strut, nan where not known; path: of the truth,
    points (n, 3): the micro nodes."""
    field = Measured(points, truth.displacement(points, state))
    found = mechanics(struts, field, np.array([not strut.broken for strut in struts]), nu)
    names = (*KINDS, *COMPARED, "bending_share_std")
    columns = {name + FIELD: np.array(found[name]) for name in names}
    volume = np.array([strut.span * strut.area.mean() for strut in struts])
    columns[f"bending_share{FIELD}"][unloaded(columns, FIELD, volume)] = np.nan
    if not isinstance(truth, Truth):
        return columns
    number = matched(struts, truth)
    beams = load_struts(path, state)
    known = number >= 0
    values = {kind: getattr(beams, kind) for kind in KINDS} | {"axial_strain": beams.axial_strain}
    total = sum(values[kind] for kind in KINDS)
    values["bending_share"] = np.divide(
        values["bending"], total, out=np.full(len(total), np.nan), where=total > 0
    )
    names = (*KINDS, *COMPARED)
    columns |= {n + BEAMS: np.where(known, values[n][number], np.nan) for n in names}
    columns[f"bending_share{BEAMS}"][unloaded(columns, BEAMS, volume)] = np.nan
    return columns | {"true_strut": number}


def unloaded(columns: dict[str, np.ndarray], ending: str, volume: np.ndarray) -> np.ndarray:
    """(n,) bool: struts of volumes (n,) with hardly any energy, as those that end in the open."""
    energy = np.sum([columns[kind + ending] for kind in KINDS], axis=0)
    known = np.isfinite(energy)
    return known & (energy * volume[known].sum() < LOADED * volume * energy[known].sum())


def judged(table: dict, true: dict, results: dict[str, str]) -> dict:
    """Figures of each result (name -> suffix of its columns in the table) against both truths, and of
    one truth against the other, over the struts that are valid and whole."""
    columns = table | true
    use = (np.asarray(table["valid"]) > 0) & (np.asarray(table["whole"]) > 0)
    truths = {"field": FIELD} | ({"beams": BEAMS} if f"bending{BEAMS}" in true else {})
    figures = {
        name: {other: agreement(columns, suffix, end, use) for other, end in truths.items()}
        for name, suffix in results.items()
    }
    if "beams" in truths:
        figures["field"] = {"beams": agreement(columns, FIELD, BEAMS, use)}
    return figures


def flags(struts: list[Strut], valid: list, error: np.ndarray) -> dict:
    """How well doubt tells error, over the struts that the threshold has not broken: those whose nodes
    are off by over `WRONG` voxels (rms of error (n, 3)), and the shares of these and of the others
    that are not `valid` (one each)."""
    square = np.sum(error**2, axis=1)
    whole = [n for n, strut in enumerate(struts) if not strut.broken]
    off = [np.average(square[struts[n].nodes], weights=struts[n].weight) for n in whole]
    wrong = np.sqrt(np.array(off, float)) > WRONG
    flagged = np.array([int(valid[n]) == 0 for n in whole], dtype=bool)
    return {
        "struts": len(whole),
        "wrong": int(wrong.sum()),
        "wrong_flagged": mean(flagged[wrong]),
        "right_flagged": mean(flagged[~wrong]),
    }


def agreement(columns: dict, first: str, second: str, use: np.ndarray) -> dict:
    """Of the columns with two suffixes, over struts `use` (n,) that both know: correlation of the
    share of bending and of the axial strain, share of equal classes, share of struts whose class is
    sure by a deviation and how many of those are right, share of bending in all."""
    values = {
        name: (np.asarray(columns[name + first], float), np.asarray(columns[name + second], float))
        for name in (*KINDS, *COMPARED)
    }
    both = use & np.logical_and.reduce([np.isfinite(v) for pair in values.values() for v in pair])
    sure = np.abs(values["bending_share"][0] - 0.5) > np.asarray(
        columns[f"bending_share_std{first}"]
    )
    decided = sure[both]
    share, strain = ([v[both] for v in values[name]] for name in COMPARED)
    return {
        "struts": int(both.sum()),
        "bending_share_correlation": correlation(*share),
        "axial_strain_correlation": correlation(*strain),
        "axial_strain_rms": rms(strain[0] - strain[1]),
        "same_class": mean((share[0] > 0.5) == (share[1] > 0.5)),
        "decided": mean(decided),
        "decided_same_class": mean(((share[0] > 0.5) == (share[1] > 0.5))[decided]),
        "foam": [foam_share(lambda kind, n=n: values[kind][n][both]) for n in (0, 1)],
    }


def correlation(a: np.ndarray, b: np.ndarray) -> float | None:
    """Pearson's, None where it is not defined."""
    if len(a) < 3 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return None
    return float(np.corrcoef(a, b)[0, 1])


def mean(right: np.ndarray) -> float | None:
    """Share of what is right (n,)."""
    return float(np.mean(right)) if len(right) else None


def foam_share(energy: Callable[[str], np.ndarray]) -> float | None:
    """Bending over the whole energy of all struts; energy(kind): (n,)."""
    sums = [float(energy(kind).sum()) for kind in KINDS]
    return sums[0] / sum(sums) if sum(sums) > 0 else None
