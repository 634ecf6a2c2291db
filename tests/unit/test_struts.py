"""Struts as objects, and their mechanics under known motions."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from addvc.analysis.strut_energy import KINDS, strut_energy
from addvc.analysis.strut_motion import Beam, frames, integrated, strut_motion
from addvc.analysis.strut_prior import posterior, prior_variances, spread
from addvc.analysis.strut_store import (
    load_partition,
    read_columns,
    save_partition,
    strut_of_cells,
    write_columns,
)
from addvc.analysis.strut_table import (
    GEOMETRY,
    MECHANICS,
    MESO,
    RAW,
    UNDECIDED,
    Measured,
    described,
    foam,
    strut_table,
)
from addvc.analysis.struts import Strut, partition
from addvc.analysis.struts_truth import BEAMS, FIELD, flags, judged, unloaded
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.store import save_solution
from addvc.fem.io import write_vtu
from addvc.fem.mesh import Mesh, cell_volumes
from addvc.geometry.centre_line import Curve, centre_line
from addvc.geometry.lines import resampled
from addvc.geometry.skeleton import FREE_END, Branch, kinks, simplified, strut_graph
from addvc.images.files import write_json
from addvc.report.case import Case
from addvc.report.struts import trusted, tubes
from addvc.report.struts_truth import truth_rows

NU, LENGTH, RADIUS = 0.3, 9.0, 1.1
TURN = Rotation.from_rotvec([0.9, -1.7, 0.6])
SHIFT = np.array([30.0, -4.0, 11.0])
KUHN = np.array([[0, a, a + b, 7] for a, b in ((1, 2), (1, 4), (2, 1), (2, 4), (4, 1), (4, 2))])


def cylinder(count=400, bow=0.0, stations=17, seed=2417):
    """A strut along x with nodes anywhere in it, its line an arc of curvature `bow`, and the places
    (k, 2) of the nodes across it along two normals."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, LENGTH, stations)
    strut = Strut(
        (0, 1), arc(s, bow)[0], np.full(stations, np.pi * RADIUS**2), LENGTH, LENGTH + 3,
        np.arange(count), np.full(count, 1.0), rng.uniform(0, stations - 1, count),
    )  # fmt: skip
    across = RADIUS * np.sqrt(rng.random(count)) * np.exp(2j * np.pi * rng.random(count))
    at = strut.place / (stations - 1) * LENGTH
    return strut, at, np.column_stack([across.real, across.imag])


def arc(s, curvature):
    """Points (k, 3) of an arc in the plane x, y from the origin, and its normals in that plane."""
    angle = curvature * s
    if abs(curvature) < 1e-12:
        return np.column_stack([s, 0 * s, 0 * s]), np.tile([0.0, 1.0, 0.0], (len(s), 1))
    points = np.column_stack([np.sin(angle), 1 - np.cos(angle), 0 * s]) / curvature
    return points, np.column_stack([-np.sin(angle), np.cos(angle), 0 * s])


def placed(s, across, curvature=0.0, stretch=0.0, twist=0.0):
    """Where the nodes at s (k,), across (k, 2) are when the line is an arc, stretched and twisted."""
    line, normal = arc((1 + stretch) * s, curvature / (1 + stretch))
    turned = (across[:, 0] + 1j * across[:, 1]) * np.exp(1j * twist * s)
    return line + turned.real[:, None] * normal + turned.imag[:, None] * np.eye(3)[2]


def fitted(strut, before, after):
    fit = strut_motion(strut, before, after - before)
    assert fit.converged
    return fit, strut_energy(strut, fit, NU)


# ---------------------------------------------------------------------------- the motion


@pytest.mark.parametrize("bow", [0.0, 0.06])
def test_a_rigid_motion_has_no_strain_and_no_energy(bow):
    strut, s, across = cylinder(bow=bow)
    before = placed(s, across, bow)
    fit, energy = fitted(strut, before, TURN.apply(before) + SHIFT)
    assert_allclose(fit.coefficients, 0, atol=1e-9)
    assert_allclose(fit.rotation, TURN.as_matrix(), atol=1e-9)
    assert energy.energies.sum() < 1e-16


