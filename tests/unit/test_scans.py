"""Scans: every format gives the same voxels, streamed or whole; every defect is named."""

import os
from dataclasses import replace

import h5py
import numpy as np
import pytest
import SimpleITK as sitk
import tifffile
import zarr
from numpy.testing import assert_allclose, assert_array_equal
from scipy.ndimage import gaussian_filter

import addvc.images.scans as scans
from addvc.images.files import atomic_path
from addvc.images.levels import bin_mean
from addvc.images.scans import (
    ScanError,
    ScanFormat,
    load_volume,
    open_scan,
    read_binned,
    save_volume,
)
from addvc.images.scans_check import check_scans
from addvc.images.scans_itk import SUFFIXES as ITK_SUFFIXES

SHAPE = (34, 37, 41)  # x, y, z
RAW = ScanFormat(shape=SHAPE[::-1], dtype="uint16")


@pytest.fixture
def volume():
    """Grey values (x, y, z), uint16."""
    return np.random.default_rng(2417).integers(100, 60000, SHAPE, dtype=np.uint16)


@pytest.fixture
def pages(volume):
    """The same as pages along z, rows along y."""
    return np.ascontiguousarray(volume.transpose(2, 1, 0))


def write_stack(folder, pages, first=7):
    """Single-page files numbered without leading zeros."""
    folder.mkdir()
    for number, page in enumerate(pages, first):
        tifffile.imwrite(folder / f"scan_{number}.tif", page)


def write(path, pages):
    """Write pages (z, y, x) in the format that the name asks for."""
    match path.name:
        case "pages.tif":
            with tifffile.TiffWriter(path) as tif:
                for page in pages:
                    tif.write(page, contiguous=False, metadata=None)
        case "packed.tiff":
            tifffile.imwrite(path, pages, compression="zlib")
        case "imagej.tif":
            tifffile.imwrite(path, pages[None, :, None], imagej=True, metadata={"axes": "TZCYX"})
        case "big.tif":
            tifffile.imwrite(path, pages, bigtiff=True, byteorder=">", metadata=None)
        case "plain.TIF":
            tifffile.imwrite(path, pages)
        case "array.npy":
            np.save(path, pages)
        case "fortran.npy":
            np.save(path, np.asfortranarray(pages))
        case "volume.h5":
            with h5py.File(path, "w") as file:
                file["entry/data"] = pages
        case "volume.zarr":
            zarr.open_group(path, mode="w").create_array("0/data", data=pages, chunks=(8, 16, 16))
        case "ome.zarr":
            levels = zarr.open_group(path, mode="w")
            levels.create_array("0", data=pages[None, None], chunks=(1, 1, 8, 16, 16))
            levels.create_array("labels", data=np.zeros((2, *pages.shape), np.uint8))
        case "plain.zarr":
            zarr.save_array(path, pages)
        case "stack":
            write_stack(path, pages)
        case name if path.suffix in ITK_SUFFIXES:
            image = sitk.GetImageFromArray(pages)
            sitk.WriteImage(image, path, useCompression="packed" in name)
        case _:
            pages.tofile(path)


NAMES = ["pages.tif", "packed.tiff", "imagej.tif", "big.tif", "plain.TIF", "array.npy"]
NAMES += ["fortran.npy", "volume.h5", "stack", "scan.raw", "scan.vol", "scan.bin"]
NAMES += [
    "volume.zarr",
    "plain.zarr",
    "ome.zarr",
    "a.nrrd",
    "packed.nrrd",
    "a.nhdr",
    "a.mha",
    "packed.mha",
]
NAMES += ["a.mhd", "packed.mhd", "a.nii", "a.nii.gz"]


@pytest.mark.parametrize("name", NAMES)
def test_every_format_gives_the_same_voxels(tmp_path, volume, pages, name):
    write(tmp_path / name, pages)
    scan = open_scan(tmp_path / name, RAW if name.startswith("scan.") else None)
    assert (scan.shape, scan.slow_axis, scan.path) == (SHAPE, 2, tmp_path / name)
    assert scan.dtype == np.uint16 or scan.dtype == np.dtype(">u2")
    assert_array_equal(scan.slab(9, 12), volume[:, :, 9:12])
    assert_array_equal(scan.slab(0, 1), volume[:, :, :1])
    assert_array_equal(read_binned(scan), volume)


