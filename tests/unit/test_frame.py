"""A frame of beams: its elements, its equilibrium, and what the filter makes of noise."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import ndimage, sparse
from scipy.spatial.transform import Rotation

from addvc.analysis import frame_filter
from addvc.analysis.balance import REFUSALS, balanced, micro_fields, refusal
from addvc.analysis.frame_filter import WEIGHTS, best_fit, judged
from addvc.analysis.strut_table import RAW, Measured
from addvc.correlation.frame_fit import Problem, fitted, mean_square
from addvc.fem.carried import Attached, first_motion
from addvc.fem.frame import Frame, FrameMotion, at_rest, energies, forces, moduli, skew, strains
from addvc.geometry.centre_line import Curve
from addvc.geometry.region import Region
from addvc.geometry.skeleton import FREE_END, Branch, StrutGraph
from addvc.geometry.strut_frame import (
    SHORTEST,
    StrutFrame,
    crossings,
    linked,
    load_frame,
    middles,
    save_frame,
    stations,
    strut_frame,
    widening,
)

NU, SEED = 0.3, 2417
TURN = Rotation.from_rotvec([0.9, -1.7, 0.6])
PIECES = 6


def lattice(cells=2, size=12.0, area=3.0, seed=SEED):
    """A cubic lattice of struts, its junctions off their places, nodes along its struts; its faces
    across x are cut."""
    rng = np.random.default_rng(seed)
    grid = np.argwhere(np.ones((cells + 1,) * 3, dtype=bool))
    corners = size * grid + rng.uniform(-2, 2, grid.shape)
    points, pieces = [corners], []
    count = len(corners)
    for a, one in enumerate(grid):
        for axis in range(3):
            b = np.flatnonzero((grid == one + np.eye(3, dtype=int)[axis]).all(axis=1))
            if len(b) == 0:
                continue
            share = np.linspace(0, 1, PIECES + 1)[1:-1, None]
            points.append(corners[a] + share * (corners[b[0]] - corners[a]))
            chain = [a, *range(count, count + PIECES - 1), b[0]]
            pieces += pairwise(chain)
            count += PIECES - 1
    frame = Frame(
        np.concatenate(points), np.array(pieces), rng.uniform(0.8, 1.2, len(pieces)) * area
    )
    cut = np.zeros(count, dtype=bool)
    cut[: len(grid)] = (grid[:, 0] == 0) | (grid[:, 0] == cells)
    return StrutFrame(frame, cut, size)


def equilibrium(held, compression=0.05, times=8):
    """The lattice pressed along x, its cut nodes clamped: Newton's method, in steps."""
    frame, motion = held.frame, at_rest(held.frame)
    clamped = np.repeat(held.loaded, 6)
    for _ in range(times):
        step = np.zeros((len(frame.points), 6))
        step[held.loaded, 0] = -compression / times * frame.points[held.loaded, 0]
        motion = motion.moved(step)
        for _ in range(6):
            load, stiff = forces(frame, motion, NU)
            inner = np.flatnonzero(~clamped)
            move = np.zeros(len(load))
            move[inner] = sparse.linalg.spsolve(stiff[inner][:, inner].tocsc(), -load[inner])
            motion = motion.moved(move.reshape(-1, 6))
    return motion


def nodes_of(held, per_piece=12, seed=SEED, scatter=0.6):
    """Points of a mesh in the struts of the frame, (k, 3)."""
    rng, frame = np.random.default_rng(seed), held.frame
    piece = np.repeat(np.arange(len(frame.pieces)), per_piece)
    along = rng.random((len(piece), 1)) * frame.chord[piece]
    aside = scatter * rng.standard_normal((len(piece), 3))
    return frame.points[frame.pieces[piece, 0]] + along + aside


@pytest.fixture(scope="module")
def pressed():
    held = lattice()
    return held, equilibrium(held), nodes_of(held)


def noise_of(points, count, size=0.05, seed=SEED):
    """Draws (d, k, 3) that move neighbours alike, over some voxels."""
    rng = np.random.default_rng(seed)
    waves = rng.standard_normal((count, 60, 3)) / 3
    phase, way = rng.uniform(0, 2 * np.pi, (count, 60, 1)), rng.standard_normal((count, 60, 3))
    values = [np.sin(w @ points.T + p).T @ v for w, p, v in zip(waves, phase, way, strict=True)]
    draws = np.array(values)
    return size * draws / np.sqrt(mean_square(draws))


