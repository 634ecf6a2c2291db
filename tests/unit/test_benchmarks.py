"""The benchmarks, but for what needs the peers' packages: the pair and its truth, tables, costs."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import ndimage

from addvc.errors import AddvcError
from addvc.images.spline import interpolating_coefficients
from addvc.twin import Truth

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

from benchmark.band import Band  # noqa: E402
from benchmark.pairs import PairOptions, make_pair, strut_nodes, turned  # noqa: E402
from benchmark.study import ONCE, RULES, cost  # noqa: E402
from benchmark.tables import best_of, fill, with_ratio, write_csv  # noqa: E402

OPTIONS = PairOptions(side=56, size="tiny", junction=0.9, bow=0.7)


@pytest.fixture(scope="module")
def pair():
    return make_pair(OPTIONS)


def test_truth_of_a_pair_is_that_of_its_images(pair):
    """At the voxels of struts the residual under the truth is that of the noise, and a tenth more."""
    network, motions, images = pair
    before, after = (image.astype(np.float32) for image in images)
    truth = Truth(network, motions, (0.0, 0.01))
    points = np.argwhere(before > 65).astype(float)
    points = points[((points > 6) & (points < OPTIONS.side - 7)).all(axis=1)]
    u = truth.displacement(points, 1)
    at = (points + u).T
    found = ndimage.map_coordinates(
        interpolating_coefficients(after, 3), at, order=3, prefilter=False
    )
    here = tuple(points.astype(int).T)
    r, rest = before[here] - found, (before - after)[here]
    print(
        f"residual {r.std():.2f}, at rest {rest.std():.2f}, rms u {np.sqrt((u**2).sum(1).mean()):.2f}"
    )
    assert r.std() < 1.5 * np.sqrt(2) * OPTIONS.noise
    assert rest.std() > 4 * r.std()


def test_struts_move_each_on_its_own(pair):
    """Neighbouring junctions are not correlated; nodes are where the truth puts them."""
    network, motions, _ = pair
    u = motions[1].positions - network.nodes
    ends = np.array([chain[[0, -1]] for chain in strut_nodes(network)])
    a, b = u[ends].swapaxes(0, 1)
    assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.2
    assert u[ends].std() == pytest.approx(OPTIONS.junction, rel=0.15)
    truth = Truth(network, motions, (0.0, 0.01))
    middle = np.array([chain[len(chain) // 2] for chain in strut_nodes(network)])
    inside = ((network.nodes[middle] > 4) & (network.nodes[middle] < OPTIONS.side - 5)).all(axis=1)
    middle = middle[inside]
    # where another strut is near the truth blends both
    gap = np.linalg.norm(truth.displacement(network.nodes[middle], 1) - u[middle], axis=1)
    assert np.median(gap) < 1e-9 and (gap < 0.05).mean() > 0.9


def test_least_rotation_takes_one_direction_to_the_other(rng):
    a, b = rng.standard_normal((2, 20, 3))
    unit = lambda v: v / np.linalg.norm(v, axis=1)[:, None]  # noqa: E731
    assert_allclose(np.einsum("nij,nj->ni", turned(a, b), unit(a)), unit(b), atol=1e-12)


def test_band_is_pulled_back_to_where_it_came_from(rng):
    band = Band()
    x = rng.uniform(0, 95, (500, 3))
    u = band.displacement(x)
    assert_allclose(band.pulled_back(x + u), x, atol=1e-4)
    step = 1e-4 * band.normal
    slope = (band.displacement(x + step) - band.displacement(x - step))[:, 1] / 2e-4
    assert slope.min() == pytest.approx(-band.strain, rel=0.02)


ROWS = [
    {"state": 1, "tool": "meso 12", "rms": 0.2, "cpu_s": 20.0},
    {"state": 1, "tool": "peer", "rms": 0.1, "cpu_s": 50.0},
    {"state": 1, "tool": "peer", "rms": 0.3, "cpu_s": 10.0},
]


def test_a_peer_is_shown_by_its_best_settings():
    assert best_of(ROWS[1:])["rms"] == 0.1
    assert [row["cpu_ratio"] for row in with_ratio(ROWS, "meso 12")] == [1.0, 2.5, 0.5]


def test_costs_are_those_of_rules_that_there_are(tmp_path):
    text = "".join(path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk"))
    rules = {name for names in RULES.values() for name in names} | {*ONCE, "micro_dvc"}
    assert rules <= set(re.findall(r"rule (\w+):", text))
    for name in (
        "smooth/state1",
        "smooth/state2",
        "meso_dvc/meso12_state1",
        "micro_dvc/micro_state1",
    ):
        path = tmp_path / f"benchmarks/{name}.tsv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("s\tcpu_time\n3.0\t2.5\n")
    assert cost(tmp_path, "meso12", 1) == 5.0
    assert cost(tmp_path, "micro", 1) == 7.5
    assert cost(tmp_path, "micro-eq10", 1) == 5.0


def test_tables_go_between_their_marks(tmp_path):
    readme, table = tmp_path / "README.md", tmp_path / "peers.csv"
    write_csv(table, ROWS[:2], ["tool", "rms"])
    for text in ("before\n<!-- table peers -->\n<!-- end -->\nafter\n", None):
        if text:
            readme.write_text(text)
        fill(readme, [table])
        assert readme.read_text() == (
            "before\n<!-- table peers -->\n\n| tool | rms |\n| --- | --- |\n"
            "| meso 12 | 0.200 |\n| peer | 0.100 |\n\n<!-- end -->\nafter\n"
        )
    readme.write_text("no marks")
    with pytest.raises(AddvcError, match="no mark `<!-- table peers -->`"):
        fill(readme, [table])
