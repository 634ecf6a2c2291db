"""Figures and tables of a synthetic test: drawn from a small stored twin, with panels and units."""

import csv
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import LogNorm

from addvc import twin
from addvc.images.files import write_json
from addvc.images.scans_store import save_volume
from addvc.report import judging, style, synthetic
from addvc.report.case import Case

STRAINS = (0.01, 0.02)
LABELS = {1: "1.0 %", 2: "2.0 %"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A tiny twin of two states as the workflow stores it: scans, networks, load steps."""
    root = tmp_path_factory.mktemp("case")
    options = twin.TwinOptions(size="tiny", seed=2417, strains=STRAINS)
    foam = twin.make_foam(options)
    motions, history = twin.compress(foam, options)
    for state, motion in enumerate(motions):
        volume = np.float32(twin.image(foam, motion, options, state))
        save_volume(root / f"volumes/volume{state}.h5", volume)
        save_volume(root / f"volumes/smooth{state}.h5", volume)
        twin.write_network(root / f"network_state{state}.vtu", foam, motion, options)
    twin.write_history(root / "history.csv", history)
    body = foam.body
    specimen = {"kind": "cylinder", "axis": 1, "low": body.low, "high": body.high,
                "centre": body.centre[[0, 2]], "radius": body.radius,
                "bounds": [[0, 71], [0, 71]]}  # fmt: skip
    write_json(root / "geometry/specimen.json", specimen)
    return root


@pytest.fixture
def case(folder):
    description = {
        "root": folder,
        "labels": LABELS,
        "meso": ["meso33", "meso12"],
        "micro": ["micro"],
        "voxel_um": 20.0,
    }
    return Case.of(description)


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """drawn(call): the figure that call(outputs) has saved, and the picture (rows, columns, 3)."""
    kept, save = [], style.save

    def keep(fig, outputs):
        fig.canvas.draw()
        kept.append(fig)
        save(fig, outputs)

    def draw(call):
        monkeypatch.setattr(style, "save", keep)
        call([tmp_path / "figure.png"])
        return kept[-1], plt.imread(tmp_path / "figure.png")[..., :3]

    return draw


def titles(fig):
    return [ax.get_title(loc="left") for ax in fig.axes if ax.get_title(loc="left")]


def words(fig):
    """All that is written in a figure."""
    return [text.get_text() for text in fig.findobj(plt.Text) if text.get_text()]


def within_the_page(picture):
    page = np.array([style.HEIGHT, style.WIDTH]) * style.INCH * style.DPI
    return (picture.shape[:2] <= 1.03 * page).all()


# ----------------------------------------------------------------------------------- figures


def test_scans_stand_side_by_side_in_one_grey_scale(case, drawn):
    fig, picture = drawn(lambda outputs: synthetic.scans(case, outputs))
    assert titles(fig) == ["(a) reference", "(b) 1.0 %", "(c) 2.0 %"]
    images = [image for ax in fig.axes for image in ax.get_images()]
    assert len(images) == 2 * 3 and len({image.get_clim() for image in images}) == 1
    assert {image.get_array().shape for image in images} == {(84, 72)}  # compression upright
    assert {"slice", "maximum projection", "grey level"} <= set(words(fig))
    assert any(re.fullmatch(r"\d+ voxels = .+ (µm|mm)", text) for text in words(fig))
    assert within_the_page(picture)


def test_networks_share_their_colours_and_say_what_they_are(case, folder, drawn):
    files = [folder / f"network_state{n}.vtu" for n in case.states]
    fig, picture = drawn(lambda outputs: synthetic.network(case, outputs, files))
    assert titles(fig) == ["(a) 1.0 %", "(b) 2.0 %"]
    assert any("bending energy per length of the strut" in text for text in words(fig))
    assert any("voxels = " in text for text in words(fig))
    spread = picture.max(axis=-1) - picture.min(axis=-1)
    assert 0.01 < (spread > 0.2).mean() < 0.9, "struts are coloured, and there is air between them"
    assert within_the_page(picture)


def test_colours_of_a_network_are_energies_per_length_over_their_mean(folder):
    points, faces, values = synthetic._tubes(folder / "network_state2.vtu")
    norm = LogNorm(1 / synthetic.SPAN, synthetic.SPAN)
    assert faces.max() < len(points) and len(values) == len(faces)
    assert (values > 0).all() and np.median(values) < 1 < values.max()
    assert np.mean((values > norm.vmin) & (values < norm.vmax)) > 0.7


def test_mechanics_has_its_three_panels_with_units(case, folder, drawn):
    fig, picture = drawn(lambda outputs: synthetic.mechanics(case, outputs, folder / "history.csv"))
    assert titles(fig) == ["(a) stress", "(b) energy", "(c) convergence"]
    for ax in fig.axes:
        assert ax.get_xlabel() == "nominal strain (%)"
        assert re.search(r"\(.+\)$", ax.get_ylabel())
    stress, energy, _ = fig.axes
    strain, force = stress.get_lines()[0].get_data()
    assert strain == pytest.approx([0, *(100 * np.array(STRAINS))])
    assert force[0] == 0 and (np.diff(force) > 0).all()
    top = [path.vertices[:, 1].max() for c in energy.collections for path in c.get_paths()]
    assert len(top) == len(synthetic.ENERGIES) and max(top) == pytest.approx(1)
    assert within_the_page(picture)


@pytest.mark.parametrize("name", ["scans", "mechanics"])
def test_nothing_is_written_beyond_the_border(case, folder, drawn, name):
    more = [folder / "history.csv"] if name == "mechanics" else []
    fig, _ = drawn(lambda outputs: getattr(synthetic, name)(case, outputs, *more))
    width, height = fig.bbox.size
    for ax in fig.axes:
        box = ax.get_tightbbox()
        assert box.x0 > -0.01 * width and box.x1 < 1.01 * width
        assert box.y0 > -0.03 * height and box.y1 < 1.03 * height


# ------------------------------------------------------------------------------------ tables


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


STATE = {
    "sigma": {"rest": 30.0, "truth": 5.5, "meso33": 8.2},
    "beyond": {"affine": 0.7, "meso33": 0.3},
}


def test_the_table_of_checks_says_which_do_not_hold(tmp_path):
    check = {
        "name": "peak",
        "value": 28.5,
        "unit": "voxel",
        "low": 27.0,
        "high": None,
        "passed": True,
    }
    checks = [check, check | {"high": 1000.0, "value": 2000.0, "passed": False}]
    write_json(tmp_path / "analysis/twin_check.json", {"checks": checks})
    case = Case.of(
        {
            "root": tmp_path,
            "labels": LABELS,
            "meso": ["meso33"],
            "micro": ["micro"],
            "voxel_um": 20.0,
        }
    )
    judging.twin_check(case, [tmp_path / "table.csv"])
    head, good, bad = rows_of(tmp_path / "table.csv")
    assert head == ["Check", "Value", "Unit", "At least", "At most", "Holds"]
    assert good == ["peak", "28.5", "voxel", "27", "–", "yes"]
    assert bad == ["peak", "2000", "voxel", "27", "1000", "NO"]


@pytest.mark.parametrize("turning", [False, True])
def test_the_table_of_difficulty_has_a_column_a_state_and_units(tmp_path, turning):
    more = {"rotation": {"median": 2.0, "p95": 6.0}} if turning else {}
    states = [STATE | more | {"state": n} for n in LABELS]
    write_json(tmp_path / "analysis/difficulty.json", {"states": states})
    case = Case.of(
        {
            "root": tmp_path,
            "labels": LABELS,
            "meso": ["meso33"],
            "micro": ["micro"],
            "voxel_um": 20.0,
        }
    )
    judging.difficulty(case, [tmp_path / "table.csv"])
    head, *rows = rows_of(tmp_path / "table.csv")
    assert head == ["Quantity", "Unit", "1.0 %", "2.0 %"]
    units = ["grey level"] * 3 + ["voxel"] * 2 + ["degree"] * 2 * turning
    assert [row[1] for row in rows] == units
    assert rows[1] == ["σ(r) under the truth", "grey level", "5.50", "5.50"]
    assert all(len(row) == 4 for row in rows)
