"""Figures: what is read, cut out, projected and written, on small meshes; no stored pictures."""

import csv
import html
import re
from dataclasses import replace

import h5py
import matplotlib.pyplot as plt
import numpy as np
import pytest

from addvc.correlation.gauss_newton import Solution
from addvc.correlation.store import save_field, save_solution
from addvc.fem.io import write_vtu
from addvc.fem.mesh import boundary_faces, outer_faces
from addvc.images.files import write_json
from addvc.images.scans_store import save_volume
from addvc.report import (
    anatomy,
    captions,
    curves,
    judging,
    meso,
    scene,
    starts,
    style,
    surfaces,
    tables,
    ultimate,
    warp,
)
from addvc.report.case import Case, UndeclaredInput

DESCRIPTION = {"labels": {1: "3.4 %", 2: "5.2 %"}, "meso": ["meso9"], "micro": ["micro"],
               "voxel_um": 20.0}  # fmt: skip


@pytest.fixture
def cube(box):
    return box((0, 0, 0), (8, 10, 12), (4, 5, 6), shake=0.2)


@pytest.fixture
def folder(tmp_path, cube):
    """Results of a case of one meso mesh and two states, the second not converged."""
    rng = np.random.default_rng(1)
    specimen = {"kind": "box", "axis": 1, "low": 0.0, "high": 10.0, "centre": [4, 6],
                "radius": None, "bounds": [[0, 8], [0, 12]]}  # fmt: skip
    write_json(tmp_path / "geometry/specimen.json", specimen)
    write_json(tmp_path / "geometry/meso9.json", {"nodes": 1, "cells": 1, "mean_edge": 9.0})
    write_vtu(tmp_path / "geometry/meso9.vtu", cube.points, cube.cells)
    write_json(tmp_path / "analysis/image_noise.json", {"1": 1.4, "2": None})
    save_volume(tmp_path / "volumes/smooth0.h5", rng.random((9, 11, 13)))
    for state, flagged in ((1, 5), (2, 0)):
        foam = {"micro": {"valid": 7, "flagged": flagged, "bending_share": None}}
        write_json(tmp_path / f"struts_state{state}.json", {"foam": foam})
    for name in ("meso9", "micro"):
        for state in (1, 2):
            result = Solution(0.01 * state * cube.points, [0.1, 1e-2 / 100**state], state == 1,
                              residual={"mean": 0.0, "std": 1.5, "outside": 0})  # fmt: skip
            save_solution(tmp_path / f"dvc/{name}_state{state}.h5", result, cube)
            write_vtu(tmp_path / f"fields/{name}_state{state}.vtu", cube.points, cube.cells,
                      {"valid": np.full(len(cube.points), 2 - state, np.uint8)})  # fmt: skip
            path = tmp_path / f"analysis/residual_{name}_state{state}.h5"
            path.parent.mkdir(exist_ok=True)
            with h5py.File(path, "w") as file:
                file["r"] = rng.normal(0, state, 4000).astype(np.float32)
                file["inside"], file["weight"] = np.ones(4000, bool), rng.random(4000)
                file.attrs.update(std=float(state), mean=0.1, kurtosis=0.2)
    return tmp_path


@pytest.fixture
def case(folder):
    return Case.of(DESCRIPTION | {"root": folder})


# --------------------------------------------------------------------------- reading results


def test_a_file_the_rule_does_not_declare_is_not_read(folder):
    case = Case.of(DESCRIPTION | {"root": folder}, [str(folder / "geometry/meso9.vtu")])
    case.mesh("meso9")
    with pytest.raises(UndeclaredInput, match=r"specimen\.json is not among the 1 inputs"):
        _ = case.specimen


def test_titles_tell_of_loops_that_did_not_end_and_of_lost_struts(case):
    assert case.title(1, "meso9") == "3.4 %: converged"
    assert case.title(1, "micro") == "3.4 %: converged, 5 struts flagged"
    assert case.title(2, "meso9") == "5.2 %: not converged"
    assert case.title(2, "micro") == "5.2 %: failed"
    assert case.shown_state() == 1


