"""Starts that any mesh may take, and the choice among them."""

from dataclasses import asdict

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from addvc.correlation import meso
from addvc.correlation.candidates import candidate, shortening
from addvc.correlation.clear import clear_voxels
from addvc.correlation.cutoff import Ladder
from addvc.correlation.gauss_newton import Solution, rms
from addvc.correlation.meso import MesoOptions, meso_dvc, meso_system
from addvc.correlation.meso_start import chosen_register
from addvc.correlation.register import Stop, register
from addvc.correlation.spline_grid import grid_over
from addvc.correlation.store import save_field, save_solution
from addvc.correlation.ultimate import fft_shift
from addvc.correlation.uncertainty import Noise
from addvc.errors import CorrelationError
from addvc.fem import solver
from addvc.fem.io import write_mesh
from addvc.images.scans_store import save_volume
from addvc.images.spline import interpolating_coefficients, spline_value

AXIS = 1
SLOPE = np.array([[0.01, 0.03, 0], [-0.02, -0.05, 0.01], [0, 0.02, 0.04]])
STEP = np.array([[-0.02, 0, 0.01], [0.01, -0.03, 0], [0, 0.01, 0.02]])
SHIFT = np.array([0.3, -0.4, 0.2])


def between(low, high, grey=90, shape=(24, 40, 24)):
    """An image with bright platens up to `low` and from `high` on, and void between."""
    y = np.arange(shape[AXIS]) + 0.5
    row = np.where((y < low) | (y > high), 200.0, 20.0) + 5 * np.sin(y)
    image = np.broadcast_to(row[None, :, None], shape).astype(np.float32).copy()
    image[::6, low:high] = grey
    return image


@pytest.fixture
def source(tmp_path, box):
    """The files of a job: affine displacements of the state before and of the step."""
    mesh = box((0, 0, 0), (23, 39, 23), (3, 4, 3))
    grid = grid_over((24, 40, 24), 8.0)
    names = ("finest.vtu", "previous.h5", "step.h5", "freeform.h5", "reference.h5",
             "deformed_before.h5", "deformed.h5")  # fmt: skip
    files = {name.split(".")[0]: str(tmp_path / name) for name in names}
    write_mesh(files["finest"], mesh)
    save_field(files["previous"], mesh.points @ SLOPE.T)
    for name in ("step", "freeform"):
        affine = (grid.control_points() @ STEP.T).reshape(-1, 3)
        save_solution(files[name], Solution(affine, [], True), grid=asdict(grid))
    for name, faces in (
        ("reference", (5, 35)),
        ("deformed_before", (6, 34)),
        ("deformed", (7, 32)),
    ):
        save_volume(files[name], between(*faces))
    return files


@pytest.fixture
def points(rng):
    return rng.uniform(4, [20, 35, 20], (200, 3))


def test_affine_starts_are_exact(source, points):
    before = points @ SLOPE.T
    assert_allclose(candidate("freeform", source, AXIS)(points), points @ STEP.T, atol=1e-10)
    assert_allclose(candidate("previous", source, AXIS)(points), before, atol=1e-10)
    composed = before + (points + before) @ STEP.T
    assert_allclose(candidate("composed", source, AXIS)(points), composed, atol=1e-10)


def test_extrapolation_goes_by_what_the_platens_moved(source, points):
    """They close in by 2 voxels, then by 5."""
    found = candidate("extrapolated", source, AXIS)(points)
    assert_allclose(found, 2.5 * points @ SLOPE.T, rtol=0.02)


def test_extrapolation_without_platens_says_what_to_do(source, points, speckle):
    save_volume(source["deformed"], speckle((24, 40, 24)))
    with pytest.raises(CorrelationError, match="leave `extrapolated` out of meso"):
        candidate("extrapolated", source, AXIS)


def test_one_platen_that_moves_is_no_compression(rng):
    """Both images show the lower one only; the end of the image is no face."""
    volumes = [rng.normal(20, 2, (40, 60, 40)).astype(np.float32) for _ in range(2)]
    for volume, face in zip(volumes, (8, 11), strict=True):
        volume[:, :face] = 150
    with pytest.raises(CorrelationError, match="do not both show both platens along axis 1"):
        shortening(*volumes, AXIS)


# ------------------------------------------------------------------------------- the choice


@pytest.fixture
def system(speckle, box):
    image = speckle((48, 48, 48))
    mesh = box((8, 8, 8), (39, 39, 39), (3, 3, 3))
    return image, meso_system(mesh, image, MesoOptions(AXIS, 0.0, 40.0))


def test_the_start_that_is_nearer_is_taken_and_its_iterations_count(system):
    image, one = system
    near = np.zeros_like(one.reference.mesh.points) + SHIFT - 0.1
    starts = {"far": near - 9.0, "near": near}
    moved, stop = fft_shift(image, SHIFT), Stop(1e-7, 40)
    solution, best, table = chosen_register(one, moved, starts, stop, "mesh")
    assert best == "near"
    assert [row["candidate"] for row in table] == ["far", "near"]
    assert table[1]["residual_std"] < table[0]["residual_std"]
    alone = register(one, moved, near, stop)
    assert_array_equal(solution.u, alone.u)
    assert solution.history == alone.history
    assert solution.converged


def test_no_more_iterations_than_allowed(system):
    image, one = system
    starts = {"rest": np.zeros_like(one.reference.mesh.points)}
    solution, *_ = chosen_register(one, fft_shift(image, SHIFT), starts, Stop(1e-12, 3), "mesh")
    assert solution.iterations == 3
    assert not solution.converged