def test_a_rigid_motion_has_no_strain():
    frame = lattice().frame
    moved = FrameMotion(
        TURN.apply(frame.points) + 3, np.tile(TURN.as_matrix(), (len(frame.points), 1, 1))
    )
    assert_allclose(strains(frame, moved)[0], 0, atol=1e-12)
    load, stiff = forces(frame, moved, NU)
    assert_allclose(load, 0, atol=1e-10)
    spin = np.cross([0.3, 0.1, -0.2], moved.positions)
    rigid = np.hstack([spin, np.tile([0.3, 0.1, -0.2], (len(frame.points), 1))]).ravel()
    assert_allclose(stiff @ rigid, 0, atol=1e-10)


def test_stretch_twist_and_bending_are_what_they_are_called():
    frame = Frame(np.array([[0.0, 0, 0], [2, 0, 0]]), np.array([[0, 1]]), np.array([3.0]))
    turn = np.stack([np.eye(3), Rotation.from_rotvec([0.1, 0.0, 0.0]).as_matrix()])
    moved = FrameMotion(frame.points * 1.01, turn)
    found = strains(frame, moved)[0]
    assert_allclose(found, [[0.01, 0, 0, 0.05, 0, 0]], atol=1e-12)
    inertia = 9 / (4 * np.pi)
    expected = 0.5 * 2 * (3 * 0.01**2 + inertia / (1 + NU) * 0.05**2)
    assert_allclose(energies(frame, found, NU), expected)
    assert_allclose(moduli(frame, NU), moduli(frame, NU).swapaxes(1, 2))


def test_forces_are_the_slope_of_the_energy(pressed):
    """Taylor: what is left after the first order falls with the square of the step."""
    held, motion, _ = pressed
    rng = np.random.default_rng(SEED)
    motion = motion.moved(0.05 * rng.standard_normal((len(held.frame.points), 6)))
    step = rng.standard_normal((len(held.frame.points), 6))

    def energy(t):
        return energies(held.frame, strains(held.frame, motion.moved(t * step))[0], NU).sum()

    load, stiff = forces(held.frame, motion, NU)
    assert_allclose((stiff - stiff.T).data, 0, atol=1e-9)
    left = [abs(energy(t) - energy(0) - t * load @ step.ravel()) for t in (1e-3, 5e-4)]
    assert np.log2(left[0] / left[1]) == pytest.approx(2, abs=0.1)


def test_a_cantilever_bends_by_the_cube_of_its_length():
    def tip(pieces):
        x = np.linspace(0, 40, pieces + 1)
        frame = Frame(np.column_stack([x, 0 * x, 0 * x]),
                      np.column_stack([np.arange(pieces), np.arange(1, pieces + 1)]),
                      np.full(pieces, 1.0))  # fmt: skip
        _, stiff = forces(frame, at_rest(frame), NU)
        load = np.zeros(6 * (pieces + 1))
        load[-5] = 1e-6
        return sparse.linalg.spsolve(stiff[6:, 6:].tocsc(), load[6:])[-5]

    exact = 1e-6 * (40**3 / (3 / (4 * np.pi)) + 40 / (0.9 * 0.5 / (1 + NU)))
    errors = [abs(tip(n) / exact - 1) for n in (8, 16)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)


def test_skew_is_a_cross_product():
    a, b = np.random.default_rng(SEED).standard_normal((2, 5, 3))
    assert_allclose(np.einsum("kij,kj->ki", skew(a), b), np.cross(a, b))


def test_points_are_carried_and_their_slopes_are_right(pressed):
    held, motion, points = pressed
    attached = Attached.of(held.frame, points)
    assert_allclose(attached.moved(at_rest(held.frame)), points, atol=1e-12)
    step = np.random.default_rng(SEED).standard_normal((len(held.frame.points), 6))
    slope = (attached.slopes(motion) @ step.ravel()).reshape(-1, 3)
    left = [
        np.abs(attached.moved(motion.moved(t * step)) - attached.moved(motion) - t * slope).max()
        for t in (1e-3, 5e-4)
    ]
    assert np.log2(left[0] / left[1]) == pytest.approx(2, abs=0.1)


