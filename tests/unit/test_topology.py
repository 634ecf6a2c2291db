"""Dangling stubs, necks and welds of a mesh of struts, where they are known; lengths in voxels."""

import csv

import numpy as np
import pytest

from addvc.analysis.struts import Strut, partition
from addvc.analysis.topology import (
    APART,
    Moved,
    contacts,
    mesh_edges,
    necks,
    stretch,
    topology,
    welds,
)
from addvc.fem.mesh import cell_volumes, check_mesh
from addvc.fem.rotations import nearest_rotation
from addvc.geometry.skeleton import FREE_END, StrutGraph, strut_graph
from addvc.geometry.stubs import dangling_stubs, pruned
from addvc.geometry.stuffing import stuff
from addvc.images.files import write_json
from addvc.report import topology as pictures
from addvc.report.case import Case
from addvc.report.doubts import topology_warnings
from addvc.report.tables import write_table

SHAPE = (56, 40, 40)
MIDDLE = np.array([28.0, 20.0, 20.0])
TIP = np.array([28.0, 34.0, 20.0])
RODS = [
    ((4, 20, 20), MIDDLE), (MIDDLE, (52, 20, 20)),  # from cut to cut
    (MIDDLE, (28, 20, 4)), (MIDDLE, TIP),  # to a third cut, and to nowhere
]  # fmt: skip


def rods(lines, radius=2.0):
    """Grey levels of rods between points, 0 to 100, 50 at their surface."""
    x = np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), -1).astype(float)
    away = np.full(SHAPE, np.inf)
    for a, b in np.asarray(lines, dtype=float):
        t = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        away = np.minimum(away, np.linalg.norm(x - a - t[..., None] * (b - a), axis=-1))
    return (50 - 30 * (away - radius)).clip(0, 100).astype(np.float32)


@pytest.fixture(scope="module")
def frame():
    """Mesh, graph and nodes on the cuts of four rods that meet, one of which ends in the bulk."""
    grey = rods(RODS)
    mesh = stuff(grey, 50.0, 1.5)
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    return mesh, strut_graph(grey > 50), (x < 6) | (x > 50) | (z < 6), grey


def test_a_rod_that_ends_in_the_bulk_is_a_stub_and_those_at_the_cuts_are_none(frame):
    mesh, graph, cut, _ = frame
    (stub,) = dangling_stubs(graph, mesh, cut)
    assert stub["position"] == pytest.approx(TIP, abs=2.5)
    assert stub["length"] == pytest.approx(np.linalg.norm(TIP - MIDDLE) - 2, abs=3)
    assert stub["nearest"] is None


def test_without_cuts_every_end_is_a_stub(frame):
    mesh, graph, cut, _ = frame
    assert len(dangling_stubs(graph, mesh, np.zeros_like(cut))) == 4
    gaps = [s["nearest"] for s in dangling_stubs(graph, mesh, np.zeros_like(cut))]
    assert min(gaps) == pytest.approx(np.hypot(14, 16), abs=5)


def test_pruning_takes_the_stub_and_nothing_else(frame):
    mesh, graph, cut, _ = frame
    rest, count = pruned(mesh, graph, cut)
    check_mesh(rest, "pruned")
    assert count == 1
    assert rest.points[:, 1].max() == pytest.approx(MIDDLE[1] + 2, abs=2)
    lost = cell_volumes(mesh).sum() - cell_volumes(rest).sum()
    assert lost == pytest.approx(np.pi * 4 * (TIP - MIDDLE)[1], rel=0.25)
    ends = set(map(tuple, mesh.points[cut]))
    assert ends <= set(map(tuple, rest.points))


def test_pruning_a_mesh_without_stubs_changes_nothing(frame):
    mesh, graph, _, _ = frame
    rest, count = pruned(mesh, graph, np.ones(len(mesh.points), bool))
    assert count == 0
    np.testing.assert_array_equal(rest.cells, mesh.cells)
    nothing = StrutGraph(np.zeros((0, 3)), np.zeros(0), [])
    assert pruned(mesh, nothing, np.zeros(len(mesh.points), bool)) == (mesh, 0)
    assert contacts(mesh, mesh_edges(mesh), nothing) == []


def strut(area, ends=(0, 1)):
    line = np.column_stack([np.linspace(0, 16, 17), np.zeros(17), np.zeros(17)])
    nodes = np.arange(30)
    return Strut(ends, line, np.asarray(area, float), 16.0, 20.0, nodes, np.ones(30), nodes / 2)


