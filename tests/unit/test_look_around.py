"""The 3D page: what is packed comes back, nothing is fetched, a browser draws it; ParaView series."""

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import pyvista

from addvc.analysis.strut_store import save_partition, write_columns
from addvc.analysis.struts import Strut
from addvc.correlation.gauss_newton import Solution
from addvc.correlation.store import save_solution
from addvc.fem.io import write_series, write_vtu
from addvc.fem.mesh import outer_faces
from addvc.images.files import write_json
from addvc.images.scans_store import save_volume
from addvc.report import look_around
from addvc.report.case import Case

TEMPLATE = Path(__file__).parents[2] / "workflow/report/scene.html"
BROWSER = next(filter(shutil.which, ("chromium", "chromium-browser", "google-chrome")), None)
SLOPE = -0.05


@pytest.fixture
def bar(box):
    return box((0, 0, 0), (8, 24, 8), (4, 12, 4), shake=0.1)


@pytest.fixture
def case(tmp_path, bar):
    """Two states of a bar: its lower half is a strut, its upper half one that is flagged."""
    write_json(tmp_path / "geometry/specimen.json",
               {"kind": "box", "axis": 1, "low": 0.0, "high": 24.0, "centre": [4, 4],
                "radius": None, "bounds": [[0, 8], [0, 8]]})  # fmt: skip
    write_vtu(tmp_path / "geometry/micro.vtu", bar.points, bar.cells)
    save_volume(tmp_path / "volumes/smooth0.h5", np.zeros((9, 25, 9)))
    struts = [strut(bar, 1, 11), strut(bar, 15, 23)]
    save_partition(tmp_path / "geometry/struts.h5", struts, np.zeros((0, 3)))
    for state in (1, 2):
        u = state * SLOPE * bar.points * [0, 1, 0]
        save_solution(tmp_path / f"dvc/micro_state{state}.h5", Solution(u, [1e-4], True), bar)
        save_solution(tmp_path / f"dvc/meso9_state{state}.h5", Solution(u, [1e-4], True), bar)
        for name in ("micro", "meso9"):
            write_vtu(tmp_path / f"fields/{name}_state{state}.vtu", bar.points, bar.cells,
                      {"displacement": u, "valid": np.ones(len(u), np.uint8)},
                      {"strain_norm": np.full(len(bar.cells), -state * SLOPE)})  # fmt: skip
        foam = {"micro": {"valid": 1, "flagged": 1}}
        write_json(tmp_path / f"struts_state{state}.json", {"foam": foam})
        write_columns(tmp_path / f"struts_state{state}.csv",
                      {"valid": [1, 0], "bending_share": [0.75, 0.5]})  # fmt: skip
    labels = {1: "5 %", 2: "10 %"}
    return Case.of(
        {
            "root": tmp_path,
            "labels": labels,
            "meso": ["meso9"],
            "micro": ["micro"],
            "voxel_um": 20.0,
        }
    )


def strut(mesh, low, high):
    nodes = np.flatnonzero((mesh.points[:, 1] > low) & (mesh.points[:, 1] < high))
    line = np.column_stack([np.full(17, 4.0), np.linspace(low, high, 17), np.full(17, 4.0)])
    ones = np.ones(len(nodes))
    return Strut((-1, -1), line, np.full(17, 64.0), high - low, high - low, nodes, ones, ones)


@pytest.fixture
def page(case):
    path = case.root / "scene.html"
    look_around.write_scene(case, TEMPLATE, path)
    return path


def payload(page):
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>',
                     page.read_text(encoding="utf-8"), re.S)[1]  # fmt: skip
    return json.loads(text)


def numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def unpacked(entry):
    raw = numbers(entry["data"], "<u2").astype(float)
    return np.where(raw == look_around.UNKNOWN, np.nan, entry["low"] + entry["step"] * raw)


# -------------------------------------------------------------------------------- what is packed


def test_packed_values_come_back_to_half_a_step(rng):
    values = rng.normal(size=500)
    values[::7] = np.nan
    entry = look_around.packed(values)
    assert np.array_equal(np.isnan(unpacked(entry)), np.isnan(values))
    assert np.nanmax(np.abs(unpacked(entry) - values)) <= 0.51 * entry["step"]
    assert np.isnan(unpacked(look_around.packed(np.full(3, np.nan)))).all()
    assert np.array_equal(unpacked(look_around.packed(np.full(3, 7.0))), np.full(3, 7.0))


