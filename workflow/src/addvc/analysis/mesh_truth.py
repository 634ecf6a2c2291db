"""A truth given as displacements of the nodes of a tetrahedral mesh, such as a finite-element
reference of the user's own. For judging only.

The file (HDF5): `points` (n, 3) in voxels of the binned image, x y z = i j k; `cells` (m, 4) linear
or (m, 10) quadratic tetrahedra, nodes in VTK's order (edges 01, 12, 02, 03, 13, 23), sides straight
in the reference; `displacement1`, `displacement2`, ... (n, 3) in voxels, one per loading state.
Optional attributes: `strains` (states,), `platens` (states + 1, 2): positions of both faces along
the loading axis, the reference first.
"""

import os
import re
from functools import cached_property

import h5py
import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from addvc.correlation.transfer import locate
from addvc.errors import ConfigError, MeshError
from addvc.fem.elements import P2_EDGES, tet_p1, tet_p2
from addvc.fem.mesh import Mesh, boundary_faces, cell_volumes, oriented
from addvc.images.files import atomic_path

STRAIGHT = 1e-3
"""Voxels that the middle node of an edge may be off the middle of its ends."""

FLAT = 1e-9
"""Voxel^3 that a cell holds at least."""

REACH = 1.5
"""Radius of the ball whose solid gives the axis of a strut, in diameters of struts."""

SLENDER = 0.65
"""Least 1 - (second / first moment) of a piece of strut; a junction is below it."""


