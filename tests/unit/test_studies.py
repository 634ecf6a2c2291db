"""Ablation and sensitivity: what is varied, whose files are whose, rows and pictures."""

import numpy as np
import pytest

from addvc import studies
from addvc.analysis.variant import seminorms, settings
from addvc.correlation.micro import micro_options
from addvc.errors import ConfigError
from addvc.report import studies as pictures

MICRO = {"methods": ["corotational", "eq10"], "l_k": "auto", "l_l": 40.0, "l_e": "auto",
         "period": 35, "nu": 0.28}  # fmt: skip
FACTORS = {"l_k": [0.5, 2], "l_l": [], "l_e": [2], "nu": [0], "threshold": [0.8], "size": [1.5]}
CONFIG = {
    "micro": MICRO,
    "mesh": {"size": 1.2},
    "sensitivity": {"state": "auto"} | FACTORS,
}


def variant(parameter, factor):
    return next(
        v for v in studies.sensitivity(CONFIG) if (v.parameter, v.factor) == (parameter, factor)
    )


def test_the_value_in_use_is_always_among_those_tried_and_an_empty_list_leaves_out():
    found = {}
    for v in studies.sensitivity(CONFIG):
        found.setdefault(v.parameter, []).append(v.factor)
    assert "l_l" not in found
    assert found["l_k"] == [0.5, 1, 2] and found["l_e"] == [1, 2]


def test_names_tell_variants_apart():
    names = [v.name for v in studies.sensitivity(CONFIG)]
    assert len(set(names)) == len(names) and "l_k-0.5" in names


def test_lengths_are_those_of_the_paper_s_method_others_those_of_the_default_one():
    methods = {v.parameter: v.method for v in studies.sensitivity(CONFIG)}
    assert methods["l_k"] == "eq10" and methods["l_e"] == methods["size"] == "corotational"


@pytest.mark.parametrize(
    ("parameter", "factor", "own", "shared"),
    [
        ("l_k", 2, "factor", "start"),
        ("threshold", 0.8, "threshold", None),
        ("size", 1.5, "solid", "threshold"),
        ("size", 1, "factor", "start"),
    ],
)
def test_what_a_change_does_not_touch_is_shared_with_the_case(parameter, factor, own, shared):
    v = variant(parameter, factor)
    assert v.owns(own) and v.owns("error")
    assert shared is None or not v.owns(shared)


def test_a_variant_that_changes_nothing_is_the_result_of_the_main_run():
    assert variant("l_k", 1).path("solution", "r", CONFIG, "3") == "r/dvc/micro-eq10_state3.h5"
    own = variant("l_k", 2).path("solution", "r", CONFIG, "3")
    assert own == "r/sensitivity/l_k-2/dvc/micro_state3.h5"
    assert variant("l_k", 2).path("start", "r", CONFIG, "3") == "r/dvc/micro_start_state3.h5"
    alone = CONFIG | {"micro": MICRO | {"methods": ["corotational"]}}
    assert variant("l_k", 1).path("solution", "r", alone, "3").startswith("r/sensitivity/l_k-1/")


def test_values_are_those_in_use_times_the_factor():
    base = settings(micro_options(MICRO, 20.0, 1), 50.0, 1.2)
    for parameter, factor in (("l_k", 2), ("l_e", 2), ("nu", 0)):
        section = variant(parameter, factor).section(MICRO)
        found = settings(micro_options(section, 20.0, 1), 50.0, 1.2)
        assert found.pop(parameter) == pytest.approx(factor * base[parameter])
        assert found == {key: value for key, value in base.items() if key != parameter}
    assert variant("size", 1.5).mesh(CONFIG["mesh"]) == {"size": pytest.approx(1.8)}


def test_factors_that_lead_poisson_s_ratio_out_of_range_are_left_out():
    wide = CONFIG | {"sensitivity": CONFIG["sensitivity"] | {"nu": [0.5, 1.5, 2]}}
    found = [v.factor for v in studies.sensitivity(wide) if v.parameter == "nu"]
    assert found == [0.5, 1, 1.5]  # 2 would be 0.56


