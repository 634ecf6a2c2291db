"""Spline grids: values, refinement, and the matrices between control points."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from addvc.correlation.spline_grid import (
    SplineGrid,
    evaluate,
    grid_over,
    refine,
    scatter_vectors,
    spline_points,
)
from addvc.correlation.spline_stencil import (
    add_scalar,
    bending,
    conjugate_gradient,
    gram,
    scalar_product,
    scatter_dyads,
    stencil_product,
)

GRID = SplineGrid((-1.5, 2.0, 0.25), 6.0, (4, 5, 3))
SLOPE = np.array([[0.1, 0.04, 0.2], [0, -0.3, 0.05], [-0.03, 0.1, 0.12]])


@pytest.fixture
def points(rng):
    """Points of the box, some of them on its faces."""
    low, size = np.array(GRID.origin), GRID.spacing * np.array(GRID.cells)
    return np.vstack([low + size * rng.random((400, 3)), low, low + size])


@pytest.fixture
def coefficients(rng):
    return rng.normal(size=(*GRID.shape, 3))


def affine(points):
    return points @ SLOPE.T + [1.0, -2.0, 0.5]


# --------------------------------------------------------------------------- values


def test_the_basis_is_a_partition_of_unity(points):
    located = spline_points(GRID, points)
    assert_allclose(located.basis.sum(axis=2), 1, atol=1e-14)
    assert located.basis.min() >= 0


def test_an_affine_field_is_its_own_values_at_the_control_points(points):
    found = evaluate(GRID, affine(GRID.control_points()), points)
    assert_allclose(found, affine(points), atol=1e-12)


def test_refinement_keeps_the_field(points, coefficients):
    fine = refine(coefficients)
    assert fine.shape[:3] == GRID.finer().shape
    assert_allclose(
        evaluate(GRID.finer(), fine, points), evaluate(GRID, coefficients, points), atol=1e-13
    )


def test_the_field_has_no_jump_between_cells(coefficients):
    face = np.array([[GRID.origin[0] + 2 * GRID.spacing, 9.0, 7.0]])
    before, after = (
        evaluate(GRID, coefficients, face + np.array([d, 0, 0])) for d in (-1e-7, 1e-7)
    )
    assert_allclose(before, after, atol=1e-6)


def test_beyond_the_box_the_field_is_that_of_its_face(coefficients):
    inside = np.array([[GRID.origin[0], 9.0, 7.0]])
    far = evaluate(GRID, coefficients, inside - [50, 0, 0])
    assert_array_equal(far, evaluate(GRID, coefficients, inside))


@pytest.mark.parametrize("spacing", [7.0, 32.0, 200.0])
def test_a_grid_over_an_image_holds_every_voxel_centre(spacing):
    shape = np.array([40, 63, 51])
    grid = grid_over(tuple(shape), spacing)
    low, high = np.array(grid.origin), grid.origin + spacing * np.array(grid.cells)
    assert (low <= 0).all() and (high >= shape - 1).all()
    assert (high - low < shape - 1 + spacing).all()
    assert_allclose(low + high, shape - 1)


def test_sorted_points_are_the_same_points(points):
    located = spline_points(GRID, points)
    assert located.first[-1] == len(points)
    assert_array_equal(np.unique(located.points, axis=0), np.unique(points, axis=0))
    number = np.ravel_multi_index(tuple(located.cell.T), GRID.cells)
    assert (np.diff(number) >= 0).all()


# --------------------------------------------------------------------------- matrices


@pytest.fixture
def lattice():
    """Voxel centres: lines and planes of points that share coordinates."""
    lines = [np.arange(0.0, 20), np.arange(3.0, 30), np.arange(1.0, 17)]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize("kind", ["points", "lattice"])
def test_vectors_are_scattered_by_the_transpose_of_the_values(kind, request, coefficients, rng):
    located = spline_points(GRID, request.getfixturevalue(kind))
    vectors = rng.normal(size=located.points.shape)
    scattered = scatter_vectors(GRID.cells, located.first, located.basis, vectors)
    values = evaluate(GRID, coefficients, located.points)
    assert_allclose(np.sum(scattered * coefficients), np.sum(vectors * values), rtol=1e-12)


@pytest.fixture(params=["points", "lattice"])
def stencil(request, rng):
    """The stencil of sum w (g . u)^2 over points, and that sum as a function of coefficients."""
    located = spline_points(GRID, request.getfixturevalue(request.param))
    g, w = rng.normal(size=located.points.shape), rng.random(len(located.points))

    def form(x, y):
        along = (np.sum(g * evaluate(GRID, c, located.points), axis=1) for c in (x, y))
        return np.sum(w * np.prod(list(along), axis=0))

    return scatter_dyads(GRID.cells, located.first, located.basis, g, w), form


def test_a_stencil_is_the_sum_over_the_points(stencil, rng):
    """To the rounding of each of its entries, which are in single precision."""
    matrix, form = stencil
    x, y = rng.normal(size=(2, *GRID.shape, 3))
    rounding = np.finfo(np.float32).eps * np.sum(abs(y) * stencil_product(abs(matrix), abs(x)))
    assert_allclose(np.sum(y * stencil_product(matrix, x)), form(x, y), rtol=0, atol=rounding)
    assert_allclose(np.sum(x * stencil_product(matrix, y)), form(x, y), rtol=0, atol=rounding)


def test_sums_do_not_depend_on_threads(lattice, rng, with_one_and_two_threads):
    located = spline_points(GRID, lattice)
    g, w = rng.normal(size=lattice.shape), rng.random(len(lattice))

    def sums():
        return (
            scatter_dyads(GRID.cells, located.first, located.basis, g, w),
            scatter_vectors(GRID.cells, located.first, located.basis, g),
        )

    for one, two in zip(*with_one_and_two_threads(sums), strict=True):
        assert_array_equal(one, two)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_gram_bands_integrate_squares_of_derivatives(order):
    cells = 5
    knots = np.arange(cells + 3) - 1.0
    # x^2 has the coefficients k^2 - 1/3
    c = knots**2 - 1 / 3
    matrix, bands = np.zeros((cells + 3, cells + 3)), gram(cells, order)
    for a in range(cells + 3):
        for b in range(max(0, a - 3), min(cells + 3, a + 4)):
            matrix[a, b] = bands[a, 3 + b - a]
    exact = {0: cells**5 / 5, 1: 4 * cells**3 / 3, 2: 4 * cells}[order]
    assert_allclose(c @ matrix @ c, exact, rtol=1e-12)


def test_affine_fields_do_not_bend(rng):
    energy = bending(GRID)
    field = affine(GRID.control_points())
    scale = np.abs(scalar_product(energy, rng.normal(size=field.shape))).max()
    assert_allclose(scalar_product(energy, field) / scale, 0, atol=1e-12)


def test_only_affine_fields_do_not_bend():
    grid = SplineGrid((0.0, 0.0, 0.0), 2.0, (1, 2, 1))
    energy, n = bending(grid), int(np.prod(grid.shape))
    columns = []
    for unit in np.eye(n):
        x = np.zeros((*grid.shape, 3))
        x[..., 0] = unit.reshape(grid.shape)
        columns.append(scalar_product(energy, x)[..., 0].ravel())
    values = np.linalg.eigvalsh(np.array(columns))
    assert (np.abs(values) < 1e-10 * values[-1]).sum() == 4
    assert values[0] > -1e-12 * values[-1]


@pytest.mark.parametrize("axes", [(0, 0), (0, 1), (1, 2)])
def test_bending_energy_of_a_quadratic_field(axes):
    """|grad grad u|^2 = 4 for u = x^2 and 2 for u = x y."""
    points, h = GRID.control_points(), GRID.spacing
    i, j = axes
    u = np.zeros_like(points)
    u[..., 2] = points[..., i] * points[..., j] - (h * h / 3 if i == j else 0)
    volume = np.prod(h * np.array(GRID.cells))
    found = np.sum(u * scalar_product(bending(GRID), u))
    assert_allclose(found, volume * (4 if i == j else 2), rtol=1e-9)


def test_conjugate_gradients_solve_to_the_accuracy_asked(stencil, rng):
    system = stencil[0]
    add_scalar(system, bending(GRID), 30.0)
    b = rng.normal(size=(*GRID.shape, 3))
    for accuracy in (1e-2, 1e-8):
        x, steps = conjugate_gradient(system, b, accuracy, 3000)
        assert steps < 3000
        left = np.linalg.norm(b - stencil_product(system, x)) / np.linalg.norm(b)
        assert left < 1.1 * accuracy


def test_nothing_to_solve_takes_no_step(stencil):
    system = stencil[0]
    add_scalar(system, bending(GRID), 30.0)
    x, steps = conjugate_gradient(system, np.zeros((*GRID.shape, 3)), 1e-2, 10)
    assert steps == 0 and not x.any()