class MeshTruth:
    """Displacement of any point of a solid that a mesh of tetrahedra fills.

    A point outside is extrapolated from an element next to it, which holds within a voxel or so.
    `strains` (states + 1,), 0 first, and `platens` (states + 1, 2) are None where not given."""

    def __init__(
        self,
        points: np.ndarray,
        cells: np.ndarray,
        displacements: list[np.ndarray],
        strains: np.ndarray | None = None,
        platens: np.ndarray | None = None,
    ) -> None:
        _check(points, cells, displacements)
        self._points, self._cells, self._u = np.asarray(points, float), cells, displacements
        self.strains = None if strains is None else (0.0, *map(float, strains))
        self.platens = platens
        self.mesh = Mesh(points, cells[:, :4])

    @classmethod
    def load(cls, path: str | os.PathLike) -> "MeshTruth":
        """From a file of `save_mesh_truth`, or of the user's making.

        Raises ConfigError where points, cells or one of displacement1, 2, ... is missing, MeshError
        where the shapes of these do not fit, a vector is not finite, a cell has a node that there is
        not, or a side of a quadratic tetrahedron is not straight."""
        with h5py.File(path) as file:
            count = sum(re.fullmatch(r"displacement\d+", name) is not None for name in file)
            wanted = {f"displacement{n}" for n in range(1, max(count, 1) + 1)}
            there = {name for name, item in file.items() if isinstance(item, h5py.Dataset)}
            missing = {"points", "cells", *wanted} - there
            if missing:
                raise ConfigError(
                    f"truth {path} has no dataset {sorted(missing)}; a truth is a mesh (points, "
                    "cells) with displacement1, displacement2, ...: see workflow/README.md"
                )
            return cls(
                file["points"][:],
                file["cells"][:],
                [file[f"displacement{n}"][:] for n in range(1, count + 1)],
                file.attrs.get("strains"),
                file.attrs.get("platens"),
            )

    def displacement(self, points: np.ndarray, state: int) -> np.ndarray:
        """u (q, 3) of reference points (q, 3), voxels: I_reference(x) = I_state(x + u(x)).

        Zero for state 0, the reference. Raises ConfigError where the truth has no such state."""
        if not 0 <= state <= len(self._u):
            raise ConfigError(
                f"the truth has no state {state} (0 to {len(self._u)}); list as many states in "
                "scans.states as it has displacements"
            )
        if state == 0:
            return np.zeros_like(points, dtype=float)
        cell, local = locate(self.mesh, points)
        shape = (tet_p1 if self._cells.shape[1] == 4 else tet_p2)(local[:, 1:])[0]
        return np.einsum("qa,qai->qi", shape, self._u[state - 1][self._cells[cell]])

    def strut(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Strut (q,) at or next to each point, its unit tangent (q, 3), distance (q,) to the
        surface, negative inside and known to some tenths of an edge.

        The tangent is the principal axis of the solid nearby; struts are the slender pieces
        between junctions, where it has none."""
        cell, local = locate(self.mesh, points)
        away, _ = self._surface.query(points)
        inside = local.min(axis=1) >= 0
        return self._struts[0][cell], self._axes[0][cell], np.where(inside, -away, away)

    @property
    def states(self) -> int:
        """How many loading states it has."""
        return len(self._u)

    @property
    def junctions(self) -> np.ndarray:
        """(j, 3) where struts meet in the reference."""
        return self._struts[1]

    @cached_property
    def _surface(self) -> cKDTree:
        """The surface as points: the middles of each triangle cut in 16."""
        t = (np.arange(4) + 1 / 3) / 4
        share = np.array([(1 - a - b, a, b) for a in t for b in t if a + b < 1])
        share = np.vstack([share, 2 / 3 - share[(2 / 3 - share > 0).all(axis=1)]])
        corners = self.mesh.points[boundary_faces(oriented(self.mesh))]
        return cKDTree(np.einsum("sa,fai->fsi", share, corners).reshape(-1, 3))

    @cached_property
    def _axes(self) -> tuple[np.ndarray, np.ndarray]:
        return local_axes(oriented(self.mesh))

    @cached_property
    def _struts(self) -> tuple[np.ndarray, np.ndarray]:
        return struts_and_junctions(oriented(self.mesh), self._axes[1] > SLENDER)


def is_mesh_truth(path: str | os.PathLike) -> bool:
    """Whether a file is not one of `addvc.twin`, which hold a foam of beams."""
    try:
        with h5py.File(path) as file:
            return "foam" not in file
    except OSError as error:
        raise ConfigError(
            f"truth {path} cannot be read as HDF5 ({error}); see workflow/README.md"
        ) from error


def _check(points: np.ndarray, cells: np.ndarray, displacements: list[np.ndarray]) -> None:
    """MeshError for what cannot be interpolated in."""
    _check_shapes(points, cells, displacements)
    if cells.min() < 0 or cells.max() >= len(points):
        raise MeshError(
            f"the cells of the truth have nodes {cells.min()} to {cells.max()}, its points are 0 to "
            f"{len(points) - 1}; count nodes from 0"
        )
    for name, values in {"points": points, **_named(displacements)}.items():
        bad = int((~np.isfinite(values).all(axis=1)).sum())
        if bad:
            raise MeshError(
                f"{bad} of the {len(values)} vectors of {name} of the truth are not finite; give all "
                "nodes numbers, or leave out cells whose motion is not known"
            )
    flat = int((np.abs(cell_volumes(Mesh(points, cells[:, :4]))) < FLAT).sum())
    if flat:
        raise MeshError(
            f"{flat} of {len(cells)} cells of the truth have no volume (at least {FLAT:g} voxel^3); "
            "leave them out, and check the order of their nodes"
        )
    if cells.shape[1] == 10:
        _check_straight(points, cells)


def _named(displacements: list[np.ndarray]) -> dict[str, np.ndarray]:
    return {f"displacement{state}": u for state, u in enumerate(displacements, start=1)}


def _check_shapes(points: np.ndarray, cells: np.ndarray, displacements: list[np.ndarray]) -> None:
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise MeshError(f"the truth has points of shape {points.shape}; (n, 3) is needed, x y z")
    if cells.ndim != 2 or cells.shape[1] not in (4, 10) or len(cells) == 0:
        raise MeshError(f"the truth has cells of shape {cells.shape}; (m, 4) or (m, 10) is needed")
    if cells.dtype.kind not in "iu":
        raise MeshError(
            f"the cells of the truth are numbers of {cells.dtype.name}; give whole ones, the nodes of "
            "each"
        )
    for name, u in _named(displacements).items():
        if u.shape != points.shape:
            raise MeshError(
                f"{name} of the truth has shape {u.shape}, its points {points.shape}; give one vector a "
                "node"
            )


def _check_straight(points: np.ndarray, cells: np.ndarray) -> None:
    middle = points[cells[:, P2_EDGES]].mean(axis=2)
    off = float(np.linalg.norm(points[cells[:, 4:]] - middle, axis=2).max())
    if off > STRAIGHT:
        raise MeshError(
            f"a node of an edge is {off:.2g} voxel off the middle (at most {STRAIGHT}); give "
            "quadratic tetrahedra with straight sides, nodes in VTK's order"
        )


def local_axes(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Principal axis (m, 3) of the solid around each tetrahedron, and how slender it is (m,), 0..1.

    Second moments of the tetrahedra in a ball of REACH diameters, the diameter of a strut being
    four times its volume over its surface."""
    volume, centre = cell_volumes(mesh), mesh.points[mesh.cells].mean(axis=1)
    faces = mesh.points[boundary_faces(mesh)]
    area = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1)
    radius = REACH * 4 * volume.sum() / (area.sum() / 2)
    pairs = cKDTree(centre).query_pairs(radius, output_type="ndarray")
    near = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(volume),) * 2).tocsr()
    near = near + near.T
    near.setdiag(1)
    weight = near @ volume
    mean = near @ (volume[:, None] * centre) / weight[:, None]
    square = np.einsum("mi,mj->mij", centre, centre).reshape(-1, 9)
    moment = (near @ (volume[:, None] * square) / weight[:, None]).reshape(-1, 3, 3)
    value, vector = np.linalg.eigh(moment - np.einsum("mi,mj->mij", mean, mean))
    return vector[:, :, 2], 1 - value[:, 1] / np.maximum(value[:, 2], 1e-300)


