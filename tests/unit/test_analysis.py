"""What the displacement says: residuals, validity, errors, fields and costs, on hand-made cases."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from addvc.analysis.fields import by_owner, described, result_fields
from addvc.analysis.residuals import by_cell, load_residual, residual_on, save_residual
from addvc.analysis.summary import costs, said, scan_noise
from addvc.analysis.truth import error_statistics, errors_at, judged_nodes, load_truth
from addvc.analysis.validity import nodal_residual, valid_nodes, verdict
from addvc.correlation.doubt import LIMIT, nodal_square, residual_limit
from addvc.correlation.metric import Reference
from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import gauss_points
from addvc.images.levels import bin_mean
from addvc.images.spline import gaussian_blur
from addvc.twin.virtual import VirtualField

PAIR = Mesh(np.vstack([np.zeros(3), np.eye(3), np.ones(3)]), [[0, 1, 2, 3], [1, 2, 3, 4]])
SLOPE = np.array([[0.02, 0.01, 0.0], [-0.03, -0.05, 0.004], [0.0, 0.02, 0.01]])


# ------------------------------------------------------------------------------- residuals


@pytest.fixture(scope="module")
def fine(box):
    return box((2, 2, 2), (18, 18, 18), (16, 16, 16), shake=0.2)


def reference_of(mesh, grey):
    """A reference with the given grey levels at its points, and no gradient."""
    quadrature = gauss_points(mesh)
    still, inside = np.zeros((len(grey), 3)), np.ones(len(grey), bool)
    return Reference(mesh, quadrature, grey.astype(np.float32), still, inside)


@pytest.mark.parametrize(
    ("kind", "skewness", "kurtosis"),
    [("normal", 0, 0), ("uniform", 0, -1.2), ("exponential", 2, 6)],
)
def test_statistics_of_a_known_residual(fine, rng, kind, skewness, kurtosis):
    """Against an image of 50 the residual is the noise itself; its law has known moments."""
    count = 4 * len(fine.cells)
    noise = getattr(rng, kind)(size=count)
    result = residual_on(
        reference_of(fine, 50 + 3 * noise), np.full((21, 21, 21), 50, np.float32), 0 * fine.points
    )
    found = result["statistics"]
    spread = {"normal": 1, "uniform": 12**-0.5, "exponential": 1}[kind]
    assert result["inside"].all() and found["outside"] == 0
    assert found["std"] == pytest.approx(3 * spread, rel=0.02)
    assert found["skewness"] == pytest.approx(skewness, abs=0.03 + 0.05 * skewness)
    assert found["kurtosis"] == pytest.approx(kurtosis, abs=0.06 + 0.15 * abs(kurtosis))


def test_statistics_are_those_of_the_points_inside(fine):
    """A motion of 5 voxels pushes what is beyond x = 15 out of an image of 21 voxels."""
    reference = reference_of(fine, np.where(gauss_points(fine).points[:, 0] > 15, 1e6, 51.0))
    u = np.zeros_like(fine.points)
    u[:, 0] = 5
    result = residual_on(reference, np.full((21, 21, 21), 50, np.float32), u)
    beyond = reference.quadrature.points[:, 0] > 15
    np.testing.assert_array_equal(result["inside"], ~beyond)
    assert result["statistics"]["outside"] == beyond.sum() > 0
    assert result["statistics"]["mean"] == pytest.approx(1)
    assert result["statistics"]["std"] == pytest.approx(0, abs=1e-9)
    assert result["statistics"]["skewness"] == pytest.approx(0, abs=1e-9)
    assert np.all(result["r"][beyond] == 0)


@pytest.mark.parametrize("far", [100.0, np.nan], ids=["far away", "nan"])
def test_a_displacement_that_leaves_the_image_has_no_statistics(box, far):
    """A result, not an error: the state is then `failed`."""
    mesh = box((2, 2, 2), (8, 8, 8), (2, 2, 2))
    reference = reference_of(mesh, np.full(4 * len(mesh.cells), 50.0))
    u = np.full_like(mesh.points, far)
    result = residual_on(reference, np.full((11, 11, 11), 50, np.float32), u)
    assert not result["inside"].any()
    assert result["statistics"]["outside"] == len(reference.quadrature)
    for name in ("mean", "std", "skewness", "kurtosis"):
        assert np.isnan(result["statistics"][name])


def test_a_residual_survives_the_disk(tmp_path, rng):
    result = {
        "r": rng.standard_normal(8).astype(np.float32),
        "inside": rng.random(8) > 0.5,
        "weight": rng.random(8),
        "node_square": rng.random(5),
        "statistics": {"mean": -0.5, "std": float("nan"), "outside": 3, "kurtosis": 1.25},
    }
    save_residual(tmp_path / "new/r.h5", result)
    found = load_residual(tmp_path / "new/r.h5")
    for name in ("r", "inside", "weight", "node_square"):
        np.testing.assert_array_equal(found[name], result[name])
        assert found[name].dtype == result[name].dtype
    assert type(found["statistics"]["outside"]) is int
    np.testing.assert_equal(found["statistics"], result["statistics"])


def test_mean_of_a_cell_is_weighted_and_knows_what_was_dropped():
    values = np.array([1, 3, 5, 7, 2, 100, 9, 9], dtype=float)
    weight = np.array([1, 1, 1, 1, 3, 1, 1, 1], dtype=float)
    inside = np.array([1, 1, 1, 1, 1, 0, 1, 0], dtype=bool)
    np.testing.assert_allclose(by_cell(values, weight, inside, 2), [4, (6 + 9) / 4])
    inside[4:] = False
    np.testing.assert_array_equal(by_cell(values, weight, inside, 2), [4, np.nan])


def test_mean_by_owner_leaves_out_the_unknown():
    values = np.array([1.0, 3.0, np.nan, 8.0, np.nan])
    owner = np.array([2, 2, 2, 0, 3])
    np.testing.assert_array_equal(by_owner(values, owner, 5), [8, np.nan, 2, np.nan, np.nan])


# -------------------------------------------------------------------------------- validity


def test_residual_around_a_node_is_the_rms_over_its_cells():
    np.testing.assert_allclose(
        nodal_residual(PAIR, np.array([4.0, 16.0])), [2, *[10**0.5] * 3, 4], rtol=1e-14
    )


def test_residual_around_a_node_knows_what_is_unknown():
    found = nodal_residual(PAIR, np.array([np.nan, 9.0]))
    np.testing.assert_array_equal(found, [np.nan, 3, 3, 3, 3])


def test_a_node_is_valid_up_to_a_multiple_of_the_noise_of_a_difference():
    limit = residual_limit(2.0)
    assert limit == pytest.approx(LIMIT * np.hypot(2, 2))
    around = np.array([0.999 * limit, 1.001 * limit, np.nan, 0.0])
    np.testing.assert_array_equal(valid_nodes(around, 2.0), [True, False, False, True])


def test_a_uniform_residual_is_that_of_every_node(fine):
    reference = reference_of(fine, np.full(4 * len(fine.cells), 50.0))
    inside = np.ones(len(reference.quadrature), bool)
    square = nodal_square(reference, np.full(len(inside), -3.0), inside)
    np.testing.assert_allclose(square, 9, rtol=1e-12)


def test_a_residual_stays_near_its_place_and_keeps_what_is_unknown(fine):
    """r = 5 for x < 8: known far on either side, unknown where every point has left the image."""
    reference = reference_of(fine, np.full(4 * len(fine.cells), 50.0))
    x, node = reference.quadrature.points[:, 0], fine.points[:, 0]
    r = np.where(x < 8, 5.0, 0.0)
    square = nodal_square(reference, r, np.ones(len(x), bool), times=1)
    assert square.min() >= 0 and square.max() <= 25 + 1e-9
    far = np.abs(node - 8) > 6
    np.testing.assert_allclose(square[far], np.where(node[far] < 8, 25, 0), atol=1e-9)
    unknown = nodal_square(reference, r, x > 1e9)
    assert np.isnan(unknown).all()


@pytest.mark.parametrize(
    ("converged", "share", "word"),
    [
        (True, 1.0, "converged"),
        (True, 0.95, "converged"),
        (True, 0.9499, "flagged"),
        (False, 1.0, "flagged"),
        (True, 0.5001, "flagged"),
        (True, 0.5, "failed"),
        (False, 0.0, "failed"),
        (True, float("nan"), "failed"),
    ],
)
def test_verdict(converged, share, word):
    assert verdict(converged, share) == word


# ---------------------------------------------------------------------------------- errors


def test_error_statistics_of_known_vectors():
    error = np.zeros((100, 3))
    error[:20] = [3, 0, 4]
    error[20:40] = [0, 0.5, 0]
    found = error_statistics(error, None)
    assert found["count"] == 100
    assert found["rms"] == pytest.approx(np.sqrt(0.2 * 25 + 0.2 * 0.25))
    assert found["median"] == 0
    assert found["p95"] == 5
    assert found["within_1_voxel"] == 0.8
    assert found["rms_normal"] is None and found["rms_along"] is None


def test_error_normal_to_and_along_the_strut():
    error = np.array([[1.0, 2.0, 2.0], [0.0, 3.0, 0.0]])
    tangent = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    found = error_statistics(error, tangent)
    assert found["rms_along"] == pytest.approx(np.sqrt((1 + 9) / 2))
    assert found["rms_normal"] == pytest.approx(np.sqrt((8 + 0) / 2))


def test_normal_and_along_are_two_sides_of_a_right_triangle(rng):
    error, tangent = rng.standard_normal((2, 500, 3))
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    found = error_statistics(error, tangent)
    assert np.hypot(found["rms_normal"], found["rms_along"]) == pytest.approx(found["rms"])
    assert found["rms_normal"] == pytest.approx(np.sqrt(2) * found["rms_along"], rel=0.1)


def test_error_against_the_truth_of_a_virtual_test(tmp_path, rng):
    field = VirtualField((0.02, 0.05), axis=2)
    field.save(tmp_path / "virtual.json")
    points = 60 * rng.random((50, 3))
    u = field.displacement(points, 2) + np.array([0, 0.3, 0.4])
    (found,) = errors_at(load_truth(tmp_path / "virtual.json"), points, [u], 2)
    assert found["rms"] == pytest.approx(0.5) and found["p95"] == pytest.approx(0.5)
    assert found["rms_normal"] is None


# ---------------------------------------------------------------------------------- fields


def residual_of(mesh, value):
    """A residual of one value at every Gauss point and in the shell."""
    quadrature = gauss_points(mesh)
    return {
        "r": np.full(len(quadrature), value, np.float32),
        "inside": np.ones(len(quadrature), bool),
        "weight": quadrature.weight,
        "node_square": np.full(len(mesh.points), value**2),
    }


def check_strain(cells):
    strain = (SLOPE + SLOPE.T) / 2
    np.testing.assert_allclose(cells["strain"], np.tile(strain.ravel(), (len(cells["strain"]), 1)),
                               atol=1e-14)  # fmt: skip
    np.testing.assert_allclose(cells["strain_norm"], np.sqrt((strain**2).sum()), rtol=1e-12)


def test_fields_of_a_uniform_strain_on_the_struts(box):
    micro = box((0, 0, 0), (4, 6, 5), (4, 6, 5), shake=0.2)
    u = micro.points @ SLOPE.T + 1.5
    points, cells = result_fields(micro, u, micro, residual_of(micro, -2.0), noise=1.0)
    check_strain(cells)
    assert points["displacement"] is u
    assert points["valid"].dtype == np.uint8 and points["valid"].all()
    np.testing.assert_allclose(cells["residual"], -2)
    doubtful, _ = result_fields(micro, u, micro, residual_of(micro, -2.0), noise=0.4)
    assert not doubtful["valid"].any()


def test_a_turn_is_a_small_strain_but_none_of_green_and_lagrange(box):
    micro = box((0, 0, 0), (4, 6, 5), (4, 6, 5), shake=0.2)
    turn = Rotation.from_rotvec([0.0, 0.0, np.radians(20)]).as_matrix()
    u, residual = micro.points @ (turn - np.eye(3)).T, residual_of(micro, 0.0)
    small, green = (
        result_fields(micro, u, micro, residual, 1.0, finite=finite)[1]["strain_norm"]
        for finite in (False, True)
    )
    np.testing.assert_allclose(small, np.sqrt(2) * (1 - np.cos(np.radians(20))), rtol=1e-9)
    np.testing.assert_allclose(green, 0, atol=1e-12)
    points, cells = result_fields(micro, u, micro, residual, 1.0)
    assert {*points, *cells, "uncertainty"} == set(described("small")["fields"])


def test_torn_cells_have_no_strain_and_their_nodes_no_judgement(box):
    micro = box((0, 0, 0), (4, 6, 5), (4, 6, 5), shake=0.2)
    residual = residual_of(micro, -2.0)
    points, cells = result_fields(micro, 0.0 * micro.points, micro, residual, 1.0, torn=[3])
    assert np.flatnonzero(np.isnan(cells["strain_norm"])).tolist() == [3]
    gone = np.unique(micro.cells[3])
    assert np.flatnonzero(points["valid"] == 0).tolist() == gone.tolist()
    penalised = np.zeros(len(micro.points), int)
    penalised[7] = 1
    judged = judged_nodes(micro.cells, penalised, [3])
    assert np.flatnonzero(~judged).tolist() == np.union1d(gone, 7).tolist()


def test_fields_on_a_coarse_mesh_that_the_struts_fill_in_part(box):
    """Cells and nodes far from any strut are unknown, hence not valid."""
    coarse = box((0, 0, 0), (40, 20, 20), (4, 2, 2))
    micro = box((1, 1, 1), (9, 19, 19), (4, 9, 9), shake=0.2)
    u = coarse.points @ SLOPE.T
    points, cells = result_fields(coarse, u, micro, residual_of(micro, 2.0), noise=1.0)
    check_strain(cells)
    x = coarse.points[coarse.cells].mean(axis=1)[:, 0]
    np.testing.assert_allclose(cells["residual"][x < 10], 2)
    assert np.isnan(cells["residual"][x > 10]).all()
    np.testing.assert_array_equal(points["valid"], coarse.points[:, 0] <= 10)


def test_opposite_residuals_of_one_cell_cancel_in_its_mean_but_not_in_validity(box):
    """The residual of a cell has a sign; a node is judged by the square."""
    micro = box((0, 0, 0), (4, 4, 4), (2, 2, 2))
    residual = residual_of(micro, 10.0)
    residual["r"][::2] *= -1
    points, cells = result_fields(micro, 0 * micro.points, micro, residual, noise=1.0)
    np.testing.assert_allclose(cells["residual"], 0, atol=1e-6)
    assert not points["valid"].any()


# ----------------------------------------------------------------------------------- costs

HEAD = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"


def test_costs_add_up_over_the_jobs_of_a_rule(tmp_path):
    """Figures are drawn while the summary is made: they do not count, nor do rules apart."""
    rows = {
        "meso_dvc/meso12_state1.tsv": "4.0\t0:00:04\t200.5\t1\t1\t1\t1\t1\t90\t3.5\n",
        "meso_dvc/meso12_state2.tsv": "6.0\t0:00:06\t300.5\t1\t1\t1\t1\t1\t90\t5.5\n",
        "summary/all.tsv": "0.4\t0:00:00\tNA\tNA\tNA\tNA\tNA\tNA\tNA\tNA\n",
        "scene/all.tsv": "8.0\t0:00:08\t500.0\t1\t1\t1\t1\t1\t90\t7.0\n",
        "figures/fig03.tsv": "8.0\t0:00:08\t500.0\t1\t1\t1\t1\t1\t90\t7.0\n",
    }
    for name, row in rows.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(HEAD + row)
    assert costs(tmp_path, ["scene"], [1, 2], ["meso12", "micro"]) == {
        "meso_dvc": {"jobs": 2, "cpu_s": 9.0, "wall_s": 10.0, "max_rss_mb": 300.5},
        "summary": {"jobs": 1, "cpu_s": 0.0, "wall_s": 0.4, "max_rss_mb": 0.0},
    }


def test_a_benchmark_that_is_being_written_is_no_error(tmp_path):
    (tmp_path / "smooth").mkdir()
    (tmp_path / "smooth/state1.tsv").write_text("")
    (tmp_path / "smooth/state2.tsv").write_text(HEAD)
    assert costs(tmp_path, [], [], []) == {}


def test_costs_leave_out_what_earlier_configurations_made(tmp_path):
    names = ["micro_state1", "micro-eq10_state1", "micro_state2", "all", "micro-without_shell"]
    for name in names:
        (tmp_path / "micro_dvc").mkdir(exist_ok=True)
        (tmp_path / f"micro_dvc/{name}.tsv").write_text("s\tcpu_time\tmax_rss\n2\t1\t3\n")
    jobs = lambda *given: costs(tmp_path, [], *given)["micro_dvc"]["jobs"]  # noqa: E731
    assert jobs([1, 2], ["micro", "micro-eq10"]) == 4
    assert jobs([1], ["micro", "micro-eq10"]) == 3
    assert jobs([1], ["micro"]) == 2


@pytest.mark.parametrize(("blur", "factor"), [(0.0, 1), (0.7, 1), (0.8, 3)])
def test_the_noise_of_a_scan_is_told_from_that_of_the_blurred_image(blur, factor):
    noise = np.random.default_rng(2417).normal(0, 5, (40 * factor,) * 3)
    image = gaussian_blur(bin_mean(noise, factor), blur)[4:-4, 4:-4, 4:-4]
    assert scan_noise(image.std(), blur, factor) == pytest.approx(5, rel=0.03)


def test_warnings_of_jobs_are_collected(tmp_path):
    """Those of rules that the first page does not speak for, and of states that there are."""
    log = "00:18:10 [smooth {0}] WARNING: this scan has void of 47\n00:18:10 [smooth {0}] done\n"
    for path, text in (("smooth/state2.log", log.format(2)), ("smooth/state7.log", log.format(7)),
                       ("volume/state0.log", "00:18:09 [volume 0] done in 1.1 s\n"),
                       ("meso_dvc/state2.log", log.format(2))):  # fmt: skip
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text)
    assert said(tmp_path, [1, 2], []) == ["smooth 2: this scan has void of 47"]
    assert said(tmp_path, [1, 2], ["smooth"]) == []