@pytest.mark.parametrize("stretch", [-0.02, 0.001])
def test_a_stretch_is_found_and_is_no_bending(stretch):
    strut, s, across = cylinder()
    after = TURN.apply(placed(s, across, stretch=stretch)) + SHIFT
    _, energy = fitted(strut, placed(s, across), after)
    assert_allclose(energy.axial_strain, stretch, rtol=1e-6)
    assert_allclose(energy.energies[1], 0.5 * np.pi * RADIUS**2 * stretch**2 * LENGTH, rtol=1e-6)
    assert_allclose(energy.shares, [0, 1, 0], atol=1e-8)


@pytest.mark.parametrize("curvature", [1e-3, 0.05, 0.15])
def test_bending_is_found_whatever_its_angle_and_is_no_stretch(curvature):
    strut, s, across = cylinder()
    after = TURN.apply(placed(s, across, curvature)) + SHIFT
    _, energy = fitted(strut, placed(s, across), after)
    assert_allclose(energy.curvature, curvature, rtol=2e-3)
    inertia = np.pi * RADIUS**4 / 4
    assert_allclose(energy.energies[0], 0.5 * inertia * curvature**2 * LENGTH, rtol=4e-3)
    assert_allclose(energy.shares, [1, 0, 0], atol=1e-4)


def test_a_change_of_curvature_is_told_from_the_bow_at_rest():
    bow, curvature = 0.04, 0.07
    strut, s, across = cylinder(bow=bow)
    after = TURN.apply(placed(s, across, curvature))
    _, energy = fitted(strut, placed(s, across, bow), after)
    assert_allclose(energy.curvature, curvature - bow, rtol=2e-3)
    assert abs(energy.axial_strain) < 1e-4


def test_twist_is_found_and_is_torsion():
    strut, s, across = cylinder()
    after = TURN.apply(placed(s, across, twist=0.03))
    _, energy = fitted(strut, placed(s, across), after)
    assert_allclose(energy.twist, 0.03, rtol=1e-3)
    torque = np.pi * RADIUS**4 / 2 / (2 * (1 + NU))
    assert_allclose(energy.energies[2], 0.5 * torque * 0.03**2 * LENGTH, rtol=2e-3)
    assert_allclose(energy.shares, [0, 0, 1], atol=1e-6)


def test_bending_to_and_fro_along_the_strut_is_bending():
    """As between two junctions that move past each other without turning."""
    strut, s, across = cylinder(count=2000)
    size = 1e-3
    x = s - LENGTH / 2
    slope = size * (x**2 / 2 - LENGTH**2 / 8)
    shift = size * (x**3 / 6 - x * LENGTH**2 / 8)
    before = placed(s, across)
    after = before + np.column_stack([-across[:, 0] * slope, shift, 0 * s])
    _, energy = fitted(strut, before, after)
    assert_allclose(energy.curvature, size * LENGTH / np.sqrt(12), rtol=2e-2)
    assert energy.shares[0] > 0.99


def test_shear_is_neither_bending_nor_stretching():
    strut, s, across = cylinder()
    before = placed(s, across)
    after = before + 0.01 * np.column_stack([0 * s, s, 0 * s])
    fit, energy = fitted(strut, before, after)
    assert_allclose(np.linalg.norm(fit.coefficients[6:]), 0.01, rtol=1e-3)
    assert abs(energy.axial_strain) < 1e-4
    assert energy.curvature < 1e-6


def test_an_offset_of_the_line_reads_curvature_as_stretch():
    """Why the centre line has to be right: to an offset d belongs an axial strain -k d."""
    strut, s, across = cylinder()
    off = Strut(**{**vars(strut), "points": strut.points + np.array([0, 0.2, 0])})
    _, energy = fitted(off, placed(s, across), placed(s, across, curvature=0.02))
    assert_allclose(energy.axial_strain, -0.02 * 0.2, rtol=2e-2)


def test_pieces_converge_to_the_arc_with_the_square_of_their_length():
    errors = []
    for stations in (5, 9, 17):
        strut, _, _ = cylinder(stations=stations)
        beam = Beam.of(strut)
        values = np.r_[0, 0.1, 0, 0, 0, 0, 0, 0]
        motion = integrated(beam, values, np.zeros(3), np.eye(3))
        chord = np.linalg.norm(motion.positions[-1] - motion.positions[0])
        errors.append(abs(chord - 2 * np.sin(0.05 * LENGTH) / 0.1))
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert_allclose(order, 2, atol=0.1)