def test_the_first_motion_of_a_rigid_one_is_exact(pressed):
    held, _, points = pressed
    found = first_motion(held.frame, points, TURN.apply(points) + 5 - points)
    assert_allclose(found.positions, TURN.apply(held.frame.points) + 5, atol=1e-9)
    assert_allclose(
        found.rotations, np.tile(TURN.as_matrix(), (len(found.rotations), 1, 1)), atol=1e-9
    )


def problem(pressed, noise=0.0):
    held, motion, points = pressed
    attached = Attached.of(held.frame, points)
    return Problem(held, attached, attached.moved(motion) + noise, NU)


@pytest.mark.parametrize("weight", WEIGHTS[[0, 4, -1]])
def test_what_is_in_equilibrium_stays_as_it_is(pressed, weight):
    """Whatever the weight: the energy that holds what nothing else holds hardly counts."""
    found = fitted(problem(pressed), pressed[1], weight)
    assert_allclose(found.positions, pressed[1].positions, atol=2e-3)


def test_noise_that_is_no_equilibrium_is_taken_off(pressed):
    """Strains far more than displacements: the share of stretching is what noise spoils."""
    held, motion, points = pressed
    draws = noise_of(points, 7)
    task = problem(pressed, draws[0])
    start = first_motion(held.frame, points, task.now - points)
    fit = best_fit(task, start, draws[1:])
    loose = fitted(task, start, WEIGHTS[0])
    error = {
        name: strains(held.frame, one)[0][:, :3] - strains(held.frame, motion)[0][:, :3]
        for name, one in (("loose", loose), ("best", fit.motion))
    }
    assert mean_square(error["best"]) < 0.2 * mean_square(error["loose"])
    true = task.attached.moved(motion)
    assert mean_square(task.attached.moved(fit.motion) - true) < 0.6 * mean_square(draws[0])
    assert fit.weight > WEIGHTS[0]


def test_the_error_that_is_foreseen_is_the_error(pressed):
    """What is left of the noise, by the draws, over several noises."""
    draws = noise_of(pressed[2], 12)
    true = problem(pressed).attached.moved(pressed[1])
    actual = []
    for noise in draws[:4]:
        task = problem(pressed, noise)
        found = fitted(task, pressed[1], 1e3)
        actual.append(mean_square(task.attached.moved(found) - true))
    fit = judged(task, found, 1e3, draws[4:])
    assert np.mean(actual) == pytest.approx(fit.kept * mean_square(draws), rel=0.4)


def hinged(pressed, size=0.5):
    """The same motion, and a kink in the middle of each strut, as no elastic one has."""
    held, motion, points = pressed
    rng = np.random.default_rng(SEED + 1)
    share = Attached.of(held.frame, points)
    strut = np.arange(len(held.frame.pieces)) // PIECES
    piece = np.arange(len(points)) // (len(points) // len(held.frame.pieces))
    along = (piece % PIECES + 0.5) / PIECES
    kink = rng.standard_normal((strut.max() + 1, 3))[strut[piece]]
    tent = np.minimum(along, 1 - along)[:, None]
    return share.moved(motion) + size * kink * tent


def test_struts_that_hinge_are_left_as_measured(pressed):
    """A little hinging goes with less weight, or none at all when the filter would do harm."""
    held, _, points = pressed
    draws = noise_of(points, 6)
    for size, known in ((0.0, True), (0.5, False)):
        measured = Measured(points, hinged(pressed, size) + draws[0] - points, draws[1:])
        found, notes = balanced(held, measured, np.ones(len(points)), NU)
        error = mean_square(points + found.u - hinged(pressed, size))
        assert error < 1.01 * mean_square(draws[0])
        assert (notes["weight"] is not None) == known
        assert notes["refused"] == (None if known else "harm")
    assert notes["misfit"] > notes["bound"] and f"{notes['misfit']:.3f} voxel" in refusal(notes)


def test_more_noise_lets_more_misfit_pass(pressed, monkeypatch):
    """The bound is lenient: a filter that would harm at the noise of its draws may help at more."""
    _, motion, points = pressed
    draws, task = noise_of(points, 3), problem(pressed)
    bounds = []
    for times in (1.0, 2.0):
        monkeypatch.setattr(frame_filter, "DOUBTED", times)
        bounds.append(judged(task, motion, 1e3, draws).bound)
    assert bounds[1] == pytest.approx(4 * bounds[0])


