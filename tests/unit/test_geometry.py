"""From image to geometry: cell size, threshold, region, surface, tetrahedra, grid."""

import os

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BSpline

from addvc.errors import GeometryError, MeshError
from addvc.fem.mesh import (
    Mesh,
    boundary_faces,
    cell_volumes,
    check_mesh,
    face_components,
    mean_edge_length,
)
from addvc.geometry.cell_size import (
    autocorrelation,
    central_box,
    measure_cell_size,
    radial_average,
    secondary_peak,
)
from addvc.geometry.grid import grid_lines, hex_grid
from addvc.geometry.meso import meso_mesh
from addvc.geometry.region import (
    ENDS,
    FREE,
    SIDES,
    caps_depth,
    micro_region,
    node_classes,
    worst_slab,
)
from addvc.geometry.stuffing import stuff
from addvc.geometry.surface import (
    Surface,
    capped,
    check_watertight,
    enclosed_volume,
    largest_component,
    marching_cubes,
    remeshed,
)
from addvc.geometry.tets import TetOptions, largest_piece, tetrahedralise
from addvc.geometry.threshold import FLAT, bisect_threshold, check_contrast, noise_of, void_noise
from addvc.images.specimen import Specimen

SHELL_PEAK = 7.7253 / (2 * np.pi)  # second maximum of sin(2 pi r) / (2 pi r), in wavelengths
WHOLE = Specimen("box", 1, -0.5, 83.5, (39.5, 43.5), bounds=((-0.5, 79.5), (-0.5, 87.5)))
CYLINDER = Specimen("cylinder", 1, 5.3, 44.8, (20.0, 22.5), radius=15.0)
BOX = Specimen("box", 2, -0.5, 29.5, (11.0, 12.5), bounds=((2.0, 20.0), (-0.5, 25.5)))


def voxels(shape):
    """Voxel centres (nx, ny, nz, 3)."""
    return np.moveaxis(np.indices(shape).astype(float), 0, -1)


# ----------------------------------------------------------------------------- cell size


def test_autocorrelation_is_the_mean_product_over_the_pairs_of_each_shift(rng):
    box, mask = rng.random((5, 6, 7)).astype(np.float32), rng.random((5, 6, 7)) < 0.7
    grey = np.where(mask, box - box[mask].mean(), 0)
    found = autocorrelation(box, mask)
    for i, j, k in ((0, 0, 0), (1, 2, 3), (3, 0, 5), (0, 4, 1)):
        here, there = np.s_[: 5 - i, : 6 - j, : 7 - k], np.s_[i:, j:, k:]
        mean = np.sum(grey[here] * grey[there]) / np.sum(mask[here] & mask[there])
        assert found[i, j, k] == pytest.approx(mean / grey[mask].var(), abs=1e-4)


def test_shift_without_pairs_is_unknown():
    mask = np.zeros((6, 6, 6), bool)
    mask[:3] = True
    found = autocorrelation(voxels((6, 6, 6))[..., 0].astype(np.float32), mask)
    lag = np.minimum(np.arange(len(found)), len(found) - np.arange(len(found)))
    assert np.isnan(found[lag >= 3]).all()
    assert np.isfinite(found[lag < 3][:, :6, :6]).all()


def test_radial_average_of_a_function_of_the_distance():
    lag = np.minimum(np.arange(60), 60 - np.arange(60))
    distance = np.sqrt(lag[:, None, None] ** 2 + lag[:, None] ** 2 + lag**2)
    radius, curve = radial_average(np.exp(-distance / 8), 24)
    assert_array_equal(radius, np.arange(24))
    assert_allclose(curve, np.exp(-radius / 8), atol=0.03)  # shells are a voxel thick


