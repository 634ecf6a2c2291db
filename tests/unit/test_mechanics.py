"""Mechanics of the twin: derivatives, invariants, closed forms, equilibria that are stable."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from addvc import twin
from addvc.twin import beam, contact, equilibrium
from addvc.twin.closed_forms import buckling_load, observed_order, roll_up_error
from addvc.twin.compression import load_step, platen_forces
from addvc.twin.equilibrium import EquilibriumError, advanced
from addvc.twin.motion import Motion, at_rest
from addvc.twin.structure import structure
from addvc.twin.strut_state import strut_states
from addvc.twin.tangent import energies, linearise, tangent_pattern

SEED = 2417
STEPS = np.array([1e-1, 5e-2, 2.5e-2])


@pytest.fixture(scope="module")
def options():
    return twin.TwinOptions(size="tiny", seed=SEED, strains=(0.034, 0.10))


@pytest.fixture(scope="module")
def foam(options):
    return twin.make_foam(options)


@pytest.fixture(scope="module")
def held(foam, options):
    return structure(foam, options)


@pytest.fixture(scope="module")
def compressed(foam, options):
    return twin.compress(foam, options)


def order(errors):
    """Observed orders over STEPS."""
    return np.diff(np.log(np.abs(errors))) / np.diff(np.log(STEPS))


# ------------------------------------------------------------------------------- element


def one_beam(limit):
    law = [np.array([x]) for x in (3.1, 1.1, 0.6, 0.78, limit, 5 * limit)]
    return beam.Sections(np.array([2.5]), np.array([[0.0, 0.6, 0.8]]), *law, 0.05)


@pytest.mark.parametrize("limit", [np.inf, 0.05])
@pytest.mark.parametrize("turn", [1e-4, 0.3, 1.2])
def test_beam_energy_has_the_gradient_and_hessian_of_the_kernel(turn, limit, rng):
    law, work = one_beam(limit), beam.scratch()
    x1, r1 = rng.standard_normal(3), Rotation.from_rotvec(rng.standard_normal(3))
    r2 = r1 * Rotation.from_rotvec(turn * rng.standard_normal(3))
    x2 = x1 + r1.apply(2.5 * law.tangent[0]) + 0.3 * rng.standard_normal(3)
    gradient, hessian, parts = np.zeros((2, 6)), np.zeros((2, 6, 2, 6)), np.zeros(4)

    def energy(v):
        a, b = ((r * Rotation.from_rotvec(t)).as_matrix() for r, t in ((r1, v[3:6]), (r2, v[9:])))
        beam.element_energy(law, 0, x1 + v[:3], a, x2 + v[6:9], b, work, parts)
        return parts.sum()

    ends = x1, r1.as_matrix(), x2, r2.as_matrix()
    value = beam.element_tangent(law, 0, *ends, work, gradient, hessian)
    g, h = gradient.ravel(), hessian.reshape(12, 12)
    v = rng.standard_normal(12)
    v *= 0.3 / np.linalg.norm(v)
    first = [energy(t * v) - value - t * g @ v for t in STEPS]
    second = [left - t * t / 2 * v @ h @ v for left, t in zip(first, STEPS, strict=True)]
    assert value == pytest.approx(energy(np.zeros(12)))
    assert np.abs(h - h.T).max() < 1e-12
    assert order(first) == pytest.approx(2, abs=0.35)
    assert order(second)[-1] > 2.6


def test_bending_moment_saturates_with_its_hardening_slope():
    at = 1e-4, 3.0, 5.0
    energy, moment, slope = np.array([beam.bending_law(k, 2.0, 0.1, 4.0, 0.05) for k in at]).T
    assert slope == pytest.approx([2.0, 0.05 * 2.0, 1.05 * 2.0], rel=1e-3)
    assert moment[0] == pytest.approx(2.0 * 1e-4, rel=1e-3)
    assert moment[1] == pytest.approx(0.05 * 2 * 3 + 0.95 * 2 * 0.1)
    assert moment[2] == pytest.approx(0.05 * 2 * 5 + 0.95 * 2 * 0.1 + 2)  # folded
    assert energy[0] == pytest.approx(1e-8, rel=1e-3)


def test_a_rigid_motion_costs_nothing_and_asks_for_no_force(foam, held):
    turn = Rotation.from_rotvec([0.8, -1.1, 2.0])
    moved = Motion(
        turn.apply(foam.nodes) + np.array([3.0, -2.0, 5.0]),
        np.tile(turn.as_matrix(), (len(foam.nodes), 1, 1)),
        (-500.0, 500.0),
    )
    none = np.zeros((0, 2), np.int32)
    elastic, penalty = energies(held, moved, none)
    assert elastic == pytest.approx(0, abs=1e-24)
    assert penalty == 0
    gradient = linearise(held, moved, tangent_pattern(held, none, moved.positions))
    assert np.abs(gradient).max() < 1e-12


def test_roll_up_is_exact_and_buckling_converges_with_order_two():
    assert roll_up_error(6) < 1e-8  # 1e6 times the round-off: axial stiffness over bending
    assert buckling_load(64) == pytest.approx(1, abs=0.003)
    assert observed_order() == pytest.approx(2, abs=0.1)


# ------------------------------------------------------------------------------- contact


@pytest.mark.parametrize("case", ["crossing", "end to side", "end to end"])
def test_contact_has_the_gradient_and_hessian_of_the_kernel(case, rng):
    shift = {"crossing": 0.0, "end to side": 0.9, "end to end": 1.6}[case]
    x = np.array([[-1, 0, 0], [1, 0.2, 0], [0.1, -1, 0.7], [-0.1, 1.2, 0.8]], dtype=float)
    x[2:, 0] += 1.5 * shift
    x[2:, 1] += 1.9 * (case == "end to end")
    guards = contact.guards(np.array([[0, 1], [2, 3]], np.int32), np.ones((2, 2)))
    pairs, gradient = np.array([[0, 1]], np.int32), np.zeros((4, 6))
    blocks = np.zeros((1, 4, 3, 4, 3))
    contact.pair_tangent(guards, pairs, x, gradient, blocks)
    v = rng.standard_normal((4, 3))
    v *= 0.3 / np.linalg.norm(v)
    g, h = gradient[:, :3].ravel() @ v.ravel(), v.ravel() @ blocks.reshape(12, 12) @ v.ravel()
    value = contact.pair_energy(guards, pairs, x)
    first = [contact.pair_energy(guards, pairs, x + t * v) - value - t * g for t in STEPS]
    assert value > 0
    assert order(first) == pytest.approx(2, abs=0.4)
    assert order([f - t * t / 2 * h for f, t in zip(first, STEPS, strict=True)])[-1] > 2.5


def test_nothing_touches_at_rest(foam, held):
    pairs = contact.near_pairs(held.guards, foam.nodes, foam.nodes)
    _, penalty = energies(held, at_rest(foam), pairs)
    assert penalty == 0


def test_a_platen_pushes_what_would_enter_it(foam, held):
    body = foam.body
    pressed = replace(at_rest(foam), platens=(body.low + 1, body.high - 1))
    none = np.zeros((0, 2), np.int32)
    gradient = linearise(held, pressed, tangent_pattern(held, none, foam.nodes))
    low, high = platen_forces(held, pressed, np.zeros_like(gradient))
    assert low > 0 > high
    near = (foam.nodes[:, 1] < body.low + 2) & ~held.clamped
    assert gradient[near, 1].min() < 0  # down the gradient is up
    assert gradient[:, 1].sum() == pytest.approx(-(low + high), abs=1e-12)


# --------------------------------------------------------------------------- equilibrium


def test_assembled_tangent_is_the_derivative_of_the_assembled_gradient(foam, held, compressed, rng):
    motion = compressed[0][-1]
    pairs = contact.near_pairs(held.guards, foam.nodes, motion.positions)
    tangent = tangent_pattern(held, pairs, motion.positions)
    v = 0.02 * rng.standard_normal((len(foam.nodes), 6))
    v[held.clamped] = 0

    def total(t):
        elastic, penalty = energies(held, advanced(motion, t * v), pairs)
        return elastic.sum() + penalty

    gradient = linearise(held, motion, tangent)
    product = np.empty_like(v)
    product[tangent.order] = (tangent.matrix @ v[tangent.order].ravel()).reshape(-1, 6)
    left = [total(t) - total(0) - t * np.sum(gradient * v) for t in STEPS]
    assert order(left) == pytest.approx(2, abs=0.3)
    second = [f - t * t / 2 * np.sum(v * product) for f, t in zip(left, STEPS, strict=True)]
    assert order(second)[-1] > 2.5


def test_every_load_step_is_balanced_and_at_rest(compressed, options):
    _, history = compressed
    assert [step.strain for step in history][-1] == options.strains[-1]
    for step in history:
        assert step.last_step < equilibrium.TOLERANCE
        assert step.force_low + step.force_high == pytest.approx(0, abs=1e-6 * step.force_low)
        assert step.bending > 0.6 * (step.bending + step.stretching + step.shear + step.torsion)


def test_equilibrium_is_a_minimum_of_the_energy(foam, held, compressed, rng):
    motion = compressed[0][-1]
    pairs = contact.near_pairs(held.guards, foam.nodes, motion.positions)
    elastic, penalty = energies(held, motion, pairs)
    for _ in range(5):
        v = 0.02 * rng.standard_normal((len(foam.nodes), 6))
        v[held.clamped] = 0
        moved, pushed = energies(held, advanced(motion, v), pairs)
        assert moved.sum() + pushed > elastic.sum() + penalty


def test_work_of_the_platens_is_the_energy(compressed, foam):
    _, history = compressed
    strain = np.array([0, *(step.strain for step in history)])
    force = np.array([0, *(step.force_low for step in history)])
    work = np.trapezoid(force, strain * foam.body.height)
    stored = sum(getattr(history[-1], name) for name in (*beam.ENERGIES, "penalty"))
    assert work == pytest.approx(stored, rel=0.01)  # the trapezoidal rule over 10 steps


def test_the_same_foam_moves_by_the_same_bytes(foam, options, compressed):
    again, _ = twin.compress(foam, options)
    assert again[-1].positions.tobytes() == compressed[0][-1].positions.tobytes()


def test_states_of_struts_add_up_and_hinges_concentrate_curvature(foam, held, options, compressed):
    motions, history = compressed
    elastic = strut_states(held, foam.strut, motions[-1])
    assert elastic.bending.sum() == pytest.approx(history[-1].bending)
    hinging = replace(options, material="hinging")
    bent, _ = twin.compress(foam, hinging)
    hinged = strut_states(structure(foam, hinging), foam.strut, bent[-1])

    def peak(state):
        return np.average(state.largest_curvature / state.curvature, weights=state.curvature)

    assert peak(hinged) > 1.1 * peak(elastic)


def test_no_equilibrium_is_an_error_that_says_so(foam, held, monkeypatch):
    monkeypatch.setattr(equilibrium, "MOST", 1)
    with pytest.raises(
        EquilibriumError, match=r"no equilibrium for a move of 0\.0\d+ voxels.*limit"
    ):
        load_step(held, at_rest(foam), None, 1.0)