def noisy(strut, before, after, count, std=0.05):
    """Fits of `count` measurements of one motion, with noise at every node, whose law is known."""
    fits, draws = [], np.random.default_rng(2416).normal(0, std, (100, *before.shape))
    for seed in range(2417, 2417 + count):
        noise = np.random.default_rng(seed).normal(0, std, before.shape)
        fits.append(strut_motion(strut, before, after + noise - before, draws))
    return fits


def test_the_deviations_are_those_of_repeated_measurements():
    strut, s, across = cylinder(count=300)
    after = placed(s, across, curvature=0.02, stretch=0.005)
    found = [strut_energy(strut, fit, NU) for fit in noisy(strut, placed(s, across), after, 60)]
    strain = np.array([energy.axial_strain for energy in found])
    fits = noisy(strut, placed(s, across), after, 60)
    for covariances in ([fit.covariance for fit in fits], [fit.noise for fit in fits]):
        assert_allclose(np.sqrt(np.mean(covariances, axis=0)[5, 5]), strain.std(), rtol=0.3)
    assert_allclose(strain.mean(), 0.005, rtol=0.1)


def test_draws_of_noise_that_move_whole_ends_widen_the_deviation():
    """Noise that stretches the strut from end to end leaves no scatter of its nodes."""
    strut, s, across = cylinder()
    before = placed(s, across)
    sizes = np.random.default_rng(2417).normal(0, 0.01, 400)
    draws = np.multiply.outer(sizes, s[:, None] * np.eye(3)[0])
    fit = strut_motion(strut, before, 0 * before, draws)
    alone = strut_motion(strut, before, 0 * before)
    std = np.sqrt(fit.noise[5, 5])
    assert_allclose(std, np.sqrt(np.mean(sizes**2)), rtol=1e-6)
    assert np.sqrt(alone.covariance[5, 5]) < 1e-9


def test_noise_alone_has_no_energy_and_a_clear_motion_keeps_its_own():
    strut, s, across = cylinder(count=300)
    before = placed(s, across)
    energies = []
    for curvature in (0.0, 0.05):
        fits = noisy(strut, before, placed(s, across, curvature), 60)
        values = np.array([fit.coefficients for fit in fits])
        areas = np.full(len(fits), strut.area.mean())
        variances = prior_variances(values, np.array([fit.noise for fit in fits]), areas)
        kept = np.mean([strut_energy(strut, fit, NU, variances).energies for fit in fits], axis=0)
        raw = np.mean([strut_energy(strut, fit, NU).energies for fit in fits], axis=0)
        energies.append((kept, raw))
    (kept, raw), (bent, _) = energies
    assert kept.sum() < 0.2 * raw.sum()
    assert_allclose(bent[0], 0.5 * np.pi * RADIUS**4 / 4 * 0.05**2 * LENGTH, rtol=0.05)


def test_the_spread_of_a_foam_is_found_behind_the_noise():
    rng = np.random.default_rng(2417)
    noise = rng.uniform(0.5, 2, 4000) ** 2
    square = rng.normal(0, np.sqrt(1.5**2 + noise)) ** 2
    assert_allclose(spread(square, noise), 1.5**2, rtol=0.1)
    assert spread(np.zeros(9), np.ones(9)) <= 1e-30


def test_struts_that_share_loads_tell_the_same_whatever_their_areas():
    """Stretch and curvature as one over the area: the prior of all struts is that of each half."""
    rng = np.random.default_rng(2417)
    areas = np.repeat([4.0, 16.0], 4000)
    noise = np.eye(8) / areas[:, None, None] ** 2
    values = rng.normal(0, np.sqrt(1 + 1.5**2), (len(areas), 8)) / areas[:, None]
    for part in (slice(None), areas < 9, areas > 9):
        found = prior_variances(values[part], noise[part], areas[part])
        assert_allclose(found, 1.5**2, rtol=0.15)