def test_a_frame_that_is_loaded_everywhere_is_in_no_equilibrium(pressed):
    held, _, points = pressed
    clamped = StrutFrame(held.frame, np.ones_like(held.loaded), held.span)
    measured = Measured(points, np.zeros_like(points), noise_of(points, 2))
    found, notes = balanced(clamped, measured, np.ones(len(points)), NU)
    assert found is measured and notes["refused"] == "clamped" and "micro.region" in refusal(notes)


def test_without_noise_nothing_is_taken_off(pressed):
    held, _, points = pressed
    measured = Measured(points, np.zeros_like(points), np.zeros((3, *points.shape)))
    found, notes = balanced(held, measured, np.ones(len(points)), NU)
    assert found is measured and notes["refused"] == "noiseless"


def test_what_cannot_be_solved_is_left_as_measured(pressed, monkeypatch):
    """The matrix may be positive definite for the fit, and no longer be when it is judged."""
    held, motion, points = pressed
    draws = noise_of(points, 3)
    monkeypatch.setattr(frame_filter, "solver_or_none", lambda matrix: None)
    assert judged(problem(pressed), motion, 1e3, draws) is None
    monkeypatch.undo()
    monkeypatch.setattr(frame_filter, "judged", lambda *given: None)
    measured = Measured(points, problem(pressed).now - points, draws)
    found, notes = balanced(held, measured, np.ones(len(points)), NU)
    assert found is measured and notes["refused"] == "unsettled"


def test_every_refusal_says_what_to_do():
    notes = {"carrying": 0.2, "nodes": 7, "frame_nodes": 9, "misfit": 0.3, "bound": 0.2}
    for key in REFUSALS:
        assert ";" in refusal(notes | {"refused": key}) and "struts.eq" not in REFUSALS[key]
    assert refusal(notes | {"refused": None}) is None


@pytest.mark.parametrize("radius", [1.3, 3.4, 4.5])
def test_a_strut_is_within_reach_up_to_its_surface(radius):
    """And no farther than its own size: the void of a foam is no strut."""
    held = lattice(cells=1, size=40.0, area=np.pi * radius**2)
    axis = nodes_of(held, scatter=0.0)
    aside = np.random.default_rng(SEED).standard_normal(axis.shape)
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    for times, inside in ((1.4 * radius, True), (2.5 * radius + 3, False)):
        attached = Attached.of(held.frame, axis + times * aside)
        farther = attached.distance > 0.95 * times
        assert (attached.within[farther] == inside).all() and farther.any()


def test_thick_struts_are_filtered_wholly():
    held = lattice(cells=1, size=40.0, area=np.pi * 4.5**2)
    points = nodes_of(held, scatter=2.0)
    draws = noise_of(points, 4)
    measured = Measured(points, draws[0], draws[1:])
    found, notes = balanced(held, measured, np.ones(len(points)), NU)
    assert notes["weight"] is not None
    distance = Attached.of(held.frame, points).distance
    thick = distance < 4.5
    assert (distance[thick] > 3.5).any() and (found.u != measured.u)[thick].all()


def test_a_field_is_balanced_where_the_frame_is(pressed):
    held, motion, points = pressed
    draws = noise_of(points, 5).astype(np.float32)
    task = problem(pressed, draws[0])
    far = np.vstack([points, [[500.0, 0, 0]]])
    u = np.vstack([task.now - points, [[7.0, 0, 0]]])
    more = np.concatenate([draws[1:], np.ones((4, 1, 3), np.float32)], axis=1)
    measured = Measured(far, u, more)
    fields, notes = micro_fields(held, measured, np.ones(len(far)), NU)
    assert list(fields) == ["", RAW] and fields[RAW] is measured
    assert_allclose(fields[""].u[-1], [7, 0, 0])
    true = task.attached.moved(motion) - points
    assert mean_square(fields[""].u[:-1] - true) < 0.7 * mean_square(draws[0])
    assert mean_square(fields[""].draws[:, :-1]) < mean_square(draws)
    assert notes["weight"] in WEIGHTS and notes["misfit_over_noise"] >= 1