@pytest.mark.parametrize("length", [14.0, 20.0])
def test_period_of_a_texture_is_found(length):
    """Waves of one length in all directions correlate as sin(k r) / (k r)."""
    rng, grey = np.random.default_rng(6113), np.zeros((80, 84, 88))
    for _ in range(60):
        way = rng.standard_normal(3)
        way *= 2 * np.pi / length / np.linalg.norm(way)
        a, b, c = (np.exp(1j * way[d] * np.arange(n)) for d, n in enumerate(grey.shape))
        turn = np.exp(2j * np.pi * rng.random())
        grey += np.real(turn * a[:, None, None] * b[:, None] * c)
    found = measure_cell_size(grey, WHOLE, "auto")
    assert found["cell_size"] == pytest.approx(SHELL_PEAK * length, rel=0.04)
    assert found["source"] == "measured"


def test_given_cell_size_is_taken(rng):
    found = measure_cell_size(rng.random((80, 84, 88)), WHOLE, 28)
    assert (found["cell_size"], found["source"]) == (28.0, "config")


def test_a_cell_of_few_voxels_is_warned_of(rng, caplog):
    """scans.bin was too high: no strut has voxels enough."""
    measure_cell_size(rng.random((40, 44, 48)), WHOLE, 15.5)
    assert not caplog.text
    measure_cell_size(rng.random((40, 44, 48)), WHOLE, 9.1)
    assert "a cell is 9.1 voxels wide (at least 15; " in caplog.text and "scans.bin" in caplog.text


def test_peak_of_a_known_curve_is_found_between_voxels():
    radius = np.arange(60)
    curve = np.sinc(2 * radius / 23.7)
    assert secondary_peak(radius, curve) == pytest.approx(SHELL_PEAK * 23.7, abs=0.2)


def test_curve_without_a_second_peak_is_an_error():
    radius = np.arange(40)
    with pytest.raises(GeometryError, match=r"no secondary peak up to 39 voxels.*set geometry"):
        secondary_peak(radius, np.exp(-radius / 5))


@pytest.mark.parametrize("specimen", [CYLINDER, BOX], ids=["cylinder", "box"])
def test_central_box_holds_the_specimen_without_its_ends(specimen):
    shape = (41, 50, 46)
    mask = specimen.voxel_mask(shape)
    box = central_box(specimen, shape)
    ends = box[specimen.axis]
    assert (ends.start - specimen.low, specimen.high - (ends.stop - 1)) >= (3, 3)
    rows = np.moveaxis(mask, specimen.axis, 0)[ends].sum()
    assert mask[box].sum() == rows


def test_central_box_of_a_large_specimen_stays_small_and_central():
    large = Specimen("box", 0, -0.5, 599.5, (249.5, 199.5), bounds=((-0.5, 499.5), (-0.5, 399.5)))
    for s, middle in zip(central_box(large, (600, 500, 400)), (299.5, 249.5, 199.5), strict=True):
        assert s.stop - s.start <= 201
        assert (s.start + s.stop - 1) / 2 == pytest.approx(middle, abs=1)


# ----------------------------------------------------------------------------- threshold


def test_bisection_finds_a_known_fraction(rng):
    grey = np.r_[rng.normal(20, 5, 92_000), rng.normal(110, 5, 8_000)]
    gamma, trials = bisect_threshold(grey, 0.92)
    assert 40 < gamma < 90
    assert trials[-1] == (gamma, pytest.approx(0.92, abs=1e-4))


@pytest.mark.parametrize("porosity", [0.1, 0.5, 0.955])
def test_threshold_of_continuous_levels_is_their_quantile(rng, porosity):
    grey = rng.uniform(0, 255, 50_000)
    gamma, _ = bisect_threshold(grey, porosity)
    assert gamma == pytest.approx(np.quantile(grey, porosity), abs=0.1)


@pytest.mark.parametrize("porosity", [0.0, 1.0, 96])
def test_porosity_must_be_a_share(porosity):
    with pytest.raises(GeometryError, match=f"porosity is {porosity}; it must be between 0 and 1"):
        bisect_threshold(np.arange(10.0), porosity)