# --------------------------------------------------------------------------- clear voxels


def test_only_voxels_near_an_edge_are_clear(rng):
    """A plate of 6 voxels in noise: its faces, blurred over two voxels, and nothing else."""
    image = rng.normal(20, 2, (40, 40, 40)).astype(np.float32)
    image[17:23] += 100
    found = clear_voxels(image, 1, 8.0)
    assert found[16:18, 2:-2, 2:-2].all()
    assert found[22:24, 2:-2, 2:-2].all()
    assert not found[:15].any()
    assert not found[26:].any()


def test_quadrature_of_clear_voxels_is_a_part_of_all(rng, box):
    image = rng.normal(20, 2, (40, 40, 40)).astype(np.float32)
    image[17:23] += 100
    mesh = box((5, 5, 5), (34, 34, 34), (2, 2, 2))
    every = meso_system(mesh, image, MesoOptions(AXIS, 8.0, 40.0)).reference.quadrature
    some = meso_system(mesh, image, MesoOptions(AXIS, 8.0, 40.0, clear=8.0)).reference.quadrature
    clear = clear_voxels(image, 1, 8.0)[tuple(np.rint(every.points).astype(int).T)]
    assert_array_equal(some.points, every.points[clear])
    assert_array_equal(some.shape, every.shape[clear])


def test_nodes_in_the_void_do_not_make_the_coarsest_mesh_singular(rng, box):
    """No clear voxel is near the far corner of the mesh, and no Laplacian is asked for."""
    image = rng.normal(20, 2, (60, 40, 40)).astype(np.float32)
    image[6:20, ::8] += 100
    mesh = box((5, 5, 5), (54, 34, 34), (7, 3, 3))
    system = meso_system(mesh, image, MesoOptions(AXIS, 0.0, 40.0, clear=8.0))
    assert (system.reference.quadrature.points[:, 0] < 30).all()
    load = rng.normal(size=mesh.points.size)
    assert np.isfinite(system.factor.solve(load)).all()


def test_meso_dvc_without_a_factor_finds_the_same(speckle, box, monkeypatch):
    image = interpolating_coefficients(speckle((48, 48, 48)))
    moved = fft_shift(image, (0.3, -0.2, 0.4))
    mesh, options = box((8, 8, 8), (40, 40, 40), (4, 4, 4)), MesoOptions(AXIS, 8.0, 40.0)
    rest = {"rest": np.zeros_like}
    direct, _ = meso_dvc(mesh, [image, moved], options, rest, "meso")
    monkeypatch.setattr(solver, "DIRECT", 0)
    iterative, notes = meso_dvc(mesh, [image, moved], options, rest, "meso")
    assert notes["best"] == "rest" and iterative.iterations == direct.iterations
    assert_allclose(iterative.u, direct.u, atol=1e-8)


def waved(image, amplitude, sigma, seed):
    """An image (n, n, n) moved by a wave of 20 voxels, with noise; and the wave at points (q, 3)."""

    def wave(x):
        return amplitude * np.sin(2 * np.pi * x[:, [1, 2, 0]] / 20)

    x = np.argwhere(np.ones(image.shape, bool)).astype(float)
    moved = spline_value(image, np.clip(x - wave(x - wave(x)), 0, 47))[0]
    noise = sigma * np.random.default_rng(seed).standard_normal(image.size)
    return (moved + noise).reshape(image.shape).astype(np.float32), wave


@pytest.mark.parametrize("amplitude, sigma, shorter", [(0.6, 1.0, True), (0.0, 40.0, False)])
def test_the_cut_off_follows_the_motion_and_the_noise(speckle, box, amplitude, sigma, shorter):
    """l_L falls where it hid a wave, rises where there is noise only; the error falls in both cases."""
    still = interpolating_coefficients(speckle((48, 48, 48)))
    image, _ = waved(still, 0.0, sigma, 2417)
    deformed, wave = waved(still, amplitude, sigma, 6113)
    mesh = box((6, 6, 6), (42, 42, 42), (8, 8, 8))
    options = MesoOptions(AXIS, 6.0, 24.0)
    ladder = Ladder(Noise(sigma, 0.0), shortest=-2, draws=4)
    found = {}
    for name, given in (("as it is", None), ("chosen", ladder)):
        rest = {"rest": np.zeros_like}
        solution, notes = meso_dvc(mesh, [image, deformed], options, rest, "meso", given)
        assert solution.converged
        found[name] = notes["l_l"], rms(solution.u - wave(mesh.points))
    assert (found["chosen"][0] < found["as it is"][0]) == shorter
    assert found["chosen"][0] != found["as it is"][0] == options.cutoff
    assert found["chosen"][1] < found["as it is"][1]


def test_a_cut_off_from_which_the_loop_does_not_settle_is_dropped(speckle, box, monkeypatch):
    still = interpolating_coefficients(speckle((48, 48, 48)))
    deformed, _ = waved(still, 0.6, 0.0, 2417)
    mesh, options = box((6, 6, 6), (42, 42, 42), (8, 8, 8)), MesoOptions(AXIS, 6.0, 24.0)
    monkeypatch.setattr(meso, "ONCE_MORE", 1)
    start, ladder = {"rest": np.zeros_like}, Ladder(Noise(1.0, 0.0), shortest=-2)
    plain, _ = meso_dvc(mesh, [still, deformed], options, start, "meso")
    chosen, notes = meso_dvc(mesh, [still, deformed], options, start, "meso", ladder)
    assert len(notes["risk"]) > 1 and notes["l_l"] == options.cutoff
    assert_array_equal(chosen.u, plain.u)
