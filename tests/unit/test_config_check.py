"""Every fault of a configuration is told at once, with its key, value, limit and remedy."""

import math

import pytest
import yaml

from addvc import reference
from addvc.config_check import check_config
from addvc.errors import ConfigError

SCHEMA = yaml.safe_load(reference.SCHEMA.read_text())


@pytest.fixture(autouse=True)
def scans_are_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.tif", "b.tif"):
        (tmp_path / name).touch()


def own(**changes):
    """A configuration of the user's own scans that nothing is wrong with, but for the changes."""
    scans = {"reference": "a.tif", "states": ["b.tif"], "voxel_size_um": 20}
    given = {"case": "mine", "porosity": 0.96, "loading_axis": "y", "scans": scans}
    return {key: value for key, value in (given | changes).items() if value is not None}


def scans(**changes):
    return {"scans": own()["scans"] | changes}


@pytest.mark.parametrize(
    ("config", "key", "meant"),
    [
        ({"porosty": 0.96}, "porosty", "porosity"),
        ({"meso": {"sizs": [33]}}, "meso.sizs", "meso.sizes"),
        ({"twin": {"sed": 2417}}, "twin.sed", "twin.seed"),
        ({"micro": {"region": {"hig": 3}}}, "micro.region.hig", "micro.region.high"),
        ({"micro": {"lE": 3}}, "micro.lE", "micro.l_e"),
    ],
)
def test_a_misspelt_key_is_told_with_the_nearest_one(config, key, meant):
    with pytest.raises(ConfigError) as told:
        check_config(config, SCHEMA)
    assert f"unknown key `{key}`" in str(told.value)
    assert f"did you mean `{meant}`?" in str(told.value)


def test_an_unknown_key_among_several_kinds_of_value_is_told_once():
    with pytest.raises(ConfigError, match=r"^unknown key `micro.region.hi`: did you mean") as told:
        check_config({"micro": {"region": {"low": 5, "hi": 3}}}, SCHEMA)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("config", "words"),
    [
        ({"twin": {"strains": [0.1, 0.05]}}, r"twin.strains is \[0.1, 0.05\]; they must increase"),
        ({"porosity": 0.5}, "`porosity` is 0.5; a twin has at least 0.85"),
        (
            {"twin": {"size": "tiny", "cell_size": 60}},
            "cell_size is 60; 8 to 36 voxels are possible",
        ),
    ],
)
def test_a_twin_that_cannot_be_made_is_told_before_any_work(config, words):
    with pytest.raises(ConfigError, match=words):
        check_config(config, SCHEMA)


def test_a_key_like_no_other_gets_the_list_of_those_known():
    with pytest.raises(ConfigError, match=r"unknown key `images\.qqqq`: see config/README") as told:
        check_config({"images": {"qqqq": 1}}, SCHEMA)
    assert str(told.value).endswith("Known here: blur, degree, grey")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"porosity": 96}, r"`porosity` is 96; it must be below 1 \(did you mean 0.96\?\)\. Share"),
        (
            {"porosity": 0.04},
            r"`porosity` is 0.04; at least 0.3 .* not of solid \(did you mean 0.96\?",
        ),
        ({"porosity": None}, "`porosity` is missing: give"),
        ({"porosity": "0,96"}, r"must be a number \(write 0.96, without a comma\)\."),
        ({"porosity": "96 %"}, r"must be a number \(did you mean 0.96\?\)\. Share"),
        ({"porosity": "a lot"}, r"`porosity` is 'a lot'; it must be a number\. Share of void"),
        ({"case": "my case"}, "`case` is 'my case'; only letters, digits"),
        ({"case": None}, "`case` is missing: .*case: mine"),
        ({"case": "twin"}, "`case` is twin, .*case: mine"),
        ({"loading_axis": "Y"}, r"one of x, y, z \(did you mean y\?\)\. Direction of compression"),
        (
            {"scans": {"reference": "a.tif"}},
            "`scans.voxel_size_um` is missing. Voxel size of the scan",
        ),
        (scans(voxel_size_um=0.018), r"at least 0.05 \(0.018 millimetres\? that is 18\)\. Voxel"),
        (scans(voxel_size_um=18e-6), r"at least 0.05 \(1.8e-05 metres\? that is 18\)"),
        (scans(voxel_size_um=18000), r"at most 1000 \(18000 nanometres\? that is 18\)"),
        (scans(crop=[20, 100]), r"`scans.crop` is \[20, 100\]; it must be a list of at least 3\."),
        (scans(platens=[130, 10]), r"scans.platens is \[130, 10\]; give \[LOW, HIGH\]"),
        (scans(platens="both"), "it must be auto, none or a list"),
        (scans(platens=False), r"none or a list \(write none: YAML takes no for false\)"),
        (scans(crop=[0, 9, 0, 9, 0, 9]), r"mean \[\[0, 9\], \[0, 9\], \[0, 9\]\]\?"),
        (
            {"geometry": {"threshold": float("nan")}},
            "`geometry.threshold` is nan; give a finite number",
        ),
        (scans(platens=[math.nan, 10]), r"`scans.platens.0` is nan; give a finite number"),
        (
            {"meso": {"sizes": [12.00000001, 12.0]}},
            "must fall from coarse to fine, and differ in six digits",
        ),
        (scans(states=[]) | {"virtual": {"strains": [2]}}, r"at most 0.3 \(did you mean 0.02\?\)"),
        ({"axes": "xyz"}, "unknown key `axes`: did you mean `scans.axes`?"),
        (scans(crop=[None, [9, 3], None]), "scans.crop of y is 9 to 3; use START < STOP"),
        ({"geometry": {"cell_size": "1.2mm"}}, r"auto or a number \(write 1.2, without its unit\)"),
        (
            scans(crop=[[-5, 10], None, None]),
            r"`scans.crop\[0\]\[0\]` is -5; it must be at least 0\. \[\[x0",
        ),
        (
            scans(states="b.tif"),
            r"`scans.states` is 'b.tif'; it must be a list \(write \[b.tif\]\)\. Scans",
        ),
        ({"micro": {"l_e": -3}}, r"`micro.l_e` is -3; it must be above 0\. Cut-off length l_E"),
        (
            {"micro": {"l_e": "automatic"}},
            r"`micro.l_e` is 'automatic'; it must be auto or a number\. Cut-off",
        ),
        (
            {"micro": {"region": {"low": 80, "high": 40}}},
            "low = 80 to high = 40; low must be below",
        ),
        (
            {"micro": {"region": {"low": 20, "height": 40}}},
            "has a height, whose place meso DVC finds, and low or high",
        ),
        (
            {"meso": {"candidates": ["previous"]}},
            "at least one of zero, platens, freeform",
        ),
        ({"meso": {"candidates": ["zero", "zero"]}}, "nothing may be in it twice"),
        ({"meso": {"sizes": [12, 33]}}, "must fall from coarse to fine"),
        ({"twin": {}}, "both `twin` and `scans`"),
        (scans(voxel_size_um="20"), r"it must be a number \(write 20, without quotes\)\. Voxel"),
        ({"micro": {"rotated": "1"}}, r"it must be true or false\. "),
        ({"micro": {"tolerance": "1.2.3e5"}}, r"it must be a number\. "),
        (scans(platens=[5]), r"`scans.platens` is \[5\]; it must be a list of at least 2"),
        ({"micro": {"tolerance": "1e-3"}}, r"\(write 0.001: YAML takes 1e-3 for a text\)"),
        ({"micro": {"region": {"low": "a"}}}, "`micro.region.low` is 'a'; it must be a number"),
    ],
)
def test_a_wrong_value_is_told_with_its_limit_and_what_it_means(changes, words):
    with pytest.raises(ConfigError, match=words) as told:
        check_config(own(**changes), SCHEMA)
    assert "\n" not in str(told.value)