def test_porosity_that_no_threshold_gives_is_an_error():
    grey = np.repeat([20.0, 110.0], [500, 500])
    with pytest.raises(GeometryError, match=r"porosity of 0.8: the nearest is 0.5000 at grey"):
        bisect_threshold(grey, 0.8)


def test_contrast_of_two_levels(rng):
    grey = np.r_[rng.normal(20, 5, 90_000), rng.normal(110, 5, 10_000)]
    levels = check_contrast(grey, 65)
    assert levels["void"] == pytest.approx(20, abs=0.2)
    assert levels["solid"] == pytest.approx(110, abs=0.3)
    assert levels["noise"] == pytest.approx(5, rel=0.02)


def test_threshold_in_the_noise_is_an_error(rng):
    with pytest.raises(GeometryError, match=r"threshold 24.0 is within 2 .*raise porosity"):
        check_contrast(rng.normal(20, 5, 10_000), 24.0)


# -------------------------------------------------------------------------------- region


def test_region_keeps_its_margin_from_the_platens():
    region = micro_region(CYLINDER, "all", margin=3.0)
    assert (region.low, region.high) == pytest.approx((8.3, 41.8))
    assert not region.cut_sides
    core = micro_region(CYLINDER, {"low": 12, "radius": 9.0})
    assert (core.low, core.high, core.radius, core.cut_sides) == (12, pytest.approx(41.8), 9, True)


def test_region_of_a_box_cuts_its_sides():
    region = micro_region(BOX, "all", margin=3.0)
    assert region.cut_sides
    assert_allclose(region.bounds, [(5, 17), (2.5, 22.5)])


def test_sides_are_cut_or_free_as_is_said():
    field_of_view = micro_region(CYLINDER, "all", 3.0, "cut")
    assert (field_of_view.radius, field_of_view.cut_sides) == (CYLINDER.radius - 3, True)
    own = micro_region(BOX, "all", 3.0, "free")
    assert not own.cut_sides
    assert_allclose(own.bounds, [(-1, 23), (-3.5, 28.5)])
    assert micro_region(BOX, {"radius": 4.0}, 3.0, "free").cut_sides


def test_empty_region_is_an_error():
    with pytest.raises(GeometryError, match=r"\(low = 40\) leaves 1.8 voxels .* 8.3 to 41.8"):
        micro_region(CYLINDER, {"low": 40})


def test_depth_is_the_distance_to_caps_and_sides():
    region = micro_region(CYLINDER, {"low": 12, "high": 40, "radius": 9.0})
    ends, sides = caps_depth(region, np.array([[20.0, 14, 22.5], [20, 41, 32.5]]))
    assert_allclose(ends, [2, -1])
    assert_allclose(sides, [9, -1])


@pytest.mark.parametrize("sides", ["penalised", "free"])
def test_nodes_of_a_cut_box_are_told_apart(box, sides):
    mesh = box((5, 2.5, 2.5), (17, 22.5, 26.5), (4, 6, 8))
    classes = node_classes(mesh, micro_region(BOX, "all"), sides)
    z, on = mesh.points[:, 2], np.zeros(len(mesh.points), bool)
    on[boundary_faces(mesh)] = True
    ends = (z == 2.5) | (z == 26.5)
    assert_array_equal(classes["surface"] == ENDS, ends)
    assert_array_equal(classes["surface"] == SIDES, on & ~ends)
    assert_array_equal(classes["penalised"] == ENDS, ends)
    assert_array_equal(classes["penalised"] != FREE, on if sides == "penalised" else ends)


# ------------------------------------------------------------------------------- surface


def ball(radius, centre=(20.3, 19.6, 20.1), shape=(41, 40, 42)):
    """Grey levels that fall by 30 a voxel, 65 on a sphere."""
    distance = np.linalg.norm(voxels(shape) - centre, axis=-1)
    return np.clip(65 + 30 * (radius - distance), 20, 110).astype(np.float32)