@pytest.mark.parametrize("axes", ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx"])
def test_every_axis_order(tmp_path, volume, axes):
    stored = volume.transpose(["xyz".index(name) for name in axes])
    np.save(tmp_path / "scan.npy", stored)
    scan = open_scan(tmp_path / "scan.npy", ScanFormat(axes=axes))
    assert scan.shape == SHAPE
    assert_array_equal(np.moveaxis(scan.slab(3, 8), scan.slow_axis, 0), stored_rows(volume, axes))
    assert_allclose(read_binned(scan, 2), bin_mean(volume, 2))


def stored_rows(volume, axes):
    """Rows 3 to 8 along the axis stored first, that axis first."""
    return np.moveaxis(volume, "xyz".index(axes[0]), 0)[3:8]


def test_pattern_sorts_numbers_naturally(tmp_path, volume, pages):
    write_stack(tmp_path / "stack", pages)
    tifffile.imwrite(tmp_path / "stack" / "preview.tif", pages[0, :5])
    assert_array_equal(read_binned(open_scan(tmp_path / "stack" / "scan_*.tif")), volume)


def test_keys_of_another_format_are_not_left_aside(tmp_path, pages):
    np.save(tmp_path / "a.npy", pages)
    expect("scans.shape and dtype are for raw files; leave them out", tmp_path / "a.npy", RAW)
    expect("scans.dataset is for HDF5 and Zarr", tmp_path / "a.npy", ScanFormat(dataset="a"))


@pytest.mark.parametrize("order", ["little", "big"])
def test_raw_header_and_byte_order(tmp_path, volume, pages, order):
    data = pages.astype(np.dtype("u2").newbyteorder("<" if order == "little" else ">")).tobytes()
    (tmp_path / "scan.raw").write_bytes(b"x" * 513 + data)
    fmt = ScanFormat(shape=SHAPE[::-1], dtype="uint16", byte_order=order, header_bytes=513)
    assert_array_equal(read_binned(open_scan(tmp_path / "scan.raw", fmt)), volume)


@pytest.mark.parametrize("factor", [1, 2])
@pytest.mark.parametrize("axes", ["zyx", "xyz", "yxz"])
def test_slabs_crop_and_bin_as_the_whole_does(tmp_path, monkeypatch, volume, axes, factor):
    monkeypatch.setattr(scans, "SLAB_VOXELS", 4000)  # a few slices at a time
    np.save(tmp_path / "scan.npy", volume.transpose(["xyz".index(name) for name in axes]))
    scan = open_scan(tmp_path / "scan.npy", ScanFormat(axes=axes))
    calls = []
    crop = ((1, None), (2, -1), None)
    found = read_binned(scan, factor, crop, lambda done, total: calls.append((done, total)))
    assert found.dtype == np.float32
    assert_array_equal(found, bin_mean(volume[1:, 2:-1], factor))
    assert len(calls) > 2 and calls[-1][0] == calls[-1][1]


def test_streaming_reads_each_slice_once(tmp_path, monkeypatch, volume, pages):
    monkeypatch.setattr(scans, "SLAB_VOXELS", 5000)
    np.save(tmp_path / "scan.npy", pages)
    scan, read = open_scan(tmp_path / "scan.npy"), []
    source = scans.Source(
        scan.source.shape,
        scan.source.dtype,
        lambda start, stop: read.append((start, stop)) or pages[start:stop],
        scan.source.files,
    )
    read_binned(
        scans.Scan(scan.path, scan.shape, scan.dtype, "zyx", source), 2, (None, None, (3, 40))
    )
    assert [stop for _, stop in read[:-1]] == [start for start, _ in read[1:]]
    assert (read[0][0], read[-1][1]) == (3, 39)


def expect(message, path, fmt=None):
    with pytest.raises(ScanError, match=message):
        read_binned(open_scan(path, fmt))


def test_missing_file_says_where_it_was_sought(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    expect(f"data/a.tif: no such file or folder .relative to {tmp_path}", "data/a.tif")
    expect("an absolute path", tmp_path / "a.tif")
    expect(r"scan_\*.tif: no TIFF file found", "scan_*.tif")


def test_unknown_suffix_lists_the_known(tmp_path):
    (tmp_path / "a.jpg").touch()
    expect(r"unknown suffix '.jpg'; known are .tif, .tiff, .raw", tmp_path / "a.jpg")


@pytest.mark.parametrize("axes", ["xyy", "xy", "XYZ", "zyxt"])
def test_axes_must_be_a_permutation(axes):
    expect(f"axes is '{axes}'; use a permutation of 'xyz'", "a.tif", ScanFormat(axes=axes))


@pytest.mark.parametrize("name", ["pages.tif", "packed.tiff", "big.tif", "plain.TIF"])
@pytest.mark.parametrize("share", [0.002, 0.1, 0.5, 0.9, 0.97, 0.995])
def test_truncated_tiff(tmp_path, pages, name, share):
    path = tmp_path / name
    write(path, pages)
    os.truncate(path, int(path.stat().st_size * share))
    expect(f"{name}: .*truncated or damaged; copy", path)


def test_truncated_imagej_and_others(tmp_path, pages):
    for name in ("imagej.tif", "volume.h5", "array.npy"):
        path = tmp_path / name
        write(path, pages)
        os.truncate(path, int(path.stat().st_size * 0.8))
        expect(f"{name}: .*copy", path)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.mha", r"a\.mha: cannot be read .*; copy the file again"),
        ("a.mhd", r"a\.mhd: cannot be read .*; copy the file again"),
        ("a.nrrd", r"a\.nrrd: (cannot be read|holds \d+ bytes) .*copy the file again"),
        ("a.nii", r"a\.nii: cannot be read .*; copy the file again"),
        ("packed.mha", r"packed\.mha: cannot be read .*; copy the file again"),
        ("packed.nrrd", r"packed\.nrrd: cannot be read .*; copy the file again"),
        ("a.nii.gz", r"a\.nii\.gz: cannot be unpacked .*; copy the file again"),
    ],
)
@pytest.mark.parametrize("left", [0.5, 0.999])
def test_truncated_medical_formats(tmp_path, pages, name, message, left):
    write(tmp_path / name, pages)
    data = tmp_path / name.replace(".mhd", ".raw")
    os.truncate(data, int(left * data.stat().st_size))
    with pytest.raises(ScanError, match=message):
        read_binned(open_scan(tmp_path / name))