def test_the_state_is_the_third_or_the_last():
    assert studies.studied_state(CONFIG, [1, 2, 3, 4]) == 3
    assert studies.studied_state(CONFIG, [1, 2]) == 2
    asked = CONFIG | {"sensitivity": CONFIG["sensitivity"] | {"state": 4}}
    assert studies.studied_state(asked, [1, 2, 3, 4]) == 4
    with pytest.raises(ConfigError, match="state is 4, but there are 2"):
        studies.studied_state(asked, [1, 2])


def test_seminorms_vanish_in_a_rigid_motion_and_are_one_for_the_wave(box):
    mesh = box((0, 0, 0), (8, 40, 8), (4, 20, 4), shake=0.2)
    ends = (mesh.points[:, 1] < 1) | (mesh.points[:, 1] > 39)
    options = micro_options(MICRO, 20.0, 1)
    still = seminorms(mesh, np.tile([1.0, -2.0, 3.0], (len(mesh.points), 1)), ends, options)
    assert max(still.values()) < 1e-10
    wave = np.zeros_like(mesh.points)
    wave[:, 1] = np.cos(2 * np.pi * mesh.points[:, 1] / options.period)
    assert seminorms(mesh, wave, ends, options)["l_k"] == pytest.approx(1)
    assert seminorms(mesh, 2 * wave, ends, options)["l_l"] == pytest.approx(2)


def test_a_stretch_has_its_own_elastic_strain(box):
    """E of a uniaxial strain e without lateral strain: (lam + 2 mu) e^2."""
    mesh = box((0, 0, 0), (8, 8, 8), (4, 4, 4))
    u = np.zeros_like(mesh.points)
    u[:, 1] = 1e-4 * mesh.points[:, 1]
    nu = MICRO["nu"]
    modulus = (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    found = seminorms(mesh, u, np.zeros(len(u), bool), micro_options(MICRO, 20.0, 1))
    assert found["l_e"] == pytest.approx(1e-4 * np.sqrt(modulus), rel=1e-3)
    assert np.isnan(found["l_l"])


def row(v, state, error):
    return vars(v) | {
        "state": state, "settings": {p: 2.0 * v.factor for p in studies.PARAMETERS},
        "nodes": 10, "cells": 20, "kept": 0.9, "iterations": 4,
        "converged": v.factor != 2, "seconds": 1.0,
        "residual_std": 3.0 / v.factor if v.factor else None, "flagged": 0.0, "error": error,
        "seminorms": {"l_k": 1.0 + v.factor, "l_l": None, "l_e": 0.1},
    }  # fmt: skip


ERROR = {"rms": 0.1, "median": 0.08, "p95": 0.2, "rms_normal": None}


@pytest.mark.parametrize("error", [ERROR, None])
def test_studies_are_tables_and_pictures_with_or_without_a_truth(tmp_path, error):
    found = [row(v, 3, error) for v in studies.sensitivity(CONFIG)]
    table = pictures.sensitivity_rows(found)
    assert {len(line) for line in table} == {len(table[0])} and len(table) == len(found) + 1
    assert ("Error, rms (voxels)" in table[0]) == (error is not None)
    pictures.sensitivity(found, "12.3 %", [tmp_path / "a.png"])

    found = [row(v, state, error) for v in studies.ablation() for state in (1, 2)]
    table = pictures.ablation_rows(found, {1: "3.4 %", 2: "5.2 %"})
    assert [line[:2] for line in table[1:3]] == [
        ["corotational", "3.4 %"],
        ["corotational", "5.2 %"],
    ]
    pictures.ablation(found, {1: "3.4 %", 2: "5.2 %"}, [tmp_path / "b.png"])
    assert (tmp_path / "a.png").stat().st_size > 1e4 < (tmp_path / "b.png").stat().st_size
