"""The methods to paste: what was done is told, nothing else; each reference is cited, in order."""

import re
from pathlib import Path

import pytest
import yaml
from snakemake.utils import validate

from addvc.errors import ScanError
from addvc.images.hashes import check_different, content_hash
from addvc.provenance import commit
from addvc.report.methods import STARTS, listing, methods, region_named, span
from addvc.report.references import REFERENCES, Citations

ROOT = Path(__file__).parents[2]
MESH = {"nodes": 71416, "cells": 239573, "mean_edge": 12.34, "mean_volume": 0.117,
        "ultimate_error": 4.66e-4}  # fmt: skip
SCANS = {"scans": [{"shape": [120, 140, 120]}] * 3, "bin": 3}


def state(number, converged=True, error=None, weight=1e4):
    found = {
        "converged": converged,
        "l_e": 11.5 * number,
        "residual_std": 1.0 + number,
        "valid_nodes": 0.99,
        "error": error,
    }
    struts = {"valid": 340, "bending_share": 0.7 + 0.05 * number}
    return {"label": f"{number} %", "micro": found, "meso12": {"l_l": 3.7 * number},
            "meso12-network": {"weight": weight},
            "struts": struts, "cells": {"bands": 1}, "equilibrium": {"weight": weight},
            "uncertainty": {"rms": 0.05 + 0.01 * number}}  # fmt: skip


def summary(*states):
    return {"cell_size": 28.8, "region": None, "topology": {"bridges": 0},
            "results": ["meso33", "meso12", "meso12-network", "micro"],
            "threshold": 47.8, "porosity": 0.96, "voxel_size_um": 20.01,
            "meshes": {"meso33": MESH, "meso12": MESH, "micro": MESH}, "states": list(states),
            "versions": {"addvc": "0.1.0", "commit": "ab12"}}  # fmt: skip


def config(**micro):
    given = {"case": "foam", "porosity": 0.96, "twin": {}, "micro": micro}
    validate(given, str(ROOT / "workflow/schemas/config.schema.yaml"))
    return given


@pytest.mark.parametrize(
    ("grey", "words"),
    [("none", None), ("auto", "had clearly drifted, blurred"), ("global", "reference, blurred")],
)
def test_what_was_done_to_grey_levels_is_told(grey, words):
    settings = config(methods=["corotational"])
    settings["images"]["grey"] = grey
    text = told(settings)
    assert (words or "were blurred") in text
    assert ("brought to the brightness" in text) == (words is not None)


def told(settings, *states):
    return "\n".join(methods(summary(*states or (state(1), state(2))), settings, SCANS))


def test_what_was_put_into_the_mesh_and_what_was_left_out_is_told():
    """Struts that are rods, and a part of the specimen: a box has bounds, a cylinder a radius."""
    slab = {"axis": 2, "low": 40.0, "high": 90.0, "radius": 35.0, "bounds": None}
    given = summary(state(1)) | {"region": slab, "topology": {"bridges": 7}}
    text = "\n".join(methods(given, config(), SCANS))
    assert "The struts of a part of the specimen (40.0 to 90.0 voxels along z, within 35.0" in text
    assert "7 struts that the threshold broke, but a lower one shows whole, were put in" in text
    box = slab | {"axis": 1, "radius": None, "bounds": [[1.0, 9.0], [2.0, 8.5]]}
    assert (
        region_named(box) == "40.0 to 90.0 voxels along y, 1.0 to 9.0 along x, 2.0 to 8.5 along z"
    )
    assert "of a part" not in told(config()) and "put in" not in told(config())


def test_what_made_the_scans_and_what_was_left_of_them_is_told():
    assert "are synthetic, of a network of beams" in told(config())
    given = {
        "case": "foam",
        "porosity": 0.96,
        "virtual": {"strains": [0.02]},
        "scans": {"reference": "a.tif", "voxel_size_um": 9, "crop": [[0, 50], None, None]},
    }
    validate(given, str(ROOT / "workflow/schemas/config.schema.yaml"))
    scans = SCANS | {"scans": [SCANS["scans"][0] | {"binned_shape": [16, 46, 40]}]}
    text = "\n".join(methods(summary(state(1)), given, scans))
    assert "deformed by a known field on the computer" in text
    assert "120 x 140 x 120 voxels of 6.67 micrometres, of which 16 x 46 x 40 were kept" in text


def test_nothing_is_said_of_what_was_not_done():
    settings = config()
    settings["images"]["blur"] = 0
    flat = [state(1) | {"meso12": {"l_l": 0.0}}]
    assert "blurred" not in told(settings) and "Laplacian below 0" not in told(settings, *flat)
    one = summary(state(1))
    del one["meshes"]["meso33"]
    text = "\n".join(methods(one, config(), SCANS))
    assert "finer meshes" not in text and "and micro DVC started" not in text


def test_the_network_fit_is_told_where_it_was_made():
    """And the states in which no weight was taken."""
    assert "in each state (meso12-network)." in told(config())
    one = told(config(), state(1), state(2, weight=None))
    assert "in each state (meso12-network; refused in 2 %)." in one
    without = summary(state(1)) | {"results": ["meso33", "meso12", "micro"]}
    assert "also fitted" not in "\n".join(methods(without, config(), SCANS))