@pytest.mark.parametrize(
    ("name", "header", "message"),
    [
        ("a.mhd", "NDims = 3\nElementDataFile = gone.raw\n", "names gone.raw, which was not found"),
        ("a.mhd", "NDims = 3\nElementDataFile = LIST\n", r"in several files \(LIST\), 1 is needed"),
        ("a.nhdr", "NRRD0004\ndata file: s%03d.raw 0 33 1\n\n", "in several files"),
        ("a.tif.gz", "", r"of packed files \.nii\.gz is known only; unpack it"),
    ],
)
def test_headers_of_voxels_that_are_elsewhere(tmp_path, name, header, message):
    (tmp_path / name).write_text(header)
    expect(message, tmp_path / name)


def test_a_scaled_image_has_the_values_that_it_stands_for(tmp_path, volume, pages):
    image = sitk.GetImageFromArray((pages // 4).astype(np.int16))
    path = tmp_path / "a.nii"
    sitk.WriteImage(image, path)
    with path.open("r+b") as file:
        file.seek(112)  # scl_slope, scl_inter
        file.write(np.array([0.5, 3.0], "<f4").tobytes())
    assert_allclose(read_binned(open_scan(path)), 0.5 * (volume // 4) + 3)


def test_damaged_and_missing_chunks(tmp_path, caplog, pages):
    path = tmp_path / "a.zarr"
    zarr.create_array(path, data=pages, chunks=(8, 16, 16))
    chunk = path / "c/1/1/1"
    os.truncate(chunk, chunk.stat().st_size // 2)
    with pytest.raises(ScanError, match="a chunk is damaged"):
        read_binned(open_scan(path))
    chunk.unlink()
    read_binned(open_scan(path))
    assert "53 of 54 chunks are there" in caplog.text
    (path / "zarr.json").write_text('{"zarr_format": 3, "node_type": "array"}')
    expect("not a readable Zarr folder", path)


def test_vectors_of_a_medical_format_are_no_grey_levels(tmp_path, pages):
    sitk.WriteImage(
        sitk.GetImageFromArray(np.stack([pages] * 3, -1), isVector=True), tmp_path / "a.nrrd"
    )
    with pytest.raises(ScanError, match="has 3 values a voxel"):
        open_scan(tmp_path / "a.nrrd")


def test_zarr_array_is_chosen_or_asked_for(tmp_path, volume, pages):
    group = zarr.open_group(tmp_path / "two.zarr", mode="w")
    group.create_array("0", data=pages)
    group.create_array("1", data=pages[::2, ::2, ::2])
    group.create_array("flat", data=pages[0])
    with pytest.raises(ScanError, match=r"holds 2 .*set scans.dataset to one of: 0, 1"):
        open_scan(tmp_path / "two.zarr")
    assert_array_equal(
        read_binned(open_scan(tmp_path / "two.zarr", ScanFormat(dataset="0"))), volume
    )
    with pytest.raises(ScanError, match="no array '7'"):
        open_scan(tmp_path / "two.zarr", ScanFormat(dataset="7"))
    with pytest.raises(ScanError, match="has 2 dimensions"):
        open_scan(tmp_path / "two.zarr", ScanFormat(dataset="flat"))
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(ScanError, match="not a readable Zarr folder"):
        open_scan(tmp_path / "empty.zarr")


@pytest.fixture
def blobs(tmp_path, rng):
    """blobs(dtype): a raw scan (14, 20, 26) of smooth grey levels in some noise, big endian."""

    def make(dtype):
        grey = gaussian_filter(rng.standard_normal((14, 20, 26)), 2.0)
        grey = 20000 + 8000 * grey / grey.std() + 1000 * rng.standard_normal(grey.shape)
        (tmp_path / "scan.raw").write_bytes(
            grey.astype(np.dtype(dtype).newbyteorder(">")).tobytes()
        )
        return tmp_path / "scan.raw"

    return make


@pytest.mark.parametrize("dtype", ["uint16", "float32"])
def test_a_raw_scan_in_the_other_byte_order_is_told_by_its_looks(blobs, dtype):
    right = ScanFormat(shape=(14, 20, 26), dtype=dtype, byte_order="big")
    assert open_scan(blobs(dtype), right).shape == (26, 20, 14)
    expect("with big by .*say byte_order: big", blobs(dtype), replace(right, byte_order="little"))


def test_a_raw_scan_with_its_sizes_in_another_order_is_told_by_its_looks(blobs):
    wrong = ScanFormat(shape=(26, 20, 14), dtype="uint16", byte_order="big")
    expect(r"with \[14, 20, 26\] by .*in the order of axes, 'zyx'", blobs("uint16"), wrong)


def test_missing_values_of_a_raw_scan_are_not_put_down_to_its_byte_order(blobs):
    """Whole numbers of single precision are finite in either order."""
    path, right = (
        blobs("float32"),
        ScanFormat(shape=(14, 20, 26), dtype="float32", byte_order="big"),
    )
    grey = np.rint(np.fromfile(path, ">f4")).reshape(right.shape)
    grey[:, 3] = np.nan
    grey.astype(">f4").tofile(path)
    assert open_scan(path, right).shape == (26, 20, 14)


def test_a_type_with_its_byte_order_is_refused(blobs):
    both = ScanFormat(shape=(14, 20, 26), dtype=">u2")
    expect("say dtype: uint16 and byte_order: big", blobs("uint16"), both)


def test_raw_size_names_both_counts_and_a_type_that_fits(tmp_path, pages):
    path = tmp_path / "scan.raw"
    pages.tofile(path)
    wrong = ScanFormat(shape=SHAPE[::-1], dtype="uint8")
    expect(
        f"expected {pages.size} bytes .*found {pages.nbytes}; .*fit dtype uint16 or int16",
        path,
        wrong,
    )
    header = ScanFormat(shape=(40, *SHAPE[1::-1]), dtype="uint16")
    expect(f"a header of {pages[0].nbytes} bytes would fit", path, header)
    expect("give scans.shape .*and scans.dtype", path)
    expect("dtype 'grey' is unknown", path, ScanFormat(shape=SHAPE, dtype="grey"))
    expect("byte_order is 'pdp'", path, ScanFormat(shape=SHAPE, dtype="u2", byte_order="pdp"))
    expect("give three sizes", path, ScanFormat(shape=(3, 4), dtype="u2"))


def test_hdf5_dataset_is_chosen_or_asked_for(tmp_path, volume, pages):
    path = tmp_path / "volume.h5"
    with h5py.File(path, "w") as file:
        file["a/first"], file["second"], file["angles"] = pages, pages + 1, np.arange(5)
    expect("holds 2 three-dimensional datasets, .*a/first, second", path)
    expect(
        "no dataset 'a'; set scans.dataset to one of: a/first, second",
        path,
        ScanFormat(dataset="a"),
    )
    assert_array_equal(read_binned(open_scan(path, ScanFormat(dataset="second"))), volume + 1)


def test_not_a_grey_volume(tmp_path, pages):
    tifffile.imwrite(tmp_path / "one.tif", pages[0])
    expect("has 2 dimensions, .*3 are needed", tmp_path / "one.tif")
    colour = np.stack([pages] * 3, axis=-1).astype(np.uint8)
    tifffile.imwrite(tmp_path / "rgb.tif", colour, photometric="rgb")
    expect("colour image", tmp_path / "rgb.tif")
    np.save(tmp_path / "complex.npy", pages.astype(complex))
    expect("values are complex128; convert", tmp_path / "complex.npy")
    np.save(tmp_path / "flat.npy", pages[0])
    expect("has 2 dimensions", tmp_path / "flat.npy")


def test_stack_with_an_odd_or_missing_slice(tmp_path, pages):
    write_stack(tmp_path / "odd", pages)
    tifffile.imwrite(tmp_path / "odd" / "scan_12.tif", pages[0, :5])
    expect(r"scan_12.tif is \(5, 34\) uint16, but scan_7.tif is \(37, 34\)", tmp_path / "odd")
    write_stack(tmp_path / "gap", pages)
    (tmp_path / "gap" / "scan_12.tif").unlink()
    expect("slice numbers go from 11 to 13 where others go up by 1; put", tmp_path / "gap")
    write_stack(tmp_path / "bad", pages)
    os.truncate(tmp_path / "bad" / "scan_30.tif", 900)
    expect("scan_30.tif: .*truncated", tmp_path / "bad")


def test_nan_and_inf_are_counted_and_placed(tmp_path, monkeypatch, volume):
    monkeypatch.setattr(scans, "SLAB_VOXELS", 4000)
    data = volume.astype(np.float32)
    data[5, 6, 30], data[1, 2, 31], data[8, 9, 40] = np.nan, np.inf, np.nan
    np.save(tmp_path / "scan.npy", data.transpose(2, 1, 0))
    scan = open_scan(tmp_path / "scan.npy")
    with pytest.raises(ScanError, match=r"3 voxels .*= \(5, 6, 30\) of the scan; crop"):
        read_binned(scan, 2, ((1, None), None, (9, None)))
    assert np.isfinite(read_binned(scan, 1, (None, None, (0, 30)))).all()


def test_constant_image(tmp_path):
    np.save(tmp_path / "scan.npy", np.full(SHAPE, 7, np.uint8))
    expect("every voxel is 7; an image with structure is needed", tmp_path / "scan.npy")


@pytest.mark.parametrize(
    ("factor", "crop", "message"),
    [
        (3, None, r"leave \(11, 12, 13\); at least 16 are needed .*smaller bin"),
        (1, ((0, 10), None, None), r"leave \(10, 37, 41\)"),
        (1, ((0, 35), None, None), "crop of x is 0 to 35, but the scan has 34 voxels along x; use"),
        (1, (None, (30, 20), None), "crop of y is 30 to 20"),
        (0, None, "bin is 0; use a whole number"),
        (1.5, None, "bin is 1.5; use a whole number"),
    ],
)
def test_sizes_are_checked_before_reading(tmp_path, pages, factor, crop, message):
    np.save(tmp_path / "scan.npy", pages)
    with pytest.raises(ScanError, match=message):
        check_scans([tmp_path / "scan.npy"], ScanFormat(), factor, crop)
    with pytest.raises(ScanError, match=message):
        read_binned(open_scan(tmp_path / "scan.npy"), factor, crop)


def test_volume_round_trip(tmp_path, volume):
    path = tmp_path / "deep" / "volume.h5"
    save_volume(path, volume, {"bin": 3, "state": "reference", "crop": [1, 2]})
    found, attrs = load_volume(path)
    assert found.dtype == np.float32
    assert_array_equal(found, volume)
    given = {"bin": 3, "state": "reference", "crop": [1, 2]}
    assert attrs == {**given, "axes": "xyz"}
    assert [file.name for file in path.parent.iterdir()] == ["volume.h5"]
    assert_array_equal(read_binned(open_scan(path, ScanFormat(axes="xyz"))), volume)


def test_atomic_path_keeps_the_old_file_on_failure(tmp_path):
    path = tmp_path / "a.json"
    with atomic_path(path) as temporary:
        assert (temporary.suffix, temporary.parent) == (".json", tmp_path)
        temporary.write_text("old")
    with pytest.raises(RuntimeError), atomic_path(path) as temporary:
        temporary.write_text("half of the n")
        raise RuntimeError
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.json"]