def test_marching_cubes_close_a_sphere_outwards():
    surface = marching_cubes(ball(12.3), 65)
    check_watertight(surface, "sphere")
    assert enclosed_volume(surface) == pytest.approx(4 / 3 * np.pi * 12.3**3, rel=0.02)
    away = np.linalg.norm(surface.points - [20.3, 19.6, 20.1], axis=1)
    assert np.abs(away - 12.3).max() < 0.25  # vertices are kept 0.2 voxel off the voxels


def test_marching_cubes_close_what_touches_the_image_border():
    surface = marching_cubes(np.full((6, 7, 8), 110, np.float32), 65)
    check_watertight(surface, "full image")
    assert enclosed_volume(surface) == pytest.approx(6 * 7 * 8, rel=0.05)  # edges are cut


@pytest.mark.parametrize("place", [12, 21, 30])
def test_the_slab_is_where_meso_dvc_leaves_most(place):
    """Of planes 0 to 49 the specimen has 5.3 to 44.8; that with most points need not be the worst."""
    count = np.full(50, 100.0)
    square = count * np.where(np.abs(np.arange(50) - place) < 3, 9.0, 1.0)
    square[40:43] *= 5
    count[40:43] *= 5  # denser, no worse
    found = worst_slab(CYLINDER, {"height": 8, "radius": 9}, square, count, unit="grey level^2")
    assert found["high"] - found["low"] == pytest.approx(8) and found["radius"] == 9
    assert found["low"] <= place - 2.5 and place + 2.5 <= found["high"]
    region = micro_region(CYLINDER, worst_slab(CYLINDER, {"height": 900}, square, count))
    assert (region.low, region.high) == pytest.approx((8.3, 41.8))


@pytest.mark.parametrize("low", [10.0, 10.4, 10.75])
def test_caps_lie_on_the_plane(low):
    """A cylinder along x cut across: its ends are flat, at `low` and 30.5, and its length exact."""
    distance = np.linalg.norm(voxels((41, 40, 42))[..., 1:] - [19.6, 20.1], axis=-1)
    grey = np.clip(65 + 30 * (8.3 - distance), 20, 110).astype(np.float32)
    region = micro_region(Specimen("cylinder", 0, low, 30.5, (19.6, 20.1), radius=18.0), "all", 0)
    surface = marching_cubes(capped(grey, 65, region, contrast=90), 65)
    check_watertight(surface, "cut cylinder")
    x = surface.points[:, 0]
    assert x.min() == pytest.approx(low, abs=1e-5)
    assert x.max() == pytest.approx(30.5, abs=1e-5)
    flat = surface.points[np.abs(x - low) < 1e-5]
    assert len(flat) > 0.7 * np.pi * 8.3**2


def test_capping_changes_nothing_deep_inside():
    grey = ball(12.3)
    region = micro_region(Specimen("cylinder", 1, 8.0, 32.0, (20.3, 20.1), radius=12.0), "all", 0)
    cut = capped(grey, 65, region, contrast=90)
    depth = np.minimum(*caps_depth(region, voxels(grey.shape)))
    assert_array_equal(cut[depth > 1], grey[depth > 1])
    assert np.all(cut[depth <= 0] <= 65)


def test_only_the_largest_solid_stays():
    grey = np.maximum(ball(8.0, (12, 19, 20)), ball(4.0, (33, 19, 20)))
    kept, figures = largest_component(grey, 65, 20)
    assert figures["components"] == 2
    assert figures["kept_fraction"] == pytest.approx(8 / 9, abs=0.02)
    assert np.sum(grey > 65) - np.sum(kept > 65) == figures["dropped_voxels"]
    assert enclosed_volume(marching_cubes(kept, 65)) == pytest.approx(4 / 3 * np.pi * 512, rel=0.03)