def test_a_title_tells_of_elements_turned_inside_out(case, folder, cube):
    mirror = Solution(cube.points * [-2, 0, 0], [0.1], True, residual={})
    save_solution(folder / "dvc/meso9_state1.h5", mirror, cube)
    assert case.title(1, "meso9") == "3.4 %: converged, 100.0 % inverted"


def test_a_state_without_any_solid_has_a_panel_that_says_so(case, cube, tmp_path, monkeypatch):
    """A failed state is a result, not an error."""
    whole = cube.points, boundary_faces(cube)
    nothing = np.zeros((0, 3)), np.zeros((0, 3), int)
    monkeypatch.setattr(anatomy, "_foam", lambda _, state: nothing if state == 2 else whole)
    said, picture = [], tmp_path / "states.png"
    monkeypatch.setattr(style, "note", lambda ax, text, *given, **options: said.append(text))
    anatomy.states(case, [picture])
    assert "no solid is seen" in said and picture.stat().st_size > 0


def test_several_lengths_may_have_the_least_risk(case, folder, cube, tmp_path):
    """As where a state is the reference itself."""
    risk = [{"l_e": length, "risk": 0.0} for length in (10.0, 15.0, 22.5)]
    for state in (1, 2):
        still = Solution(0 * cube.points, [0.0], True, residual={"std": 0.0})
        save_solution(folder / f"dvc/micro_state{state}.h5", still, cube, risk=risk)
    curves.cutoff(case, [tmp_path / "cutoff.svg"])
    assert (tmp_path / "cutoff.svg").stat().st_size > 0


def test_a_result_looks_alike_in_all_figures():
    few = style.looks(("meso12",), ("micro",))
    many = style.looks(("meso33", "meso12"), ("micro", "micro-eq10"), ["freeform"])
    assert all(few[name]["color"] == many[name]["color"] for name in few)
    assert len({look["color"] for look in many.values()}) == len(many) == 5


@pytest.mark.parametrize(("count", "shown"), [(3, [1, 2, 3]), (11, [1, 3, 5, 7, 9, 11])])
def test_many_states_are_told_apart_and_pictured_from_first_to_last(case, count, shown):
    many = replace(case, labels={n: f"state {n}" for n in range(1, count + 1)})
    assert many.pictured == shown
    assert len({many.colour(n) for n in many.states}) == count


def test_panels_beyond_the_alphabet_have_two_letters():
    assert [style.letter(n) for n in (0, 25, 26, 52)] == ["(a)", "(z)", "(aa)", "(ba)"]


def test_labels_survive_keys_that_are_words(folder):
    description = DESCRIPTION | {"labels": {"2": "b", "1": "a"}, "root": folder}
    assert Case.of(description).states == [1, 2]


def test_a_result_without_flags_is_converged_and_failures_are_red(case, folder):
    write_json(folder / "struts_state1.json", {"foam": {"micro": {"flagged": 0}}})
    assert case.verdict("micro", 1) == "converged"
    fig = style.figure(30)
    good, bad = fig.subplots(1, 2)
    style.headline(good, case.title(1, "micro"), 0)
    style.headline(bad, "a very long name, " + case.title(2, "meso9"), 1)
    assert good._left_title.get_text() == "(a) 3.4 %: converged"
    assert bad._left_title.get_text().endswith("5.2 %:\nnot converged")
    words = "5.2 %: not converged, 35 struts flagged"
    assert style.narrow(words) == "5.2 %\nnot converged,\n35 struts\nflagged"
    assert "\n" not in style.two_lines("a long title of a panel: of something else")
    assert bad._left_title.get_color() == style.RED != good._left_title.get_color()
    plt.close(fig)


# ------------------------------------------------------------------------------ what is cut


def test_boundary_agrees_with_the_mesh_module(cube):
    faces, owner = outer_faces(cube)
    assert {tuple(sorted(f)) for f in faces} == {tuple(sorted(f)) for f in boundary_faces(cube)}
    assert all(set(face) <= set(cube.cells[cell]) for face, cell in zip(faces, owner, strict=True))


def test_boundary_of_a_part_is_closed(cube):
    faces, _ = outer_faces(cube, surfaces.centroids(cube)[:, 0] < 3)
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count % 2 == 0).all()


