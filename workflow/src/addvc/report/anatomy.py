"""Fig. 3, 5, 7, 8, 9, 14: the specimen, the meshes and the region, rendered."""

from collections.abc import Iterable

import numpy as np

from addvc.fem.mesh import Mesh, outer_faces
from addvc.geometry.region import Region, caps_depth
from addvc.images.platens import find_platens
from addvc.images.spline import gaussian_blur
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, Picture, View, aspect, facing, oblique, render
from addvc.report.surfaces import (
    box_corners,
    centroids,
    clipped,
    compact,
    in_box,
    segmented,
    slab,
    slab_box,
    whole_foam,
)

PALE_BLUE = "#9dbfe0"


def states(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 3: the segmented foam in the reference and in each state, at one scale."""
    numbers = [0, *case.pictured]
    foams = [_foam(case, n) for n in numbers]
    view = oblique(case.specimen.axis)
    fit = np.vstack([points for points, _ in foams])
    fit = fit[in_box(fit, *np.percentile(fit, (0.2, 99.8), axis=0))]  # specks of noise left out
    fig, axes = style.panels(1, len(numbers), aspect(view, fit))
    for panel, (ax, state, foam) in enumerate(zip(axes[0], numbers, foams, strict=True)):
        if len(foam[0]):
            render([Layer(*foam)], view, 170 / len(numbers), fit, shadows=True).show(ax)
        else:
            ax.axis("off")
            style.note(ax, "no solid is seen", y=0.5)
        style.headline(ax, case.labels[state] if state else "reference", panel)
    style.scale_bar(axes[0, 0], case.voxel_um, 0.5)
    style.axis_arrows(axes[0, -1], view.right, view.up)
    style.save(fig, outputs)


def _foam(case: Case, state: int) -> tuple[np.ndarray, np.ndarray]:
    """Surface of the foam of a state, between its own platens where they are seen."""
    volume = case.image(state)
    specimen = case.specimen
    low, high = specimen.low, specimen.high
    if state:
        low, high = find_platens(volume, specimen.axis) or (low, high)
    return whole_foam(volume, case.gamma, specimen, low, high)


def meso_meshes(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 5: the meso meshes, a quarter of the cells taken away, with size and counts."""
    axis = case.specimen.axis
    view, fit = oblique(axis), case.mesh(case.meso[0]).points
    fig, axes = style.panels(1, len(case.meso), aspect(view, fit), spare=20)
    for panel, (ax, name) in enumerate(zip(axes[0], case.meso, strict=True)):
        mesh, facts = case.mesh(name), case.mesh_facts(name)
        render([_opened(mesh, view, axis)], view, 56, fit).show(ax)
        style.headline(ax, name, panel)
        counts = f"{facts['nodes']:,} nodes\n{facts['cells']:,} tetrahedra"
        style.note(ax, f"mean edge {facts['mean_edge']:.1f} voxels\n{counts}", y=-0.03)
    style.scale_bar(axes[0, 0], case.voxel_um, 0.4, y=-0.3)
    style.axis_arrows(axes[0, -1], view.right, view.up, y=-0.3)
    style.save(fig, outputs)


def _opened(mesh: Mesh, view: View, axis: int) -> Layer:
    """A mesh without the quarter of its cells at the right and in front, the inside in sand."""
    shift = centroids(mesh) - (mesh.points.min(axis=0) + mesh.points.max(axis=0)) / 2
    front = view.towards * (np.arange(3) != axis)
    inner, _ = outer_faces(mesh, ~((shift @ view.right > 0) & (shift @ front > 0)))
    skin = set(map(tuple, np.sort(outer_faces(mesh)[0], axis=1)))
    outside = np.array([tuple(face) in skin for face in np.sort(inner, axis=1)])
    colour = np.where(outside[:, None], [157, 191, 224], [240, 200, 140]).astype(np.uint8)
    return Layer(mesh.points, inner, colour, edges=True, line_width=2)


def blur(case: Case, outputs: Iterable[str], sigma: float) -> None:
    """Fig. 7: surface of a crop of 50 voxels a side without blur, with Eq. 8, and with 2 voxels."""
    crop = _crop(case)
    share = float(np.mean(gaussian_blur(crop, sigma) > case.gamma))
    widths = {
        "no blur": 0.0,
        f"σ = {sigma:g} voxels (used)": sigma,
        f"σ = {max(2.0, 2 * sigma):g} voxels (exaggerated)": max(2.0, 2 * sigma),
    }
    cube, view = box_corners(np.zeros(3), np.array(crop.shape) - 1.0), oblique(case.specimen.axis)
    fig, axes = style.panels(1, 3, aspect(view, cube), spare=15)
    for panel, (ax, (title, width)) in enumerate(zip(axes[0], widths.items(), strict=True)):
        grey = gaussian_blur(crop, width)
        gamma = float(np.quantile(grey, 1 - share)) if width > sigma else case.gamma
        body = segmented(grey, gamma, np.zeros(3), np.array(crop.shape))
        render([Layer(*body)], view, 56, cube, True).show(ax)
        style.headline(ax, title, panel)
    style.scale_bar(axes[0, 0], case.voxel_um)
    style.axis_arrows(axes[0, -1], view.right, view.up)
    style.save(fig, outputs)


def _crop(case: Case) -> np.ndarray:
    """50 voxels a side in the middle of the specimen, not blurred."""
    volume = case.image(0, smooth=False)
    specimen = case.specimen
    middle = np.empty(3)
    middle[specimen.axis] = (specimen.low + specimen.high) / 2
    middle[list(specimen.across)] = specimen.centre
    low = np.maximum(np.round(middle).astype(int) - 25, 0)
    return volume[tuple(slice(a, a + 50) for a in low)]


def region(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 8: (a) the region in the whole foam, (b) its mesh close up."""
    mesh, facts = case.mesh("micro"), case.mesh_facts("micro")
    view = oblique(case.specimen.axis)
    layers = [_outside(case), Layer(mesh.points, outer_faces(mesh)[0], style.BLUE)]
    pictures = {
        "region (blue) in the foam (grey)": render(layers, view, 80, shadows=True),
        "its mesh close up": _close_up(mesh, case, view),
    }
    counts = f"{facts['nodes']:,} nodes, {facts['cells']:,} tetrahedra"
    text = f"micro mesh: {counts} of {facts['mean_volume']:.2f} voxel³ in the mean"
    _side_by_side(case, pictures, (view, view), text, outputs)


def _side_by_side(
    case: Case, pictures: dict, views: tuple, text: str, outputs: Iterable[str]
) -> None:
    """Two pictures {title: picture}, each at its own scale and from its view, and words below them."""
    tallest = max(picture.aspect for picture in pictures.values())
    fig, axes = style.panels(1, 2, tallest, spare=24, below=14)
    for panel, (ax, (title, picture)) in enumerate(zip(axes[0], pictures.items(), strict=True)):
        picture.show(ax)
        style.headline(ax, title, panel)
        style.scale_bar(ax, case.voxel_um)
        style.axis_arrows(ax, views[panel].right, views[panel].up)
    fig.supxlabel(text, fontsize=8.5)
    style.save(fig, outputs)


def _outside(case: Case) -> Layer:
    """The foam that is not in the region of micro DVC."""
    specimen, limits = case.specimen, Region(**case.json("geometry/region.json"))
    points, faces = whole_foam(case.image(0), case.gamma, specimen, specimen.low, specimen.high)
    depth = np.minimum(*caps_depth(limits, points[faces].mean(axis=1)))
    return Layer(points, faces[depth < 0])


def _close_up(mesh: Mesh, case: Case, view: View) -> Picture:
    """Edges of the mesh in a box of 0.8 cell around its densest place near the middle."""
    half = 0.4 * case.cell_size
    where = centroids(mesh)
    near = where[np.linalg.norm(where - mesh.points.mean(axis=0), axis=1) < 3 * half]
    near = near if len(near) else where
    tries = near[:: max(1, len(near) // 200)]
    counts = [in_box(near, x - half / 2, x + half / 2).sum() for x in tries]
    centre = tries[int(np.argmax(counts))]
    faces, _ = outer_faces(mesh, in_box(where, centre - half, centre + half))
    points, faces, _ = compact(mesh.points, faces)
    layer = Layer(points, faces, PALE_BLUE, edges=True, line_width=1.5)
    return render([layer], view, 80)


def penalised(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 9: nodes of the ends and of the sides, whose curvature is penalised (D_L)."""
    mesh, kind = case.mesh("micro"), case.penalised()
    colours = np.array([[191, 197, 204], [61, 134, 207], [224, 130, 20]], dtype=np.uint8)
    faces, _ = outer_faces(mesh)
    on_faces = colours[kind[faces].max(axis=1)]
    axis = case.specimen.axis
    views = {"from the side": oblique(axis), "from above": oblique(axis, 35, 75)}
    tallest = max(aspect(view, mesh.points) for view in views.values())
    fig, axes = style.panels(1, 2, tallest, spare=28, below=13)
    for panel, (ax, (name, view)) in enumerate(zip(axes[0], views.items(), strict=True)):
        render([Layer(mesh.points, faces, on_faces)], view, 80, shadows=True).show(ax)
        style.headline(ax, name, panel)
        style.scale_bar(ax, case.voxel_um)
        style.axis_arrows(ax, view.right, view.up)
    names = ("equilibrium gap", "curvature, ends", "curvature, sides")
    handles = [
        style.line(tuple(c / 255), f"{name}, {np.sum(kind == n):,} nodes", "", "s")
        for n, (c, name) in enumerate(zip(colours, names, strict=True))
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=3, columnspacing=1)
    style.save(fig, outputs)


def local_region(case: Case, outputs: Iterable[str]) -> None:
    """Fig. 14: the slice of Fig. 15 to 17, (a) in the whole foam, (b) alone, towards the viewer."""
    mesh, specimen, size = case.mesh("micro"), case.specimen, case.cell_size
    normal, first, last = slab(mesh, specimen.axis, size)
    box = slab_box(mesh, specimen.axis, size)
    cut = Layer(*clipped(mesh, *box)[:2], style.BLUE)
    behind, before = _around(case, box, normal)
    side = oblique(specimen.axis, 30 if normal == (specimen.axis + 1) % 3 else 60)
    view = facing(specimen.axis, normal)
    pictures = {
        "slab (blue) in the foam (grey)": render([behind, cut, before], side, 80),
        "the slab alone, along its normal": render([cut], view, 80, shadows=True),
    }
    thick = f"{last - first:.1f} voxels thick ({(last - first) / size:.2f} cell size)"
    text = f"slab: {thick}, normal to {style.AXES[normal]}"
    _side_by_side(case, pictures, (side, view), text, outputs)


def _around(case: Case, box: tuple, normal: int) -> tuple[Layer, Layer]:
    """The foam without what is in a box: behind it and beside it, and, hardly to be seen, before it."""
    specimen = case.specimen
    points, faces = whole_foam(case.image(0), case.gamma, specimen, specimen.low, specimen.high)
    middle = points[faces].mean(axis=1)
    before = middle[:, normal] > box[1][normal]
    rest = ~before & ~in_box(middle, *box)
    return Layer(points, faces[rest]), Layer(points, faces[before], opacity=0.1)
