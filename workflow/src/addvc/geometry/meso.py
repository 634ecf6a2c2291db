"""Fig. 5: meso meshes of the whole specimen, a cylinder or a box between the platens."""

import numpy as np
import pyvista as pv

from addvc.geometry.surface import Surface
from addvc.geometry.tets import sized


def specimen_surface(specimen, size: float) -> Surface:
    """The outline of the specimen as triangles of about `size` voxels."""
    middle = (specimen.low + specimen.high) / 2
    across = [d for d in range(3) if d != specimen.axis]
    if specimen.kind == "cylinder":
        centre = np.insert(np.array(specimen.centre, dtype=float), specimen.axis, middle)
        around = max(8, round(2 * np.pi * specimen.radius / size))
        turn = 2 * np.pi / around
        solid = pv.Cylinder(
            center=centre,
            direction=np.eye(3)[specimen.axis],
            radius=specimen.radius * np.sqrt(turn / np.sin(turn)),  # same area
            height=specimen.high - specimen.low,
            resolution=around,
        )
    else:
        bounds = np.empty((3, 2))
        bounds[specimen.axis] = specimen.low, specimen.high
        bounds[across] = specimen.bounds
        solid = pv.Box(bounds.ravel())
    solid = solid.triangulate().clean()
    return Surface(np.asarray(solid.points, dtype=float), solid.faces.reshape(-1, 4)[:, 1:])


def meso_mesh(specimen, size: float):
    """Tetrahedra of the specimen whose mean edge is `size` voxels (Table 2's element size)."""
    return sized(specimen_surface(specimen, size), size)