def struts_and_junctions(mesh: Mesh, slender: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Strut (m,) of each tetrahedron and the middles (j, 3) of junctions.

    Struts are the connected pieces of slender (m,) tetrahedra; any other has that of the nearest.
    A junction is a connected piece of the others that three struts or more share nodes with."""
    centre = mesh.points[mesh.cells].mean(axis=1)
    rods, knots = np.flatnonzero(slender), np.flatnonzero(~slender)
    label = np.zeros(len(slender), dtype=np.int64)
    if len(rods) == 0 or len(knots) == 0:
        return label, np.zeros((0, 3))
    strut, knot = pieces(mesh.cells[rods]), pieces(mesh.cells[knots])
    label[rods] = strut
    label[knots] = strut[cKDTree(centre[rods]).query(centre[knots])[1]]
    n = len(mesh.points)
    at_knot = incidence(mesh.cells[knots], knot, n)
    meet = (at_knot.T @ incidence(mesh.cells[rods], strut, n)).tocsr()
    volume = cell_volumes(mesh)[knots]
    total = np.bincount(knot, volume)
    middle = np.stack([np.bincount(knot, volume * x) / total for x in centre[knots].T], axis=1)
    return label, middle[np.diff(meet.indptr) > 2]


def incidence(cells: np.ndarray, label: np.ndarray, nodes: int) -> csr_matrix:
    """(nodes, labels), not zero where a cell (m, a) of that label (m,) has the node."""
    entries = cells.ravel(), np.repeat(label, cells.shape[1])
    return csr_matrix((np.ones(cells.size), entries), shape=(nodes, label.max() + 1))


def pieces(cells: np.ndarray) -> np.ndarray:
    """Label (m,) of the connected piece of each cell (m, a); cells that share a node are connected."""
    used, node = np.unique(cells, return_inverse=True)
    node = node.reshape(cells.shape)
    ends = np.repeat(node[:, 0], node.shape[1] - 1), node[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(ends[0])), ends), shape=(len(used),) * 2)
    return connected_components(graph, directed=False)[1][node[:, 0]]


def save_mesh_truth(
    path: str | os.PathLike,
    points: np.ndarray,
    cells: np.ndarray,
    displacements: list[np.ndarray],
    strains: np.ndarray | None = None,
    platens: np.ndarray | None = None,
) -> None:
    """Write the file that `MeshTruth.load` reads: points (n, 3) and displacements (n, 3) in voxels, one
    per loading state; cells (m, 4) or (m, 10); strains (states,); platens (states + 1, 2) in voxels, the
    reference first. Raises MeshError as `MeshTruth.load` does."""
    _check(points, cells, displacements)
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        file["points"], file["cells"] = points, cells
        for name, u in _named(displacements).items():
            file[name] = u
        for name, value in (("strains", strains), ("platens", platens)):
            if value is not None:
                file.attrs[name] = value
