"""Small meshes, textures and images that several tests share; lengths in voxels."""

import numba
import numpy as np
import pytest
import pyvista as pv
from scipy import ndimage

from addvc import twin
from addvc.fem.mesh import Mesh, boundary_faces, oriented
from addvc.twin.motion import at_rest

SEED = 2417


def pytest_addoption(parser):
    parser.addoption("--slow", action="store_true", help="run the tests marked slow as well")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--slow"):
        skip = pytest.mark.skip(reason="slow: give --slow to run it")
        for item in items:
            if "slow" in item.keywords:
                item.add_marker(skip)


@pytest.fixture
def rng():
    return np.random.default_rng(SEED)


@pytest.fixture(scope="session")
def box():
    """box(low, high, counts, shake): tetrahedra of a box; `shake` moves inner nodes (of a cell)."""

    def make(low, high, counts, shake=0.0):
        lines = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)]
        grid = pv.RectilinearGrid(*lines).to_tetrahedra(5)
        mesh = oriented(Mesh(np.asarray(grid.points), grid.cells_dict[pv.CellType.TETRA]))
        points = mesh.points.copy()
        inner = np.setdiff1d(np.arange(len(points)), boundary_faces(mesh))
        side = (np.asarray(high, dtype=float) - low) / counts
        rng = np.random.default_rng(SEED)
        points[inner] += shake * side * rng.uniform(-1, 1, (len(inner), 3))
        return Mesh(points, mesh.cells)

    return make


@pytest.fixture(scope="session")
def rigid_motions():
    """rigid_motions(points): the three translations and three rotations, (3 n, 6)."""

    def make(points):
        modes = [np.broadcast_to(axis, points.shape) for axis in np.eye(3)]
        modes += [np.cross(axis, points - points.mean(axis=0)) for axis in np.eye(3)]
        return np.column_stack([mode.ravel() for mode in modes])

    return make


@pytest.fixture(scope="session")
def speckle():
    """speckle(shape, length): periodic random grey levels, correlated 1/e at `length` voxels."""

    def make(shape, length=4.0):
        noise = np.random.default_rng(SEED).standard_normal(shape)
        smooth = ndimage.gaussian_filter(noise, length / 2, mode="wrap")
        return (110 + 40 * smooth / smooth.std()).astype(np.float32)

    return make


@pytest.fixture(scope="session")
def stretched():
    """stretched(shape, slope, centre, shortest): I_r and I_d of u = slope (x - centre).

    Grey levels are plane waves of `shortest` voxels to three times that, so that both are exact."""

    def waves(shape, way, phase):
        lines = [np.exp(1j * np.outer(np.arange(n), way[:, d])) for d, n in enumerate(shape)]
        planes = (lines[1][:, None] * lines[2]).reshape(-1, len(way))
        grey = np.real((lines[0] * np.exp(1j * phase)) @ planes.T).reshape(shape)
        return (110 + 40 * grey / np.sqrt(len(way) / 2)).astype(np.float32)

    def make(shape, slope, centre, shortest=8.0, count=80):
        rng = np.random.default_rng(SEED)
        way = rng.standard_normal((count, 3))
        length = shortest * rng.uniform(1, 3, count)
        way *= (2 * np.pi / length / np.linalg.norm(way, axis=1))[:, None]
        phase = rng.uniform(0, 2 * np.pi, count)
        back = np.linalg.inv(np.eye(3) + slope)  # x = back (y - centre) + centre
        moved = phase + way @ (centre - back @ centre)
        return waves(shape, way, phase), waves(shape, way @ back, moved)

    return make


@pytest.fixture(scope="session")
def foam():
    """Image (72, 84, 72) of a small foam between platens, without noise, and its specimen."""
    options = twin.TwinOptions(
        size="tiny", seed=SEED, noise=0, cupping=0, rings=0, drift=0, dtype="float32"
    )
    network = twin.make_foam(options)
    return twin.image(network, at_rest(network), options, 0), twin.specimen(options)


@pytest.fixture
def with_one_and_two_threads():
    """with_one_and_two_threads(call): its two results; the number of threads is put back."""
    before = numba.get_num_threads()

    def run(call):
        results = []
        for threads in (1, 2):
            numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
            results.append(call())
        return results

    yield run
    numba.set_num_threads(before)
