"""The solver of the solid twin: derivatives, invariants, closed forms, observed order."""

import numpy as np
import pytest

from addvc.fem.elements import gauss_tet, tet_p2
from addvc.fem.mesh import Mesh
from solid_twin.compression import compress
from solid_twin.equilibrium import Body, Options
from solid_twin.platens import Contact, Press
from solid_twin.solid import Material, Solid, SolidError, Tetrahedra, quadratic
from solid_twin.system import System

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


@pytest.fixture(scope="module")
def cube(box):
    return Solid(quadratic(box((0, 0, 0), (3, 3, 3), (3, 3, 3), shake=0.2)))


@pytest.fixture
def bent(cube, rng):
    """Positions with strains of some 20 %."""
    x = cube.mesh.points
    return x + 0.3 * np.sin(x[:, [1, 2, 0]]) + 0.01 * rng.standard_normal(x.shape)


def slopes(sizes, errors):
    """Observed orders between neighbours."""
    return np.diff(np.log(errors)) / np.diff(np.log(sizes))


# ------------------------------------------------------------------------------ derivatives


def test_force_is_the_derivative_of_the_energy_and_tangent_that_of_the_force(cube, bent, rng):
    v = 0.3 * rng.standard_normal(bent.shape)
    energy, force = cube.energy(bent), cube.force(bent)
    curved = (cube.matrix(cube.tangent(bent)) @ v.ravel()).reshape(-1, 3)
    sizes = 10.0 ** np.arange(-4, -1.9, 0.5)
    first = [abs(cube.energy(bent + t * v) - energy - t * np.sum(force * v)) for t in sizes]
    third = [
        abs(cube.energy(bent + t * v) - energy - np.sum((t * force + t**2 / 2 * curved) * v))
        for t in sizes[1:]
    ]
    second = [np.linalg.norm(cube.force(bent + t * v) - force - t * curved) for t in sizes]
    np.testing.assert_allclose(slopes(sizes, first), 2, atol=0.05)
    np.testing.assert_allclose(slopes(sizes[1:], third), 3, atol=0.15)
    np.testing.assert_allclose(slopes(sizes, second), 2, atol=0.05)


def test_contact_forces_are_the_derivative_of_their_energy(cube, rng):
    x = cube.mesh.points + 1e-3 * rng.standard_normal(cube.mesh.points.shape)
    contact = Contact(np.arange(len(x)), 0.25, 2.6)
    v = rng.standard_normal(x.shape)
    slope = (contact.energy(x + 1e-6 * v) - contact.energy(x - 1e-6 * v)) / 2e-6
    assert slope == pytest.approx(np.sum(contact.force(x) * v), rel=1e-7)
    depth = contact.depth(x)
    assert (depth > 0).sum() > 10 and (depth < 0).sum() > 10
    moved = Contact(contact.nodes, 0.25 + 1e-4, 2.6 - 2e-4)
    np.testing.assert_allclose(
        contact.change(x, moved)[depth != 0],
        (moved.force(x) - contact.force(x))[depth != 0],
        atol=1e-10,
    )


def test_the_tangent_is_symmetric_and_does_not_depend_on_threads(
    cube, bent, with_one_and_two_threads
):
    one, two = with_one_and_two_threads(lambda: (cube.force(bent), cube.tangent(bent)))
    np.testing.assert_array_equal(one[0], two[0])
    np.testing.assert_array_equal(one[1], two[1])
    matrix = cube.matrix(one[1])
    assert abs(matrix - matrix.T).max() < 1e-13


# ------------------------------------------------------------------------------- invariants


def test_a_rigid_motion_costs_nothing(cube):
    x = cube.mesh.points @ TURN.T + [5, -7, 2]
    np.testing.assert_allclose(TURN @ TURN.T, np.eye(3), atol=1e-12)
    assert cube.energy(x) == pytest.approx(0, abs=1e-12)
    assert np.abs(cube.force(x)).max() < 1e-13


def test_energy_does_not_depend_on_the_frame(cube, bent):
    assert cube.energy(bent @ TURN.T) == pytest.approx(cube.energy(bent), rel=1e-12)


