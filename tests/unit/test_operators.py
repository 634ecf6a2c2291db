"""K and L: symmetry, null spaces, patch test, energy, and the order of convergence."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from addvc.fem.assembly import node_pattern
from addvc.fem.mesh import Mesh, boundary_faces
from addvc.fem.operators import lame, laplacian, stiffness, strain, vectorised
from addvc.fem.quadrature import gauss_points, interpolate
from addvc.fem.solver import factorise
from addvc.geometry.grid import hex_grid

NU = 0.28


@pytest.fixture(params=["tet", "hex"])
def mesh(request, box):
    if request.param == "tet":
        return box((1, 2, 3), (11, 14, 12), (3, 4, 3), shake=0.15)
    grid = hex_grid([np.linspace(1, 11, 4), np.linspace(2, 14, 5), np.linspace(3, 12, 4)])
    move = np.random.default_rng(2417).uniform(-0.3, 0.3, grid.points.shape)
    return Mesh(grid.points + move, grid.cells)


def inner_nodes(mesh):
    """Nodes that are not on the boundary, (n,) bool."""
    inner = np.ones(len(mesh.points), dtype=bool)
    inner[boundary_faces(mesh)] = False
    return inner


def test_stiffness_is_symmetric(mesh):
    k = stiffness(mesh, NU)
    assert abs(k - k.T).max() < 1e-14 * abs(k).max()


def test_null_space_of_stiffness_is_the_rigid_motions(mesh, rigid_motions):
    k = stiffness(mesh, NU).toarray()
    assert_allclose(k @ rigid_motions(mesh.points), 0, atol=1e-12 * abs(k).max() * 10)
    values = np.linalg.eigvalsh(k)
    assert_allclose(values[:6], 0, atol=1e-12 * values[-1])
    assert values[6] > 1e-5 * values[-1]


def test_laplacian_is_semi_definite_and_constants_are_its_null_space(mesh):
    matrix = laplacian(mesh)
    assert abs(matrix - matrix.T).max() < 1e-14 * abs(matrix).max()
    assert_allclose(matrix @ np.ones(matrix.shape[0]), 0, atol=1e-12)
    values = np.linalg.eigvalsh(matrix.toarray())
    assert values[0] > -1e-12 * values[-1]
    assert values[1] > 1e-4 * values[-1]


def test_laplacian_of_a_displacement_acts_on_each_component(mesh):
    u = np.random.default_rng(2417).standard_normal(mesh.points.shape)
    expected = laplacian(mesh) @ u
    assert_allclose((vectorised(laplacian(mesh)) @ u.ravel()).reshape(-1, 3), expected, atol=1e-12)


def affine(points):
    """u (n, 3) of a displacement gradient with stretch, shear and rotation."""
    slope = np.array([[0.01, 0.03, 0], [-0.02, -0.05, 0.01], [0, 0.02, 0.04]])
    return points @ slope.T + [1, -2, 0.5], slope


def test_patch(mesh):
    """An affine displacement imposed on the boundary is the solution inside, to round-off."""
    u, _ = affine(mesh.points)
    k, inner = stiffness(mesh, NU).tocsr(), np.repeat(inner_nodes(mesh), 3)
    imposed = np.where(inner, 0, u.ravel())
    assert_allclose((k @ u.ravel())[inner], 0, atol=1e-12)
    found = factorise(k[inner][:, inner]).solve(-(k @ imposed)[inner])
    assert_allclose(found, u.ravel()[inner], atol=1e-12)


def test_laplacian_of_an_affine_field_is_zero_on_inner_rows_only(mesh):
    field, inner = affine(mesh.points)[0], inner_nodes(mesh)
    assert_allclose((laplacian(mesh) @ field)[inner], 0, atol=1e-12)
    assert np.abs((laplacian(mesh) @ field)[~inner]).max() > 0.01


def test_energy_of_a_uniform_strain(box):
    """u^T K u = V (lam tr(e)^2 + 2 mu e:e)."""
    mesh = box((0, 0, 0), (3, 4, 5), (2, 3, 2), shake=0.2)
    u, slope = affine(mesh.points)
    e, (lam, mu) = (slope + slope.T) / 2, lame(NU)
    expected = 60 * (lam * np.trace(e) ** 2 + 2 * mu * np.sum(e * e))
    assert u.ravel() @ (stiffness(mesh, NU) @ u.ravel()) == pytest.approx(expected, rel=1e-12)
    assert np.sum(u * (laplacian(mesh) @ u)) == pytest.approx(60 * np.sum(slope**2), rel=1e-12)


def test_youngs_modulus_and_poissons_ratio_of_lame():
    lam, mu = lame(NU, young=3.0)
    assert mu * (3 * lam + 2 * mu) / (lam + mu) == pytest.approx(3.0)
    assert lam / (2 * (lam + mu)) == pytest.approx(NU)


def test_pattern_is_the_node_graph(mesh):
    """Two nodes have an entry when they share a cell; slots point at the entry of their pair."""
    pattern = node_pattern(mesh)
    pairs = np.zeros((len(mesh.points),) * 2, dtype=bool)
    for cell in mesh.cells:
        pairs[np.ix_(cell, cell)] = True
    rows = np.repeat(np.arange(len(mesh.points)), np.diff(pattern.indptr))
    assert_array_equal(np.argwhere(pairs), np.column_stack([rows, pattern.indices]))
    assert_array_equal(pattern.indices[pattern.slot], np.broadcast_to(
        mesh.cells[:, None, :], pattern.slot.shape))  # fmt: skip
    assert_array_equal(rows[pattern.slot], np.broadcast_to(
        mesh.cells[:, :, None], pattern.slot.shape))  # fmt: skip


def test_strain_of_an_affine_field_is_exact_and_green_lagrange_ignores_rotation(box):
    mesh = box((0, 0, 0), (3, 4, 5), (2, 2, 2), shake=0.2)
    u, slope = affine(mesh.points)
    found = strain(mesh, u)
    assert_allclose(found, np.broadcast_to((slope + slope.T) / 2, found.shape), atol=1e-13)
    turn = Rotation.from_rotvec([0.1, -0.2, 0.4]).as_matrix()
    rotated = mesh.points @ turn.T - mesh.points
    assert_allclose(strain(mesh, rotated, finite=True), 0, atol=1e-13)
    assert np.abs(strain(mesh, rotated)).max() > 0.05


def manufactured(x):
    """u = (sin sin sin, 0, 0) on the unit cube, zero on its boundary, and -div sigma(u)."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(np.pi * x.T), np.cos(np.pi * x.T)
    (lam, mu), zero = lame(NU), np.zeros(len(x))
    s = sx * sy * sz
    force = (lam + mu) * np.column_stack([s, -cx * cy * sz, -cx * sy * cz])
    force[:, 0] += 3 * mu * s
    return np.column_stack([s, zero, zero]), np.pi**2 * force


def test_l2_error_of_a_manufactured_solution_has_order_two(box):
    counts, errors = np.array([4, 8, 16]), []
    for count in counts:
        mesh = box((0, 0, 0), (1, 1, 1), (count,) * 3)
        quadrature = gauss_points(mesh)
        exact, force = manufactured(quadrature.points)
        load = np.zeros_like(mesh.points)
        share = (quadrature.weight[:, None] * quadrature.shape)[:, :, None] * force[:, None]
        np.add.at(load, mesh.cells[quadrature.cell], share)
        inner = np.repeat(inner_nodes(mesh), 3)
        u = np.zeros(inner.shape)
        k = stiffness(mesh, NU).tocsr()[inner][:, inner]
        u[inner] = factorise(k).solve(load.ravel()[inner])
        found = interpolate(mesh.cells, quadrature.cell, quadrature.shape, u.reshape(-1, 3))
        errors.append(np.sqrt(quadrature.weight @ np.sum((found - exact) ** 2, axis=1)))
    orders = -np.diff(np.log(errors)) / np.diff(np.log(counts))
    print("errors", errors, "orders", orders)
    assert orders[-1] == pytest.approx(2, abs=0.1)
