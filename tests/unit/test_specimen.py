"""The specimen is found where it was put: platens, cylinder, box; and not where there is none."""

import json
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.spatial import Voronoi
from scipy.stats import norm

from addvc.errors import GeometryError
from addvc.images.specimen import Specimen, find_platens, find_specimen, platen_faces

SHAPE, AXIS, CENTRE, RADIUS, FACES = (100, 110, 104), 1, (48.3, 53.1), 41.0, (9.3, 99.6)
VOID, FOAM, PLATEN, CELL = 20.0, 110.0, 150.0, 28.0


@cache
def struts(shape, radius=1.9, seed=2417):
    """Occupancy (nx, ny, nz) of an open-cell foam of porosity 0.95: edges of a Voronoi diagram."""
    rng = np.random.default_rng(seed)
    grid = np.indices([int(n / CELL) + 4 for n in shape]).reshape(3, -1).T
    seeds = np.concatenate((grid, grid + 0.5)) * CELL - CELL
    diagram = Voronoi(seeds + rng.normal(0, 0.12 * CELL, seeds.shape))
    lines = np.ones(shape, dtype=bool)
    for ridge in diagram.ridge_vertices:
        if -1 in ridge:
            continue
        start = diagram.vertices[ridge]
        points = start + np.linspace(0, 1, 60)[:, None, None] * (np.roll(start, -1, 0) - start)
        points = np.rint(points.reshape(-1, 3)).astype(int)
        lines[tuple(points[((points >= 0) & (points < shape)).all(axis=1)].T)] = False
    return np.clip(radius + 0.5 - distance_transform_edt(lines), 0, 1)


def scanned(occupancy, axis=AXIS, faces=FACES, noise=8.0, platen=PLATEN):
    """Grey image of an occupancy, between platens where faces are given."""
    image = VOID + (FOAM - VOID) * occupancy
    rows = np.indices(image.shape)[axis]
    for face, sign in zip(faces, (1, -1), strict=True):
        if face is not None:
            share = np.clip(sign * (face - rows) + 0.5, 0, 1)
            image = image * (1 - share) + platen * share
    rng = np.random.default_rng(731)
    return (gaussian_filter(image, 0.7) + rng.normal(0, noise, image.shape)).astype(np.float32)


def cylinder(axis=AXIS, centre=CENTRE, radius=RADIUS):
    """Occupancy of a foam cylinder in air."""
    index = np.delete(np.indices(SHAPE), axis, axis=0)
    distance = np.hypot(index[0] - centre[0], index[1] - centre[1])
    return struts(SHAPE) * np.clip(radius + 0.5 - distance, 0, 1)


def box():
    """Occupancy of a foam box in air."""
    occupancy = struts(SHAPE).copy()
    occupancy[:15] = occupancy[81:] = 0
    occupancy[:, :, :12] = occupancy[:, :, 91:] = 0
    return occupancy


def blobs(shape, axis, fraction, seed=2417):
    """Occupancy of random blobs whose volume fraction varies by 30 % along the axis."""
    field = gaussian_filter(np.random.default_rng(seed).normal(size=shape), 3)
    level = norm.isf(fraction * (1 + np.linspace(-0.3, 0.3, shape[axis]))) * field.std()
    return np.moveaxis(np.moveaxis(field, axis, -1) > level, -1, axis).astype(float)


@pytest.mark.parametrize("noise", [0.0, 8.0, 25.0])
def test_foam_cylinder_between_platens(noise):
    found = find_specimen(scanned(cylinder(), noise=noise), AXIS)
    assert (found.kind, found.axis, found.bounds) == ("cylinder", AXIS, None)
    assert_allclose((found.low, found.high), FACES, atol=0.2)
    assert_allclose(found.centre, CENTRE, atol=1)
    assert abs(found.radius - RADIUS) < 1.5


@pytest.mark.parametrize("axis", [0, 2])
def test_any_loading_axis(axis):
    image = scanned(cylinder(axis, centre=(50, 52), radius=40), axis, faces=(8.7, 90.2))
    found = find_specimen(image, axis)
    assert_allclose((found.low, found.high), (8.7, 90.2), atol=0.2)
    assert_allclose(found.centre, (50, 52), atol=1)
    assert abs(found.radius - 40) < 1.5


