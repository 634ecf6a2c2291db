"""Off-screen renderings in parallel projection, as pictures whose axes are voxels."""

import ctypes
import os
import sys
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Normalize, to_rgb

from addvc.errors import AddvcError
from addvc.report.style import DPI, INCH, SOLID

REMEDY = (
    "install the software renderer: `apt install libegl1 libgl1-mesa-dri` (Debian, Ubuntu), "
    "`dnf install mesa-libEGL mesa-dri-drivers` (Fedora, Rocky)"
)

HAZE = 0.55  # share of white in the farthest faces


@dataclass(frozen=True, eq=False)
class Layer:
    """Polygons (f, 3 | 4) or lines (f, 2) between points (n, 3), in one colour, in a colour a face
    (f, 3), or with values (n,) or (f,) mapped to colours."""

    points: np.ndarray
    faces: np.ndarray
    colour: str | np.ndarray = SOLID
    values: np.ndarray | None = None
    norm: Normalize | None = None
    cmap: str = "viridis"
    edges: bool = False
    opacity: float = 1.0
    smooth: bool = False
    line_width: float = 1.0


@dataclass(frozen=True, eq=False)
class View:
    """Orthonormal directions: `right` and `up` in the picture, `towards` the viewer."""

    right: np.ndarray
    up: np.ndarray
    towards: np.ndarray

    def project(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) -> (n, 2): voxels in the picture."""
        return points @ np.column_stack([self.right, self.up])


@dataclass(frozen=True, eq=False)
class Picture:
    """An image (h, w, 3) and its (left, right, bottom, top) in voxels."""

    image: np.ndarray
    extent: tuple[float, float, float, float]

    @property
    def aspect(self) -> float:
        """Height over width."""
        return self.image.shape[0] / self.image.shape[1]

    def show(self, ax: Axes) -> None:
        """Draw it without axes, one voxel as long in either direction."""
        ax.imshow(self.image, extent=self.extent)
        ax.set_aspect("equal")
        ax.set_axis_off()


def facing(axis: int, normal: int) -> View:
    """Straight onto the planes across axis `normal`: the loading axis up, the third right."""
    up, right = np.eye(3)[axis], np.eye(3)[3 - axis - normal]
    return View(right, up, np.cross(right, up))


def oblique(axis: int, azimuth: float = 35.0, elevation: float = 22.0) -> View:
    """From the side and above, in degrees, the loading axis up in the picture."""
    first, second = np.eye(3)[[(axis + 1) % 3, (axis + 2) % 3]]
    a, e = np.radians([azimuth, elevation])
    level = np.cos(a) * first + np.sin(a) * second
    towards = np.cos(e) * level + np.sin(e) * np.eye(3)[axis]
    right = np.cross(np.eye(3)[axis], level)
    return View(right, np.cross(towards, right), towards)


def aspect(view: View, points: np.ndarray) -> float:
    """Height over width of a picture that holds points (n, 3)."""
    width, height = np.ptp(view.project(points), axis=0)
    return float(height / width)


@cache
def plotter_class():
    """pyvista.Plotter that draws off screen; AddvcError with what to install if it cannot."""
    if sys.platform.startswith("linux"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
        try:
            ctypes.CDLL("libEGL.so.1")
        except OSError as error:
            raise AddvcError(f"3D figures need libEGL.so.1, which is missing: {REMEDY}") from error
    import pyvista

    pyvista.OFF_SCREEN = True
    plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32), lighting="none")
    plotter.add_mesh(pyvista.Plane(i_size=9, j_size=9), color="black", lighting=False)
    plotter.view_xy()
    image = plotter.screenshot(return_img=True)
    plotter.close()
    if image[16, 16].max() > 20:
        raise AddvcError(f"a black test picture came out as {image[16, 16].tolist()}: {REMEDY}")
    return pyvista.Plotter


def render(
    layers: list[Layer],
    view: View,
    width_mm: float,
    fit: np.ndarray | None = None,
    shadows: bool = False,
    margin: float = 0.02,
) -> Picture:
    """The layers seen from `view`, a picture for a print `width_mm` wide that holds the points
    `fit` (n, 3), by default all. `shadows`: ambient occlusion, and haze with depth."""
    points = np.vstack([layer.points for layer in layers]) if fit is None else fit
    flat = view.project(points)
    low, high = flat.min(axis=0), flat.max(axis=0)
    middle, size = (low + high) / 2, (high - low) * (1 + 2 * margin)
    columns = round(width_mm * INCH * DPI)
    rows = max(8, round(columns * size[1] / size[0]))
    image = _screenshot(layers, view, (columns, rows), middle, size[1] / 2, shadows)
    half = np.array([size[1] * columns / rows, size[1]]) / 2
    left, bottom, right, top = *(middle - half), *(middle + half)
    return Picture(image, (left, right, bottom, top))


def _screenshot(
    layers: list[Layer],
    view: View,
    pixels: tuple[int, int],
    middle: np.ndarray,
    half_height: float,
    shadows: bool,
) -> np.ndarray:
    """The image (rows, columns, 3) of a camera onto the middle (2,) of the picture."""
    plotter = plotter_class()(off_screen=True, window_size=pixels)
    plotter.set_background("white")
    depth = np.concatenate([layer.points for layer in layers]) @ view.towards
    for layer in layers:
        _add(plotter, _faded(layer, view, depth.min(), depth.max()) if shadows else layer)
    _aim(plotter, view, middle, half_height, depth)
    if shadows:
        plotter.enable_ssao(radius=max(pixels) / pixels[1] * half_height / 12, kernel_size=48)
    plotter.enable_anti_aliasing("ssaa")
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return image


def _faded(layer: Layer, view: View, far: float, near: float) -> Layer:
    """The layer with its colours paler the farther its faces are, as through haze."""
    if layer.values is not None or layer.faces.shape[1] == 2:
        return layer
    depth = (layer.points @ view.towards)[layer.faces].mean(axis=1)
    haze = HAZE * ((near - depth) / max(near - far, 1e-9))[:, None]
    colour = 255 * np.array(to_rgb(layer.colour)) if isinstance(layer.colour, str) else layer.colour
    return replace(layer, colour=((1 - haze) * colour + haze * 255).astype(np.uint8))


def _aim(plotter, view: View, middle: np.ndarray, half_height: float, depth: np.ndarray) -> None:
    """Parallel camera onto the middle (2,) of the picture, in front of every point."""
    focus = middle[0] * view.right + middle[1] * view.up + depth.mean() * view.towards
    distance = float(np.ptp(depth)) + 10 * half_height
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point = focus
    camera.position = focus + distance * view.towards
    camera.up = view.up
    camera.parallel_scale = half_height
    camera.clipping_range = (0.05 * distance, 2 * distance)


def _polydata(layer: Layer):
    """The polygons or lines of a layer, as VTK has them."""
    import pyvista

    if layer.faces.shape[1] == 2:
        pairs = np.column_stack([np.full(len(layer.faces), 2), layer.faces]).ravel()
        return pyvista.PolyData(layer.points, lines=pairs)
    return pyvista.PolyData.from_regular_faces(layer.points, layer.faces)


def _add(plotter, layer: Layer) -> None:
    """One layer with its colours; mapped values are lit softly so that they match the bar."""
    if len(layer.faces) == 0:
        return
    mesh = _polydata(layer)
    options = {
        "opacity": layer.opacity,
        "smooth_shading": layer.smooth,
        "line_width": layer.line_width,
    }
    options |= {"show_edges": layer.edges, "edge_color": "#30343a", "ambient": 0.3, "diffuse": 0.85}
    colours = layer.colour
    if layer.values is not None:
        colours = (255 * colormaps[layer.cmap](layer.norm(layer.values))[:, :3]).astype(np.uint8)
        options |= {"ambient": 0.4, "diffuse": 0.65}
    if isinstance(colours, str):
        plotter.add_mesh(mesh, color=colours, **options)
    else:
        plotter.add_mesh(mesh, scalars=colours, rgb=True, **options)