def test_forces_have_neither_resultant_nor_moment(cube, bent):
    force = cube.force(bent)
    np.testing.assert_allclose(force.sum(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(np.cross(bent, force).sum(axis=0), 0, atol=1e-12)


def test_an_element_turned_inside_out_has_no_finite_energy(cube):
    assert cube.energy(cube.mesh.points * [1, -1, 1]) == np.inf


def test_patch(cube):
    """A homogeneous deformation of the faces is found inside, at 20 % of strain and shear."""
    gradient = np.array([[1.2, 0.15, 0], [0, 0.8, 0.1], [0.05, 0, 1.1]])
    x = cube.mesh.points
    held = (np.isclose(x, 0) | np.isclose(x, 3)).any(axis=1)
    shift = np.where(held[:, None], x @ (gradient - np.eye(3)).T, 0)
    found, _ = Body(cube, held).equilibrium(x, shift)
    assert held.sum() < len(x) - 90
    np.testing.assert_allclose(found, x @ gradient.T, atol=1e-9)


# ----------------------------------------------------------------------------- closed forms


def test_bar_in_tension_has_the_moduli_of_its_material(box):
    """Small strain, free sides: force E A e, lateral strain -nu e."""
    solid = Solid(quadratic(box((0, 0, 0), (2, 6, 2), (2, 6, 2))), Material(7.0, 0.3))
    strain, x = 1e-4, solid.mesh.points
    grip = np.isclose(x[:, 1], 0) | np.isclose(x[:, 1], 6)
    exact = x * [1 - 0.3 * strain, 1 + strain, 1 - 0.3 * strain]
    body = Body(solid, grip)
    found, _ = body.equilibrium(x, np.where(grip[:, None], exact - x, 0))
    np.testing.assert_allclose(found, exact, atol=3 * strain**2)
    pull = body.force(found, None)[np.isclose(x[:, 1], 6), 1].sum()
    assert pull == pytest.approx(7 * 4 * strain, rel=3 * strain)


def guided_beam(mesh, length, side):
    """Shear force at one end that moves by 1e-3 across, over Timoshenko's, both ends clamped."""
    solid, x, move = Solid(mesh), mesh.points, 1e-3
    held = np.isclose(x[:, 1], 0) | np.isclose(x[:, 1], length)
    shift = np.zeros_like(x)
    shift[np.isclose(x[:, 1], length), 0] = move
    body = Body(solid, held)
    found, _ = body.equilibrium(x, shift)
    force = body.force(found, None)[np.isclose(x[:, 1], length), 0].sum()
    second, nu = side**4 / 12, solid.material.poisson
    shear = 10 * (1 + nu) / (12 + 11 * nu)  # Cowper's coefficient of a rectangle
    soft = length**3 / (12 * second) + length / (shear * solid.material.mu * side**2)
    return force / (move / soft)


def test_beam_with_two_elements_over_its_width_is_as_stiff_as_it_should_be(box):
    """Struts have two or three elements over their width."""
    ratio = guided_beam(quadratic(box((0, 0, 0), (2, 40, 2), (2, 40, 2))), 40, 2)
    assert ratio == pytest.approx(1, abs=0.02)


def column(box, length=32.0, bow=0.0):
    """A clamped column of 2 x 2 voxels with a bow, and Euler's strain with shear."""
    mesh = quadratic(box((0, 0, 0), (2, length, 2), (1, 16, 1)))
    points = mesh.points.copy()
    points[:, 0] += bow * np.sin(np.pi * points[:, 1] / length) ** 2
    # sides straight again, as the elements have them
    solid = Solid(quadratic(Mesh(points[: mesh.cells[:, :4].max() + 1], mesh.cells[:, :4])))
    return solid, 4 * np.pi**2 * (2**4 / 12) / length**2 / 4


def test_straight_column_is_stable_up_to_eulers_load_and_not_beyond(box):
    solid, critical = column(box)
    x = solid.mesh.points
    body = Body(solid, np.isclose(x[:, 1], 0) | np.isclose(x[:, 1], 32))
    for strain, stable in ((0.93 * critical, True), (1.07 * critical, False)):
        poisson = 1 + solid.material.poisson * strain
        y = 1 + (x - [1, 0, 1]) * [poisson, 1 - strain, poisson] - [0, 1, 0]
        assert body.system.factorise(solid.tangent(y)) is stable


def test_bowed_column_buckles_to_a_stable_state_at_eulers_load(box):
    solid, critical = column(box, bow=0.02)
    steps = []
    compress(solid, Press(0.0, 32.0), [0.02], Options(increment=0.004), steps.append)
    last = steps[-1]
    deflection = (last.x - solid.mesh.points)[:, 0].max()
    assert deflection > 1
    assert last.force == pytest.approx(4 * critical, rel=0.04)
    assert Body(solid, Press(0.0, 32.0).held(solid.mesh.points)).system.factorise(
        solid.tangent(last.x)
    )
    work = np.trapezoid([0, *(s.force for s in steps)], [0, *(32 * s.strain for s in steps)])
    assert last.energy == pytest.approx(work, rel=0.05)


def antiplane(x):
    """A harmonic function: u = (0, 0, phi(x, y)) is an equilibrium at any strain, since J = 1 and
    P = mu (e_z grad phi^T + grad phi e_z^T) has no divergence."""
    return 0.5 * np.exp(0.8 * x[:, 0]) * np.sin(0.8 * x[:, 1])


def test_observed_order_of_convergence(box):
    """Anti-plane shear of up to 0.9: the error in L2 falls with the cube of the edge."""
    errors, counts = [], np.array([2, 4, 8])
    for count in counts:
        mesh = quadratic(box((0, 0, 0), (1, 1, 1), (count,) * 3))
        x = mesh.points
        held = (np.isclose(x, 0) | np.isclose(x, 1)).any(axis=1)
        shift = np.zeros_like(x)
        shift[held, 2] = antiplane(x[held])
        solid = Solid(mesh)
        u = Body(solid, held).equilibrium(x, shift)[0] - x
        shape = tet_p2(gauss_tet(4)[0])[0]
        at = np.einsum("qa,eai->eqi", shape, x[mesh.cells]).reshape(-1, 3)
        found = np.einsum("qa,eai->eqi", shape, u[mesh.cells]).reshape(-1, 3)
        found[:, 2] -= antiplane(at)
        errors.append(np.sqrt(np.mean(found**2)))
    np.testing.assert_allclose(slopes(1 / counts, errors), 3, atol=0.3)


# ---------------------------------------------------------------------------------- platens


def test_a_platen_pushes_only_what_it_has_reached(box):
    """A block half a voxel below the platen: no force until it is reached, then as if clamped to
    it without friction; nothing sinks in by more than a few hundredths of a voxel."""
    solid = Solid(quadratic(box((0, 0, 0), (3, 6, 3), (2, 4, 2))))
    x, press = solid.mesh.points, Press(0.0, 6.5)
    found = compress(solid, press, [0.05, 0.1, 0.15], Options(increment=0.025))
    assert not press.held(x)[x[:, 1] > 1].any()
    assert [step.force > 1e-6 for step in found] == [False, True, True]
    for step in found[1:]:
        face = 6.5 - step.strain * 6.5
        top = step.x[np.isclose(x[:, 1], 6), 1]
        assert face <= top.max() < face + 0.05
        short = (6 - face) / 6
        assert step.force == pytest.approx(9 * short, rel=0.25)


# ----------------------------------------------------------------------------------- errors


def test_no_equilibrium_is_an_error_with_the_strain(cube):
    options = Options(increment=0.99, least_increment=0.6)
    with pytest.raises(SolidError, match=r"at a strain of 0\.0000: .*; use a smaller increment"):
        compress(cube, Press(0.0, 3.0), [0.99], options)


def test_a_part_that_hangs_in_the_air_is_told(box):
    one = box((0, 0, 0), (1, 1, 1), (1, 1, 1))
    two = Mesh(np.vstack([one.points, one.points + 3]), np.vstack([one.cells, one.cells + 8]))
    solid = Solid(quadratic(two))
    with pytest.raises(SolidError, match=r"not positive definite|no equilibrium"):
        compress(solid, Press(0.0, 9.0), [0.01], Options(least_increment=0.01))


def test_inverted_tetrahedra_are_refused(box):
    mesh = box((0, 0, 0), (1, 1, 1), (1, 1, 1))
    with pytest.raises(SolidError, match="5 of 5 tetrahedra are inverted or flat"):
        Solid(quadratic(Mesh(mesh.points * [1, 1, -1], mesh.cells)))


def test_the_factor_solves_on_free_nodes(cube, bent, rng):
    free = cube.mesh.points[:, 1] > 0
    system = System(cube, free)
    blocks = cube.tangent(cube.mesh.points)
    assert system.factorise(blocks)
    right = rng.standard_normal(bent.shape)
    x = system.solve(right)
    assert not x[~free].any()
    back = (cube.matrix(blocks) @ x.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(back[free], right[free], atol=1e-10)


def test_a_quadratic_mesh_shares_the_nodes_of_its_edges(box):
    mesh = box((0, 0, 0), (2, 2, 2), (2, 2, 2))
    found = quadratic(mesh)
    assert isinstance(found, Tetrahedra)
    assert len(found.points) < len(mesh.points) + 6 * len(mesh.cells) / 2
    assert len(np.unique(found.points.round(9), axis=0)) == len(found.points)
