"""What every strut undergoes in a state, a row a strut, and what the foam does as a whole."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from addvc.analysis.strut_energy import KINDS, StrutEnergy, strut_energy
from addvc.analysis.strut_motion import StrutMotion, strut_motion
from addvc.analysis.struts import Strut
from addvc.analysis.validity import valid_strut
from addvc.geometry.skeleton import FREE_END

UNDECIDED = "undecided"

GEOMETRY = {
    "x": ("voxel", "middle of the strut in the reference, binned image"),
    "y": ("voxel", "middle of the strut in the reference, binned image"),
    "z": ("voxel", "middle of the strut in the reference, binned image"),
    "length": ("voxel", "from junction to junction along the centre line"),
    "radius": ("voxel", "of the circle with the mean area of its sections"),
    "direction_x": ("–", "unit vector from end to end"),
    "direction_y": ("–", "unit vector from end to end"),
    "direction_z": ("–", "unit vector from end to end"),
    "whole": ("–", "1: both ends are junctions of the mesh; 0: cut or broken"),
    "junction_a": ("–", "number of the junction at the first end, -1 for none"),
    "junction_b": ("–", "number of the junction at the second end, -1 for none"),
    "neighbours": ("–", "rows (from 0) of the struts that share a junction with it"),
    "valid": ("–", "1: measured, whole or not, and its nodes can be trusted; 0: flagged"),
}
"""Columns that do not depend on the displacement, with unit and meaning."""

MECHANICS = {
    "axial_strain": ("–", "stretch of the centre line less 1, between the junctions"),
    "axial_strain_std": ("–", "standard deviation of it, from the scatter of the nodes"),
    "curvature": ("1/voxel", "change of curvature, rms weighted with the moment of inertia"),
    "twist": ("1/voxel", "twist per length"),
    "rotation": ("degree", "by how much the middle has turned"),
    "bending": ("E voxel^3", "energy of bending, E: Young's modulus of the solid"),
    "stretching": ("E voxel^3", "energy of stretching"),
    "torsion": ("E voxel^3", "energy of torsion"),
    "bending_share": ("–", "bending / (bending + stretching + torsion)"),
    "bending_share_std": ("–", "standard deviation of it, from the scatter of the nodes"),
    "dominance": ("–", "the kind with over half the energy by one deviation, or undecided"),
    "scatter": ("voxel", "rms distance of the nodes from the motion of a beam"),
}
"""Columns of each displacement, with unit and meaning."""

MESO = "_meso"
"""Added to the names of the columns that the finest meso mesh gives."""


def strut_table(
    struts: list[Strut],
    points: np.ndarray,
    fields: dict[str, np.ndarray],
    valid: np.ndarray,
    nu: float,
) -> dict[str, list]:
    """Columns by name: the geometry, and the mechanics under each displacement u (n, 3) of the micro
    nodes at points (n, 3), whose names end in the keys of `fields`. The first is what `valid` (n,)
    of its nodes judges. nu: Poisson's ratio of the solid."""
    columns: dict[str, list] = {}
    for suffix, u in fields.items():
        rows = [mechanics(strut, points, u, nu) for strut in struts]
        columns |= {name + suffix: [row[name] for row in rows] for name in MECHANICS}
    measured = np.isfinite(columns["bending_share"])
    trusted = [
        int(known and not strut.broken and valid_strut(valid[strut.nodes], strut.weight))
        for strut, known in zip(struts, measured, strict=True)
    ]
    return geometry(struts) | {"valid": trusted} | columns


def geometry(struts: list[Strut]) -> dict[str, list]:
    """The columns that do not depend on the displacement, but for `valid`."""
    rows = []
    for number, (strut, near) in enumerate(zip(struts, neighbours(struts), strict=True)):
        others = " ".join(str(n) for n in near if n != number)
        whole = int(strut.whole and not strut.broken)
        values = [*strut.middle, float(strut.length), strut.radius, *strut.direction, whole]
        rows.append([*values, *strut.ends, others])
    names = [name for name in GEOMETRY if name != "valid"]
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def neighbours(struts: list[Strut]) -> list[list[int]]:
    """For each strut the sorted numbers of those at its junctions, itself with them."""
    at: dict[int, set[int]] = {}
    for number, strut in enumerate(struts):
        for end in strut.ends:
            at.setdefault(end, set()).add(number)
    at[FREE_END] = set()
    return [sorted({n} | at[s.ends[0]] | at[s.ends[1]]) for n, s in enumerate(struts)]


def mechanics(strut: Strut, points: np.ndarray, u: np.ndarray, nu: float) -> dict:
    """A row of the columns of MECHANICS; nan where no motion of a beam was found."""
    fit = strut_motion(strut, points[strut.nodes], u[strut.nodes])
    if not fit.converged:
        return dict.fromkeys(MECHANICS, float("nan")) | {"dominance": UNDECIDED}
    energy = strut_energy(strut, fit, nu)
    return {
        "axial_strain": energy.axial_strain,
        "axial_strain_std": energy.axial_strain_std,
        "curvature": energy.curvature,
        "twist": energy.twist,
        "rotation": turned(fit),
        **dict(zip(KINDS, map(float, energy.energies), strict=True)),
        "bending_share": float(energy.shares[0]),
        "bending_share_std": energy.bending_share_std,
        "dominance": dominance(energy),
        "scatter": fit.scatter,
    }


def turned(fit: StrutMotion) -> float:
    """Degrees."""
    return float(np.degrees(Rotation.from_matrix(fit.rotation).magnitude()))


def dominance(energy: StrutEnergy) -> str:
    """The kind of KINDS with more than half of the energy, by a standard deviation."""
    largest = int(np.argmax(energy.energies))
    share, doubt = energy.shares[largest], energy.share_std(largest)
    return KINDS[largest] if share - doubt > 0.5 else UNDECIDED


def foam(columns: dict[str, Sequence], suffix: str = "") -> dict:
    """Of the valid struts: how many, shares of the energy of all of them with the deviation of that
    of bending, number of struts of each dominance."""
    valid = np.asarray(columns["valid"], dtype=float) > 0
    energies = np.array([np.asarray(columns[kind + suffix], float)[valid] for kind in KINDS])
    total = np.nansum(energies)
    if not total > 0:
        return {"valid": int(valid.sum()), "flagged": int((~valid).sum()), "bending_share": None}
    part = np.nan_to_num(energies.sum(axis=0) / total)
    doubt = np.nan_to_num(np.asarray(columns["bending_share_std" + suffix], float)[valid])
    kinds = np.asarray(columns["dominance" + suffix])[valid]
    return {
        "valid": int(valid.sum()),
        "flagged": int((~valid).sum()),
        **{f"{k}_share": float(np.nansum(e) / total) for k, e in zip(KINDS, energies, strict=True)},
        "bending_share_std": float(np.sqrt(np.sum((part * doubt) ** 2))),
        "dominance": {kind: int((kinds == kind).sum()) for kind in (*KINDS, UNDECIDED)},
    }


def described(suffixes: Sequence[str]) -> dict[str, dict[str, str]]:
    """Unit and meaning of every column of the table."""
    columns = {**GEOMETRY}
    for suffix in suffixes:
        columns |= {name + suffix: value for name, value in MECHANICS.items()}
    return {name: {"unit": unit, "meaning": text} for name, (unit, text) in columns.items()}
