"""Where the specimen is in its binned image: between which platens, inside which cylinder or box.

All coordinates are voxels of the image at hand, voxel k reaching from k - 0.5 to k + 0.5. The two
directions across the loading axis are ordered by increasing axis index.
"""

import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from addvc.errors import GeometryError
from addvc.images.levels import bin_mean, to_fine
from addvc.images.orientation import check_no_platens_elsewhere, check_outline
from addvc.images.platens import find_platens, given_faces, seen
from addvc.images.silhouette import (
    Rectangle,
    corners_filled,
    fit_disc,
    fit_rectangle,
    likelihood,
)

__all__ = ["Specimen", "find_platens", "find_specimen", "platen_faces", "solid_threshold"]

BIN = 2  # lines of solid outlast the noise better in means of 2 x 2 x 2 voxels
log = logging.getLogger(__name__)

MIN_ROWS = 8  # voxels between the platens
FACE_MARGIN = 3  # rows left out at each platen: the blur of its face
OTSU_VOXELS = 2e6  # more are thinned out


@dataclass(frozen=True)
class Specimen:
    """A cylinder or box along `axis`, from `low` to `high` on it.

    centre: its middle across the axis. radius: of a cylinder, else None. bounds: of a box, two
    (low, high) pairs across the axis, else None.
    """

    kind: str
    axis: int
    low: float
    high: float
    centre: tuple[float, float]
    radius: float | None = None
    bounds: Rectangle | None = None

    @property
    def across(self) -> tuple[int, int]:
        """The two axes across the loading axis."""
        first, second = (axis for axis in range(3) if axis != self.axis)
        return first, second

    @property
    def widest(self) -> Rectangle:
        """Two (low, high) across the axis, between which all of it lies."""
        if self.bounds is not None:
            return self.bounds
        a, b = ((x - self.radius, x + self.radius) for x in self.centre)
        return a, b

    def inside(self, points: NDArray, margin: float = 0.0) -> NDArray[np.bool_]:
        """points (n, 3) -> (n,): inside, at least `margin` from every face (negative: beyond)."""
        along = points[:, self.axis]
        within = (along >= self.low + margin) & (along <= self.high - margin)
        first, second = self.across
        return within & self._inside_across(points[:, first], points[:, second], margin)

    def voxel_mask(self, shape: Sequence[int]) -> NDArray[np.bool_]:
        """Volume (nx, ny, nz) that is True at the voxels whose centres are inside."""
        rows = np.arange(shape[self.axis])
        grid = np.ogrid[tuple(slice(shape[axis]) for axis in self.across)]
        within = (rows >= self.low) & (rows <= self.high)
        mask = np.zeros(tuple(shape), dtype=bool)
        np.moveaxis(mask, self.axis, 0)[within] = self._inside_across(*grid, 0.0)
        return mask

    def _inside_across(self, first: NDArray, second: NDArray, margin: float) -> NDArray[np.bool_]:
        """Coordinates across the axis, broadcast against each other -> inside."""
        if self.kind == "cylinder":
            distance = np.hypot(first - self.centre[0], second - self.centre[1])
            return distance <= self.radius - margin
        (a, b), (c, d) = self.bounds
        inside_first = (first >= a + margin) & (first <= b - margin)
        return inside_first & (second >= c + margin) & (second <= d - margin)

    def to_dict(self) -> dict:
        """Numbers, strings and lists only, for JSON."""
        data = asdict(self)
        data["centre"] = list(self.centre)
        data["bounds"] = self.bounds and [list(pair) for pair in self.bounds]
        return data

    @classmethod
    def from_dict(cls, data: dict) -> "Specimen":
        """The inverse of to_dict."""
        bounds = data["bounds"] and tuple(tuple(pair) for pair in data["bounds"])
        return cls(**{**data, "centre": tuple(data["centre"]), "bounds": bounds})


def find_specimen(
    volume: NDArray,
    axis: int,
    platens: str | Sequence[float] = "auto",
    specimen: str = "auto",
    threshold: float | None = None,
) -> Specimen:
    """Find the specimen in an image (nx, ny, nz) loaded along `axis`.

    platens: 'auto', 'none' (the ends of the image) or [low, high]. specimen: 'auto', 'cylinder' or
    'box'; auto says box where the solid fills the corners of the image or outlines a rectangle
    better than a disc. threshold: grey level of the solid, by default Otsu's between the platens,
    of an image binned by two against noise. Raises GeometryError when there is no solid, no room
    between the platens, or when `axis` cannot be the loading axis.
    """
    if specimen not in ("auto", "cylinder", "box"):
        raise GeometryError(f"specimen is '{specimen}'; use auto, cylinder or box")
    faces = platen_faces(volume, axis, platens)
    found = _within(volume, axis, faces, specimen, threshold)
    check_outline(found.widest, volume.shape, axis)
    return found


