"""What every strut undergoes in a state, a row a strut, and what the foam does as a whole."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from addvc.analysis.strut_energy import KINDS, StrutEnergy, strut_energy
from addvc.analysis.strut_motion import StrutMotion, strut_motion
from addvc.analysis.strut_prior import prior_variances
from addvc.analysis.struts import Strut
from addvc.analysis.validity import valid_strut
from addvc.geometry.skeleton import FREE_END

UNDECIDED = "undecided"

ASTRAY = 5.0
"""How far the nodes of a strut may be from where equilibrium has them, over the median of all struts.
A strut that lies on another one has a residual of noise only: on the default twin at 28.5 % one that
is 6.7 voxels off is .78 voxel from equilibrium, 7 times the median; at 12.3 % none is over 4.5."""

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
    "bridge": ("–", "1: the threshold had broken it, mesh.mend has put a rod into it; 0: it has not"),
    "valid": ("–", "1: measured, whole or not, its residual small, near equilibrium; 0: flagged"),
    "flag": ("–", "why it is flagged: broken (by the threshold), residual (its nodes are in doubt), "
                  "equilibrium (far from that), shape (no motion of a beam); none: it is not"),
}  # fmt: skip
"""Columns that do not depend on the displacement, with unit and meaning."""

FLAGS = ("broken", "residual", "equilibrium", "shape")
"""Why a strut is flagged: the first that holds."""

UNFLAGGED = "none"

MECHANICS = {
    "axial_strain": ("–", "stretch of the centre line less 1, between the junctions"),
    "axial_strain_std": ("–", "standard deviation of it, by noise and scatter of the nodes"),
    "curvature": ("1/voxel", "change of curvature, rms weighted with inertia, without noise"),
    "twist": ("1/voxel", "twist per length"),
    "rotation": ("degree", "by how much the middle has turned"),
    "bending": ("E voxel^3", "expected energy of bending, E: Young's modulus of the solid"),
    "stretching": ("E voxel^3", "expected energy of stretching"),
    "torsion": ("E voxel^3", "expected energy of torsion"),
    "bending_share": ("–", "expected share of bending in the whole energy"),
    "bending_share_std": ("–", "standard deviation of it, by noise and scatter of the nodes"),
    "dominance": ("–", "the kind with over half the energy by one deviation, or undecided"),
    "scatter": ("voxel", "rms distance of the nodes from the motion of a beam"),
}
"""Columns of each displacement, with unit and meaning."""

MESO, RAW = "_meso", "_raw"
"""Added to the names of the columns that the finest meso mesh gives, and of those that micro DVC gives
before the filter by equilibrium."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A displacement u (n, 3) of the nodes at points (n, 3), and what noise makes of it in draws
    (d, n, 3), None where that is not known; voxels."""

    points: np.ndarray
    u: np.ndarray
    draws: np.ndarray | None = None


def strut_table(
    struts: list[Strut],
    fields: dict[str, Measured],
    valid: np.ndarray,
    nu: float,
    bridges: Sequence[dict] = (),
) -> dict[str, list]:
    """Columns by name: the geometry, and the mechanics under each displacement of the micro nodes,
    whose names end in the keys of `fields`; the first is what `valid` (n,) of the nodes judges. nu:
    Poisson's ratio of the solid; rows of bridges.json."""
    broken = np.array([strut.broken for strut in struts], dtype=bool)
    doubtful = np.array([not valid_strut(valid[s.nodes], s.weight) for s in struts], dtype=bool)
    away = astray(struts, fields[""], fields[RAW]) if RAW in fields else np.zeros_like(broken)
    sound = ~(broken | doubtful | away)
    columns: dict[str, list] = {}
    for suffix, field in fields.items():
        found = mechanics(struts, field, sound, nu)
        columns |= {name + suffix: values for name, values in found.items()}
    shapeless = ~np.isfinite(columns["bending_share"])
    flags = np.select([broken, doubtful, away, shapeless], FLAGS, UNFLAGGED)
    judged = {
        "bridge": bridged(struts, next(iter(fields.values())).points, bridges),
        "valid": list((flags == UNFLAGGED).astype(int)),
        "flag": list(flags),
    }
    return geometry(struts) | judged | columns


def bridged(struts: list[Strut], points: np.ndarray, bridges: Sequence[dict]) -> list[int]:
    """1 for each strut that has the node of the mesh (n, 3) nearest to the middle of a bridge, or 0."""
    places = np.array([bridge["position"] for bridge in bridges]).reshape(-1, 3)
    nodes = cKDTree(points).query(places)[1]
    return [int(np.isin(nodes, strut.nodes).any()) for strut in struts]


def astray(struts: list[Strut], balanced: Measured, measured: Measured) -> np.ndarray:
    """Which struts (s,) were measured far from where equilibrium has them (`analysis.balance`)."""
    square = np.sum((measured.u - balanced.u) ** 2, axis=1)
    away = np.sqrt([np.average(square[strut.nodes], weights=strut.weight) for strut in struts])
    return away > ASTRAY * np.median(away) if len(away) else np.zeros(0, dtype=bool)