@pytest.mark.parametrize("slope", [1e-5, 1, 200])
def test_the_unit_of_the_grey_level_does_not_matter(slope):
    """Nothing is left of what is dropped, nor is anything made, in attenuations or at 16 bits."""
    grey = slope * np.maximum(ball(8.0, (12, 19, 20)), ball(4.0, (33, 19, 20)))
    kept, _ = largest_component(grey, 65 * slope, 20 * slope)
    mesh = stuff(kept, 65 * slope, 1.2)
    assert face_components(mesh).max() == 0
    surfaces = marching_cubes(kept, 65 * slope), marching_cubes(kept / slope, 65)
    assert_allclose(*(surface.points for surface in surfaces), atol=1e-4)
    assert cell_volumes(mesh).sum() == pytest.approx(enclosed_volume(surfaces[0]), rel=0.02)


def test_no_solid_is_an_error():
    with pytest.raises(GeometryError, match=r"above the threshold 130.0; widen micro.region"):
        largest_component(ball(8.0), 130, 20)


def test_open_and_doubled_surfaces_are_refused():
    surface = marching_cubes(ball(6.0), 65)
    with pytest.raises(GeometryError, match=r"micro: .* not watertight \(6 open and 0 doubled"):
        check_watertight(Surface(surface.points, surface.faces[1:]), "micro")
    with pytest.raises(GeometryError, match=r"not watertight \(0 open and \d+ doubled edges"):
        check_watertight(Surface(surface.points, np.vstack([surface.faces] * 2)), "micro")


def test_remeshing_stays_closed_and_on_the_surface():
    before = marching_cubes(ball(12.3), 65)
    after = remeshed(before, 2.0)
    check_watertight(after, "sphere")
    assert enclosed_volume(after) == pytest.approx(enclosed_volume(before), rel=0.02)
    assert np.abs(np.linalg.norm(after.points - [20.3, 19.6, 20.1], axis=1) - 12.3).max() < 0.4
    corner = after.points[after.faces]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    assert sides.mean() == pytest.approx(2.0, rel=0.15)


# ------------------------------------------------------------------------ tets, meso, grid


def test_tetrahedra_fill_a_sphere_and_leave_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    surface = remeshed(marching_cubes(ball(10.0), 65), 3.0)
    mesh = tetrahedralise(surface, TetOptions(4.0))
    figures = check_mesh(mesh, "sphere", min_dihedral=5)
    assert figures["volume"] == pytest.approx(enclosed_volume(surface), rel=0.03)
    assert os.listdir(tmp_path) == []


def test_largest_piece_is_kept_and_the_rest_counted(box):
    a, b = box((0, 0, 0), (4, 4, 4), (2, 2, 2)), box((6, 0, 0), (16, 4, 4), (5, 2, 2))
    both = Mesh(np.vstack([a.points, b.points]), np.vstack([a.cells, b.cells + len(a.points)]))
    mesh, figures = largest_piece(both)
    assert figures == {"pieces": 2, "dropped_cells": len(a.cells)}
    assert face_components(mesh).max() == 0
    assert cell_volumes(mesh).sum() == pytest.approx(160)


@pytest.mark.parametrize("specimen", [CYLINDER, BOX], ids=["cylinder", "box"])
def test_meso_mesh_has_its_edge_and_the_volume_of_the_specimen(specimen):
    height = specimen.high - specimen.low
    area = np.pi * 15.0**2 if specimen.kind == "cylinder" else 18 * 26
    mesh = meso_mesh(specimen, 8.0)
    check_mesh(mesh, "meso", min_dihedral=5)
    assert mean_edge_length(mesh) == pytest.approx(8.0, rel=0.1)
    assert cell_volumes(mesh).sum() == pytest.approx(area * height, rel=0.03)
    along = mesh.points[:, specimen.axis]
    assert (along.min(), along.max()) == pytest.approx((specimen.low, specimen.high), abs=0.5)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_meso_mesh_of_a_cylinder_is_in_its_place_whatever_its_axis(axis):
    specimen = Specimen("cylinder", axis, 5.0, 45.0, (20.0, 22.5), radius=15.0)
    mesh = meso_mesh(specimen, 6.0)
    assert cell_volumes(mesh).sum() == pytest.approx(np.pi * 15**2 * 40, rel=1e-9)
    middle = np.insert([20.0, 22.5], axis, 25.0)
    assert_allclose((mesh.points.min(0) + mesh.points.max(0)) / 2, middle, atol=0.5)