def test_what_is_measured_well_stays_and_what_is_noise_goes():
    values, variances = np.full(8, 3.0), np.full(8, 4.0)
    mean, covariance = posterior(values, 1e-9 * np.eye(8), variances)
    assert_allclose(mean, values, rtol=1e-8)
    assert_allclose(covariance, 1e-9 * np.eye(8), atol=1e-12)
    mean, covariance = posterior(values, 1e9 * np.eye(8), variances)
    assert_allclose(mean, 0, atol=1e-7)
    assert_allclose(covariance, 4 * np.eye(8), rtol=1e-6)


def test_normals_are_unit_and_turn_with_the_line():
    tangent = np.diff(arc(np.linspace(0, 9, 17), 0.1)[0], axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    t, first, second = frames(tangent)
    for a, b in ((t, first), (t, second), (first, second)):
        assert_allclose(np.einsum("ki,ki->k", a, b), 0, atol=1e-12)
    assert_allclose(np.cross(first, second), t, atol=1e-12)


# ---------------------------------------------------------------------------- the network


def rod_grey(points, ends, radius, contrast=40.0):
    """Grey level at points (..., 3) of a round bar between ends (2, 3), with an edge a voxel wide."""
    axis = ends[1] - ends[0]
    along = np.clip((points - ends[0]) @ axis / (axis @ axis), 0, 1)
    away = np.linalg.norm(points - ends[0] - along[..., None] * axis, axis=-1)
    return contrast * np.clip(radius - away + 0.5, 0, 1)


def solid_mesh(solid):
    """Six tetrahedra for every voxel of a solid."""
    corner = np.argwhere(solid)[:, None] + np.argwhere(np.ones((2, 2, 2)))[:, ::-1]
    points, number = np.unique(corner.reshape(-1, 3), axis=0, return_inverse=True)
    cells = number.reshape(-1, 8)[:, KUHN].reshape(-1, 4)
    mesh = Mesh(points - 0.5, cells)
    flipped = cell_volumes(mesh) < 0
    cells[flipped] = cells[flipped][:, [1, 0, 2, 3]]
    return Mesh(points - 0.5, cells)


SIDE, STEP = 3, 13.0
KNOTS = 6 + STEP * np.argwhere(np.ones((SIDE, SIDE, SIDE)))


def lattice_bars():
    """Ends (54, 2, 3) of the bars between the neighbours of KNOTS."""
    pairs = [
        (a, a + step)
        for a in KNOTS
        for step in STEP * np.eye(3)
        if ((a + step) < KNOTS.max() + 1).all()
    ]
    return np.array(pairs)


@pytest.fixture(scope="module")
def lattice():
    """Grey level above the void, solid and mesh of a cubic lattice of bars of radius 2."""
    size = int(KNOTS.max()) + 7
    points = np.moveaxis(np.indices((size,) * 3).astype(float), 0, -1)
    grey = np.zeros((size,) * 3)
    for ends in lattice_bars():
        grey = np.maximum(grey, rod_grey(points, ends, 2.0))
    solid = grey > 20
    return grey, solid, solid_mesh(solid)


@pytest.fixture(scope="module")
def cut(lattice):
    """The struts of the lattice, and its graph."""
    grey, solid, mesh = lattice
    graph = strut_graph(solid)
    return partition(mesh, graph, grey), graph


def test_a_lattice_has_its_junctions_and_struts(cut):
    struts, graph = cut
    away = np.linalg.norm(KNOTS[:, None] - graph.junctions, axis=2).min(axis=1)
    assert len(graph.junctions) == len(KNOTS)
    assert away.max() < 1.2
    assert len(struts) == len(graph.branches) == len(lattice_bars())
    assert all(strut.whole and not strut.broken for strut in struts)


def test_struts_of_a_lattice_are_where_the_bars_are(cut):
    struts, _ = cut
    bars = lattice_bars()
    middles = np.array([strut.middle for strut in struts])
    away = np.linalg.norm(middles[:, None] - bars.mean(axis=1), axis=2)
    nearest = away.argmin(axis=1)
    assert sorted(nearest) == list(range(len(bars)))
    axis = np.diff(bars[nearest], axis=1)[:, 0] / STEP
    straight = [abs(strut.direction @ a) for strut, a in zip(struts, axis, strict=True)]
    assert min(straight) > 0.99
    for strut in struts:
        assert_allclose(strut.length, STEP, atol=1.2)
        assert_allclose(strut.radius, np.sqrt(9 / np.pi), rtol=0.03)  # 9 voxels a section


def table_under(struts, points, u, valid=None, draws=None):
    """The table of struts under one displacement."""
    valid = np.ones(len(points)) if valid is None else valid
    return strut_table(struts, {"": Measured(points, u, draws)}, valid, NU)


def test_an_affine_field_stretches_every_strut_of_a_lattice_and_bends_none(cut, lattice):
    struts, _ = cut
    points = lattice[2].points
    gradient = 1e-3 * np.array([[2.0, 0, 0], [0, -3, 0], [0, 0, 1]])
    table = table_under(struts, points, points @ gradient)
    along = [strut.direction @ gradient @ strut.direction for strut in struts]
    assert_allclose(table["axial_strain"], along, atol=2e-5)
    assert max(table["bending_share"]) < 1e-2
    assert set(table["dominance"]) == {"stretching"}
    assert sum(table["valid"]) == len(struts)


def test_neighbours_share_a_junction(cut, lattice):
    points = lattice[2].points
    table = table_under(cut[0], points, 0.01 * points)
    near = [{int(n) for n in text.split()} for text in table["neighbours"]]
    assert all(number in near[other] for number, others in enumerate(near) for other in others)
    assert {len(others) for others in near} <= {4, 5, 6, 7, 8, 9, 10}


def test_a_bar_alone_has_no_junction(caplog):
    solid = np.zeros((9, 9, 20), bool)
    solid[3:6, 3:6, 2:18] = True
    with caplog.at_level("WARNING"):
        graph = strut_graph(solid)
    assert "no junction" in caplog.text
    assert len(graph.branches) == 0
    assert partition(solid_mesh(solid), graph, np.zeros(solid.shape)) == []


def test_no_struts_are_a_table_too(tmp_path):
    points = np.zeros((4, 3))
    table = table_under([], points, points)
    save_partition(tmp_path / "struts.h5", [], np.zeros((0, 3)))
    assert load_partition(tmp_path / "struts.h5")[0] == []
    write_columns(tmp_path / "table.csv", table)
    back = read_columns(tmp_path / "table.csv")
    assert set(back) == set(described([""]))
    assert foam(back)["valid"] == 0
    true = {name + FIELD: np.zeros(0) for name in (*KINDS, "bending_share", "axial_strain")}
    assert judged(back, true, {"micro": ""})["micro"]["field"]["struts"] == 0


def test_one_neighbour_is_a_text_as_several_are(tmp_path):
    write_columns(tmp_path / "table.csv", {"neighbours": ["1", "0"], "length": [2.5, 3.0]})
    back = read_columns(tmp_path / "table.csv")
    assert back["neighbours"].tolist() == ["1", "0"]
    assert back["length"].tolist() == [2.5, 3.0]


def test_a_stub_is_no_strut_and_leaves_one_strut_behind():
    line = np.column_stack([np.arange(21.0), np.zeros(21), np.zeros(21)])
    stub = Branch(np.array([[10.0, 0, 0], [10, 1, 0], [10, 2, 0]]), (2, FREE_END))
    branches = [Branch(line[:11], (0, 2)), Branch(line[10:], (2, 1)), stub]
    _, kept = simplified(3, branches, width=3.0)
    assert len(kept) == 1
    assert set(kept[0].ends) == {0, 1}
    assert kept[0].length == 20


def test_junctions_nearer_than_a_radius_are_one():
    step = np.array([[0.0, 0, 0], [1, 0, 0]])
    arms = [Branch(np.linspace(a, b, 9), ends) for a, b, ends in (
        ([0, 0, 0], [-8, 6, 0], (0, 2)), ([0, 0, 0], [-8, -6, 0], (0, 3)),
        ([1, 0, 0], [9, 6, 0], (1, 4)), ([1, 0, 0], [9, -6, 0], (1, 5)))]  # fmt: skip
    merged, kept = simplified(6, [*arms, Branch(step, (0, 1))], width=3.0)
    assert merged[0] == merged[1]
    assert len(kept) == 4


def test_a_line_is_cut_where_it_turns_and_nowhere_else():
    leg = np.arange(13.0)
    corner = np.vstack([np.c_[leg, 0 * leg, 0 * leg], np.c_[12 + 0 * leg, leg, 0 * leg][1:]])
    assert kinks(corner) == [12]
    assert kinks(np.c_[leg, 0.02 * leg**2, 0 * leg]) == []


def test_the_centre_line_of_a_bar_is_found_below_a_voxel():
    """From a line that is off by most of a voxel, in an image with noise."""
    ends = np.array([[5.3, 6.1, 7.4], [20.8, 9.7, 8.2]])
    points = np.moveaxis(np.indices((26, 17, 17)).astype(float), 0, -1)
    grey = rod_grey(points, ends, 1.3) + np.random.default_rng(2417).normal(0, 2, points.shape[:3])
    line = np.linspace(*ends, 60) + np.array([0, 0.5, -0.5])
    length = np.linalg.norm(np.diff(ends, axis=0))
    curve = centre_line(line, (2.0, length - 2), 1.3, grey)
    found = curve(np.linspace(2, length - 2, 20))
    axis = (ends[1] - ends[0]) / length
    off = (found - ends[0]) - np.outer((found - ends[0]) @ axis, axis)
    assert np.linalg.norm(off, axis=1).max() < 0.15


def test_the_line_of_a_branch_as_short_as_it_is_wide_stays_in_it(rng):
    """Its voxels may hardly differ in their arc length, so that a parabola leads anywhere."""
    x = np.indices((24, 24, 24)).reshape(3, -1).T
    ball = 50.0 * (np.linalg.norm(x - 11.5, axis=1) < 4).reshape(24, 24, 24)
    for length in rng.uniform(1.7, 6, 200):
        way = rng.normal(size=3)
        way *= length / np.linalg.norm(way)
        line = resampled(11.5 + rng.uniform(-1, 1, 3) + np.outer([-0.5, 0.5], way))
        bounds = 0.3 * length, 0.7 * length
        curve = centre_line(line, bounds, 1.5, ball + 20 * rng.normal(size=ball.shape))
        assert curve.astray(line) <= 2.5


def test_points_find_their_place_on_a_curve():
    s = np.linspace(0, 10, 40)
    line = np.column_stack([s, 0.01 * s**2, 0 * s])
    curve = Curve.fit((0, 10), s, line, np.ones(40))
    normal = np.column_stack([-0.02 * s, np.ones(40), 0 * s])
    found = curve.projected(line + normal, s + 0.5)
    assert_allclose(found, s, atol=2 * 0.5 * 0.02**3)  # each step takes off curvature x distance


# ------------------------------------------------------------------------ tables and judging


def test_struts_come_back_from_disk(tmp_path, cut, lattice):
    struts, graph = cut
    save_partition(tmp_path / "struts.h5", struts, graph.junctions)
    back, junctions = load_partition(tmp_path / "struts.h5")
    assert_array_equal(junctions, graph.junctions)
    assert len(back) == len(struts)
    for a, b in zip(struts, back, strict=True):
        assert a.ends == b.ends
        assert_array_equal(a.nodes, b.nodes)
        assert_array_equal(a.points, b.points)
        assert a.length == b.length
    owner = strut_of_cells(back, lattice[2])
    assert set(owner) == {-1, *range(len(struts))}


def test_tables_come_back_with_numbers_and_words(tmp_path):
    columns = {"x": [1.5, float("nan")], "dominance": ["bending", UNDECIDED], "valid": [1, 0]}
    write_columns(tmp_path / "t.csv", columns)
    back = read_columns(tmp_path / "t.csv")
    assert_array_equal(back["x"], columns["x"])
    assert list(back["dominance"]) == columns["dominance"]


def test_every_column_has_its_unit_and_meaning(cut, lattice):
    points = lattice[2].points
    fields = {"": Measured(points, 0.01 * points), MESO: Measured(points, 0.02 * points)}
    table = strut_table(cut[0][:3], fields, np.ones(len(points)), NU)
    assert set(table) == set(described(["", MESO]))


def test_the_readme_explains_every_column():
    text = (Path(__file__).parents[2] / "workflow" / "README.md").read_text(encoding="utf-8")
    for name, (unit, meaning) in (GEOMETRY | MECHANICS).items():
        row = next(row for row in text.splitlines() if f"`{name}`" in row and row.startswith("|"))
        assert f"| {unit} | {meaning} |" in row


def test_struts_with_doubtful_nodes_or_a_neck_are_flagged(cut, lattice):
    struts, points = cut[0][:3], lattice[2].points
    valid = np.ones(len(points))
    valid[struts[1].nodes[::3]] = 0
    area = struts[2].area.copy()
    area[8] *= 0.1
    struts = [*struts[:2], Strut(**{**vars(struts[2]), "area": area})]
    table = table_under(struts, points, 0.01 * points, valid)
    assert table["valid"] == [1, 0, 0]
    assert table["flag"] == ["none", "residual", "broken"]
    assert table["bridge"] == [0, 0, 0]
    bridges = [{"position": struts[1].middle.tolist()}]
    fields = {"": Measured(points, 0.01 * points, None)}
    assert strut_table(struts, fields, valid, NU, bridges)["bridge"] == [0, 1, 0]
    assert table["whole"] == [1, 1, 0]


def test_a_strut_far_from_equilibrium_is_flagged(cut, lattice):
    """One that lies on another: no residual tells. Where nothing was balanced none is."""
    struts, points = cut[0], lattice[2].points
    rng, valid = np.random.default_rng(2417), np.ones(len(points))
    balanced = 0.01 * points
    measured = balanced + rng.normal(0, 0.1, points.shape)
    measured[struts[1].nodes] += 2.0
    fields = {"": Measured(points, balanced), RAW: Measured(points, measured)}
    table = strut_table(struts, fields, valid, NU)
    assert_array_equal(np.flatnonzero(np.array(table["valid"]) == 0), [1])
    assert table["flag"][1] == "equilibrium" and table["flag"].count("none") == len(struts) - 1
    fields = {"": Measured(points, measured), RAW: Measured(points, measured)}
    assert all(strut_table(struts, fields, valid, NU)["valid"])


def table_of(energies, valid=None):
    """A table of struts with energies (n, 3)."""
    energies = np.asarray(energies, float)
    columns = dict(zip(KINDS, energies.T, strict=True))
    columns["bending_share"] = energies[:, 0] / energies.sum(axis=1)
    columns["bending_share_std"] = np.full(len(energies), 0.01)
    columns["axial_strain"] = np.sqrt(energies[:, 1])
    columns["dominance"] = np.array(["bending"] * len(energies))
    columns["valid"] = np.ones(len(energies)) if valid is None else np.asarray(valid)
    columns["flag"] = np.where(columns["valid"] > 0, "none", "residual")
    return columns | {"whole": np.ones(len(energies)), "bridge": np.arange(len(energies)) == 0}


def test_the_share_of_the_foam_is_weighted_with_energy_over_valid_struts():
    found = foam(table_of([[9, 1, 0], [0, 90, 0], [0, 0, 5]], valid=[1, 1, 0]))
    assert found["valid"] == 2
    assert found["flagged"] == found["flags"]["residual"] == 1
    assert sum(found["flags"].values()) == found["bridged"] == 1
    assert_allclose(found["bending_share"], 9 / 100)
    assert_allclose(found["stretching_share"], 91 / 100)


def test_a_foam_without_valid_struts_has_no_share():
    assert foam(table_of([[1, 1, 1]], valid=[0]))["bending_share"] is None


def test_what_is_measured_right_is_judged_right():
    rng = np.random.default_rng(2417)
    energies = rng.random((30, 3))
    table = table_of(energies)
    true = {name + end: table[name] for end in (FIELD, BEAMS)
            for name in (*KINDS, "bending_share", "axial_strain", "bending_share_std")}  # fmt: skip
    figures = judged(table, true, {"micro": ""})
    for found in (*figures["micro"].values(), figures["field"]["beams"]):
        assert_allclose(found["bending_share_correlation"], 1)
        assert found["same_class"] == 1
        assert found["axial_strain_rms"] == 0
        assert_allclose(*found["foam"])


def test_struts_without_a_load_are_not_compared():
    energies = np.array([[1.0, 1, 1], [1e-6, 1e-6, 0], [2, 0, 0]])
    columns = {kind + BEAMS: values for kind, values in zip(KINDS, energies.T, strict=True)}
    assert_array_equal(unloaded(columns, BEAMS, np.ones(3)), [False, True, False])


# ------------------------------------------------------------------------------- the figures


def test_tubes_hold_every_strut_between_its_junctions(cut):
    struts, graph = cut
    points, faces, owner = tubes(struts, graph.junctions)
    assert set(owner) == {FREE_END, *range(len(struts))}
    assert faces.max() == len(points) - 1
    first = np.unique(faces[owner == 0])
    away = points[first] - struts[0].middle
    along = away @ struts[0].direction
    across = np.linalg.norm(away - np.outer(along, struts[0].direction), axis=1)
    assert_allclose(np.ptp(along), struts[0].length, atol=0.5)
    assert_allclose(across.max(), struts[0].radius, rtol=0.2)


def test_the_strut_of_a_figure_is_trusted_only_where_all_results_know_it():
    table = table_of([[1, 1, 1], [2, 1, 1], [3, 1, 1]], valid=[1, 1, 0])
    table["bending_share_field"] = np.array([np.nan, 0.5, 0.5])
    sources = {"micro": ("", "k"), "truth": ("_field", "k")}
    assert_array_equal(trusted(table, sources), [False, True, False])


FLAGS = {"struts": 30, "wrong": 2, "wrong_flagged": 1.0, "right_flagged": 0.0}


def test_flags_are_judged_by_the_error_of_the_nodes_of_each_strut(cut, lattice):
    struts, error = cut[0], np.zeros_like(lattice[2].points)
    for number in (0, 3):
        error[struts[number].nodes] = [0, 1.2, 0.9]  # 1.5 voxels
    valid = [1] * len(struts)
    valid[0] = valid[1] = 0
    found = flags(struts, valid, error)
    assert found["struts"] == len(struts) and found["wrong"] == 2
    assert found["wrong_flagged"] == 0.5
    assert found["right_flagged"] == pytest.approx(1 / (len(struts) - 2))
    assert flags(struts, valid, 0 * error)["wrong_flagged"] is None


def test_figures_against_the_truth_become_rows_with_units(tmp_path):
    table = table_of(np.random.default_rng(2417).random((30, 3)))
    names = (*KINDS, "bending_share", "axial_strain", "bending_share_std")
    true = {name + FIELD: table[name] for name in names}
    for state in (1, 2):
        write_json(tmp_path / f"analysis/struts_truth_state{state}.json",
                   judged(table, true, {"micro": "", "meso9": ""}) | {"flags": FLAGS})  # fmt: skip
        result = Solution(np.zeros((4, 3)), [1e-4], state == 1, residual={})
        save_solution(tmp_path / f"dvc/micro_state{state}.h5", result, inverted=0.0)
        write_vtu(tmp_path / f"fields/micro_state{state}.vtu", np.eye(4, 3), np.arange(4)[None],
                  {"valid": np.ones(4)})  # fmt: skip
        write_json(tmp_path / f"struts_state{state}.json", {"foam": {"micro": {"flagged": 3}}})
    labels = {1: "3.4 %", 2: "5.2 %"}
    case = Case.of(
        {
            "root": tmp_path,
            "labels": labels,
            "meso": ["meso9"],
            "micro": ["micro"],
            "voxel_um": 20.0,
        }
    )
    rows = truth_rows(case)
    assert {len(row) for row in rows} == {6}
    verdicts = ["converged, 3 struts flagged", "not converged, 3 struts flagged"]
    assert rows[0][4:] == [f"3.4 %: {verdicts[0]}", f"5.2 %: {verdicts[1]}"]
    found = next(row for row in rows if row[2] == "correlation of the share of bending")
    assert found[4:] == ["1", "1"]
    assert next(row for row in rows if row[2] == "share of these that is flagged")[4:] == ["1", "1"]
