"""The platens in an image: bright, even slabs across the loading axis at the ends of the image."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from addvc.errors import GeometryError

DISC_POINTS = 20_000  # voxels of the central disc used in each row
MIN_BRIGHT_ROWS = 3
FEW_ROWS = 8  # rows next to a face that give the foam's level, at least
CLEAR_STEP = 0.2  # of the contrast of the whole image
CLEAR_RANGE = 1.5  # times the range of the rows between the platens


def find_platens(volume: NDArray, axis: int) -> tuple[float, float] | None:
    """Coordinates (low, high) of the platen faces along `axis`, in voxels, or None.

    A row is a plane across the axis, seen through a central disc. A platen row is even, so that
    its darker quarter is bright too; in a porous row that quarter is void, however dense the row.
    The face is where the mean crosses half-way from the platen's to the foam's level. A platen
    shows at least 3 rows. With one at one end only, the other coordinate is the end of the image,
    -0.5 or n - 0.5.
    """
    mean, quarter, contrast = _row_profiles(volume, axis)
    start, stop = _longest_run(quarter <= (quarter.min() + quarter.max()) / 2)
    n = len(mean)
    low = _low_face(mean, quarter, (start, stop), contrast)
    high = _low_face(mean[::-1], quarter[::-1], (n - stop, n - start), contrast)
    if low is None and high is None:
        return None
    return (-0.5 if low is None else low), (n - 0.5 if high is None else n - 1 - high)


def moved_faces(
    reference: NDArray, deformed: NDArray, axis: int
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """The faces of `find_platens` in two images of one size, None where either does not show the same
    platens: the end of an image is no place that a platen has moved from or to."""
    before, after = find_platens(reference, axis), find_platens(deformed, axis)
    if before is None or after is None:
        return None
    n = reference.shape[axis]
    return (before, after) if seen(before, n) == seen(after, n) else None


def both_faces(
    reference: NDArray, deformed: NDArray, axis: int
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """The same where both images show both platens, else None."""
    faces = moved_faces(reference, deformed, axis)
    return faces if faces and all(seen(faces[0], reference.shape[axis])) else None


def seen(faces: tuple[float, float], n: int) -> tuple[bool, bool]:
    """Which of both faces are those of a platen, and not the ends of an image of n rows."""
    return faces[0] > -0.5, faces[1] < n - 0.5


def _row_profiles(volume: NDArray, axis: int) -> tuple[NDArray, NDArray, float]:
    """Mean and lower quartile (n,) of each row in the disc, and the grey contrast of the disc."""
    rows = np.moveaxis(volume, axis, 0)
    shape = np.array(rows.shape[1:])
    grid = np.indices(shape) - (shape.reshape(2, 1, 1) - 1) / 2
    first, second = np.nonzero(np.hypot(*grid) <= shape.min() / 4)
    step = -(-len(first) // DISC_POINTS)
    first, second = first[::step], second[::step]
    disc = np.stack([row[first, second] for row in rows])
    darkest, brightest = np.percentile(disc, (0.5, 99.5))
    mean = disc.mean(axis=1, dtype=float)
    return mean, np.percentile(disc, 25, axis=1), float(brightest - darkest)


def _longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Start and stop of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(int)))
    starts, stops = edges[::2], edges[1::2]
    longest = np.argmax(stops - starts)
    return int(starts[longest]), int(stops[longest])


def _low_face(
    mean: NDArray, quarter: NDArray, foam: tuple[int, int], contrast: float
) -> float | None:
    """Face of the platen before the foam rows start:stop, or None where the step is not clear."""
    start, stop = foam
    bright = slice(max(start - 9, 0), max(start - 1, 0))  # the last row may be part foam
    if start < MIN_BRIGHT_ROWS:
        return None
    spare = 2 if stop - start >= FEW_ROWS else 0
    inner = mean[start + spare : stop - spare]
    near = inner[: max(FEW_ROWS, (stop - start) // 4)]
    platen_level, foam_level = np.median(mean[bright]), np.median(near)
    step = platen_level - foam_level
    clear = (
        np.median(quarter[bright]) > inner.max()
        and step >= CLEAR_RANGE * np.ptp(inner)
        and step >= CLEAR_STEP * contrast
    )
    return _crossing(mean, start, (platen_level + foam_level) / 2) if clear else None


def _crossing(mean: NDArray, start: int, level: float) -> float:
    """Where the falling profile passes `level` near row `start`, by linear interpolation."""
    row = max(start - 3, 0)
    while row + 2 < len(mean) and mean[row + 1] >= level:
        row += 1
    return float(row + np.clip((mean[row] - level) / (mean[row] - mean[row + 1]), 0, 1))


def given_faces(platens: Sequence[float], n: int) -> tuple[float, float]:
    """The faces that a user gives of the platens of an image of n rows; GeometryError where they are
    reversed or outside."""
    if len(platens) != 2:
        raise GeometryError(f"platens is {list(platens)}; give two coordinates, [LOW, HIGH]")
    low, high = float(platens[0]), float(platens[1])
    if not low < high:
        raise GeometryError(
            f"platens [{low:g}, {high:g}] are reversed; give [LOW, HIGH], LOW first"
        )
    if low < -0.5 or high > n - 0.5:
        raise GeometryError(
            f"platens [{low:g}, {high:g}] leave the image, which reaches from -0.5 to {n - 0.5} "
            "along the loading axis; give them in voxels of the binned image"
        )
    return low, high