@pytest.mark.parametrize("specimen", [CYLINDER, BOX], ids=["cylinder", "box"])
def test_meso_mesh_is_the_same_twice_and_well_shaped(specimen):
    first, second = meso_mesh(specimen, 7.0), meso_mesh(specimen, 7.0)
    assert_array_equal(first.points, second.points)
    assert_array_equal(first.cells, second.cells)
    assert check_mesh(first, "meso")["min_dihedral"] > 30


@pytest.mark.parametrize("specimen", [CYLINDER, BOX], ids=["cylinder", "box"])
def test_end_faces_of_a_meso_mesh_keep_away_from_the_platens(specimen):
    along = meso_mesh(specimen, 7.0, margin=5.0).points[:, specimen.axis]
    assert (along.min(), along.max()) == pytest.approx((specimen.low + 5, specimen.high - 5))
    with pytest.raises(MeshError, match=r"meso\.margin 20 \(less than .* lower meso\.margin"):
        meso_mesh(specimen, 7.0, margin=20.0)


def test_a_specimen_too_small_for_a_meso_mesh_is_an_error():
    with pytest.raises(MeshError, match=r"nearest .* too small for it; give smaller meso\.sizes"):
        meso_mesh(CYLINDER, 200.0)


def test_grid_fills_its_lines_without_gap():
    mesh = hex_grid([np.array([0.0, 3, 9]), np.array([1.0, 2, 7, 8]), np.array([-1.0, 5])])
    assert cell_volumes(mesh).min() > 0
    assert cell_volumes(mesh).sum() == pytest.approx(9 * 7 * 6)
    assert_allclose(mesh.points[mesh.cells[3]].mean(axis=0), [6, 1.5, 2])  # last axis fastest


def test_grid_reaches_into_the_platens_it_can_see():
    shape = (41, 50, 46)
    lines = grid_lines(shape, CYLINDER, across=3, along=4, platen=10.0)
    assert_allclose(lines[0], np.linspace(0, 40, 4))
    assert_allclose(lines[1], [0, *np.linspace(5.3, 44.8, 5), 49])
    none = Specimen("cylinder", 1, -0.5, 49.5, (20.0, 22.5), radius=15.0)
    assert_allclose(grid_lines(shape, none, 3, 4, 10.0)[1], np.linspace(0, 49, 5))


@pytest.mark.parametrize("degree", [3, 5])
def test_the_spline_has_less_noise_than_its_voxels(degree):
    """White noise at random places: sum_k B_p(x - k)^2 is B_2p+1(0) on average, along each axis."""
    smooth = 2 * np.random.default_rng(2417).standard_normal((50, 50, 50)).astype(np.float32)
    knots = np.arange(2 * degree + 3) - (degree + 1.0)
    share = BSpline.basis_element(knots)(0.0) ** 1.5
    noise, at_points = void_noise(smooth, np.ones(smooth.shape, bool), 50.0, degree)
    assert noise == pytest.approx(2, rel=0.02)
    assert at_points == pytest.approx(2 * share, rel=0.02)
    assert void_noise(smooth, np.ones(smooth.shape, bool), -50.0, degree) is None


def test_a_flat_void_has_the_noise_of_a_share_of_the_contrast():
    levels = {"void": 20.0, "solid": 120.0, "noise": 0.0}
    assert noise_of(levels, None)["noise"] == noise_of(levels, (1e-9, 1e-9))["noise"] == 100 * FLAT
    assert noise_of(levels | {"noise": 3.0}, None)["noise"] == 3.0
    far = noise_of(levels, (2.0, 1.5))
    assert (far["noise"], far["noise_at_points"]) == (2.0, 1.5)
    assert far["noise_from"] == "void 3 voxels off the solid"