def test_a_neck_is_where_the_section_is_below_a_square_voxel():
    thin = np.full(17, 4.0)
    thin[5] = 0.4
    found = necks([strut(np.full(17, 4.0)), strut(thin), strut(thin, (0, FREE_END))])
    assert len(found) == 1
    assert found[0]["strut"] == 1 and found[0]["area"] == pytest.approx(0.4)
    assert found[0]["position"] == pytest.approx([5, 0, 0])


@pytest.fixture(scope="module")
def crossed():
    """Two bent struts between junctions, as near as their surfaces touch in the middle."""
    lines = [
        ((6, 8, 14), (28, 18, 18)), ((28, 18, 18), (50, 8, 14)),
        ((6, 32, 14), (28, 22, 18)), ((28, 22, 18), (50, 32, 14)),
        ((6, 8, 14), (6, 32, 14)), ((50, 8, 14), (50, 32, 14)),
        ((6, 8, 14), (6, 20, 34)), ((6, 32, 14), (6, 20, 34)),
        ((50, 8, 14), (50, 20, 34)), ((50, 32, 14), (50, 20, 34)),
    ]  # fmt: skip
    apart = strut_graph(rods(lines, 1.4) > 50)  # the struts as they are
    return stuff(rods(lines, 2.2), 50.0, 1.5), apart


def test_struts_that_share_no_junction_touch_where_they_are_near(crossed):
    mesh, graph = crossed
    edges = mesh_edges(mesh)
    found = contacts(mesh, edges, graph)
    middles = np.array([mesh.points[edges[g]].mean(axis=(0, 1)) for g in found])
    assert len(found) >= 1
    assert np.linalg.norm(middles - [28, 20, 18], axis=1).min() < 2


def test_a_contact_that_is_pulled_apart_is_a_weld(crossed):
    mesh, graph = crossed
    pull = np.zeros_like(mesh.points)
    pull[:, 1] = 1.5 * np.tanh((mesh.points[:, 1] - 20) / 0.7)
    still = np.zeros_like(pull)
    calm = welds(mesh, graph, [Moved(1, still, still)])
    torn = welds(mesh, graph, [Moved(1, still, still), Moved(2, pull, still)])
    assert not any(c["weld"] for c in calm)
    (weld,) = [c for c in torn if c["weld"]]
    assert weld["position"] == pytest.approx([28, 20, 18], abs=2)
    assert weld["states"][1]["before"] > APART > weld["states"][1]["after"] == 0


def test_turning_stretches_nothing_and_pulling_by_a_tenth_a_tenth(crossed):
    mesh, _ = crossed
    edges = mesh_edges(mesh)
    rotation = nearest_rotation(np.random.default_rng(2417).normal(size=(1, 3, 3)))[0]
    turn = mesh.points @ rotation.T - mesh.points + 3.0
    assert np.abs(stretch(mesh.points, edges, turn)).max() < 1e-10
    assert stretch(mesh.points, edges, 0.1 * mesh.points) == pytest.approx(0.1)


def test_all_of_it_as_a_table_and_a_picture(frame, tmp_path):
    mesh, graph, cut, grey = frame
    struts = partition(mesh, graph, grey)
    bridges = [{"position": [9.0, 8, 7], "length": 3.0, "radius": 1.0}]
    found = topology(mesh, cut, graph, struts, [], bridges)
    assert found["counts"] == {"stubs": 1, "necks": 0, "contacts": 0, "welds": 0, "bridges": 1}
    write_json(tmp_path / "geometry/topology.json", found)
    case = Case.of(
        {"root": tmp_path, "labels": {}, "meso": ["meso9"], "micro": ["micro"], "voxel_um": 20.0}
    )
    write_table(tmp_path / "t.csv", pictures.topology_rows(case))
    rows = list(csv.reader((tmp_path / "t.csv").open()))
    assert [row[0] for row in rows] == ["Kind", "stub", "bridge"]
    assert len(pictures.places(found)["stubs"]) == 1
    layer = pictures.ball(np.array([[1.0, 2, 3], [9, 9, 9]]), "#ff0000")
    assert layer.points.mean(axis=0) == pytest.approx([5, 5.5, 6], abs=1e-6)
    assert layer.faces.max() == len(layer.points) - 1


def test_the_front_page_warns_of_what_there_is():
    counts = {"stubs": 3, "necks": 0, "contacts": 5, "welds": 1}
    (line,) = topology_warnings(counts, ["corotational"])
    assert "3 dangling stubs, 1 weld torn" in line and "necks" not in line
    assert topology_warnings(dict.fromkeys(counts, 0), ["eq10"]) == []
