"""Struts that the threshold breaks are put back, others are not made up; lengths in voxels."""

import numpy as np
import pytest
from scipy import ndimage

from addvc.fem.mesh import check_mesh
from addvc.geometry.bridges import LINKED, bridged
from addvc.geometry.region import Region
from addvc.geometry.skeleton import FREE_END, strut_graph
from addvc.geometry.stuffing import stuff
from addvc.geometry.surface import region_solid
from addvc.geometry.tets import largest_piece

SHAPE = (60, 40, 40)
LEVELS = {"void": 0.0, "solid": 100.0, "threshold": 50.0}
REGION = Region(0, 2.0, 57.0, bounds=((2.0, 37.0), (2.0, 37.0)), cut_sides=True)
RADIUS, SIZE = 1.6, 1.2
LEFT, RIGHT = (14.0, 20.0, 20.0), (46.0, 20.0, 20.0)
FEET = [(LEFT, (0, 4, 8)), (LEFT, (0, 36, 30)), (RIGHT, (60, 5, 30)), (RIGHT, (60, 36, 8)),
        (LEFT, (0, 20, 40)), (RIGHT, (60, 20, 40))]  # fmt: skip
HELD = [((0, 4, 8), (60, 5, 30))]  # holds both sides together, away from the strut in between


def rods(lines, depth=None):
    """Grey levels of rods, 0 to 100, 50 at their surface, those beyond it in proportion to `depth`:
    a function of x (nx, ny, nz, 3) that is 1 where the rods are as they are."""
    x = np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), -1).astype(float)
    away = np.full(SHAPE, np.inf)
    for a, b in np.asarray(lines, dtype=float):
        t = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        away = np.minimum(away, np.linalg.norm(x - a - t[..., None] * (b - a), axis=-1))
    grey = (50 - 30 * (away - RADIUS)).clip(0, 100)
    return (grey if depth is None else grey * depth(x)).astype(np.float32)


def faint(share, low=28.5, high=31.5):
    """The grey level between two x falls to a share of it."""
    return lambda x: np.where((x[..., 0] > low) & (x[..., 0] < high), share, 1.0)


def broken(share, low=28.5, high=31.5):
    """A strut along x between two feet, with a gap that leaves a share of its grey level."""
    strut = rods([(LEFT, RIGHT)], faint(share, low, high))
    return np.maximum(strut, rods(FEET + HELD))


def pieces(grey):
    return ndimage.label(grey > LEVELS["threshold"])[1]


def whole_struts(grey):
    return sum(FREE_END not in b.ends for b in strut_graph(grey > LEVELS["threshold"]).branches)


def test_a_broken_strut_is_one_again_with_a_mesh_in_one_piece():
    grey = broken(0.45)
    raised, rows = bridged(grey, grey, LEVELS, REGION, SIZE)
    (row,) = rows
    assert row["position"] == pytest.approx([30, 20, 20], abs=1)
    assert np.abs(row["direction"]) == pytest.approx([1, 0, 0], abs=0.1)
    assert row["length"] == pytest.approx(3, abs=1.5)
    assert LINKED <= row["radius"] <= RADIUS + 0.1
    before, after = (region_solid(g, LEVELS, REGION, 0.1)[0] for g in (grey, raised))
    assert whole_struts(after) == whole_struts(before) + 1
    mesh, _ = largest_piece(stuff(after, LEVELS["threshold"], SIZE))
    check_mesh(mesh, "bridged", 5.0)
    x, away = mesh.points[:, 0], np.linalg.norm(mesh.points[:, 1:] - 20, axis=1)
    at_gap = (x > 29) & (x < 31) & (away < 4)
    assert at_gap.sum() > 10
    assert away[at_gap].max() == pytest.approx(max(row["radius"], LINKED), abs=0.5)


def test_only_what_is_near_the_bridge_is_raised():
    grey = broken(0.45)
    raised, _ = bridged(grey, grey, LEVELS, REGION, SIZE)
    changed = np.argwhere(raised != grey)
    assert (raised >= grey).all() and len(changed)
    assert np.abs(changed - [30, 20, 20]).max() < 6
    assert raised.max() <= max(grey.max(), LEVELS["solid"])


def test_two_struts_with_nothing_between_stay_two():
    for gap in (0.0, 0.3):  # below the lower threshold there is no strut
        grey = broken(gap)
        raised, rows = bridged(grey, grey, LEVELS, REGION, SIZE)
        assert rows == []
        np.testing.assert_array_equal(raised, grey)
    apart = rods([((0, 10, 20), (60, 10, 20)), ((0, 30, 20), (60, 30, 20))])
    raised, rows = bridged(apart, apart, LEVELS, REGION, SIZE)
    assert rows == [] and pieces(raised) == 2


def test_a_whole_foam_is_left_as_it_is():
    grey = broken(1.0)
    raised, rows = bridged(grey, grey, LEVELS, REGION, SIZE)
    assert rows == []
    np.testing.assert_array_equal(raised, grey)


def test_a_strut_that_ends_in_the_bulk_is_not_continued():
    stub = rods([(LEFT, (30, 20, 20))], faint(0.45, 22, 60))
    grey = np.maximum(stub, rods(FEET + HELD))
    assert bridged(grey, grey, LEVELS, REGION, SIZE)[1] == []


def test_what_hung_by_faint_gaps_only_is_kept():
    strut = rods(
        [(LEFT, RIGHT)], lambda x: np.where(np.abs(np.abs(x[..., 0] - 30) - 6) < 2, 0.45, 1)
    )
    grey = np.maximum(strut, rods(FEET + HELD))
    raised, rows = bridged(grey, grey, LEVELS, REGION, SIZE)
    assert len(rows) == 1 and rows[0]["length"] > 12
    assert pieces(grey) > pieces(raised)


def test_two_runs_give_the_same_bridges():
    grey = broken(0.45)
    (one, rows), (other, again) = (bridged(grey, grey, LEVELS, REGION, SIZE) for _ in range(2))
    assert rows == again
    np.testing.assert_array_equal(one, other)


def test_a_coarser_lattice_has_thicker_rods():
    grey = broken(0.45)
    fine, coarse = (bridged(grey, grey, LEVELS, REGION, size)[1] for size in (1.2, 3.0))
    assert coarse[0]["radius"] >= 0.65 * 3.0 > fine[0]["radius"]


def test_a_bridge_is_thinnest_where_the_image_is_faintest():
    strut = rods([(LEFT, RIGHT)], faint(0.47, 27.5, 34.5))
    strut[33] *= 0.93
    grey = np.maximum(strut, rods(FEET + HELD))
    (row,) = bridged(grey, grey, LEVELS, REGION, SIZE)[1]
    assert row["position"] == pytest.approx([31, 20, 20], abs=0.5)
    assert row["thinnest"] == pytest.approx([33, 20, 20], abs=1.1)