def test_clipping_keeps_affine_fields_and_the_box(cube):
    pytest.importorskip("pyvista")
    low, high = np.array([1.3, 2.1, 3.7]), np.array([6.2, 8.9, 10.4])
    slope = np.array([[1.0, 2.0], [-1.0, 0.5], [0.3, 4.0]])
    cell = np.arange(len(cube.cells), dtype=float)
    points, faces, found = surfaces.clipped(cube, low, high, u=cube.points @ slope, number=cell)
    assert np.allclose(points.min(axis=0), low) and np.allclose(points.max(axis=0), high)
    assert np.allclose(found["u"], points @ slope, atol=1e-5)
    assert len(found["number"]) == len(faces)


def test_segmented_ball_has_its_radius():
    grid = np.stack(np.meshgrid(*[np.arange(21.0)] * 3, indexing="ij"), axis=-1)
    volume = (20 - np.linalg.norm(grid - 10, axis=-1)).astype(np.float32)
    points, _ = surfaces.segmented(volume, 14.0, np.zeros(3), np.full(3, 20.0))
    assert np.linalg.norm(points - 10, axis=1) == pytest.approx(6, abs=0.25)
    assert len(surfaces.segmented(volume, 99.0, np.zeros(3), np.full(3, 20.0))[1]) == 0


# ------------------------------------------------------------------------------- what is seen


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_views_are_right_handed_with_the_loading_axis_up(axis):
    for view in (scene.oblique(axis), scene.facing(axis, (axis + 1) % 3)):
        frame = np.array([view.right, view.up, view.towards])
        assert np.allclose(frame @ frame.T, np.eye(3)) and np.linalg.det(frame) > 0
        assert view.up[axis] > 0.9 and abs(view.right[axis]) < 1e-12


