"""Checks of the twin: they hold for what is right, and each fails when it is fed a wrong figure."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from addvc import twin
from addvc.analysis.twin_check import (
    Check,
    check_twin,
    continuity,
    element_checks,
    image_checks,
    mechanics_checks,
    residual_std,
    solid_voxels,
    truth_checks,
)

SEED = 2417
FOUND, CELL = {"porosity": 0.96}, {"cell_size": 28.0}


@pytest.fixture(scope="module")
def options():
    return twin.TwinOptions(size="tiny", seed=SEED, strains=(0.02,))


@pytest.fixture(scope="module")
def made(options, tmp_path_factory):
    """Path of the motion, the truth, and the scans (2, nx, ny, nz) of a tiny twin."""
    foam = twin.make_foam(options)
    motions, history = twin.compress(foam, options)
    path = tmp_path_factory.mktemp("twin") / "motion.h5"
    twin.save_motions(path, foam, motions, options, history)
    scans = np.array([twin.image(foam, m, options, n) for n, m in enumerate(motions)], np.float32)
    return path, twin.Truth.load(path), scans


def failed(checks):
    """Names of the checks that do not hold."""
    return [check.name for check in checks if not check.passed]


# -------------------------------------------------------------------------------- one check


@pytest.mark.parametrize(
    ("value", "passed"), [(1.0, True), (2.0, True), (0.99, False), (2.01, False), (np.nan, False)]
)
def test_a_check_holds_within_its_limits(value, passed):
    assert Check("x", value, "voxel", 1.0, 2.0).passed == passed


def test_a_check_is_json_with_null_for_no_limit():
    found = json.loads(json.dumps(Check("x", np.float32(3), "voxel", high=2.0).as_dict()))
    assert (found["low"], found["high"], found["passed"]) == (None, 2.0, False)
    assert found["remedy"]


# ---------------------------------------------------------------------------- what is checked


def test_the_beam_element_passes_its_closed_forms():
    assert failed(element_checks()) == []


HISTORY = {
    "strain": (0.01, 0.02), "force_low": (1.0, 2.0), "force_high": (-1.0, -2.0),
    "stretching": (0.1, 0.1), "shear": (0.1, 0.1), "torsion": (0.0, 0.0), "bending": (0.8, 0.8),
    "last_step": (1e-9, 1e-9),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "wrong", "told"),
    [
        ("bending", (0.8, 0.2), "share of bending in the energy at 2.0 %"),
        ("force_high", (-1.0, -2.1), "forces of the platens out of balance"),
        ("last_step", (1e-3, 1e-9), "last step to an equilibrium, rms"),
    ],
)
def test_a_wrong_load_step_fails_its_own_check_alone(name, wrong, told):
    right = {key: np.array(values) for key, values in HISTORY.items()}
    assert failed(mechanics_checks(right, (0.0, 0.02))) == []
    assert failed(mechanics_checks(right | {name: np.array(wrong)}, (0.0, 0.02))) == [told]


@pytest.mark.parametrize(
    ("found", "cell", "told"),
    [
        ({"porosity": 0.9}, CELL, "solid fraction at the threshold"),
        (FOUND, {"cell_size": 25.0}, "secondary peak of the autocorrelation"),
    ],
)
def test_a_wrong_geometry_fails_its_own_check_alone(made, options, found, cell, told):
    assert failed(image_checks(made[1], options, FOUND, CELL)) == []
    assert failed(image_checks(made[1], options, found, cell)) == [told]


def test_the_solid_is_that_of_the_porosity_asked_for(made, options):
    thinner = SimpleNamespace(porosity=0.97, cell_size=options.cell_size)
    assert "true solid fraction" in failed(image_checks(made[1], thinner, FOUND, CELL))


# ----------------------------------------------------------------------------- truth and images


def test_every_check_of_a_twin_holds(made, options):
    path, _, scans = made
    checks = check_twin(path, options, FOUND, CELL, lambda n: scans[n])
    assert [check["name"] for check in checks if not check["passed"]] == []
    assert len({check["name"] for check in checks}) == len(checks)


@pytest.mark.parametrize("wrong", ["moved", "noisy"])
def test_scans_that_do_not_follow_the_truth_fail(made, options, wrong):
    _, truth, scans = made
    other = {
        "moved": np.roll(scans[1], 1, axis=0),
        "noisy": scans[1] + np.random.default_rng(SEED).normal(0, 6, scans[1].shape),
    }[wrong].astype(np.float32)
    checks = truth_checks(truth, options, lambda n: (scans[0], other)[n])
    assert failed(checks) == ["residual under the truth at 2.0 %"]


@pytest.mark.parametrize(("jump", "least", "most"), [(0.0, 0.1, 0.31), (0.5, 1e4, 2e5)])
def test_a_jump_of_the_displacement_is_seen(jump, least, most):
    """In an affine field of slope 0.3, cut by a plane near to the junctions."""
    slope = np.diag([0.1, -0.3, 0.2])
    truth = SimpleNamespace(
        junctions=np.full((4, 3), 30.0),
        displacement=lambda x, state: x @ slope + jump * (x[:, :1] > 30.7),
    )
    assert least < continuity(truth, 1, np.random.default_rng(SEED)) < most


def test_solid_voxels_are_in_struts_at_every_resolution(made, options):
    _, truth, scans = made
    points = solid_voxels(truth, scans[0])
    assert len(points) > 1000
    assert (truth.strut(points)[2] < 0).all()
    finer = solid_voxels(truth, scans[0].repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2))
    assert finer.mean(axis=0) == pytest.approx(points.mean(axis=0), abs=0.1)


def test_no_residual_is_left_under_a_known_shift(speckle):
    """By whole voxels nothing is interpolated; half of the shift leaves the texture."""
    grey = speckle((24, 26, 28))
    volumes = grey, np.roll(grey, (2, 0, 4), axis=(0, 1, 2))
    points = np.random.default_rng(SEED).integers(8, 16, (500, 3)).astype(float)
    network = SimpleNamespace(body=SimpleNamespace(shape=grey.shape))

    def left(share):
        move = share * np.array([2.0, 0.0, 4.0])
        truth = SimpleNamespace(
            network=network, displacement=lambda x, n: np.broadcast_to(n * move, x.shape)
        )
        return residual_std(lambda n: volumes[n], truth, 1, points)

    assert left(1.0) < 1e-3 < left(0.5)