def test_the_page_holds_the_surface_its_motion_and_what_is_flagged(page, bar):
    data = payload(page)
    points = np.column_stack([unpacked(p) for p in data["points"]])
    faces = numbers(data["faces"], "<u4").reshape(-1, 3)
    assert len(faces) == len(outer_faces(bar)[0]) and faces.max() == len(points) - 1
    for state, entry in enumerate(data["states"], start=1):
        u = np.column_stack([unpacked(p) for p in entry["u"]])
        assert np.allclose(u, state * SLOPE * points * [0, 1, 0], atol=1e-3)
        beyond, strain, share = (unpacked(p) for p in entry["fields"])
        assert np.allclose(beyond, 0, atol=1e-9), "uniform compression is taken off"
        assert np.allclose(strain, -state * SLOPE)
        flagged = numbers(entry["flagged"], np.uint8) > 0
        assert np.array_equal(flagged, (points[:, 1] > 15) & (points[:, 1] < 23))
        own = (points[:, 1] > 1) & (points[:, 1] < 11)
        assert np.allclose(share[own], 0.75) and np.isnan(share[~own]).all()
    assert [field["range"] for field in data["fields"]][2] == [0, 1]
    assert data["first"] == 1 and data["up"] == [0, 1, 0]


def test_of_a_large_mesh_a_slab_is_shown(bar):
    faces = len(outer_faces(bar)[0])
    points, kept, used, words = look_around.shown_surface(bar, 1, faces // 2)
    assert 0 < len(kept) < faces and "slab" in words
    assert np.array_equal(points, bar.points[used])
    edges = np.sort(kept[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all(), "it is closed"
    assert look_around.shown_surface(bar, 1, faces)[3] == ""


@pytest.mark.parametrize("states", [1, 4, 20])
def test_the_largest_page_stays_below_25_mb(states):
    faces = look_around.most_faces(states)
    each = 6 + states * (6 + 2 * len(look_around.shown_fields(0)) + 1)
    arrays = 12 * faces + each * faces / 2
    assert 4 / 3 * arrays + len(look_around.get_plotlyjs()) < 25e6


# ---------------------------------------------------------------------------------- in a browser


def test_the_page_fetches_nothing(page):
    text = page.read_text(encoding="utf-8")
    assert "{{" not in text.replace(look_around.get_plotlyjs(), "")
    assert not re.search(r"""<(?:script|link|img|iframe)[^>]*\b(?:src|href)\s*=""", text)
    policy = re.search(r'Content-Security-Policy" content="(.*?)"', text)[1]
    assert "default-src 'none'" in policy and "http" not in policy and "*" not in policy
    assert "connect-src" not in policy, "so that nothing can be fetched"


@pytest.mark.skipif(BROWSER is None, reason="no Chromium")
def test_a_browser_draws_the_page(page, tmp_path):
    picture = tmp_path / "page.png"
    subprocess.run(
        [BROWSER, "--headless", "--no-sandbox", "--disable-background-networking", "--no-first-run",
         "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
         f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=20000",
         "--window-size=900,700", f"--screenshot={picture}", page.as_uri()],
        check=True, capture_output=True, timeout=180,
    )  # fmt: skip
    image = (255 * plt.imread(picture)[250:, :700, :3]).astype(
        int
    )  # below the words, left of the bar
    drawn = image.min(axis=-1) < 235
    flagged = (image[..., 0] > 120) & (image[..., 1] < 60) & (image[..., 2] > 90)
    assert 0.02 < drawn.mean() < 0.9
    assert 0.002 < flagged.mean() < drawn.mean()


# ------------------------------------------------------------------------------------ ParaView


def test_a_series_steps_through_its_states(tmp_path, bar):
    for state in (1, 2):
        write_vtu(tmp_path / f"micro_state{state}.vtu", bar.points, bar.cells,
                  {"displacement": state * bar.points})  # fmt: skip
    write_series(tmp_path / "micro.pvd", {n: f"micro_state{n}.vtu" for n in (1, 2)})
    reader = pyvista.get_reader(str(tmp_path / "micro.pvd"))
    assert reader.time_values == [1, 2]
    reader.set_active_time_value(2)
    assert np.allclose(reader.read()[0]["displacement"], 2 * bar.points)
