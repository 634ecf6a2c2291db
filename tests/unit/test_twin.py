"""The synthetic test: invariants of the foam, its motion and the truth; images against the truth."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
import tifffile
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from addvc import twin
from addvc.twin.motion import Motion, at_rest
from addvc.twin.store import load_history, load_struts
from addvc.twin.struts import platen_nodes

SEED = 2417
CLEAN = {"noise": 0.0, "cupping": 0.0, "rings": 0.0, "drift": 0.0, "dtype": "float32"}


@pytest.fixture(scope="module")
def options():
    return twin.TwinOptions(size="tiny", seed=SEED, **CLEAN)


@pytest.fixture(scope="module")
def foam(options):
    return twin.make_foam(options)


@pytest.fixture(scope="module")
def compressed(foam, options):
    return twin.compress(foam, options)


@pytest.fixture(scope="module")
def motions(compressed):
    return compressed[0]


@pytest.fixture(scope="module")
def truth(foam, motions, options):
    return twin.Truth(foam, motions, (0.0, *options.strains))


@pytest.fixture(scope="module")
def scans(foam, motions, options):
    return [twin.image(foam, m, options, s) for s, m in enumerate(motions)]


def solid_points(foam, count, rng):
    """Points within the struts, more than 4 voxels from the platens."""
    e = rng.integers(0, len(foam.elements), 3 * count)
    a, b = foam.nodes[foam.elements[e]].swapaxes(0, 1)
    points = a + rng.random((len(e), 1)) * (b - a) + rng.uniform(-0.6, 0.6, (len(e), 3))
    y = points[:, 1]
    return points[(y > foam.body.low + 4) & (y < foam.body.high - 4)][:count]


# ------------------------------------------------------------------------------- options


def test_unknown_key_is_rejected_with_the_known_ones():
    with pytest.raises(ValueError, match=r"unknown twin keys \['nose'\].*noise"):
        twin.TwinOptions.from_config({"nose": 3.0})


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"size": "huge"}, "none of"),
        ({"strains": (0.1, 0.05)}, "must increase"),
        ({"dtype": "int8"}, "none of"),
        ({"porosity": 0.3}, "outside"),
        ({"cell_size": 60.0, "size": "tiny"}, "outside"),
        ({"bin": 0}, "integer"),
    ],
)
def test_values_out_of_range_are_rejected(wrong, message):
    with pytest.raises(ValueError, match=message):
        twin.TwinOptions(**wrong)


def test_config_lists_become_tuples():
    assert twin.TwinOptions.from_config({"strains": [0.01, 0.02]}).strains == (0.01, 0.02)


# ---------------------------------------------------------------------------------- foam


def test_same_seed_gives_the_same_bytes_and_another_seed_does_not(foam, options):
    again = twin.make_foam(options)
    for name in ("nodes", "elements", "radii", "director", "strut", "kind"):
        assert getattr(again, name).tobytes() == getattr(foam, name).tobytes(), name
    other = twin.make_foam(replace(options, seed=SEED + 1))
    assert other.nodes.tobytes() != foam.nodes.tobytes()


def test_solid_fraction_is_one_minus_porosity(foam, options, scans):
    assert twin.solid_fraction(foam) == pytest.approx(1 - options.porosity, rel=0.01)
    body = foam.body
    grid = np.stack(np.meshgrid(*map(np.arange, body.shape), indexing="ij"), axis=-1)
    inner = body.inside(grid) & (np.abs(grid[..., 1] - body.centre[1]) < body.height / 2 - 4)
    seen = (scans[0][inner].mean() - 20) / 90
    assert seen == pytest.approx(1 - options.porosity, rel=0.15)  # ends of struts are elsewhere


def test_foam_is_one_piece_between_its_platens(foam):
    parts = np.arange(len(foam.nodes))
    for _ in range(200):
        low = parts[foam.elements].min(axis=1)
        for end in foam.elements.T:
            np.minimum.at(parts, end, low)
    assert np.all(parts == 0)
    assert foam.nodes[:, 1].min() >= foam.body.low - 1e-9
    assert foam.nodes[:, 1].max() <= foam.body.high + 1e-9


def test_struts_are_thin_at_mid_span_and_thick_at_nodes(foam):
    thinnest = [2 * foam.radii[foam.strut == s].min() for s in range(foam.strut.max() + 1)]
    thickest = 2 * foam.radii[foam.kind[foam.elements] == 0]
    assert 1.7 < np.median(thinnest) < 2.5
    assert 3.0 < np.median(thickest) < 3.8


def test_directors_are_normal_to_their_elements(foam):
    along = np.diff(foam.nodes[foam.elements], axis=1)[:, 0]
    assert np.abs(np.sum(along * foam.director, axis=1)).max() < 1e-12
    assert np.linalg.norm(foam.director, axis=1) == pytest.approx(1.0)


# -------------------------------------------------------------------------------- motion


def test_motion_starts_at_rest_follows_the_platens_and_stays_between_them(foam, motions, options):
    assert np.array_equal(motions[0].positions, foam.nodes)
    low, high = platen_nodes(foam)
    for motion, strain in zip(motions[1:], options.strains, strict=True):
        move = np.array([0, -strain * foam.body.height, 0])
        assert motion.platens[1] - foam.body.high == pytest.approx(move[1])
        assert np.allclose(motion.positions[low], foam.nodes[low])
        assert np.allclose(motion.positions[high], foam.nodes[high] + move)
        y = motion.positions[:, 1]
        assert y.min() >= motion.platens[0] - 0.1  # what the penalty lets in
        assert y.max() <= motion.platens[1] + 0.1
        assert np.allclose(np.linalg.det(motion.rotations), 1)


def test_struts_stay_inside_the_image(foam, motions):
    top = np.array(foam.body.shape) - 0.5
    for motion in motions:
        assert np.all(motion.positions > 0.5)
        assert np.all(motion.positions < top - 1)


# --------------------------------------------------------------------------------- truth


def rigid(foam):
    turn = Rotation.from_rotvec([0.3, -0.4, 0.2]).as_matrix()
    shift = np.array([1.5, -2.0, 0.7])
    positions = foam.nodes @ turn.T + shift
    rotations = np.broadcast_to(turn, (len(foam.nodes), 3, 3))
    return turn, shift, Motion(positions, rotations, (foam.body.low, foam.body.high))


def test_rigid_motion_is_reproduced_exactly(foam):
    turn, shift, motion = rigid(foam)
    truth = twin.Truth(foam, [at_rest(foam), motion], (0.0, 0.1))
    x = solid_points(foam, 2000, np.random.default_rng(SEED))
    assert np.abs(truth.displacement(x, 1) - (x @ turn.T + shift - x)).max() < 1e-9
    assert np.abs(truth.displacement(x, 0)).max() < 1e-12


def test_points_far_from_struts_move_rigidly_too(foam):
    turn, shift, motion = rigid(foam)
    truth = twin.Truth(foam, [at_rest(foam), motion], (0.0, 0.1))
    x = np.random.default_rng(SEED).uniform(15, 55, (500, 3))
    assert np.abs(truth.displacement(x, 1) - (x @ turn.T + shift - x)).max() < 1e-9


def test_affine_motion_of_the_nodes_is_met_at_the_nodes(foam):
    gradient = np.array([[0.01, 0.02, 0.0], [0.0, -0.03, 0.0], [0.0, 0.01, 0.012]])
    motion = replace(at_rest(foam), positions=foam.nodes @ (np.eye(3) + gradient).T)
    truth = twin.Truth(foam, [at_rest(foam), motion], (0.0, 0.03))
    y = foam.nodes[:, 1]
    x = foam.nodes[(y > foam.body.low + 4) & (y < foam.body.high - 4)]
    error = np.linalg.norm(truth.displacement(x, 1) - x @ gradient.T, axis=1)
    assert np.median(error) < 1e-3
    assert error.max() < 0.05


def test_truth_moves_junctions_with_their_nodes(foam, motions, truth):
    at = np.flatnonzero(foam.kind == 0)
    y = foam.nodes[at, 1]
    at = at[(y > foam.body.low + 3) & (y < foam.body.high - 3)]
    for state in (1, 4):
        expected = motions[state].positions[at] - foam.nodes[at]
        error = np.linalg.norm(truth.displacement(foam.nodes[at], state) - expected, axis=1)
        assert np.median(error) < 1e-3
        assert error.max() < 0.3


def test_truth_is_continuous_across_struts_and_towards_the_platens(foam, truth):
    rng = np.random.default_rng(SEED)
    centres = np.r_[twin.junctions(foam), foam.nodes[np.concatenate(platen_nodes(foam))]]
    x = np.repeat(centres, 40, axis=0)
    x = x + rng.uniform(-2, 2, x.shape)
    step = 1e-5 * rng.standard_normal(x.shape)
    jump = np.linalg.norm(truth.displacement(x + step, 4) - truth.displacement(x, 4), axis=1)
    assert jump.max() < 2e-3  # a slope of at most 100


def test_platens_move_rigidly(foam, truth):
    rng = np.random.default_rng(SEED)
    x = rng.uniform(0, 70, (200, 3))
    x[:100, 1] = rng.uniform(0, foam.body.low, 100)
    x[100:, 1] = rng.uniform(foam.body.high, 83, 100)
    u = truth.displacement(x, 3)
    assert np.all(u[:100] == 0)
    assert np.allclose(u[100:], [0, truth.platens[3, 1] - foam.body.high, 0])


def test_strut_gives_index_unit_tangent_and_signed_distance(foam, truth):
    middle = foam.nodes[foam.elements].mean(axis=1)
    index, tangent, distance = truth.strut(middle)
    along = np.diff(foam.nodes[foam.elements], axis=1)[:, 0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    own = index == foam.strut
    assert own.mean() > 0.95
    assert np.linalg.norm(tangent, axis=1) == pytest.approx(1.0)
    assert np.median(np.abs(np.sum(tangent * along, axis=1))[own]) > 0.999
    assert np.all(distance < 0)
    assert truth.strut(foam.body.centre[None] * [1, 1, 0])[2][0] > 2


def test_wrong_points_and_states_are_named(truth):
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        truth.displacement(np.zeros(3), 1)
    with pytest.raises(ValueError, match="state 9 is outside 0 to 4"):
        truth.displacement(np.zeros((1, 3)), 9)
    assert truth.displacement(np.zeros((0, 3)), 1).shape == (0, 3)


# -------------------------------------------------------------------------------- images


def test_images_follow_the_truth(foam, truth, scans):
    body = foam.body
    x = np.argwhere(scans[0] > 65)
    x = x[(x[:, 1] > body.low + 1) & (x[:, 1] < body.high - 1)]
    for state in range(1, 5):
        moved = x + truth.displacement(x, state)
        there = map_coordinates(scans[state], moved.T, order=3, mode="nearest")
        residual = scans[0][tuple(x.T)] - there
        still = scans[0][tuple(x.T)] - scans[state][tuple(x.T)]
        print(f"state {state}: residual std {residual.std():.2f}, {still.std():.1f} at u = 0")
        assert residual.std() < 1.6  # a sub-voxel shift alone gives 0.9 to 1.5
        assert still.std() > 20


def test_platens_are_seen_where_the_truth_puts_them(motions, scans):
    for motion, scan in zip(motions, scans, strict=True):
        profile = scan[2:5, :, 2:5].mean(axis=(0, 2))  # a corner: air between the platens
        thickness = np.clip((profile - 20) / 130, 0, 1)
        half = len(profile) // 3
        assert thickness[:half].sum() - 0.5 == pytest.approx(motion.platens[0], abs=0.01)
        high = len(profile) - 0.5 - thickness[half:].sum()
        assert high == pytest.approx(motion.platens[1], abs=0.01)


def test_binned_fine_scan_is_the_coarse_scan(foam, motions, options):
    sharp = replace(options, psf=0.0)
    coarse = twin.image(foam, motions[2], sharp, 2)
    fine = twin.image(foam, motions[2], replace(sharp, bin=2), 2)
    nx, ny, nz = coarse.shape
    binned = fine.reshape(nx, 2, ny, 2, nz, 2).mean(axis=(1, 3, 5))
    assert fine.shape == (2 * nx, 2 * ny, 2 * nz)
    assert np.std(binned - coarse) < 0.5
    shifted = np.roll(binned, 1, axis=0) * 0.5 + binned * 0.5  # half a voxel along x
    assert np.std(shifted - coarse) > 4 * np.std(binned - coarse)


def test_noise_has_its_deviation_and_depends_on_seed_and_state(foam, motions, options):
    noisy = replace(options, noise=4.0)
    clean = twin.image(foam, motions[0], options, 0)
    noise = [twin.image(foam, motions[0], noisy, s) - clean for s in (0, 0, 1)]
    assert noise[0].std() == pytest.approx(4.0, rel=0.02)
    assert np.array_equal(noise[0], noise[1])
    assert abs(np.corrcoef(noise[0].ravel(), noise[2].ravel())[0, 1]) < 0.01
    assert np.corrcoef(noise[0][1:].ravel(), noise[0][:-1].ravel())[0, 1] > 0.1


def test_artefacts_are_as_large_as_asked(foam, motions, options):
    clean = twin.image(foam, motions[0], options, 0)
    rings = twin.image(foam, motions[0], replace(options, rings=1.0), 0) - clean
    assert 0.7 < rings.std() < 1.3
    cupped = twin.image(foam, motions[0], replace(options, cupping=0.04), 0) / clean
    assert cupped.min() == pytest.approx(0.96, abs=1e-3)
    assert cupped.max() == pytest.approx(1.0, abs=1e-6)
    drifted = twin.image(foam, motions[0], replace(options, drift=0.01), 3) / clean
    assert 0 < abs(drifted.mean() - 1) <= 0.01


def test_data_types_keep_the_grey_levels(foam, motions, options):
    exact = twin.image(foam, motions[0], options, 0)
    byte = twin.image(foam, motions[0], replace(options, dtype="uint8"), 0)
    word = twin.image(foam, motions[0], replace(options, dtype="uint16"), 0)
    assert (byte.dtype, word.dtype) == (np.uint8, np.uint16)
    assert np.abs(byte - exact).max() <= 0.5
    assert np.abs(word / 100 - exact).max() <= 0.006


# -------------------------------------------------------------------------------- files


def test_scan_is_written_zyx(tmp_path):
    volume = np.arange(4 * 5 * 6, dtype=np.uint8).reshape(4, 5, 6)
    twin.write_scan(tmp_path / "scans" / "a.tif", volume)
    pages = tifffile.imread(tmp_path / "scans" / "a.tif")
    assert pages.shape == (6, 5, 4)
    assert np.array_equal(pages.transpose(2, 1, 0), volume)
    assert [p.name for p in (tmp_path / "scans").iterdir()] == ["a.tif"]


def test_foam_motions_and_truth_come_back_from_disk(tmp_path, foam, compressed, truth, options):
    motions, history = compressed
    twin.save_foam(tmp_path / "foam.h5", foam)
    assert twin.load_foam(tmp_path / "foam.h5").body == foam.body
    path = tmp_path / "truth.h5"
    twin.save_motions(path, foam, motions, options, history)
    back = twin.load_motions(path)
    assert all(
        np.array_equal(a.rotations, b.rotations) and a.platens == b.platens
        for a, b in zip(back, motions, strict=True)
    )
    x = solid_points(foam, 100, np.random.default_rng(SEED))
    loaded = twin.Truth.load(path)
    assert np.array_equal(loaded.displacement(x, 2), truth.displacement(x, 2))
    assert loaded.strains == (0.0, *options.strains)
    assert np.array_equal(loaded.platens, truth.platens)
    assert np.array_equal(load_history(path)["steps"], [step.steps for step in history])
    final = load_struts(path, len(motions) - 1)
    assert final.bending.sum() == pytest.approx(history[-1].bending)


def test_interrupted_write_leaves_no_file(tmp_path, foam, options):
    with pytest.raises(AttributeError):
        twin.save_motions(tmp_path / "truth.h5", foam, [None], options)
    assert not (tmp_path / "truth.h5").exists()
    with pytest.raises(FileNotFoundError):
        h5py.File(tmp_path / "truth.h5")