def test_all_that_is_wrong_is_told_at_once():
    config = own(porosity=96, porosty=0.96, loading_axis="Y", micro={"lE": 3})
    with pytest.raises(ConfigError, match=r"^4 things are wrong:") as told:
        check_config(config, SCHEMA)
    assert str(told.value).count("\n- ") == 4
    with pytest.raises(ConfigError, match=r"^2 things are wrong:"):
        check_config(own(porosity=None, micro={"region": {"low": 80, "high": 40}}), SCHEMA)


def test_scans_that_are_missing_are_told_with_the_other_faults():
    with pytest.raises(
        ConfigError, match=r"^2 things are wrong:[\s\S]*scan gone\.tif was not found"
    ):
        check_config(own(porosity=None, **scans(states=["gone.tif"])), SCHEMA)


def test_a_scan_in_the_home_folder_is_there_whatever_else_is_wrong(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "a.tif").touch()
    with pytest.raises(ConfigError) as told:
        check_config(own(porosity=None, **scans(reference="~/a.tif", states=[])), SCHEMA)
    assert "not found" not in str(told.value)


def test_a_misspelt_key_that_is_needed_is_told_once():
    given = {"scans": {"reference": "a.tif", "states": ["b.tif"], "voxel_size": 20}}
    with pytest.raises(ConfigError, match=r"^unknown key `scans.voxel_size`: did you mean") as told:
        check_config(own(**given), SCHEMA)
    assert "is missing" not in str(told.value)


def test_pairs_are_told_beside_wrong_values_as_far_as_they_can_be():
    with pytest.raises(ConfigError, match=r"^2 things are wrong:[\s\S]*platens is \[130, 10\]"):
        check_config(own(porosity="0,96", **scans(platens=[130, 10])), SCHEMA)


def test_every_missing_key_and_a_section_left_empty_are_told():
    with pytest.raises(ConfigError, match=r"reference` is missing[\s\S]*voxel_size_um` is missing"):
        check_config(own(scans={}), SCHEMA)
    with pytest.raises(ConfigError, match=r"`micro` is empty; it must be a section of keys"):
        check_config({"micro": None}, SCHEMA)


def test_a_right_configuration_passes():
    assert check_config({}, SCHEMA) == []
    assert check_config(own(micro={"region": {"low": 40}}), SCHEMA) == []


@pytest.mark.parametrize("kind", [{"twin": {"size": "tiny"}}, {"virtual": {}}, {}])
def test_a_slab_that_is_to_be_found_wants_states_not_their_strains(kind):
    """Of a twin and of virtual states the schema has some: who gives none has those."""
    slab = {"micro": {"region": {"height": 40}}}
    images = {"scans": None} if "twin" in kind else {}
    if "virtual" in kind:
        images = {"scans": {"reference": "a.tif", "voxel_size_um": 20}}
    check_config(own(**slab, **kind, **images), SCHEMA)
    with pytest.raises(ConfigError, match="0 loading states"):
        check_config(own(**slab) | scans(states=[]), SCHEMA)


def test_what_may_be_forgotten_is_warned_of():
    (warning,) = check_config({"case": "mine", "porosity": 0.96}, SCHEMA)
    assert "neither `scans` nor `twin`" in warning and "as case mine" in warning
    assert check_config({"case": "other", "twin": {"seed": 2418}}, SCHEMA) == []
    (warning,) = check_config(own(**scans(states=[])), SCHEMA)
    assert "scans.states is empty" in warning
    (warning,) = check_config(own(loading_axis=None), SCHEMA)
    assert "along y" in warning