def geometry(struts: list[Strut]) -> dict[str, list]:
    """The columns that the struts alone tell."""
    names = [name for name in GEOMETRY if name not in ("bridge", "valid", "flag")]
    if not struts:
        return {name: [] for name in names}
    rows = []
    for number, (strut, near) in enumerate(zip(struts, neighbours(struts), strict=True)):
        others = " ".join(str(n) for n in near if n != number)
        whole = int(strut.whole and not strut.broken)
        values = [*strut.middle, float(strut.length), strut.radius, *strut.direction, whole]
        rows.append([*values, *strut.ends, others])
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def neighbours(struts: list[Strut]) -> list[list[int]]:
    """For each strut the sorted numbers of those at its junctions, itself with them."""
    at: dict[int, set[int]] = {}
    for number, strut in enumerate(struts):
        for end in strut.ends:
            at.setdefault(end, set()).add(number)
    at[FREE_END] = set()
    return [sorted({n} | at[s.ends[0]] | at[s.ends[1]]) for n, s in enumerate(struts)]


def mechanics(
    struts: list[Strut], field: Measured, sound: np.ndarray, nu: float
) -> dict[str, list]:
    """The columns of MECHANICS, nan where no motion of a beam was found; what is likely of a strut is
    learnt from those that are `sound` (n,)."""
    fits = [
        strut_motion(
            strut,
            field.points[strut.nodes],
            field.u[strut.nodes],
            None if field.draws is None else field.draws[:, strut.nodes],
        )
        for strut in struts
    ]
    known = sound & np.array([fit.converged for fit in fits], dtype=bool)
    variances = likely(struts, fits, known) if known.any() else None
    rows = [row(strut, fit, nu, variances) for strut, fit in zip(struts, fits, strict=True)]
    return {name: [values[name] for values in rows] for name in MECHANICS}


def likely(struts: list[Strut], fits: list[StrutMotion], known: np.ndarray) -> np.ndarray:
    """What `prior_variances` tells from the struts that are `known` (n,), one at least."""
    numbers = np.flatnonzero(known)
    return prior_variances(
        np.array([fits[n].coefficients for n in numbers]),
        np.array([fits[n].noise for n in numbers]),
        np.array([struts[n].area.mean() for n in numbers]),
    )


def row(strut: Strut, fit: StrutMotion, nu: float, variances: np.ndarray | None) -> dict:
    """The columns of MECHANICS of one strut."""
    if not fit.converged:
        return dict.fromkeys(MECHANICS, float("nan")) | {"dominance": UNDECIDED}
    energy = strut_energy(strut, fit, nu, variances)
    return {
        "axial_strain": energy.axial_strain,
        "axial_strain_std": energy.axial_strain_std,
        "curvature": energy.curvature,
        "twist": energy.twist,
        "rotation": turned(fit),
        **dict(zip(KINDS, map(float, energy.energies), strict=True)),
        "bending_share": float(energy.shares[0]),
        "bending_share_std": float(energy.share_stds[0]),
        "dominance": dominance(energy),
        "scatter": fit.scatter,
    }


def turned(fit: StrutMotion) -> float:
    """Degrees."""
    return float(np.degrees(Rotation.from_matrix(fit.rotation).magnitude()))


def dominance(energy: StrutEnergy) -> str:
    """The kind of KINDS with more than half of the energy, by a standard deviation."""
    largest = int(np.argmax(energy.shares))
    share, doubt = energy.shares[largest], energy.share_stds[largest]
    return KINDS[largest] if share - doubt > 0.5 else UNDECIDED


def foam(columns: dict[str, Sequence], suffix: str = "") -> dict:
    """How many struts are valid, flagged, by reason, and have a bridge; of the valid ones the shares of
    the energy of all of them with the deviation of that of bending, number of struts of each
    dominance."""
    valid = np.asarray(columns["valid"], dtype=float) > 0
    energies = np.array([np.asarray(columns[kind + suffix], float)[valid] for kind in KINDS])
    total = np.nansum(energies)
    flags = list(columns["flag"])
    counts = {
        "valid": int(valid.sum()),
        "flagged": int((~valid).sum()),
        "flags": {flag: flags.count(flag) for flag in FLAGS},
        "bridged": int(np.sum(np.asarray(columns["bridge"], dtype=float) > 0)),
    }
    if not total > 0:
        return counts | {"bending_share": None}
    part = np.nan_to_num(energies.sum(axis=0) / total)
    doubt = np.nan_to_num(np.asarray(columns["bending_share_std" + suffix], float)[valid])
    kinds = np.asarray(columns["dominance" + suffix])[valid]
    shares = zip(KINDS, energies, strict=True)
    return counts | {
        **{f"{kind}_share": float(np.nansum(energy) / total) for kind, energy in shares},
        "bending_share_std": float(np.sqrt(np.sum((part * doubt) ** 2))),
        "dominance": {kind: int((kinds == kind).sum()) for kind in (*KINDS, UNDECIDED)},
    }


def described(suffixes: Sequence[str]) -> dict[str, dict[str, str]]:
    """Unit and meaning of every column of the table."""
    columns = {**GEOMETRY}
    whose = {MESO: "; by the finest meso mesh", RAW: "; of the displacement as measured"}
    for suffix in suffixes:
        columns |= {
            name + suffix: (unit, text + whose.get(suffix, ""))
            for name, (unit, text) in MECHANICS.items()
        }
    return {name: {"unit": unit, "meaning": text} for name, (unit, text) in columns.items()}