def test_without_valid_nodes_or_a_frame_nothing_changes(pressed, caplog):
    held, _, points = pressed
    measured = Measured(points, np.zeros_like(points), noise_of(points, 2))
    found, notes = balanced(held, measured, np.zeros(len(points)), NU)
    assert found is measured and notes["weight"] is None and notes["carrying"] == 0
    assert notes["refused"] == "unseen" and "WARNING" in caplog.text
    assert "0% of the nodes of the frame" in refusal(notes) and refusal(notes) in caplog.text
    assert micro_fields(None, measured, np.ones(len(points)), NU) == ({"": measured}, None)
    nothing = StrutFrame(Frame(np.zeros((0, 3)), np.zeros((0, 2), int), np.zeros(0)),
                         np.zeros(0, bool), 0.0)  # fmt: skip
    assert balanced(nothing, measured, np.ones(len(points)), NU)[1]["refused"] == "clamped"


@pytest.mark.parametrize(("reach", "known"), [(0.3, False), (0.7, True)])
def test_half_of_the_frame_must_have_been_seen(pressed, reach, known):
    """With fewer nodes most of the matrix has no data, which must not be its scale."""
    held, motion, points = pressed
    draws = noise_of(points, 4)
    u = problem(pressed, draws[0]).now - points
    valid = points[:, 0] < reach * points[:, 0].max()
    notes = balanced(held, Measured(points, u, draws[1:]), valid, NU)[1]
    assert (notes["weight"] is not None) == known
    assert (notes["carrying"] >= 0.5) == known
    few = points[:, 0] < 0.3 * points[:, 0].max()
    task = Problem(held, Attached.of(held.frame, points[few]), (points + u)[few], NU)
    assert fitted(task, motion, 1e3) is not None


def cross_image(shape=(48, 48, 48), radius=1.8):
    """Four struts that meet at (24, 24, 24) and end beyond the region; grey levels above the void."""
    middle = np.array([24.0, 24.0, 24.0])
    ways = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    x = np.moveaxis(np.indices(shape), 0, -1) - middle
    along = np.maximum(x @ ways.T, 0)
    away = np.linalg.norm(x[..., None, :] - along[..., None] * ways, axis=-1).min(axis=-1)
    return 80 * np.clip(radius + 0.5 - away, 0, 1), middle, radius


CORNERS = Region(1, 6.0, 42.0, bounds=((4.0, 44.0), (4.0, 44.0)), cut_sides=True)


def blurred_image(excess, blur=0.8):
    return ndimage.gaussian_filter(excess, blur)


def porosity_threshold(excess):
    """Of the blurred image, with the porosity that half of the contrast has as scanned."""
    return float(np.quantile(blurred_image(excess), np.mean(excess <= 40)))


@pytest.mark.parametrize("margin", [6.0, 8.0])
def test_noise_makes_no_struts(margin):
    """The threshold of the blurred image, over its noise: the image as scanned has several times that
    noise, which would fill the void."""
    excess, middle, _ = cross_image()
    limit = porosity_threshold(excess)
    clean = strut_frame(excess, blurred_image(excess), limit, CORNERS)
    white = np.random.default_rng(SEED).standard_normal(excess.shape)
    noisy = excess + limit / margin / blurred_image(white).std() * white
    held = strut_frame(noisy, blurred_image(noisy), limit, CORNERS)
    assert len(held.frame.points) == pytest.approx(len(clean.frame.points), rel=0.25)
    assert np.linalg.norm(held.frame.points - middle, axis=1).min() < 1.0
    assert held.loaded.sum() == clean.loaded.sum()


def test_the_image_as_scanned_is_taken_where_it_has_little_noise():
    """It has struts that blur takes from the threshold."""
    thin, middle, _ = cross_image(radius=0.9)
    held = strut_frame(thin, 0.5 * blurred_image(thin), 40.0, CORNERS)
    assert np.linalg.norm(held.frame.points - middle, axis=1).min() < 1.0


def strut_line(length, radius=2.0):
    """A straight strut along x between junctions at its ends, and its line without these."""
    junctions = np.array([[0.0, 0, 0], [length, 0, 0]])
    branch = Branch(np.linspace(junctions[0], junctions[1], 5), (0, 1))
    inner = np.linspace(0.3 * length, 0.7 * length, 20)
    points = np.column_stack([inner, 0 * inner, 0 * inner])
    curve = Curve.fit((inner[0], inner[-1]), inner, points, np.ones(20))
    return branch, curve, junctions