def _within(
    volume: NDArray, axis: int, faces: tuple[float, float], specimen: str, threshold: float | None
) -> Specimen:
    """The specimen between two faces, as `find_specimen` has it."""
    low, high = faces
    factor = BIN if threshold is None else 1
    rows = bin_mean(_rows_between(volume, axis, low, high), factor)
    outline = _outline(rows, threshold)
    kind = _kind(outline, len(rows)) if specimen == "auto" else specimen
    if kind == "cylinder":
        centre, radius = fit_disc(outline, len(rows))
        first, second = to_fine(centre, factor).tolist()
        return Specimen(kind, axis, low, high, (first, second), radius=radius * factor)
    sizes = np.delete(volume.shape, axis)
    return _box(axis, low, high, fit_rectangle(outline, len(rows)), factor, sizes)


def _outline(rows: NDArray, threshold: float | None) -> NDArray:
    """Counts (n1, n2) of solid voxels in rows (n, n1, n2), summed along the first axis."""
    level = solid_threshold(rows) if threshold is None else threshold
    counts = np.count_nonzero(rows > level, axis=0)
    if not counts.any():
        raise GeometryError(
            f"no voxel between the platens exceeds the threshold {level:.6g}, the brightest is "
            f"{rows.max():.6g}; lower the threshold, or check platens"
        )
    return counts


def _box(
    axis: int, low: float, high: float, bounds: Rectangle, factor: int, sizes: NDArray
) -> Specimen:
    """Box from bounds in binned voxels; a side at the end of the binned image lies at the end."""
    pairs = []
    for (start, stop), n in zip(bounds, sizes.tolist(), strict=True):
        reaches = stop >= n // factor - 0.5
        pairs.append(
            (float(to_fine(start, factor)), n - 0.5 if reaches else float(to_fine(stop, factor)))
        )
    (a, b), (c, d) = pairs
    return Specimen("box", axis, low, high, ((a + b) / 2, (c + d) / 2), bounds=((a, b), (c, d)))


def platen_faces(volume: NDArray, axis: int, platens: str | Sequence[float]) -> tuple[float, float]:
    """Coordinates (low, high) of both platen faces of an image (nx, ny, nz), or of its ends, in voxels.

    platens: as in `find_specimen`. Raises GeometryError when it is none of these, when given
    coordinates are reversed or leave the image, when 'auto' finds platens along another axis only, or
    when less than 8 rows lie between the faces. Warns where 'auto' finds none at an end.
    """
    n = volume.shape[axis]
    low, high = -0.5, n - 0.5
    if not isinstance(platens, str):
        low, high = given_faces(platens, n)
    elif platens == "auto":
        found = find_platens(volume, axis)
        if found is None:
            check_no_platens_elsewhere(volume, axis)
        low, high = found or (low, high)
        _warn_of_ends(low, high, n)
    elif platens != "none":
        raise GeometryError(f"platens is '{platens}'; use auto, none or [LOW, HIGH]")
    if high - low < MIN_ROWS:
        raise GeometryError(
            f"{high - low:.1f} rows lie between the platens ({low:.1f} to {high:.1f}), at least "
            f"{MIN_ROWS} are needed; give platens: [LOW, HIGH] or none, or check loading_axis; if "
            "struts are darker than the void, invert the scans"
        )
    return low, high


def _warn_of_ends(low: float, high: float, n: int) -> None:
    """A warning where an image of n rows has no platen at an end."""
    known = zip(("lower", "upper"), seen((low, high), n), strict=True)
    if ends := [end for end, has_platen in known if not has_platen]:
        log.warning(
            "WARNING: no platen is seen at the %s end of the image along the loading axis, which is "
            "taken for that of the specimen; crop less if there is one, else say scans.platens: none, "
            "or [LOW, HIGH]", " and ".join(ends),
        )  # fmt: skip


def _rows_between(volume: NDArray, axis: int, low: float, high: float) -> NDArray:
    """View (rows, n1, n2) of the image between the platens, clear of the blur of real faces."""
    n = volume.shape[axis]
    spare = min(FACE_MARGIN, (high - low - MIN_ROWS) / 2 + 1)
    start = 0 if low <= -0.5 else int(np.ceil(low + spare))
    stop = n if high >= n - 0.5 else int(np.floor(high - spare)) + 1
    return np.moveaxis(volume, axis, 0)[start:stop]


def solid_threshold(volume: NDArray) -> float:
    """Otsu's grey level between void and solid, of at most about two million voxels."""
    from skimage.filters import threshold_otsu  # slow to load, and needed here only

    step = int(np.ceil((volume.size / OTSU_VOXELS) ** (1 / 3)))
    values = volume[::step, ::step, ::step]
    darkest, brightest = np.percentile(values, (0.05, 99.95))  # hot voxels would blunt the bins
    return float(threshold_otsu(np.clip(values, darkest, brightest)))


def _kind(outline: NDArray, rows: int) -> str:
    """Box or cylinder, whichever the solid seen along the axis looks like."""
    if corners_filled(outline):
        return "box"
    disc = likelihood(outline, rows, fit_disc(outline, rows))
    rectangle = likelihood(outline, rows, fit_rectangle(outline, rows))
    return "box" if rectangle > disc else "cylinder"
