"""The compressed solid foam, a truth that shares nothing with the beam twin: what is kept of it, its
images and its displacement agree; with --slow the workflow itself, judged by it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial import cKDTree

from addvc.analysis.residuals import residual_on
from addvc.correlation.metric import reference_on, residual
from addvc.correlation.micro import micro_reference
from addvc.fem.io import read_mesh
from addvc.fem.mesh import Mesh
from addvc.fem.quadrature import gauss_points
from addvc.images.scans import load_volume
from addvc.images.spline import spline_value
from solid_twin.fixture import FIXTURE, load_record
from solid_twin.foam import struts
from solid_twin.imaging import Imaging, clean_image, correlated_noise, eight_bit
from solid_twin.scans import solid_truth, write_case
from solid_twin.solid import Solid

ROOT = Path(__file__).parents[2]
STATES = (1, 2, 3)
CLEAN = 3.0  # grey levels
EXCESS = {1: 1.15, 2: 1.15, 3: 1.25}
"""Residual over that of the noise alone. At 15 % one part in forty of the solid has come within 4
voxels of another strut and sees its grey levels: 7.8 there without noise, 0.95 elsewhere."""

LARGEST = {
    1: {"rms_normal": 0.10, "p95": 0.22},
    2: {"rms_normal": 0.11, "p95": 0.24},
    3: {"median": 0.15},
}
"""Error of micro DVC, voxels. At 15 % a few struts are lost by the method of the paper."""


@pytest.fixture(scope="module")
def compression():
    return load_record()


@pytest.fixture(scope="module")
def truth(compression):
    return solid_truth(compression)


@pytest.fixture(scope="module")
def corners(compression):
    """The linear mesh without the nodes of edges."""
    cells = compression.mesh.cells[:, :4]
    return Mesh(compression.mesh.points[: cells.max() + 1], cells)


@pytest.fixture(scope="module")
def drawn(compression):
    """(e, 2, 3) ends of the struts as they were drawn, before they were bent."""
    foam = compression.foam
    return struts(foam, np.random.default_rng([foam.seed, 1]))


@pytest.fixture(scope="module")
def clean(compression):
    """Images without noise: of the reference and all states."""
    return [clean_image(compression, state, Imaging()) for state in (0, *STATES)]


# ---------------------------------------------------------------------------- the fixture


def test_the_fixture_is_small_and_says_how_it_was_made(compression):
    assert FIXTURE.stat().st_size < 6e6
    assert "solid_twin.make" in compression.made["command"]
    assert {"python", "numpy", "scikit-sparse"} <= set(compression.made["versions"])
    assert compression.strains.tolist() == [0.04, 0.08, 0.15]


def test_it_softens_as_cells_buckle(compression):
    strain, force, energy = compression.curve.T
    slope = np.diff(force) / np.diff(strain)
    assert (slope > 0).all() and slope[-1] < 0.4 * slope[0]
    height = compression.foam.high - compression.foam.low
    work = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(strain)) * height
    np.testing.assert_allclose(energy[1:] - energy[0], work, rtol=0.01)


@pytest.mark.parametrize("state", STATES)
def test_a_state_is_whole_and_held_by_its_platens(compression, state):
    """No element is inverted; nodes in a platen move with it, no other is deep in it; the energy is
    the one of the curve, to the rounding of the file."""
    x, u = compression.mesh.points, compression.displacements[state - 1]
    low, high = compression.platens[state]
    top = x[:, 1] >= compression.foam.high
    energy = Solid(compression.mesh).energy(x + u)
    strain, _, stored = compression.curve.T
    here = np.isclose(strain, compression.strains[state - 1])
    assert energy == pytest.approx(stored[here][0], rel=0.01)
    np.testing.assert_allclose(u[x[:, 1] <= low], 0, atol=1e-9)
    np.testing.assert_allclose(u[top] - [0, high - compression.foam.high, 0], 0, atol=1e-3)
    assert (x + u)[~top, 1].max() < high + 0.1


# ------------------------------------------------------------------------ images and truth


@pytest.mark.parametrize("state", STATES)
def test_images_and_truth_agree_without_noise(corners, truth, clean, state):
    points = gauss_points(corners)
    reference = reference_on(corners, points, clean[0][0], degree=3)
    y = points.points + truth.displacement(points.points, state)
    grey, inside = spline_value(clean[state][0], y, 3)
    r = reference.grey - grey
    still, _ = residual(reference, clean[state][0], 0 * corners.points)
    assert inside.all()
    assert r.std() < CLEAN and abs(r.mean()) < 0.5
    assert still.std() > 8 * CLEAN
    assert clean[state][1] < 2e-3, "share of the solid that has gone through itself"


@pytest.mark.parametrize("state", STATES)
def test_with_noise_the_residual_is_that_of_the_noise(corners, truth, clean, state):
    at = gauss_points(corners).points
    imaging = Imaging()
    noise = [correlated_noise(clean[0][0].shape, imaging, s) for s in (0, state)]
    scans = [
        eight_bit(clean[s][0] + n).astype(np.float32)
        for s, n in zip((0, state), noise, strict=True)
    ]
    y = at + truth.displacement(at, state)
    found = spline_value(scans[0], at, 3)[0] - spline_value(scans[1], y, 3)[0]
    alone = spline_value(noise[0], at, 3)[0] - spline_value(noise[1], y, 3)[0]
    assert alone.std() < found.std() < EXCESS[state] * alone.std()


def test_tangents_are_those_of_the_struts_that_were_drawn(compression, drawn, truth):
    """In the middle of struts well inside; they are bent a little, the drawing is straight."""
    foam = compression.foam
    length = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=1)
    middle = drawn.mean(axis=1)
    away = middle - foam.centre
    inside = np.hypot(away[:, 0], away[:, 2]) < foam.radius - 6
    inside &= (np.abs(away[:, 1]) < (foam.high - foam.low) / 2 - 6) & (length > 8)
    along = (drawn[:, 1] - drawn[:, 0])[inside] / length[inside, None]
    _, tangent, distance = truth.strut(middle[inside])
    angle = np.degrees(np.arccos(np.abs(np.sum(along * tangent, axis=1)).clip(0, 1)))
    assert inside.sum() > 100
    assert np.median(angle) < 8 and np.percentile(angle, 90) < 20
    assert (distance < 0).mean() > 0.8, "most of these points are inside"


def test_junctions_are_where_drawn_struts_meet(drawn, truth):
    away, _ = cKDTree(drawn.reshape(-1, 3)).query(truth.junctions)
    assert len(truth.junctions) > 50
    assert np.median(away) < 1.5


# ------------------------------------------------------------------------------ the workflow


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The workflow on the case, up to its summary, in a folder of its own."""
    folder = tmp_path_factory.mktemp("solid")
    write_case(folder / "results/solid_scans", Imaging())
    config = yaml.safe_load((ROOT / "tests/solid_twin/config.yaml").read_text())
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "results/solid/summary.json", "--cores", "2",
         "--snakefile", str(ROOT / "Snakefile"), "--directory", str(folder),
         "--configfile", str(folder / "config.yaml")],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=3600,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-8000:]
    return folder / "results/solid"


@pytest.mark.slow
@pytest.mark.parametrize("state", STATES)
def test_the_workflow_on_the_solid_is_judged_by_its_truth(results, truth, state):
    """Micro DVC: its error, and its residual over that under the truth at the same points."""
    summary = json.loads((results / "summary.json").read_text())
    found = summary["states"][state - 1]["micro"]
    smooth = [load_volume(results / f"volumes/smooth{s}.h5")[0] for s in (0, state)]
    mesh = read_mesh(results / "geometry/micro.vtu")
    u = truth.displacement(mesh.points, state)
    under = residual_on(micro_reference(mesh, smooth[0]), smooth[1], u)["statistics"]["std"]
    print(f"state {state}: residual {found['residual_std']:.2f}, {under:.2f} under the truth,",
          found["error"])  # fmt: skip
    for figure, largest in LARGEST[state].items():
        assert found["error"][figure] < largest
    assert state == 3 or found["residual_std"] < 1.1 * under
