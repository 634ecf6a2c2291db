"""Fig. 7: the closed surface of the solid in a region, by marching cubes on the blurred image.

Caps: a cap is part of the grey-level field. Near the region's border the grey level is replaced by
the smaller of itself and gamma + slope x depth, so that the surface closes on the exact plane or
cylinder, with no staircase of voxels. Slivers are avoided at the source: a vertex of marching
cubes is kept between 0.2 and 0.8 of its voxel edge.
"""

import logging
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from skimage import measure

from addvc.errors import GeometryError, grey_words
from addvc.geometry.region import Region, caps_depth

log = logging.getLogger(__name__)

CLAMP = 0.2
DEEP = np.float32(0.1)  # of half the height of the solid above gamma
CAP_SLOPE = 0.5  # of the contrast between solid and threshold, per voxel


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of a closed surface: points (n, 3) in voxels, faces (f, 3), wound outwards."""

    points: np.ndarray
    faces: np.ndarray


def capped(grey: np.ndarray, gamma: float, region: Region, contrast: float) -> np.ndarray:
    """`grey` (nx, ny, nz) brought below gamma outside the region (float32, a copy)."""
    out = np.empty_like(grey)
    j, k = np.meshgrid(*(np.arange(n, dtype=float) for n in grey.shape[1:]), indexing="ij")
    slope = CAP_SLOPE * contrast
    for i in range(grey.shape[0]):
        points = np.stack([np.full_like(j, i), j, k], axis=-1)
        ends, sides = caps_depth(region, points)
        out[i] = np.minimum(grey[i], gamma + slope * np.clip(np.minimum(ends, sides), -1, 1e6))
    return out


def largest_component(grey: np.ndarray, gamma: float, void: float) -> tuple[np.ndarray, dict]:
    """A copy of `grey` (nx, ny, nz) with all but its largest face-connected solid brought to the grey
    level `void`, which is below gamma, and what was dropped.

    Just below gamma, the surface between voxels would still hold crumbs of what was dropped.

    Raises GeometryError when there is no solid."""
    label, count = ndimage.label(grey > gamma)
    if count == 0:
        raise GeometryError(
            f"no voxel of the region is above the threshold {grey_words(gamma)}; widen "
            "micro.region, or lower the threshold"
        )
    size = np.bincount(label.ravel())[1:]
    largest = int(np.argmax(size)) + 1
    kept = np.where((label == 0) | (label == largest), grey, np.float32(void))
    return kept, {
        "components": int(count),
        "kept_fraction": float(size.max() / size.sum()),
        "dropped_voxels": int(size.sum() - size.max()),
    }


def region_solid(
    smooth: np.ndarray, levels: dict, region: Region, min_kept: float
) -> tuple[np.ndarray, dict]:
    """Grey levels (nx, ny, nz) of the region's largest solid, all else below gamma, from the blurred
    ones, `smooth` (nx, ny, nz), and what fell out; `levels`: `find_threshold`.

    Warns when over 10 % of the solid falls out. Raises GeometryError when there is none, or less than
    `min_kept` of it (0..1) stays."""
    gamma, contrast = levels["threshold"], levels["solid"] - levels["void"]
    inside = capped(smooth, gamma, region, contrast)
    grey, figures = largest_component(inside, gamma, levels["void"])
    kept = figures["kept_fraction"]
    advice = "lower geometry.threshold or porosity, or lower images.blur"
    if kept < min_kept:
        raise GeometryError(
            f"the largest of {figures['components']} pieces holds {kept:.1%} of the "
            f"solid (at least {min_kept:.0%}, mesh.min_kept): struts are broken; "
            f"{advice}"
        )
    if kept < 0.9:
        log.warning(
            "WARNING: %.0f %% of the solid is in smaller pieces and falls out; %s",
            100 * (1 - kept),
            advice,
        )
    return grey, figures


def bordered(grey: np.ndarray, gamma: float, width: int) -> np.ndarray:
    """Grey level (nx, ny, nz) less gamma over half of its most, so that no unit of it matters, with
    `width` voxels more on each side, as far below as the last ones are above, DEEP at least: float32."""
    half = float(grey.max() - gamma) / 2
    height = np.pad((grey - np.float32(gamma)) / np.float32(abs(half) or 1), width, mode="edge")
    within = np.zeros(height.shape, bool)
    within[(slice(width, -width),) * 3] = True
    return np.where(within, height, -np.maximum(np.abs(height), DEEP))


def marching_cubes(grey: np.ndarray, gamma: float) -> Surface:
    """The level set `gamma` of grey levels (nx, ny, nz): points (n, 3) in voxels and triangles (f, 3),
    wound outwards, vertices clamped on edges. Solid ends with the image, half a voxel beyond the
    centres of its last voxels."""
    height = bordered(grey, gamma, 1)
    points, faces, _, _ = measure.marching_cubes(height, 0, gradient_direction="descent")
    base = np.floor(points)
    fraction = points - base
    moving = fraction > 1e-6
    points = base + np.where(moving, np.clip(fraction, CLAMP, 1 - CLAMP), 0)
    surface = Surface(points.astype(float) - 1, faces.astype(np.int32))
    if enclosed_volume(surface) < 0:
        surface = Surface(surface.points, surface.faces[:, ::-1].copy())
    return surface


def enclosed_volume(surface: Surface) -> float:
    """Signed volume inside a closed surface, voxel^3: positive when wound outwards."""
    a, b, c = (surface.points[surface.faces[:, n]] for n in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def check_watertight(surface: Surface, name: str) -> None:
    """GeometryError unless each edge is crossed once in either direction."""
    edges = surface.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    n = len(surface.points)
    forward = np.sort(edges[:, 0] * n + edges[:, 1])
    backward = np.sort(edges[:, 1] * n + edges[:, 0])
    bad = np.setxor1d(forward, backward)
    if len(bad) or len(np.unique(forward)) != len(forward):
        raise GeometryError(
            f"{name}: the surface is not watertight ({len(bad)} open and "
            f"{len(forward) - len(np.unique(forward))} doubled edges of {len(forward)}); "
            "remesh it, or raise images.blur"
        )


def remeshed(surface: Surface, edge_length: float, iterations: int = 6) -> Surface:
    """Isotropic remeshing to a target edge length (voxels) with pymeshlab, staying near the surface."""
    import pymeshlab

    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(surface.points, surface.faces))
    meshes.meshing_isotropic_explicit_remeshing(
        targetlen=pymeshlab.PureValue(edge_length),
        iterations=iterations,
        checksurfdist=True,
        maxsurfdist=pymeshlab.PureValue(0.2),
        featuredeg=60,
    )
    meshes.meshing_remove_unreferenced_vertices()
    result = meshes.current_mesh()
    return Surface(result.vertex_matrix(), result.face_matrix().astype(np.int32))
