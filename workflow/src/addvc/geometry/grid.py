"""Fig. 6: a hexahedral grid with few elements in height, over the image and part of the platens."""

import numpy as np

from addvc.fem.mesh import Mesh
from addvc.images.specimen import Specimen


def grid_lines(
    shape: tuple[int, int, int], specimen: Specimen, across: int, along: int, platen: float
) -> list[np.ndarray]:
    """Grid lines: `across` cells over each width, `along` over the specimen, one in each platen.

    A row of cells reaches `platen` voxels into a platen, or as far as the image does; it is left
    out where the image shows less than 4 voxels of platen."""
    last = shape[specimen.axis] - 1.0
    low, high = max(specimen.low, 0.0), min(specimen.high, last)
    lines = [np.linspace(0.0, n - 1.0, across + 1) for n in shape]
    below, above = max(0.0, low - platen), min(last, high + platen)
    lines[specimen.axis] = np.concatenate(
        [
            [below] if low - below >= 4 else [],
            np.linspace(low, high, along + 1),
            [above] if above - high >= 4 else [],
        ]
    )
    return lines


def hex_grid(lines: list[np.ndarray]) -> Mesh:
    """Hexahedra (m, 8) between three sets of grid lines, numbered with the last axis fastest; points
    (n, 3), likewise.

    `lines`: coordinates (k,), voxels, of those along x, y and z: n is the product of all k, m that of
    all k - 1."""
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape([len(line) for line in lines])
    corner = [
        number[i : i - 1 or None, j : j - 1 or None, k : k - 1 or None].ravel()
        for i, j, k in (
            (0, 0, 0),
            (1, 0, 0),
            (1, 1, 0),
            (0, 1, 0),
            (0, 0, 1),
            (1, 0, 1),
            (1, 1, 1),
            (0, 1, 1),
        )
    ]
    return Mesh(points, np.column_stack(corner))
