"""Fig. 16 in numbers: the solid of the reference, carried by u, against the segmented deformed image.

The mesh ends at the caps of its region, the image goes on to the platens. What counts of the image
is therefore between the caps, carried by the nodes on them, and what the displacement of the nearest
node takes back within the sides. What has left the image is not counted. Solid that the mesh leaves
out (pieces that are not attached) is missed by any u: the same figures of the mesh at rest, on the
image of the reference, are what can be had.
"""

import numpy as np
from scipy.spatial import cKDTree
from skimage import measure

from addvc.fem.mesh import Mesh, boundary_faces, cell_volumes
from addvc.fem.quadrature import voxel_owner
from addvc.geometry.region import Region, caps_depth
from addvc.geometry.sections import cut_depth

REST = "rest"
"""The name of the mesh at rest among results."""

CAP = 0.75
"""Voxels from a cap on that a surface is that of the solid, not the cut."""

FLAT = 1e-9
"""Volume of a deformed tetrahedron, voxel^3, below which it holds no voxel."""

FAR = 1.0
"""Distance from the carried surface, voxels, from which on a surface of the image is missed."""


def overlap(mesh: Mesh, u: np.ndarray, image: np.ndarray, gamma: float, region: Region) -> dict:
    """The mesh moved by u (n, 3) against {image > gamma}: `dice` of the solids; median and 95th
    percentile of the distance (voxels) of the carried surface from that of the image; shares of the
    carried surface `outside` of the image, and of the surface of the image that is `missed`, over a
    voxel from the carried one."""
    moved, faces = Mesh(mesh.points + u, mesh.cells), boundary_faces(mesh)
    nodes = np.unique(faces)
    limits = CarriedRegion(mesh.points, u, nodes, region)
    carried, found = solid_voxels(moved, image.shape), image > gamma
    found[found] = limits.depth(np.argwhere(found)) >= 0
    nodes = nodes[cut_depth(region, mesh.points[nodes]) >= CAP]
    inside = in_image(moved.points[nodes], image.shape)
    surface = level_set(image, gamma)
    near = surface_distance(moved.points[nodes[inside]], *surface)
    seen = surface[0][limits.depth(surface[0]) >= CAP]
    away = surface_distance(seen, moved.points, faces)
    middle, far = np.percentile(near, (50, 95)) if len(near) else (np.nan, np.nan)
    return {
        "dice": dice(carried, found),
        "distance_median": float(middle),
        "distance_p95": float(far),
        "missed": float(np.mean(away > FAR)) if len(away) else float("nan"),
        "outside": float(np.mean(~inside)) if len(nodes) else float("nan"),
    }


class CarriedRegion:
    """A region with what it holds moved: points (n, 3) by u (n, 3), those of the surface are `nodes`
    (k,)."""

    def __init__(self, points: np.ndarray, u: np.ndarray, nodes: np.ndarray, region: Region):
        self.region, self.u, self.tree = region, u, cKDTree(points + u)
        along, axis = points[nodes, region.axis], region.axis
        self.caps = []
        for inwards, below in ((1, along - region.low), (-1, region.high - along)):
            cap = (points + u)[nodes[below < CAP]]
            cap[:, axis] -= inwards * below[below < CAP]
            if len(cap):
                self.caps.append((inwards, cap[:, axis], cKDTree(np.delete(cap, axis, axis=1))))

    def depth(self, points: np.ndarray) -> np.ndarray:
        """How deep (q,) points (q, 3) of the deformed image are within; negative outside."""
        axis = self.region.axis
        depth = caps_depth(self.region, points - self.u[self.tree.query(points)[1]])[1]
        for inwards, height, across in self.caps:
            nearest = across.query(np.delete(points, axis, axis=1))[1]
            depth = np.minimum(depth, inwards * (points[:, axis] - height[nearest]))
        return depth


def level_set(image: np.ndarray, gamma: float) -> tuple[np.ndarray, np.ndarray]:
    """Surface of {image > gamma}, open at the border of the image: points (n, 3), triangles (f, 3)."""
    if not image.min() < gamma < image.max():
        return np.empty((0, 3)), np.empty((0, 3), dtype=int)
    height = (image - gamma) / np.ptp(image)  # marching cubes take what is under 1e-7 for nothing
    points, faces = measure.marching_cubes(height, 0)[:2]
    return points.astype(float), faces


def solid_voxels(mesh: Mesh, shape: tuple[int, int, int]) -> np.ndarray:
    """Volume (nx, ny, nz) bool of the voxels whose centres are in a mesh, whichever way its cells
    are turned."""
    cells = mesh.cells[np.abs(cell_volumes(mesh)) > FLAT]
    return voxel_owner(mesh.points, cells, np.array(shape, dtype=np.int64)) >= 0


def dice(a: np.ndarray, b: np.ndarray) -> float:
    """2 |a and b| / (|a| + |b|) of two sets of voxels [Dice1945]; nan when both are empty."""
    total = int(a.sum()) + int(b.sum())
    return 2 * int((a & b).sum()) / total if total else float("nan")


def in_image(points: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Which points (q, 3) are between the centres of the outermost voxels."""
    return ((points >= 0) & (points <= np.array(shape) - 1)).all(axis=1)


def surface_distance(query: np.ndarray, points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Distance (q,) of points (q, 3) from triangles (f, 3) between points (n, 3); nan without any."""
    import pyvista

    if len(faces) == 0 or len(query) == 0:
        return np.full(len(query), np.nan)
    surface = pyvista.PolyData.from_regular_faces(points, faces)
    _, nearest = surface.find_closest_cell(query, return_closest_point=True)
    return np.linalg.norm(nearest - query, axis=1)
