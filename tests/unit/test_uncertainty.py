"""Uncertainty a priori: Hutchinson's estimate against the exact one, its scaling, and what is found."""

import numpy as np
import pytest

from addvc.correlation.gauss_newton import rms
from addvc.correlation.meso import MesoOptions, meso_system
from addvc.correlation.metric import hessian
from addvc.correlation.ultimate import NOISY, fft_shift, shift_error, ultimate_error
from addvc.correlation.uncertainty import Noise, a_priori, a_priori_white
from addvc.fem.assembly import node_pattern

SEED = 2417
SHAPE = (48, 48, 48)


@pytest.fixture(scope="module")
def image(speckle):
    return speckle(SHAPE, 4.0)


@pytest.fixture(scope="module")
def system(box, image):
    mesh = box([5.5] * 3, [41.5] * 3, (3, 3, 3))
    return meso_system(mesh, image, MesoOptions(1, 8.0, 48.0))


def test_white_noise_gives_the_diagonal_of_the_covariance(system):
    """2 sigma^2 A^-1 H A^-1 by its columns, against draws."""
    size = 3 * len(system.reference.mesh.points)
    h = hessian(system.reference, node_pattern(system.reference.mesh)).toarray()
    inverse = np.column_stack([system.factor.solve(column) for column in np.eye(size)])
    exact = np.sqrt(np.diag(2 * 1.5**2 * inverse @ h @ inverse))
    drawn = a_priori_white(system, 1.5, draws=200).ravel()
    assert rms(drawn[:, None]) == pytest.approx(rms(exact[:, None]), rel=0.02)
    assert drawn == pytest.approx(exact, rel=0.2)


def test_uncertainty_grows_with_the_noise_and_falls_without_it(system):
    single, double = (a_priori(system, SHAPE, Noise(std, 0.8)) for std in (1.0, 2.0))
    assert double == pytest.approx(2 * single, rel=1e-4)
    assert single.shape == system.reference.mesh.points.shape and (single > 0).all()


def test_noise_has_the_deviation_asked_for_and_the_correlation_of_the_blur():
    field = Noise(1.5, 0.8).volume((40, 40, 40), np.random.default_rng(SEED))
    assert field.std() == pytest.approx(1.5, rel=1e-3)
    near = np.corrcoef(field[1:].ravel(), field[:-1].ravel())[0, 1]
    assert near == pytest.approx(np.exp(-1 / (4 * 0.8**2)), abs=0.03)  # of a Gaussian of sigma .8


def test_what_is_found_with_noise_is_what_was_expected(system, image):
    """Within the scatter of five draws of 192 components."""
    noise, rng = Noise(1.5, 0.8), np.random.default_rng(SEED)
    moved, start = fft_shift(image, [0.25] * 3), np.full_like(system.reference.mesh.points, 0.25)
    clean = shift_error(system, moved, 0.25, start, NOISY)[0]
    found = []
    for _ in range(5):
        noisy = moved + np.float32(np.sqrt(2)) * noise.volume(SHAPE, rng)
        found.append(shift_error(system, noisy, 0.25, clean, NOISY)[0] - clean)
    expected = rms(a_priori(system, SHAPE, noise, draws=40))
    assert rms(np.concatenate(found)) == pytest.approx(expected, rel=0.1)


def test_the_figures_of_a_mesh_stand_side_by_side(system, image):
    figures = ultimate_error(system, image, (0.25, 0.5), noise=Noise(1.5, 0.8))
    assert [row["shift"] for row in figures["noisy_shifts"]] == [0.25, 0.5]
    assert figures["with_noise"] == pytest.approx(figures["a_priori"], rel=0.2)
    assert figures["with_noise"] > 3 * figures["ultimate_error"]
    assert 0 < figures["noise_at_points"] < figures["noise"] == 1.5
