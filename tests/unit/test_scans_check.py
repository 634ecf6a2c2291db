"""What is wrong with the scans of a case is told at once, by their headers alone."""

import os

import numpy as np
import pytest
import SimpleITK as sitk
import tifffile

from addvc.errors import ConfigError, GeometryError, ScanError
from addvc.images.scans import ScanFormat
from addvc.images.scans_check import check_headers, check_scans, check_slab

SHAPE = (41, 37, 34)  # z, y, x


@pytest.fixture
def pages():
    """Grey values (z, y, x), uint16."""
    return np.random.default_rng(2417).integers(100, 60000, SHAPE, dtype=np.uint16)


def config(reference, *states, **scans):
    """A configuration with its defaults, as far as scans go."""
    paths = {"reference": str(reference), "states": [str(path) for path in states]}
    known = {"axes": "zyx", "bin": 1, "crop": None, "voxel_size_um": 20.0}
    return {"loading_axis": "y", "scans": known | paths | scans}


def write_slices(folder, pages):
    folder.mkdir()
    for number, page in enumerate(pages):
        tifffile.imwrite(folder / f"s{number:03}.tif", page)


def test_check_scans_tells_what_it_found(tmp_path, pages):
    for name, shift in (("a.npy", 0), ("b.npy", 1)):
        np.save(tmp_path / name, pages + np.uint16(shift))
    first, second = check_scans([tmp_path / "a.npy", tmp_path / "b.npy"], None, 2)
    assert first["path"] == str(tmp_path / "a.npy")
    assert (first["shape"], first["binned_shape"]) == ([34, 37, 41], [17, 18, 20])
    assert (first["dtype"], first["bytes"]) == ("uint16", (tmp_path / "a.npy").stat().st_size)
    assert len(first["fingerprint"]) == 64 and first["fingerprint"] != second["fingerprint"]


def test_the_same_scan_may_be_named_twice(tmp_path, pages):
    np.save(tmp_path / "a.npy", pages)
    rows = check_scans([tmp_path / "a.npy"] * 2, None)
    assert len(rows) == 2 and rows[0] == rows[1]


def test_scans_of_unequal_size_or_type_are_both_named(tmp_path, pages):
    np.save(tmp_path / "a.npy", pages)
    np.save(tmp_path / "b.npy", pages[:-1])
    with pytest.raises(ScanError, match=r"b.npy has \(34, 37, 40\) voxels, but .*a.npy has"):
        check_scans([tmp_path / "a.npy", tmp_path / "b.npy"], ScanFormat())
    np.save(tmp_path / "b.npy", pages.astype(np.uint8))
    with pytest.raises(ScanError, match=r"b.npy has values of uint8, but .*a.npy of uint16; .*one"):
        check_scans([tmp_path / "a.npy", tmp_path / "b.npy"], ScanFormat())


def test_byte_order_is_no_type(tmp_path, pages):
    tifffile.imwrite(tmp_path / "little.tif", pages, byteorder="<")
    tifffile.imwrite(tmp_path / "big.tif", pages, byteorder=">")
    paths = [tmp_path / "little.tif", tmp_path / "big.tif"]
    assert len(check_scans(paths, ScanFormat())) == 2