def test_given_threshold_and_noise_specks():
    image = scanned(cylinder(), noise=15.0)
    found = find_specimen(image, AXIS, threshold=50.0)
    specks = (image[:5, 20:90] > 50).mean()
    assert specks > 0.01, "the test needs specks outside of the specimen"
    assert_allclose(found.centre, CENTRE, atol=1)
    assert abs(found.radius - RADIUS) < 1.5


def test_foam_that_fills_the_image_is_a_box():
    found = find_specimen(scanned(struts(SHAPE)), AXIS)
    assert found.kind == "box"
    assert found.bounds == ((-0.5, 99.5), (-0.5, 103.5))
    assert found.centre == (49.5, 51.5)


def test_box_in_air():
    found = find_specimen(scanned(box()), AXIS)
    assert found.kind == "box"
    assert_allclose(found.bounds, ((14.5, 80.5), (11.5, 90.5)), atol=2)


def test_cylinder_asked_for_in_a_filled_image_is_the_inscribed_one():
    found = find_specimen(scanned(struts(SHAPE)), AXIS, specimen="cylinder")
    assert (found.centre, found.radius) == ((49.5, 51.5), 50.0)


@pytest.mark.parametrize("faces", [(9.3, None), (None, 99.6), (None, None)])
def test_platen_at_one_end_or_none(faces):
    found = find_platens(scanned(cylinder(), faces=faces), AXIS)
    if faces == (None, None):
        assert found is None
    else:
        expected = (-0.5 if faces[0] is None else 9.3, 109.5 if faces[1] is None else 99.6)
        assert_allclose(found, expected, atol=0.2)


@pytest.mark.parametrize(
    "faces, ends", [((9.3, None), "upper"), ((None, None), "lower and upper"), ((9.3, 99.6), None)]
)
def test_an_end_without_a_platen_is_warned_of(faces, ends, caplog):
    """A crop may have taken it off; `none` says that it is right."""
    image = scanned(cylinder(), faces=faces)
    platen_faces(image, AXIS, "auto")
    assert (f"no platen is seen at the {ends} end" in caplog.text) == bool(ends)
    caplog.clear()
    platen_faces(image, AXIS, "none")
    assert not caplog.text


@pytest.mark.parametrize("face", [8.0, 8.25, 8.5, 8.75])
def test_platen_faces_are_found_to_a_fraction_of_a_voxel(face):
    image = scanned(struts((60, 70, 60)), faces=(face, 69 - face), noise=4.0)
    assert_allclose(find_platens(image, AXIS), (face, 69 - face), atol=0.12)


@pytest.mark.parametrize("fraction", [0.15, 0.3])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_denser_rows_are_no_platens(axis, fraction):
    shape = (70, 80, 90)
    image = scanned(blobs(shape, axis, fraction), axis, faces=(None, None))
    assert find_platens(image, axis) is None
    found = find_specimen(image, axis)
    assert (found.kind, found.low, found.high) == ("box", -0.5, shape[axis] - 0.5)


def test_platens_on_a_denser_material():
    image = scanned(blobs((70, 80, 90), 2, 0.3), axis=2, faces=(7.5, 80.5))
    assert_allclose(find_platens(image, 2), (7.5, 80.5), atol=0.2)


def test_blank_rows_beyond_the_platens():
    image = scanned(cylinder())
    image[:, :3] = image[:, -3:] = 0
    assert_allclose(find_platens(image, AXIS), FACES, atol=0.2)


