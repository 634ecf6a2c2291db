"""The configuration: what it may say, what it means, and the words for what it may not."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator

from addvc import config as settings
from addvc import reference
from addvc.config_check import check_config
from addvc.errors import ConfigError
from addvc.twin import SIZES, TwinOptions
from addvc.twin.options import DTYPES, MATERIALS

ROOT = Path(__file__).parents[2]
SCHEMA = yaml.safe_load(reference.SCHEMA.read_text())
SHIPPED = [*sorted((ROOT / "config").glob("*.yaml")), ROOT / "tests/solid_twin/config.yaml"]


def known_places(schema, path=""):
    """Every key of the schema with its path, sections included."""
    for key, spec in schema.get("properties", {}).items():
        yield f"{path}{key}", spec
        for option in (spec, *spec.get("anyOf", [])):
            yield from known_places(option, f"{path}{key}.")


PLACES = dict(known_places(SCHEMA))


# ---------------------------------------------------------------------------- kind of case


@pytest.mark.parametrize(
    ("config", "kind"),
    [
        ({}, "twin"),
        ({"twin": {}}, "twin"),
        ({"twin": {}, "loading_axis": "y"}, "twin"),
        ({"scans": {"states": ["a.tif"]}, "loading_axis": "z"}, "scans"),
        ({"scans": {"states": []}, "virtual": {}}, "virtual"),
    ],
)
def test_where_images_come_from(config, kind):
    assert settings.case_kind(config) == kind


@pytest.mark.parametrize(
    ("config", "words"),
    [
        ({"twin": {}, "scans": {}}, "has both `twin` and `scans`; keep one"),
        ({"virtual": {}}, "give scans.reference"),
        ({"virtual": {}, "twin": {}}, "give scans.reference"),
        ({"virtual": {}, "scans": {"states": ["a.tif"]}}, "leave out scans.states"),
        ({"twin": {}, "loading_axis": "z"}, "loading_axis is z.*along y: leave loading_axis out"),
    ],
)
def test_a_configuration_that_says_too_much_or_too_little(config, words):
    with pytest.raises(ConfigError, match=words):
        settings.case_kind(config)


def test_loading_axis_is_a_number():
    assert [settings.loading_axis({"loading_axis": name}) for name in "xyz"] == [0, 1, 2]


# ----------------------------------------------------------------------------------- names


def test_states_are_called_by_their_strain_or_their_number():
    twin = {"twin": {"strains": [0.034, 0.285]}}
    virtual = {"scans": {}, "virtual": {"strains": [0.02]}}
    assert settings.state_labels(twin) == {1: "3.4 %", 2: "28.5 %"}
    assert settings.state_labels(virtual) == {1: "2.0 %"}
    near = {"scans": {}, "virtual": {"strains": [0.02, 0.0204]}}
    assert settings.state_labels(near) == {1: "2.00 %", 2: "2.04 %"}
    assert settings.state_labels({"scans": {"states": ["a", "b"]}}) == {1: "state 1", 2: "state 2"}
    assert settings.state_labels({"scans": {"states": []}}) == {}


def test_meso_meshes_are_called_by_their_sizes():
    assert settings.meso_names({"meso": {}}) == ["meso33", "meso23", "meso12"]
    assert settings.meso_names({"meso": {"sizes": [40, 12.5]}}) == ["meso40", "meso12.5"]


@pytest.mark.parametrize("sizes", [[12, 23], [33, 23, 23], [33, 12, 23]])
def test_meso_sizes_must_fall(sizes):
    with pytest.raises(ConfigError, match=r"meso\.sizes \[.*\] must fall from coarse to fine"):
        settings.meso_names({"meso": {"sizes": sizes}})


def test_default_meso_sizes_follow_the_cell_and_given_ones_do_not():
    assert settings.meso_size({"meso": {}}, "meso33", 28.0) == 33
    assert settings.meso_size({"meso": {}}, "meso12", 84.0) == pytest.approx(36)
    assert settings.meso_size({"meso": {"sizes": [12.5]}}, "meso12.5", 84.0) == 12.5


def test_the_first_micro_method_is_called_micro():
    assert settings.micro_names({"micro": {"methods": ["eq10"]}}) == {"micro": "eq10"}
    assert settings.micro_names({"micro": {"methods": ["corotational", "eq10"]}}) == {
        "micro": "corotational",
        "micro-eq10": "eq10",
    }


# ------------------------------------------------------------------------------ scan files


@pytest.fixture
def scans(tmp_path):
    for name in ("a/s10.tif", "a/s09.tif", "a/notes.txt", "one.raw"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"0")
    return tmp_path


def test_the_methods_of_micro_dvc_are_those_of_the_schema():
    micro = SCHEMA["properties"]["micro"]["properties"]
    assert set(micro["methods"]["items"]["enum"]) == set(settings.METHODS)
    assert settings.METHODS["corotational"] == settings.Method()


def test_a_scan_is_a_file_a_folder_or_a_pattern(scans):
    slices = [str(scans / "a/s09.tif"), str(scans / "a/s10.tif")]
    assert settings.scan_files(str(scans / "one.raw")) == [str(scans / "one.raw")]
    assert settings.scan_files(str(scans / "a")) == slices
    assert settings.scan_files(str(scans / "a/s*.tif")) == slices


def test_all_files_of_a_scan_are_known(tmp_path, monkeypatch):
    """A header with the file that it names, and what a folder of Zarr holds; ~ is the home folder."""
    (tmp_path / "a.mhd").write_text("NDims = 3\nElementDataFile = a.raw\n")
    (tmp_path / "a.nhdr").write_text("NRRD0004\ndata file: a.raw\n")
    (tmp_path / "a.raw").touch()
    (tmp_path / "b.zarr/c/0").mkdir(parents=True)
    (tmp_path / "b.zarr/zarr.json").touch()
    (tmp_path / "b.zarr/c/0/1").touch()
    found = {
        name: settings.scan_files(str(tmp_path / name)) for name in ("a.mhd", "a.nhdr", "b.zarr")
    }
    assert found == {
        "a.mhd": [str(tmp_path / "a.mhd"), str(tmp_path / "a.raw")],
        "a.nhdr": [str(tmp_path / "a.nhdr"), str(tmp_path / "a.raw")],
        "b.zarr": [str(tmp_path / "b.zarr/c/0/1"), str(tmp_path / "b.zarr/zarr.json")],
    }
    monkeypatch.setenv("HOME", str(tmp_path))
    config = {"scans": {"reference": "~/a.mhd", "states": ["b.tif"]}}
    assert settings.scan_paths(config) == [str(tmp_path / "a.mhd"), "b.tif"]


def test_suffixes_of_slices_may_be_capitals(scans):
    (scans / "b").mkdir()
    (scans / "b/S1.TIF").write_bytes(b"0")
    assert settings.scan_files(str(scans / "b")) == [str(scans / "b/S1.TIF")]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("empty", "is a folder without TIFF slices .0; at least 1.: name the file"),
        ("One.raw", r"did you mean .*one\.raw\?"),
    ],
)
def test_a_scan_that_is_hard_to_find_has_a_hint(scans, name, message):
    (scans / "empty").mkdir()
    with pytest.raises(ConfigError, match=message):
        settings.scan_files(str(scans / name))


@pytest.mark.parametrize("name", ["two.raw", "a/t*.tif"])
def test_a_missing_scan_is_told_with_its_place(scans, name):
    with pytest.raises(ConfigError, match=r"was not found \(0 files; at least 1\)") as told:
        settings.scan_files(str(scans / name))
    assert name in str(told.value)
    assert str(Path.cwd()) in str(told.value)
    assert "correct scans.reference or scans.states" in str(told.value)


def test_how_a_scan_is_read():
    raw = {
        "axes": "xyz",
        "shape": [9, 8, 7],
        "dtype": "uint16",
        "byte_order": "big",
        "header_bytes": 4,
    }
    scans = raw | {"voxel_size_um": 6.67, "bin": 3, "crop": [[0, 9], None, None]}
    given = settings.scan_settings({"scans": scans}, 1)
    assert given == {"format": raw, "bin": 3, "crop": scans["crop"]}

    made = settings.scan_settings({"scans": scans, "virtual": {}}, 1)
    assert made == {"format": {"axes": "zyx"}, "bin": 3, "crop": None}
    assert settings.scan_settings({"scans": scans, "virtual": {}}, 0) == given

    twin = settings.scan_settings({"twin": {"bin": 3}}, 2)
    assert settings.voxel_size_um({"twin": {"bin": 3}}) * twin["bin"] == pytest.approx(20.01)
    assert settings.voxel_size_um({"scans": scans}) == 6.67


# ---------------------------------------------------------------------- schema and shipped


def test_the_schema_is_one():
    Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_a_shipped_configuration_is_valid(path):
    config = yaml.safe_load(path.read_text())
    config.pop("truth", None)  # made by the one who runs it
    assert check_config(config, SCHEMA) == []


@pytest.mark.parametrize("path", PLACES)
def test_a_key_is_described_and_its_default_is_allowed(path):
    spec = PLACES[path]
    if "properties" in spec:
        assert spec["additionalProperties"] is False
    elif not path.startswith("micro.region."):
        assert spec["description"]
    if "default" in spec:
        errors = Draft202012Validator(spec).iter_errors(spec["default"])
        assert [error.message for error in errors] == []


TWIN = SCHEMA["properties"]["twin"]["properties"]


def test_keys_and_defaults_of_the_twin_are_those_of_its_options():
    """`porosity` is a key of its own, since real scans have one too."""
    options = {f.name: f.default for f in fields(TwinOptions)}
    assert set(TWIN) == set(options) - {"porosity"}
    for key, spec in TWIN.items():
        assert spec["default"] == np.asarray(options[key]).tolist(), key
    assert SCHEMA["properties"]["porosity"]["default"] == options["porosity"]


def test_choices_of_the_twin_are_those_of_its_code():
    for key, known in (("size", SIZES), ("material", MATERIALS), ("dtype", DTYPES)):
        assert TWIN[key]["enum"] == list(known)
    shapes = [" x ".join(map(str, shape)) for shape in SIZES.values()]
    assert all(shape in TWIN["size"]["description"] for shape in shapes)


def test_a_twin_is_kept_by_what_makes_it():
    """Another noise, another scan of the same motion; another seed, another motion."""
    whole = {key: spec["default"] for key, spec in TWIN.items()}

    def folders(**changes):
        parts = settings.twin_parts({"twin": whole | changes, "porosity": 0.96})
        return [settings.twin_folder(part) for part in parts]

    motion, scans = folders()
    assert set(settings.IMAGING) < set(TWIN)
    for key in settings.IMAGING:
        assert folders(**{key: 2})[0] == motion and folders(**{key: 2})[1] != scans
    for key in set(TWIN) - set(settings.IMAGING):
        other = folders(**{key: "other"})
        assert other[0] != motion and other[1] != scans


def test_every_name_that_designers_were_promised_is_there():
    promised = """case porosity loading_axis scans.reference scans.states scans.axes
        scans.voxel_size_um scans.bin scans.platens scans.specimen twin.size twin.seed
        micro.region micro.methods micro.l_k micro.l_l micro.period micro.nu meso.sizes strict"""
    assert set(promised.split()) <= set(PLACES)


def test_the_page_of_keys_is_up_to_date():
    page = reference.page(SCHEMA)
    assert (ROOT / "config/README.md").read_text() == page
    for path, spec in PLACES.items():
        if "properties" not in spec and not path.startswith("micro.region."):
            assert f"| `{path}` |" in page


def test_a_truth_belongs_to_real_scans(tmp_path):
    scans = {"scans": {"reference": "a", "states": ["b"]}}
    file = tmp_path / "truth.h5"
    file.touch()
    assert settings.case_kind(scans | {"truth": str(file)}) == "scans"
    assert settings.truth_file(scans | {"truth": str(file)}) == str(file)
    assert settings.truth_file(scans) is None
    for other in ({"twin": {}}, {}, scans | {"virtual": {}}):
        with pytest.raises(ConfigError, match="`truth` is the displacement of your own scans"):
            settings.case_kind(other | {"truth": str(file)})
    with pytest.raises(ConfigError, match=r"none\.h5 was not found; paths start at"):
        settings.truth_file(scans | {"truth": "none.h5"})