def test_the_numbers_are_those_of_the_summary():
    text = told(config(), state(1, error={"median": 0.076}), state(2, error={"median": 0.113}))
    for words in ("commit ab12", "(3, of 120 x 140 x 120 voxels of 6.67 micrometres, binned by 3",
                  "is 28.8 voxels", "239573 tetrahedra", "12.3 and 12.3 voxels", "4.7e-04 voxel",
                  "2.00 to 3.00 grey levels", "75 to 80 %", "0.076 to 0.113 voxel",
                  "as that of corotational did in every state",
                  "a Laplacian below 3.7 to 7.4 voxels, the length of least unbiased risk"):  # fmt: skip
        assert words in text
    assert "which that of corotational did not at 2 %" in told(
        config(), state(1), state(2, converged=False)
    )
    assert "truth" not in told(config())


def test_each_method_is_told_with_what_it_uses():
    both = told(config())
    assert "Geman-McClure" in both and "in a frame that turns" in both
    assert (
        "For comparison: the squared residual in the struts, regularised by the equilibrium" in both
    )
    paper = told(config(methods=["eq10"]))
    assert "Geman-McClure" not in paper and "turns" not in paper and "(eq10)" in paper
    assert "carried by their neighbours" in both and "neighbours" not in paper
    chosen = told(config(methods=["corotational"]))
    assert "below 11.5 to 23 voxels, the length of least unbiased risk" in chosen
    assert "0.060 to 0.070 voxel (1.2 to 1.4 micrometres" in chosen
    plain = told(
        config(methods=["corotational"], l_e=23, robust="none", rotated=False, shell=0, mending=0)
    )
    for word in ("neighbours", "Geman-McClure", "turns", "void within", "equilibrium gap"):
        assert word not in plain
    assert "Labelle" not in told(config() | {"mesh": {"backend": "pytetwild"}})


def test_the_states_in_equilibrium_are_told():
    assert "displacement in every state, with the weight" in told(config())
    some = told(config(), state(1), state(2, weight=None), state(3))
    assert "displacement at 1 % and 3 % only" in some and "even if noise were twice" in some
    none = told(config(), state(1, weight=None))
    assert "displacement as it is" in none and "cross-validation" not in none
    off = told(config() | {"struts": {"equilibrium": False}})
    assert "equilibrium of" not in off and "cross-validation" not in off


@pytest.mark.parametrize("chosen", [["corotational", "eq10"], ["eq10"]])
def test_references_are_numbered_in_order_and_all_are_cited(chosen):
    text = told(config(methods=chosen))
    body, listed = text.split("| [1]", 1)
    cited = [int(n) for n in re.findall(r"\[(\d+)\]", body)]
    assert list(dict.fromkeys(cited)) == list(range(1, max(cited) + 1))
    assert [int(n) for n in re.findall(r"\| \[(\d+)\]", "| [1]" + listed)] == sorted(set(cited))
    assert "{" not in text


def test_every_reference_is_used_and_none_is_made_up():
    assert set(REFERENCES) == {
        name
        for name, words in REFERENCES.items()
        if words.split(".")[0] in told(config(methods=["corotational", "eq10"]))
    }
    with pytest.raises(KeyError):
        "{nobody}".format_map(Citations())


def test_lists_and_ranges():
    assert listing(["a"]) == "a" and listing(["a", "b", "c"]) == "a, b and c"
    assert listing(["a", "b"], "or") == "a or b"
    assert span([2, 1], ".1f") == "1.0 to 2.0" and span([1.0, 1.01], ".1f") == "1.0"


# ------------------------------------------------------------------------------ provenance


def test_the_hash_is_that_of_the_bytes(tmp_path):
    (tmp_path / "a").write_bytes(b"ab")
    (tmp_path / "b").write_bytes(b"c")
    known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # "abc", FIPS 180-2
    assert content_hash([tmp_path / "a", tmp_path / "b"]) == known


def test_the_commit_is_known_in_a_repository_only(tmp_path):
    assert commit(tmp_path) == "unknown"
    assert re.fullmatch(r"[0-9a-f]{40}(-dirty)?|unknown", commit())


def test_every_start_of_the_schema_has_its_words():
    schema = yaml.safe_load((ROOT / "workflow/schemas/config.schema.yaml").read_text())
    names = schema["properties"]["meso"]["properties"]["candidates"]["items"]["enum"]
    text = told(config() | {"meso": config()["meso"] | {"candidates": names}})
    assert "the motion of the platens" in text
    assert set(names) == set(STARTS)


def test_a_copy_of_a_scan_under_another_name_is_refused():
    check_different({"rest.tif": "ab" * 32, "load.tif": "cd" * 32})
    with pytest.raises(
        ScanError, match=r"again.tif and rest.tif hold the same bytes \(SHA-256 abab"
    ):
        check_different({"rest.tif": "ab" * 32, "load.tif": "cd" * 32, "again.tif": "ab" * 32})
