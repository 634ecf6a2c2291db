"""Bands in which the strain of cells gathers: what they hold of the volume and of the compression, where
they are, how thick, how tilted."""

import numpy as np
from scipy import ndimage

FACTOR = 1.5
"""A point is of a band where its strain is this many times the mean."""

LEAST_STRAIN = 1e-3
"""Mean strain below which no band is sought: noise alone would make one."""

LEAST_POINTS = 8
"""Of a band, for a plane to be laid through it."""

LUMP = 0.6
"""Flatness from which a band is called a lump, and its angle is not told: bands of the default twin have
.41 to .50, what is no band .64 (two twins at 3.4 and 4 %)."""

THIN = 0.5
"""Thickness in cell sizes below which a band is none: it is blurred by a cell, so that a thinner one is
what a face of the region leaves of it, or the last layer of points. Default twin: .7 to 1.2."""

MEANING = {
    "points": "points of the grid where the strain of a cell is known",
    "mean_strain": "mean over them of the stretch along the loading axis less 1; not that of the whole "
    "specimen where the ends, of whose cells it is not known, or what is outside of micro.region differ",
    "scatter": "its standard deviation over the mean",
    "factor": "a point is of a band where its strain is this many times the mean",
    "volume_share": "share of the points that are of a band",
    "strain_share": "their share of the compression",
    "bands": "separate bands of at least 8 points, at least half a cell thick; what follows is of the "
    "largest",
    "band_volume_share": "its share of the points",
    "band_strain_share": "its share of the compression",
    "centre": "its middle, weighted with the strain, voxels",
    "normal": "of the plane through it, pointing along the loading axis",
    "angle": "between this and the loading axis, degrees",
    "thickness": "rms distance from the plane times root 12, as of a plate, voxels; blurred by a cell",
    "flatness": "rms distance from the plane over the rms radius of the band in it: small for a plate, "
    "1 for a lump, whose angle says nothing",
}


def localisation(points: np.ndarray, strain: np.ndarray, axis: int, cell_size: float) -> dict:
    """What MEANING lists, of the strain (nx, ny, nz) along the axis at the points (nx, ny, nz, 3) of a
    grid, nan where unknown; None where there is no band. Cell size in voxels."""
    known = np.isfinite(strain)
    mean = float(strain[known].mean()) if known.any() else None
    figures = dict.fromkeys(MEANING) | {"points": int(known.sum()), "mean_strain": mean}
    figures["factor"] = FACTOR
    if mean is None or abs(mean) < LEAST_STRAIN:
        return figures
    ratio = np.where(known, strain / mean, -np.inf)
    inside = ratio > FACTOR
    figures |= {"scatter": float(strain[known].std() / abs(mean))}
    figures |= shares(inside, ratio, known, "")
    label, count = ndimage.label(inside, np.ones((3, 3, 3)))
    parts = [label == number for number in range(1, count + 1)]
    planes = [
        (part, plane(points[part], ratio[part], axis))
        for part in parts
        if part.sum() >= LEAST_POINTS
    ]
    bands = [one for one in planes if one[1]["thickness"] >= THIN * cell_size]
    figures["bands"] = len(bands)
    if not bands:
        return figures
    band, found = max(bands, key=lambda one: one[0].sum())
    return figures | shares(band, ratio, known, "band_") | found


def shares(inside: np.ndarray, ratio: np.ndarray, known: np.ndarray, prefix: str) -> dict:
    """Shares, as fractions, of the points that are `inside`, and of the strain that they hold.

    inside, known (nx, ny, nz) bool; ratio (nx, ny, nz) of the strain to its mean over the known points;
    prefix: of the names of both shares."""
    count = known.sum()
    return {
        f"{prefix}volume_share": float(inside.sum() / count),
        f"{prefix}strain_share": float(ratio[inside].sum() / count),
    }


def plane(points: np.ndarray, weight: np.ndarray, axis: int) -> dict:
    """Middle, normal, angle to the axis (degrees), thickness and flatness of points (n, 3).

    The principal axes tell across which coordinate the band lies; the plane is the fit of this one
    over the others, which the faces of the specimen, parallel to it, do not turn."""
    centre = weight @ points / weight.sum()
    x = points - centre
    least = np.linalg.eigh((weight * x.T) @ x)[1][:, 0]
    across = int(np.abs(least).argmax())
    others = [d for d in range(3) if d != across]
    root = np.sqrt(weight)[:, None]
    slope = np.linalg.lstsq(root * x[:, others], root[:, 0] * x[:, across], rcond=None)[0]
    normal = np.zeros(3)
    normal[across], normal[others] = 1, -slope
    normal /= np.linalg.norm(normal) * (np.sign(normal[axis]) or 1)
    distance = np.sqrt(weight @ (x @ normal) ** 2 / weight.sum())
    radius = np.sqrt(weight @ (np.sum(x**2, axis=1) - (x @ normal) ** 2) / weight.sum() / 2)
    return {
        "centre": centre.tolist(),
        "normal": normal.tolist(),
        "angle": float(np.degrees(np.arccos(np.clip(normal[axis], -1, 1)))),
        "thickness": float(np.sqrt(12) * distance),
        "flatness": float(distance / max(radius, 1e-12)),
    }


def compared(found: dict, true: dict, strain: np.ndarray, true_strain: np.ndarray) -> dict:
    """Measured against true: figures of both, the rms difference and the correlation of the strain
    (n,) over the points that both know, the angle (degrees) between the normals."""
    both = np.isfinite(strain) & np.isfinite(true_strain)
    a, b = strain[both], true_strain[both]
    turn = None
    if found["normal"] and true["normal"]:
        cosine = np.clip(np.abs(np.dot(found["normal"], true["normal"])), 0, 1)
        turn = float(np.degrees(np.arccos(cosine)))
    return {
        "measured": found,
        "truth": true,
        "strain_rms_difference": float(np.sqrt(np.mean((a - b) ** 2))) if both.any() else None,
        "strain_correlation": float(np.corrcoef(a, b)[0, 1]) if both.sum() > 2 else None,
        "angle_between_normals": turn,
    }
