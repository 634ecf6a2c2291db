"""What is known must be found: derivatives, rest, shifts, strains, scalings, a small foam."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from addvc.correlation.gauss_newton import rms
from addvc.correlation.meso import MesoOptions, meso_system, pyramid_start
from addvc.correlation.meso_start import rescale
from addvc.correlation.metric import (
    hessian,
    reference_on,
    residual,
    residual_statistics,
    right_hand_side,
)
from addvc.correlation.micro import MicroOptions, eq10, micro_reference
from addvc.correlation.register import Stop, System, register
from addvc.correlation.ultimate import fft_shift
from addvc.fem.assembly import node_pattern
from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import gauss_points, interpolate, voxel_points
from addvc.fem.solver import factorise
from addvc.geometry.grid import hex_grid
from addvc.geometry.region import micro_region, node_classes
from addvc.geometry.stuffing import stuff
from addvc.geometry.surface import capped
from addvc.geometry.tets import largest_piece
from addvc.geometry.threshold import find_threshold
from addvc.images.levels import displacement_to_fine, pyramid, to_coarse
from addvc.images.specimen import Specimen
from addvc.images.spline import gaussian_blur, interpolating_coefficients, spline_value_gradient
from addvc.twin.virtual import VirtualField, warp

AXIS = 1
PLAIN = MesoOptions(AXIS, cutoff=0.0, period=40.0)
STRAIN = np.array([[0.01, 0.004, 0], [0, -0.03, 0.005], [-0.003, 0, 0.012]])


def slopes(steps, errors):
    """Observed order between each pair of steps."""
    return np.diff(np.log(errors)) / np.diff(np.log(steps))


def smooth_field(points):
    """A displacement (n, 3) of about a voxel that is not affine."""
    x = points / 15
    return np.column_stack([np.sin(x[:, 1]), np.cos(x[:, 2] + 1), np.sin(x[:, 0] + x[:, 1])])


def sampled(mesh, volume):
    """I_r at the voxel centres inside a mesh."""
    return reference_on(mesh, voxel_points(mesh, volume.shape), volume)


# --------------------------------------------------------------------------- derivatives


@pytest.fixture
def small(speckle, box):
    """I_r (40^3), a mesh 6 voxels off its border, and both kinds of quadrature."""
    mesh = box((6, 6, 6), (33, 33, 33), (3, 3, 3), shake=0.1)
    volume = speckle((40, 40, 40))
    return volume, mesh, {"voxels": voxel_points(mesh, volume.shape), "gauss": gauss_points(mesh)}


@pytest.mark.parametrize("points", ["voxels", "gauss"])
def test_residual_follows_the_gradient_of_the_deformed_image(small, points):
    """|r(u + t v) - r(u) + t grad I_d . v| falls with slope 2."""
    volume, mesh, quadratures = small
    q = quadratures[points]
    reference = reference_on(mesh, q, volume)
    deformed = fft_shift(volume, (0.3, -0.6, 0.9))
    u, v = 0.5 * smooth_field(mesh.points), smooth_field(mesh.points[:, ::-1])
    at = q.points + interpolate(mesh.cells, q.cell, q.shape, u)
    _, gradient, _ = spline_value_gradient(deformed, at)
    slope = np.sum(gradient * interpolate(mesh.cells, q.cell, q.shape, v), axis=1)
    r, inside = residual(reference, deformed, u)
    assert inside.all()
    steps = np.array([0.4, 0.2, 0.1, 0.05])
    ahead = [residual(reference, deformed, u + t * v)[0] for t in steps]
    errors = [np.abs(found - r + t * slope).mean() for t, found in zip(steps, ahead, strict=True)]
    assert slopes(steps, errors)[-1] == pytest.approx(2, abs=0.1)


def moved_and_brighter(volume, shift, brighter):
    """I_d(x + shift) = I_r(x) + brighter for a whole shift: grad I_d(x + u) is grad I_r(x)."""
    return np.roll(volume, shift, axis=(0, 1, 2)) + np.float32(brighter)


@pytest.mark.parametrize("shift", [(0, 0, 0), (2, -1, 3)])
@pytest.mark.parametrize("points", ["voxels", "gauss"])
def test_right_hand_side_is_the_gradient_of_the_functional(small, points, shift):
    """|S(u + t v) - S(u) + 2 t b.v| falls with slope 2 where grad I_r(x) = grad I_d(x + u)."""
    volume, mesh, quadratures = small
    reference = reference_on(mesh, quadratures[points], volume)
    deformed = moved_and_brighter(volume, shift, brighter=15)
    u = np.broadcast_to(np.array(shift, float), mesh.points.shape).copy()
    v = smooth_field(mesh.points)

    def functional(field):
        r, _ = residual(reference, deformed, field)
        return reference.quadrature.weight @ r.astype(float) ** 2

    b = right_hand_side(reference, residual(reference, deformed, u)[0])
    steps = np.array([0.2, 0.1, 0.05, 0.025])
    errors = [abs(functional(u + t * v) - functional(u) + 2 * t * (b @ v.ravel())) for t in steps]
    assert slopes(steps, errors)[-1] == pytest.approx(2, abs=0.1)
    assert abs(b @ v.ravel()) > 0


def test_hessian_is_the_curvature_of_the_functional_at_the_solution(small):
    """S(t v) -> t^2 v^T H v where the images agree; H is symmetric and semi-definite."""
    volume, mesh, quadratures = small
    reference = reference_on(mesh, quadratures["voxels"], volume)
    h = hessian(reference, node_pattern(mesh))
    v = smooth_field(mesh.points)
    r, _ = residual(reference, volume, 0.01 * v)
    curvature = v.ravel() @ (h @ v.ravel())
    assert np.sum(r.astype(float) ** 2) == pytest.approx(0.01**2 * curvature, rel=0.01)
    assert abs(h - h.T).max() < 1e-12 * abs(h).max()
    assert np.linalg.eigvalsh(h.toarray())[0] > -1e-9 * abs(h).max()


# -------------------------------------------------------------------------- known motions


@pytest.mark.parametrize("cutoff", [0.0, 20.0])
def test_zero_motion_gives_exactly_zero(speckle, box, cutoff):
    volume = speckle((40, 40, 40))
    mesh = box((3, 3, 3), (36, 36, 36), (3, 3, 3))
    system = meso_system(mesh, volume, MesoOptions(AXIS, cutoff, 40.0))
    solution = register(system, volume, np.zeros_like(mesh.points), Stop())
    assert_array_equal(solution.u, 0)
    assert solution.history == [0.0]
    assert solution.converged
    assert solution.residual == {"mean": 0.0, "std": 0.0, "outside": 0}


def test_points_that_leave_the_image_are_dropped_and_counted(speckle, box):
    volume = speckle((40, 40, 40))
    mesh = box((2, 2, 2), (38, 37, 37), (3, 3, 3))
    reference = sampled(mesh, volume)
    u = np.broadcast_to([3.0, 0, 0], mesh.points.shape)
    r, inside = residual(reference, moved_and_brighter(volume, (3, 0, 0), 0), u)
    assert_array_equal(inside, reference.quadrature.points[:, 0] <= 36)
    assert_array_equal(r[~inside], 0)
    assert residual_statistics(r, inside, reference.quadrature.weight)["outside"] == 2 * 36 * 36


@pytest.mark.parametrize("spline", ["voxels", "interpolating"])
@pytest.mark.parametrize("kind", ["tet", "hex"])
def test_affine_compression_is_found_to_a_hundredth_of_a_voxel(stretched, box, kind, spline):
    """With voxels as coefficients a strain leaves a residual (the smoothing is stretched too):
    then the rms error stays below 0.01 voxel, with interpolating coefficients any error."""
    centre = np.array([29.5, 31.5, 28.0])
    images = stretched((60, 64, 58), STRAIN, centre)
    if spline == "interpolating":
        images = [interpolating_coefficients(image) for image in images]
    lines = [np.linspace(5, n - 6, 4) for n in (60, 64, 58)] if kind == "hex" else None
    mesh = hex_grid(lines) if kind == "hex" else box((5, 5, 5), (54, 58, 52), (3, 3, 3))
    system = meso_system(mesh, images[0], PLAIN, lines)
    solution = register(system, images[1], np.zeros_like(mesh.points), Stop())
    error = solution.u - (mesh.points - centre) @ STRAIN.T
    print(f"{kind}, {spline}: rms {rms(error):.1e}, largest {np.abs(error).max():.1e} voxel")
    assert solution.converged
    assert rms(error) < 0.01
    assert spline == "voxels" or np.abs(error).max() < 0.01


def test_translation_is_found_whatever_the_regularisation(speckle, box):
    """A rigid shift costs the Laplacian nothing, so that no cut-off biases it."""
    volume = speckle((60, 60, 60))
    mesh, shift = box((4, 4, 4), (55, 55, 55), (4, 4, 4)), (0.5, -0.25, 1.5)
    deformed = fft_shift(volume, shift)
    for cutoff in (0.0, 10.0, 100.0):
        system = meso_system(mesh, volume, MesoOptions(AXIS, cutoff, 40.0))
        solution = register(system, deformed, np.zeros_like(mesh.points), Stop())
        assert_allclose(solution.u.mean(axis=0), shift, atol=1e-3)


def test_fft_shift_moves_the_material():
    """Whole shifts roll the volume; a plane wave moves by any shift."""
    shape, rng = (12, 13, 14), np.random.default_rng(2417)
    volume = rng.standard_normal(shape).astype(np.float32)
    rolled = np.roll(volume, (2, -3, 5), axis=(0, 1, 2))
    assert_allclose(fft_shift(volume, (2, -3, 5)), rolled, atol=1e-5)
    x = np.indices(shape).reshape(3, -1).T
    way, shift = 2 * np.pi * np.array([2, 1, 3]) / shape, np.array([0.3, -0.4, 0.7])
    wave, moved = (np.cos((x - s) @ way).reshape(shape) for s in (0, shift))
    assert_allclose(fft_shift(wave, shift), moved, atol=1e-5)


# ------------------------------------------------------------------------------ rescaling


@pytest.fixture
def compressed(stretched, box):
    """Reference, I_d and the true displacement of a compression on a tetrahedral mesh."""
    centre = np.array([25.0, 4.0, 26.0])
    reference, deformed = stretched((50, 60, 52), STRAIN, centre, shortest=12.0)
    mesh = box((5, 5, 5), (44, 54, 46), (3, 4, 3))
    return sampled(mesh, reference), deformed, (mesh.points - centre) @ STRAIN.T


def test_field_multiplied_by_1_1_is_scaled_back_within_three_iterations(compressed):
    reference, deformed, truth = compressed
    solution, factors = rescale(reference, deformed, 1.1 * truth, Stop(1e-3, 3))
    print("factors", factors, "history", solution.history)
    assert solution.converged
    assert solution.iterations <= 3
    assert_allclose(factors, 1 / 1.1, atol=2e-3)
    assert_allclose(solution.u, truth, atol=0.01)


def test_each_direction_has_its_own_factor(compressed):
    reference, deformed, truth = compressed
    _, factors = rescale(reference, deformed, truth * [1.2, 0.9, 0.8], Stop(1e-4, 10))
    assert_allclose(factors, np.divide(1, [1.2, 0.9, 0.8]), atol=5e-3)


def test_scaling_that_raises_the_residual_is_refused(speckle, box):
    """Three times the contrast makes the step three times too long: w comes back as it was."""
    volume = speckle((40, 40, 40))
    mesh = box((6, 6, 6), (33, 33, 33), (3, 3, 3))
    reference, w = sampled(mesh, volume), 0.3 * smooth_field(mesh.points)
    contrasted = np.float32(110) + 3 * (volume - np.float32(110))
    solution, factors = rescale(reference, contrasted, w, Stop(1e-3, 1))
    assert_array_equal(solution.u, w)
    assert factors == [1.0, 1.0, 1.0]
    assert not solution.converged


# -------------------------------------------------------------------------------- pyramid


@pytest.mark.parametrize("level", [1, 2])
def test_level_of_a_pyramid_registers_a_shift_without_bias(speckle, box, level):
    """Half voxels of the fine image, registered in means of 2^level voxels, mapped up."""
    volume, shift = speckle((96, 96, 96), length=14.0), np.array([0.5, -1.5, 2.5])
    references, deformed = pyramid(volume, 3), pyramid(fft_shift(volume, shift), 3)
    mesh = box((12, 12, 12), (83, 83, 83), (3, 3, 3))
    coarse = Mesh(to_coarse(mesh.points, 2**level), mesh.cells)
    system = meso_system(coarse, references[level], PLAIN)
    solution = register(system, deformed[level], np.zeros_like(mesh.points), Stop(1e-5))
    error = displacement_to_fine(solution.u, 2**level) - shift
    print(f"level {level}: bias {error.mean(axis=0)}, deviation {error.std():.1e} voxel")
    assert np.abs(error.mean(axis=0)).max() < 0.01
    assert error.std() < 0.02


@pytest.mark.parametrize("level", [1, 2])
def test_level_of_a_pyramid_keeps_positions(stretched, box, level):
    """With a strain of 4 %, centres that moved when binned would cost 0.02 and 0.06 voxel."""
    centre, slope = np.array([47.5, 47.5, 47.5]), 0.04 * np.eye(3)
    images = [pyramid(image, 3)[level] for image in stretched((96,) * 3, slope, centre, 18.0)]
    mesh = box((12, 12, 12), (83, 83, 83), (2, 2, 2))
    coarse = Mesh(to_coarse(mesh.points, 2**level), mesh.cells)
    system = meso_system(coarse, images[0], PLAIN)
    solution = register(system, images[1], np.zeros_like(mesh.points), Stop(1e-5))
    error = displacement_to_fine(solution.u, 2**level) - (mesh.points - centre) @ slope.T
    print(f"level {level}: bias {error.mean(axis=0)}, deviation {error.std():.1e} voxel")
    assert np.abs(error.mean(axis=0)).max() < 0.01 * level


def test_pyramid_finds_what_the_finest_level_alone_would_miss(speckle, box):
    """A shift of 9 voxels, over two speckles, ends in the wrong place without the pyramid."""
    noise = speckle((96, 96, 96), 4.0) + 3 * speckle((96, 96, 96), 16.0)
    shift = np.array([9.0, -8.0, 7.5])
    references, deformed = pyramid(noise, 4), pyramid(fft_shift(noise, shift), 4)
    mesh = box((16, 16, 16), (79, 79, 79), (2, 2, 2))
    options = MesoOptions(AXIS, 30.0, 60.0, Stop(1e-2, 30))
    u = pyramid_start(mesh, references, deformed, options)
    assert np.abs(u - shift).max() < 0.05


# ---------------------------------------------------------------------------- micro DVC


@pytest.fixture(scope="module")
def struts(foam):
    """A slab of the small foam: mesh, system of Eq. 10, blurred I_d and the true displacement."""
    volume, body = foam
    specimen = Specimen("cylinder", AXIS, body.low, body.high, (35.5, 35.5), radius=body.radius)
    smooth = gaussian_blur(volume, 0.8)
    levels = find_threshold(smooth, specimen, 0.96, "auto")
    gamma, contrast = levels["threshold"], levels["solid"] - levels["void"]
    region = micro_region(specimen, {"low": 22, "high": 62, "radius": 18.0})
    mesh, _ = largest_piece(stuff(capped(smooth, gamma, region, contrast), gamma, 1.6))
    penalised = node_classes(mesh, region, "penalised")["penalised"] > 0
    options = MicroOptions(AXIS, l_k=28.0, l_l=28.0, l_e=22.0, period=35.0)
    reference = micro_reference(mesh, smooth)
    a, extra, _ = eq10(reference, penalised, options)
    field = VirtualField((0.01,), AXIS, low=42.0, amplitude=0.5, wavelength=90.0)
    deformed = gaussian_blur(warp(volume, field, 1, bin=1, noise=0, seed=2417), 0.8)
    truth = field.displacement(mesh.points, 1)
    return mesh, System(reference, extra, factorise(a)), deformed, truth


def test_micro_dvc_finds_a_smooth_motion_of_struts(struts):
    mesh, system, deformed, truth = struts
    solution = register(system, deformed, np.zeros_like(truth), Stop())
    error = rms(solution.u - truth)
    print(f"{len(mesh.points)} nodes, rms error {error:.4f} of {rms(truth):.3f} voxel")
    assert solution.converged
    assert solution.residual["outside"] == 0
    assert error < 0.05
    assert error < rms(truth) / 5


def test_micro_dvc_of_struts_at_rest_is_exactly_zero(struts, foam):
    mesh, system, _, _ = struts
    solution = register(system, gaussian_blur(foam[0], 0.8), np.zeros_like(mesh.points), Stop())
    assert_array_equal(solution.u, 0)


def test_number_of_threads_changes_nothing(struts, with_one_and_two_threads):
    _, system, deformed, truth = struts
    one, two = with_one_and_two_threads(
        lambda: register(system, deformed, np.zeros_like(truth), Stop()).u
    )
    assert_array_equal(one, two)