def test_given_platens_and_none():
    image = scanned(cylinder())
    given = find_specimen(image, AXIS, platens=[12, 95.5])
    assert (given.low, given.high) == (12.0, 95.5)
    whole = find_specimen(image, AXIS, platens="none", specimen="cylinder", threshold=65.0)
    assert (whole.low, whole.high) == (-0.5, 109.5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"platens": [80, 20]}, r"platens \[80, 20\] are reversed; give \[LOW, HIGH\]"),
        ({"platens": [-3, 20]}, r"platens \[-3, 20\] leave the image, .* from -0.5 to 109.5"),
        ({"platens": [20, 120]}, r"platens \[20, 120\] leave the image"),
        ({"platens": [20]}, "give two coordinates"),
        ({"platens": [20, 26]}, "6.0 rows lie between the platens .* at least 8 are needed"),
        ({"platens": "both"}, "platens is 'both'; use auto, none or"),
        ({"specimen": "cone"}, "specimen is 'cone'; use auto, cylinder or box"),
        ({"threshold": 400.0}, "exceeds the threshold 400, the brightest is .*; lower"),
    ],
)
def test_errors_give_value_limit_and_remedy(options, message):
    with pytest.raises(GeometryError, match=message):
        find_specimen(scanned(cylinder()), AXIS, **options)


def test_too_few_rows_between_platens_that_were_found():
    image = scanned(cylinder(), faces=(50.0, 56.0))
    with pytest.raises(GeometryError, match="rows lie between the platens"):
        find_specimen(image, AXIS)


@pytest.mark.parametrize(("axis", "name"), [(0, "x"), (2, "z")])
@pytest.mark.parametrize("occupancy", [cylinder, box, lambda: struts(SHAPE)])
def test_platens_on_another_axis_than_the_configured_one(axis, name, occupancy):
    image = scanned(occupancy())
    faces = r"with faces at 9\.\d and 99\.\d of 110 voxels: say loading_axis: y"
    with pytest.raises(GeometryError, match=f"no platen along {name}, .* along y, {faces}"):
        find_specimen(image, axis)
    assert find_specimen(image, AXIS).axis == AXIS


@pytest.mark.parametrize("axis", [0, 2])
def test_a_platen_seen_from_its_side_is_no_specimen(axis):
    image = scanned(cylinder(), faces=(9.3, None))
    with pytest.raises(
        GeometryError, match=r"is 1\d\.. voxels wide along y, the image 110, .* 25%"
    ):
        find_specimen(image, axis)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_specimens_without_platens_are_no_false_alarm(axis):
    for occupancy in (cylinder(), struts(SHAPE), box()):
        image = scanned(occupancy, faces=(None, None))
        for platens in ("none", "auto"):
            assert find_specimen(image, axis, platens=platens).low == -0.5


def test_a_slim_specimen_in_air_is_one_down_to_a_quarter_of_the_image():
    assert abs(find_specimen(scanned(cylinder(radius=20.0)), AXIS).radius - 20) < 2
    with pytest.raises(GeometryError, match=r"cut the scan to the specimen by scans\.crop"):
        find_specimen(scanned(cylinder(radius=9.0)), AXIS)


def specimens():
    """A cylinder and a box, along different axes."""
    return (
        Specimen("cylinder", 1, 3.5, 20.25, (12.0, 14.5), radius=9.0),
        Specimen("box", 2, -0.5, 29.5, (11.0, 12.5), bounds=((2.0, 20.0), (-0.5, 25.5))),
    )


@pytest.mark.parametrize("specimen", specimens(), ids=lambda s: s.kind)
def test_mask_and_points_agree(specimen):
    shape = (26, 27, 30)
    points = np.indices(shape).reshape(3, -1).T.astype(float)
    mask = specimen.voxel_mask(shape)
    assert_array_equal(mask.ravel(), specimen.inside(points))
    assert 0 < mask.sum() < mask.size


@pytest.mark.parametrize("specimen", specimens(), ids=lambda s: s.kind)
def test_margin_shrinks_from_every_face(specimen):
    points = np.random.default_rng(2417).uniform(-5, 35, (4000, 3))
    inner, outer = specimen.inside(points, 2.0), specimen.inside(points, -2.0)
    assert inner.sum() < specimen.inside(points).sum() < outer.sum()
    assert points[inner, specimen.axis].min() >= specimen.low + 2
    assert points[outer, specimen.axis].min() < specimen.low


@pytest.mark.parametrize("specimen", specimens(), ids=lambda s: s.kind)
def test_json_round_trip(specimen):
    assert Specimen.from_dict(json.loads(json.dumps(specimen.to_dict()))) == specimen