def test_all_that_is_wrong_is_told_at_once(tmp_path, pages):
    """Missing, empty, truncated, of another size, of another type; what is right is not named."""
    names = ["good", "missing.tif", "empty.tif", "half.tif", "size.tif", "type.tif"]
    good, missing, empty, half, size, kind = (tmp_path / name for name in names)
    write_slices(good, pages)
    empty.touch()
    for path, values in ((half, pages), (size, pages[:-3]), (kind, pages.astype(np.uint8))):
        tifffile.imwrite(path, values)
    os.truncate(half, half.stat().st_size // 2)
    with pytest.raises(ScanError) as told:
        check_headers(config(good, missing, empty, half, size, kind))
    first, *lines = str(told.value).split("\n- ")
    assert first == "5 things are wrong with the scans:"
    for path in (missing, empty, half, size, kind):
        assert (
            sum(line.startswith((f"scan {path} ", f"{path}: ", f"{path} ")) for line in lines) == 1
        )
    assert "was not found (0 files; at least 1)" in lines[0]
    assert check_headers(config(good)).startswith("1 scan of 34 x 37 x 41 voxels")


def test_a_voxel_size_that_the_header_contradicts_is_warned_of(tmp_path, pages):
    image = sitk.GetImageFromArray(pages)
    image.SetSpacing((0.018,) * 3)
    sitk.WriteImage(image, tmp_path / "a.mha")
    right = config(tmp_path / "a.mha")
    right["scans"]["voxel_size_um"] = 18.0
    assert "WARNING" not in check_headers(right)
    right["scans"]["voxel_size_um"] = 1.8
    assert "the header has a voxel size of 0.018" in check_headers(right)
    image.SetSpacing((0.0018, 0.0018, 0.01))
    sitk.WriteImage(image, tmp_path / "a.mha")
    assert "voxels of 0.0018 x 0.0018 x 0.01, which are no cubes" in check_headers(right)


def test_scans_of_two_voxel_sizes_are_refused(tmp_path, pages):
    image = sitk.GetImageFromArray(pages)
    for name, edge in (("a.mha", 0.02), ("b.mha", 0.04)):
        image.SetSpacing((edge,) * 3)
        sitk.WriteImage(image, tmp_path / name)
    with pytest.raises(
        ScanError, match=r"b.mha has voxels of 0.04 x 0.04 x 0.04, but .*a.mha of 0.02"
    ):
        check_headers(config(tmp_path / "a.mha", tmp_path / "b.mha"))


def test_a_slab_higher_than_the_image_is_refused():
    with pytest.raises(ConfigError, match=r"height is 500 voxels \(at most 72, the image"):
        check_slab({"height": 500}, 72)
    check_slab({"height": 72}, 72)


def test_a_cell_larger_than_half_of_the_image_is_refused(tmp_path, pages):
    np.save(tmp_path / "a.npy", pages)
    wrong = config(tmp_path / "a.npy") | {"geometry": {"cell_size": 560}}
    with pytest.raises(ConfigError, match=r"cell_size is 560 voxels \(at most 17, half of"):
        check_headers(wrong)


def test_two_headers_of_the_same_voxels_are_one_scan(tmp_path, pages):
    sitk.WriteImage(sitk.GetImageFromArray(pages), tmp_path / "a.mhd")
    (tmp_path / "b.mhd").write_text("Comment = b\n" + (tmp_path / "a.mhd").read_text())
    with pytest.raises(ScanError, match=r"scans.states\[0\] is the same scan as scans.reference"):
        check_headers(config(tmp_path / "a.mhd", tmp_path / "b.mhd"))


def test_a_scan_that_is_listed_twice_is_refused(tmp_path, pages):
    for name in ("a.npy", "b.npy"):
        np.save(tmp_path / name, pages)
    a, b, link = (tmp_path / name for name in ("a.npy", "b.npy", "link.npy"))
    link.symlink_to(a)
    check_headers(config(a, b))
    with pytest.raises(ScanError, match=r"scans.states\[1\] is the same scan as scans.reference"):
        check_headers(config(a, b, link))
    with pytest.raises(ScanError, match=r"scans.states\[1\] is the same scan as scans.states\[0\]"):
        check_headers(config(a, b, b))


def test_a_problem_that_all_share_is_told_once(tmp_path, pages):
    np.save(tmp_path / "a.npy", pages)
    np.save(tmp_path / "b.npy", pages)
    given = config(tmp_path / "a.npy", tmp_path / "b.npy", crop=[[0, 99], None, None])
    with pytest.raises(ScanError, match=r"^crop of x is 0 to 99, but the scan has 34 voxels"):
        check_headers(given)


def test_a_fault_of_all_raw_files_is_told_once(tmp_path):
    for name in "ab":
        (tmp_path / f"{name}.raw").write_bytes(bytes(1000))
    given = config(tmp_path / "a.raw", tmp_path / "b.raw", shape=[20, 20, 20], dtype="uint8")
    with pytest.raises(ScanError, match=r"a\.raw: expected 8000 .*\(so it is with 1 more scan\)$"):
        check_headers(given)


@pytest.mark.parametrize("platens", [[-5, 20], [3, 500], [20, 3]])
def test_platens_outside_the_image_or_reversed_are_refused(tmp_path, pages, platens):
    np.save(tmp_path / "a.npy", pages)
    assert check_headers(config(tmp_path / "a.npy", platens=[3, 20]))
    with pytest.raises(GeometryError, match=r"platens \[.*; give"):
        check_headers(config(tmp_path / "a.npy", platens=platens))


def test_slices_are_opened_at_both_ends_only(tmp_path, pages, monkeypatch):
    write_slices(tmp_path / "a", pages)
    opened = []
    real = tifffile.TiffFile
    monkeypatch.setattr(tifffile, "TiffFile", lambda path: opened.append(path) or real(path))
    check_headers(config(tmp_path / "a"))
    assert [path.name for path in opened] == ["s000.tif", "s040.tif"]
    tifffile.imwrite(tmp_path / "a/s020.tif", pages[0, :-1])
    check_headers(config(tmp_path / "a"))
    with pytest.raises(
        ScanError, match=r"s020\.tif is \(36, 34\) uint16, but s000\.tif is \(37, 34\)"
    ):
        check_scans([tmp_path / "a"], ScanFormat())


@pytest.mark.parametrize(
    "slab", [{"low": 37}, {"low": 300, "high": 310}, {"high": 0}, {"high": -4}]
)
def test_a_slab_outside_the_image_is_refused(tmp_path, pages, slab):
    np.save(tmp_path / "a.npy", pages)
    known = config(tmp_path / "a.npy")
    assert check_headers(known | {"micro": {"region": {"low": 30, "high": 99}}})
    with pytest.raises(ConfigError, match=r"micro.region \(.*\) lies outside .* 0 to 37 along"):
        check_headers(known | {"micro": {"region": slab}})
