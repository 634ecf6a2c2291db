"""Beyond the paper: where the mesh of the struts is not the foam."""

from collections.abc import Iterable

import numpy as np

from addvc.fem.mesh import outer_faces
from addvc.report import style
from addvc.report.case import Case
from addvc.report.scene import Layer, oblique, render
from addvc.report.surfaces import compact

KINDS = {
    "stubs": ("stubs", style.RED),
    "necks": ("necks", style.ORANGE),
    "welds": ("welds", style.BLUE),
    "contacts": ("other contacts", "#7f7f7f"),
    "bridges": ("bridges", style.SERIES[2]),
}
"""What is marked: its name and its colour."""

BALL = 1.7
"""Radius of a mark, voxels."""

TURNS = (35.0, 125.0)
"""Degrees: the foam from two sides, since marks hide behind struts."""


def places(found: dict) -> dict[str, np.ndarray]:
    """Positions (k, 3) in voxels of each of KINDS."""
    lists = {
        "stubs": found["stubs"],
        "necks": found["necks"],
        "welds": [c for c in found["contacts"] if c["weld"]],
        "contacts": [c for c in found["contacts"] if not c["weld"]],
        "bridges": found["bridges"],
    }
    return {
        kind: np.array([row["position"] for row in rows]).reshape(-1, 3)
        for kind, rows in lists.items()
    }


def marked(case: Case, outputs: Iterable[str]) -> None:
    """The mesh in grey from two sides, a ball at each stub, neck, weld, contact and bridge."""
    mesh, where = case.mesh("micro"), places(case.json("geometry/topology.json"))
    points, faces, _ = compact(mesh.points, outer_faces(mesh)[0])
    foam = Layer(points, faces, colour="#d5dae0", opacity=0.35)
    balls = [ball(at, KINDS[kind][1]) for kind, at in where.items() if len(at)]
    views = [oblique(case.specimen.axis, azimuth) for azimuth in TURNS]
    pictures = [render([foam, *balls], view, style.WIDTH / 2, points) for view in views]
    fig, axes = style.panels(1, 2, pictures[0].aspect, spare=25, below=14)
    for number, (ax, picture) in enumerate(zip(axes[0], pictures, strict=True)):
        picture.show(ax)
        style.headline(ax, "from one side" if number == 0 else "a quarter turn further", number)
        style.axis_arrows(ax, views[number].right, views[number].up)
    style.scale_bar(axes[0, 0], case.voxel_um, 0.4)
    handles = [
        style.line(colour, f"{name}: {len(where[kind])}", "", "o")
        for kind, (name, colour) in KINDS.items()
        if len(where[kind]) or kind != "bridges"
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    style.save(fig, outputs)


def ball(centres: np.ndarray, colour: str) -> Layer:
    """Spheres at centres (k, 3)."""
    import pyvista

    one = pyvista.Sphere(radius=BALL, theta_resolution=14, phi_resolution=14).triangulate()
    faces = one.regular_faces
    steps = len(one.points) * np.arange(len(centres))
    points = (centres[:, None] + np.asarray(one.points, float)).reshape(-1, 3)
    return Layer(points, (faces + steps[:, None, None]).reshape(-1, 3), colour=colour)


def topology_rows(case: Case) -> list[list[str]]:
    """A row for each stub, neck, contact and bridge: where, how large, and for contacts how far torn."""
    found = case.json("geometry/topology.json")
    rows = [["Kind", "x (voxel)", "y (voxel)", "z (voxel)", "Size", "Unit", "Note"]]
    for stub in found["stubs"]:
        gap = stub["nearest"]
        note = "–" if gap is None else f"nearest other stub {gap:.1f} voxels away"
        rows.append(_row("stub", stub, f"{stub['length']:.1f}", "voxel long", note))
    for neck in found["necks"]:
        note = f"strut {neck['strut']}, mean section {neck['mean_area']:.2f} voxel^2"
        rows.append(_row("neck", neck, f"{neck['area']:.2f}", "voxel^2", note))
    for contact in found["contacts"]:
        torn = [
            f"{case.labels[s['state']]}: {s['before']:.1f}, {s['after']:.1f}"
            for s in contact["states"]
        ]
        note = "stretch over the mean before, after micro DVC: " + "; ".join(torn)
        kind = "weld" if contact["weld"] else "contact"
        rows.append(_row(kind, contact, str(contact["edges"]), "edges", note if torn else "–"))
    for bridge in found["bridges"]:
        note = f"put in by mesh.mend, mean radius {bridge['radius']:.2f} voxels"
        rows.append(_row("bridge", bridge, f"{bridge['length']:.1f}", "voxel long", note))
    return rows


def _row(kind: str, item: dict, size: str, unit: str, note: str) -> list[str]:
    return [kind, *(f"{x:.1f}" for x in item["position"]), size, unit, note]
