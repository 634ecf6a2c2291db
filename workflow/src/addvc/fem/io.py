"""Meshes and fields on disk as VTU, which ParaView opens; points in voxels, x y z = i j k."""

from pathlib import Path

import meshio
import numpy as np

from addvc.fem.mesh import Mesh
from addvc.images.files import atomic_path

KINDS = {2: "line", 3: "triangle", 4: "tetra", 8: "hexahedron"}


def write_vtu(
    path: str | Path,
    points: np.ndarray,
    cells: np.ndarray,
    point_data: dict | None = None,
    cell_data: dict | None = None,
) -> None:
    """Points (n, 3), cells (m, 2 | 3 | 4 | 8), fields by name: (n, ...) on points, (m, ...) on cells."""
    kind = KINDS[cells.shape[1]]
    grid = meshio.Mesh(
        np.asarray(points),
        [(kind, np.asarray(cells))],
        point_data or {},
        {name: [value] for name, value in (cell_data or {}).items()},
    )
    with atomic_path(path) as temporary:
        grid.write(temporary, file_format="vtu", binary=True)


def read_vtu(path: str | Path) -> tuple[np.ndarray, np.ndarray, dict, dict]:
    """Of a file of `write_vtu`: points (n, 3) in voxels, cells (m, 2 | 3 | 4 | 8), fields by name:
    (n, ...) on points, (m, ...) on cells."""
    grid = meshio.read(path)
    cell_data = {name: values[0] for name, values in grid.cell_data.items()}
    return grid.points, grid.cells[0].data, dict(grid.point_data), cell_data


def write_mesh(
    path: str | Path, mesh: Mesh, point_data: dict | None = None, cell_data: dict | None = None
) -> None:
    """A mesh and its fields."""
    write_vtu(path, mesh.points, mesh.cells, point_data, cell_data)


def read_mesh(path: str | Path) -> Mesh:
    """The mesh of a VTU file, without its fields."""
    points, cells, _, _ = read_vtu(path)
    return Mesh(points, cells)


def write_series(path: str | Path, files: dict[float, str]) -> None:
    """Files of a folder, by their time, as a collection (.pvd in it) that ParaView steps through."""
    rows = [f'<DataSet timestep="{time}" file="{name}"/>' for time, name in files.items()]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    with atomic_path(path) as temporary:
        temporary.write_text(head + "\n".join(rows) + "\n</Collection>\n</VTKFile>\n")