@pytest.mark.parametrize("length", [0.9, 1.2, 2.0, 3.1, 9.0, 30.0])
def test_no_piece_is_short(length):
    branch, curve, junctions = strut_line(length)
    s = stations(branch, curve, junctions, 2.6)
    pieces = linked(branch, 2 + np.arange(len(s)))
    chain = np.concatenate([junctions, curve(s)])
    assert len(pieces) == len(s) + 1 and len(s) > (length > 2) - 1
    assert np.linalg.norm(np.diff(chain[pieces], axis=1), axis=2).min() >= SHORTEST
    assert len(s) == 0 or len(middles(branch, s)) == len(pieces)
    loop = Branch(branch.points, (0, 0))
    assert len(linked(loop, np.array([], int))) == 0
    assert len(linked(Branch(branch.points, (0, FREE_END)), np.arange(2, 5))) == 3


@pytest.mark.parametrize("inner", [0.5, 2.0, 3.5])
def test_pieces_at_junctions_bend_as_the_profile_of_struts_says(inner):
    """The area that bends as much as the profile over the piece, from that where the piece begins;
    towards a free end there is no junction that would need it."""
    line = np.array([0.0, inner, 5.0, 10 - inner, 10.0])
    both = widening(Branch(np.zeros((2, 3)), (0, 1)), line)
    x = np.linspace(0, inner, 5000) / 10 - 0.5
    profile = 1 + x**2 + 36 * x**4
    assert both[0] * profile[-1] == pytest.approx(np.mean(profile**-2.0) ** -0.5, rel=0.02)
    assert_allclose(both, both[::-1])
    assert_allclose(both[1:-1], 1)
    assert_allclose(widening(Branch(np.zeros((2, 3)), (FREE_END, 1)), line)[:-1], 1)
    assert_allclose(widening(Branch(np.zeros((2, 3)), (0, 1)), 7 * line), both)


def test_junctions_do_not_meet():
    """Lines that cross halfway between two junctions draw both there."""
    junctions = np.array([[0.0, 0, 0], [2.0, 0, 0]])
    branches, curves = [], []
    for end in (0, 1):
        for way in ([0, 1.0, 0], [0, 0, 1.0]):
            s = np.linspace(1, 9, 20)
            points = np.array([1.0, 0, 0]) + s[:, None] * way
            branches.append(Branch(points, (end, FREE_END)))
            curves.append(Curve.fit((s[0], s[-1]), s, points, np.ones(20)))
    moved = crossings(StrutGraph(junctions, np.full(2, 2.0), branches), curves)
    assert np.linalg.norm(moved[1] - moved[0]) >= SHORTEST - 1e-9
    assert np.linalg.norm(moved - junctions, axis=1).min() > 0.3


@pytest.mark.parametrize("radius", [3.4, 4.5])
def test_thick_struts_of_an_image_are_within_reach(radius):
    excess, _, _ = cross_image(shape=(64, 64, 64), radius=radius)
    region = Region(1, 4.0, 44.0, bounds=((4.0, 44.0), (4.0, 44.0)), cut_sides=True)
    held = strut_frame(excess, blurred_image(excess), 40.0, region)
    solid = np.argwhere(excess > 40)
    solid = solid[((solid > 7) & (solid < 41)).all(axis=1)]
    attached = Attached.of(held.frame, solid.astype(float))
    assert (attached.distance > 3.5).any() == (radius > 4) and attached.within.all()


def test_a_frame_is_found_in_the_grey_level(tmp_path):
    excess, middle, radius = cross_image()
    limit = porosity_threshold(excess)
    held = strut_frame(excess, blurred_image(excess), limit, CORNERS)
    frame = held.frame
    assert np.linalg.norm(frame.points[0] - middle) < 0.3
    assert len(frame.pieces) == len(frame.points) - 1
    assert np.median(frame.area) == pytest.approx(np.pi * radius**2, rel=0.1)
    assert held.loaded.sum() >= 4 and not held.loaded[0]
    save_frame(tmp_path / "frame.h5", held)
    back = load_frame(tmp_path / "frame.h5")
    assert_allclose(back.frame.points, frame.points)
    assert back.span == held.span and (back.loaded == held.loaded).all()


def test_no_struts_make_no_frame():
    region = Region(1, 2.0, 18.0, centre=(10.0, 10.0), radius=9.0)
    held = strut_frame(np.zeros((20, 20, 20)), np.zeros((20, 20, 20)), 40.0, region)
    assert len(held.frame.pieces) == 0