def test_a_rendering_has_its_colours_at_its_voxels():
    points = np.array([[0, 0, 0], [10, 0, 0], [10, 0, 20], [0, 0, 20.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    view = scene.facing(2, 1)
    colour = np.array([[255, 0, 0], [0, 0, 255]], dtype=np.uint8)
    picture = scene.render([scene.Layer(points, faces, colour)], view, 20, margin=0.1)
    left, right, bottom, top = picture.extent
    rows, columns, _ = picture.image.shape
    assert (right - left) / columns == pytest.approx((top - bottom) / rows)

    def at(x, z):
        column = int((x - left) / (right - left) * columns)
        row = int((top - z) / (top - bottom) * rows)
        return picture.image[row, column].astype(int)

    assert at(8, 4)[0] > at(8, 4)[2] + 100 and at(2, 16)[2] > at(2, 16)[0] + 100
    assert (at(-0.5, 10) == 255).all()


def test_a_missing_renderer_names_the_package(monkeypatch):
    def missing(name):
        raise OSError(name)

    scene.plotter_class.cache_clear()
    monkeypatch.setattr(scene.sys, "platform", "linux")
    monkeypatch.setattr(scene.ctypes, "CDLL", missing)
    with pytest.raises(scene.AddvcError, match=r"libEGL\.so\.1.*apt install libegl1"):
        scene.plotter_class()
    scene.plotter_class.cache_clear()


# ----------------------------------------------------------------------------------- style


@pytest.mark.parametrize(("reach", "length"), [(7, 5), (19.9, 10), (20, 20), (0.3, 0.2)])
def test_scale_bars_have_round_lengths(reach, length):
    assert style.nice_length(reach) == pytest.approx(length)


def test_ranges_are_symmetric_only_where_both_signs_matter():
    values = np.linspace(-3, 5, 1001)
    norm, cmap = style.component_range([values])
    assert norm.vmin == -norm.vmax and cmap == style.SIGNED
    norm, cmap = style.component_range([-np.abs(values)])
    assert norm.vmax <= 0 and cmap.endswith("_r")
    norm, _ = style.component_range([values], root=True)
    assert norm(0.0) == pytest.approx(0.5) and norm(norm.vmax / 4) == pytest.approx(0.75)


def test_saved_figures_repeat_byte_for_byte(tmp_path):
    for run in "ab":
        fig = style.figure(30)
        fig.subplots().plot([1, 2])
        style.save(fig, [tmp_path / f"{run}.png", tmp_path / f"{run}.svg"])
    for suffix in ("png", "svg"):
        assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()
    assert plt.get_fignums() == []


# ---------------------------------------------------------------------------- whole figures


def test_figures_of_a_case_with_a_failed_state_are_drawn(case, tmp_path):
    names = [tmp_path / f"{n}.png" for n in range(4)]
    curves.histograms(case, names[:1])
    curves.convergence(case, names[1:2], {"meso": 1e-3, "micro": 1e-3})
    meso.deformed(case, names[2:3])
    meso.displacement(case, names[3:])
    for name in names:
        image = plt.imread(name)
        page = np.array([style.HEIGHT, style.WIDTH]) * style.INCH * style.DPI
        assert (image.shape[:2] <= 1.03 * page).all()
        assert 0.001 < (image[..., :3].min(axis=-1) < 0.9).mean() < 0.9


def test_rows_of_pictures_are_as_wide_and_as_high_as_their_aspects():
    fig, axes = style.rows_of_pictures([1.2, 0.7], 2)
    for row, aspect in zip(axes, (1.2, 0.7), strict=True):
        for ax in row:
            ax.imshow(np.zeros((round(100 * aspect), 100)))
    fig.canvas.draw()
    sizes = [ax.get_position().size * fig.get_size_inches() for ax in axes[:, 0]]
    assert sizes[0][0] == pytest.approx(sizes[1][0], rel=0.05)
    assert sizes[0][1] / sizes[1][1] == pytest.approx(1.2 / 0.7, rel=0.05)
    plt.close(fig)


def test_the_outline_of_a_picture_runs_around_what_it_shows():
    image = np.full((60, 80, 3), 255, np.uint8)
    image[20:40, 30:60] = 0
    _, ax = plt.subplots()
    warp._outline(ax, scene.Picture(image, (0.0, 8.0, 0.0, 6.0)))
    [line] = ax.collections
    points = np.vstack([path.vertices for path in line.get_paths()])
    assert points.min(axis=0) == pytest.approx([3.0, 2.0], abs=0.06)
    assert points.max(axis=0) == pytest.approx([6.0, 4.0], abs=0.06)
    plt.close("all")


def test_captions_stand_beside_their_pictures_in_the_words_of_the_report(tmp_path):
    (tmp_path / "one.rst").write_text("Fig. 3 of the paper.\n\n**Shown:** Foam, ``u``.\n")
    entries = [{"file": "fig03_a.png", "title": "Fig. 3: states", "caption": tmp_path / "one.rst"},
               {"file": "table1.html", "title": "Table 1", "caption": tmp_path / "one.rst"}]  # fmt: skip
    first, second = captions.captions_page(entries).split("## ")[1:]
    assert first.startswith("Fig. 3: states\n\n`fig03_a.png`\n\n![Fig. 3: states](fig03_a.png)")
    assert "**Shown:** Foam, `u`." in first
    assert "![" not in second and "[table1.html](table1.html)" in second


def test_ultimate_error_is_drawn_beside_what_was_expected(case, folder, tmp_path, monkeypatch):
    rows = [{"shift": s, "bias": 1e-4, "std": 1e-3} for s in (0.5, 0.25)]
    found = {"shifts": rows, "noisy_shifts": rows, "a_priori": 2e-3}
    for name in ("meso9", "micro"):
        write_json(folder / f"analysis/ultimate_{name}.json", found)
    kept, save = [], style.save
    monkeypatch.setattr(style, "save", lambda fig, out: (kept.append(fig), save(fig, out)))
    ultimate.ultimate(case, [tmp_path / "ultimate.png"])
    bias, clean, noisy = kept[0].axes
    for ax in kept[0].axes:
        assert ax.get_xlabel().endswith("(voxels)") and ax.get_ylabel().endswith("voxels)")
        assert list(ax.get_lines()[0].get_xdata()) == [0.25, 0.5]
    assert [text.get_text() for text in kept[0].legends[0].get_texts()][:2] == ["meso9", "micro"]
    assert bias.get_lines()[0].get_ydata() == pytest.approx([0.1, 0.1])  # 1e-3 voxels
    assert clean.get_lines()[0].get_ydata() == pytest.approx([1, 1])
    assert [line.get_ydata()[0] for line in noisy.get_lines()[1::2]] == [2, 2]


def test_starts_that_were_tried_are_a_row_each(case, folder, cube, tmp_path):
    coarse = [
        {"candidate": "zero", "residual_std": 2.5, "outside": 3, "factors": [1.0, 0.9, 1.0]},
        {"candidate": "freeform", "residual_std": 1.5, "outside": 0, "factors": [1.0, 1.0, 1.0]},
    ]
    fine = [{"candidate": "meso9", "residual_std": 1.0, "outside": 0, "robust_std": 0.9,
             "elastic_strain": 0.01, "score": 1.25}]  # fmt: skip
    for state in (1, 2):
        path = folder / f"dvc/start_state{state}.h5"
        save_field(path, cube.points, best="freeform", candidates=coarse)
        path = folder / f"dvc/micro_start_state{state}.h5"
        save_field(path, cube.points, best="meso9", candidates=fine)
    starts.starts(case, [tmp_path / "starts.csv"])
    with (tmp_path / "starts.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["Start of"] for row in rows] == ["meso9", "meso9", "micro"] * 2
    assert [row["Taken"] for row in rows[:3]] == ["no", "yes", "yes"]
    assert rows[0]["Scale factors along x, y, z (Eq. 6)"] == "1.000 / 0.900 / 1.000"
    assert rows[0]["Score (grey levels²)"] == "–"
    assert rows[2]["Score (grey levels²)"] == "1.25"


def test_the_table_of_errors_has_the_junctions_where_there_are_any(case, folder, tmp_path):
    error = {
        "rms": 0.0631,
        "rms_normal": None,
        "rms_along": None,
        "p95": 0.105,
        "within_1_voxel": 1.0,
    }
    found = {"count": 21, "within_1": 0.952, "within_2": 1.0, "within_4": None}
    for state, more in ((1, {"junctions": found}), (2, {})):
        write_json(folder / f"analysis/error_micro_state{state}.json", error | more)
    judging.accuracy(case, [tmp_path / "table.csv"], ["micro"])
    with (tmp_path / "table.csv").open(encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    assert (first["rms, voxel"], first["normal, voxel"]) == ("0.063", "unknown")
    assert [first[key] for key in ("junctions", "within 1 voxel", "4 voxels")] == [
        "21",
        "95.2%",
        "unknown",
    ]
    assert (second["State"], second["junctions"]) == ("5.2 %", "unknown")


def test_acquisition_has_units_in_its_header(case, folder, tmp_path):
    scan = {"shape": [144, 168, 144], "binned_shape": [72, 84, 72], "dtype": "uint16"}
    write_json(folder / "input.json", {"scans": [scan] * 3, "voxel_size_um": 6.67, "bin": 2,
                                       "binned_voxel_size_um": 13.34})  # fmt: skip
    tables.acquisition(case, [tmp_path / "table.csv"], {"twin": {"seed": 7, "noise": 4.0}})
    with (tmp_path / "table.csv").open(encoding="utf-8") as file:
        rows = {row["Parameter"]: row for row in csv.DictReader(file)}
    assert rows["Number of scans"]["Value"] == "3 (1 reference + 2 loadings)"
    assert float(rows["Memory size of one scan"]["Value"]) == pytest.approx(6.967, abs=1e-3)
    assert rows["Noise"] == {"Parameter": "Noise", "Value": "4", "Unit": "grey level"}


def rows_of(page):
    """The cells of a table of a page."""
    rows = re.findall(r"<tr>(.*?)</tr>", page, re.S)
    return [[html.unescape(c) for c in re.findall(r"<t[hd]>(.*?)</t[hd]>", row)] for row in rows]


def test_a_table_is_a_page_too(tmp_path):
    tables.write_table(tmp_path / "t.html", [["a", "b (–)"], ["x < y & z", "1.5"], ["", "2"]])
    found = rows_of((tmp_path / "t.html").read_text(encoding="utf-8"))
    assert found == [["a", "b (–)"], ["x < y & z", "1.5"], ["", "2"]]


def test_mesh_without_cells_in_the_box_is_empty(cube):
    points, faces, _ = surfaces.clipped(cube, np.full(3, 50.0), np.full(3, 60.0))
    assert len(points) == 0 and faces.shape == (0, 3)
