"""Solutions and factors come back from disk as they were."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import sparse

from addvc.correlation.gauss_newton import Solution
from addvc.correlation.store import load_factor, load_solution, save_factor, save_solution
from addvc.fem.operators import stiffness
from addvc.fem.solver import factorise


@pytest.fixture
def solution(rng):
    return Solution(rng.standard_normal((7, 3)), [0.3, 0.02, 5e-4], True, 1.25,
                    {"mean": 0.1, "std": 2.5, "outside": 3})  # fmt: skip


def test_solution_comes_back(tmp_path, solution):
    path = tmp_path / "state1" / "meso33.h5"
    save_solution(path, solution, table=[{"candidate": "zero", "residual_std": 2.5}], factor=1.5)
    back, notes = load_solution(path)
    assert_array_equal(back.u, solution.u)
    assert (back.history, back.converged, back.seconds, back.residual, back.iterations) == (
        solution.history, True, 1.25, solution.residual, 3)  # fmt: skip
    assert notes == {"table": [{"candidate": "zero", "residual_std": 2.5}], "factor": 1.5}


def test_failed_solution_stays_failed(tmp_path):
    lost = Solution(np.full((4, 3), np.nan), [np.inf, np.nan], False,
                    residual={"mean": float("nan"), "std": float("nan"), "outside": 9})  # fmt: skip
    save_solution(tmp_path / "u.h5", lost)
    back, _ = load_solution(tmp_path / "u.h5")
    assert not back.converged
    assert_array_equal(back.history, lost.history)
    assert np.isnan(back.residual["std"])


def test_factor_comes_back_and_solves_the_same(tmp_path, box, rng):
    k = stiffness(box((0, 0, 0), (6, 6, 6), (3, 3, 3)), 0.28).tocsr()
    factor = factorise(k + sparse.identity(k.shape[0]))
    save_factor(tmp_path / "factor.h5", factor, k, {"c1": 2.0, "c2": 0.0})
    back, regularisation, weights = load_factor(tmp_path / "factor.h5")
    b = rng.standard_normal(k.shape[0])
    assert_array_equal(back.solve(b), factor.solve(b))
    assert_array_equal(regularisation @ b, k @ b)
    assert weights == {"c1": 2.0, "c2": 0.0}


def test_interrupted_write_leaves_what_was_there(tmp_path, solution):
    path = tmp_path / "u.h5"
    save_solution(path, solution)
    with pytest.raises(TypeError):
        save_solution(path, solution, notes_json_cannot_hold=object())
    assert_array_equal(load_solution(path)[0].u, solution.u)
    assert [file.name for file in tmp_path.iterdir()] == ["u.h5"]
