"""Elements as functions: shape functions, their slopes, and the degree of the Gauss rules."""

from itertools import product
from math import factorial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from addvc.fem.elements import HEX_CORNERS, gauss_hex, gauss_tet, hex_q1, tet_p1

TET_CORNERS = np.vstack([np.zeros(3), np.eye(3)])
ELEMENTS = pytest.mark.parametrize(
    ("element", "corners"), [(tet_p1, TET_CORNERS), (hex_q1, HEX_CORNERS)], ids=["tet", "hex"]
)
ANYWHERE = np.random.default_rng(2417).uniform(-1, 1, (50, 3))


@ELEMENTS
def test_partition_of_unity(element, corners):
    shape, slopes = element(ANYWHERE)
    assert_allclose(shape.sum(axis=1), 1, atol=1e-14)
    assert_allclose(slopes.sum(axis=1), 0, atol=1e-14)


@ELEMENTS
def test_each_shape_function_is_one_at_its_own_corner(element, corners):
    assert_allclose(element(corners)[0], np.eye(len(corners)), atol=1e-14)


@ELEMENTS
def test_positions_are_reproduced(element, corners):
    assert_allclose(element(ANYWHERE)[0] @ corners, ANYWHERE, atol=1e-14)


@ELEMENTS
def test_slopes_are_the_derivatives(element, corners):
    """Shape functions are linear along each axis, so central differences are exact."""
    _, slopes = element(ANYWHERE)
    for j, way in enumerate(0.5 * np.eye(3)):
        difference = element(ANYWHERE + way)[0] - element(ANYWHERE - way)[0]
        assert_allclose(slopes[:, :, j], difference, atol=1e-14)


@pytest.mark.parametrize(("count", "degree"), [(1, 1), (4, 2)])
def test_tet_rule_is_exact_up_to_its_degree(count, degree):
    xi, weights = gauss_tet(count)
    for powers in product(range(degree + 1), repeat=3):
        if sum(powers) <= degree:
            exact = np.prod([factorial(p) for p in powers]) / factorial(sum(powers) + 3)
            assert weights @ np.prod(xi**powers, axis=1) == pytest.approx(exact, rel=1e-13)


def test_hex_rule_is_exact_for_cubics_in_each_direction():
    xi, weights = gauss_hex()
    for powers in product(range(4), repeat=3):
        exact = np.prod([0 if p % 2 else 2 / (p + 1) for p in powers])
        assert weights @ np.prod(xi**powers, axis=1) == pytest.approx(exact, abs=1e-13)


def test_unknown_rule_names_those_that_exist():
    with pytest.raises(ValueError, match="no tetrahedral Gauss rule with 5 points; use 1 or 4"):
        gauss_tet(5)
