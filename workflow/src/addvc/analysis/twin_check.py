"""Whether the synthetic test is what it claims to be: geometry, mechanics, truth and images.

For judging only. Each check is a value with the limit that it keeps and what to do when it does not;
a check that fails is told on the first page of the report, it does not stop a run.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from addvc.twin import Truth, TwinOptions, solid_fraction
from addvc.twin.closed_forms import buckling_load, observed_order, roll_up_error
from addvc.twin.imaging import noise
from addvc.twin.store import load_history

SPAN, STEP = 0.5, 1e-5
"""Distance of the pairs of points that continuity is tried on, at first and at last (voxels)."""

MARGIN = 3.0
"""Points nearer to a platen are left out: its rigid motion begins there (voxels)."""

ELEMENT = "the beam element is not right on this machine: run `./addvc test -k beam`"
SOLVE = "lower twin.step, or try another twin.seed"
BEND = "raise porosity or twin.bow"


@dataclass(frozen=True)
class Check:
    """What was checked, the value found, the least and the largest that is right, and what to do when
    it is not."""

    name: str
    value: float
    unit: str
    low: float = -np.inf
    high: float = np.inf
    remedy: str = SOLVE

    @property
    def passed(self) -> bool:
        return bool(self.low <= self.value <= self.high)

    def as_dict(self) -> dict:
        """For JSON; None for no limit."""
        low, high = (float(x) if np.isfinite(x) else None for x in (self.low, self.high))
        return {
            "name": self.name,
            "value": float(self.value),
            "unit": self.unit,
            "low": low,
            "high": high,
            "passed": self.passed,
            "remedy": self.remedy,
        }


def element_checks() -> list[Check]:
    """The beam element against closed forms."""
    column, order, force = buckling_load(32), observed_order(), roll_up_error(32)
    name = "force out of balance in a rolled-up cantilever"
    return [
        Check(name, force, "–", high=1e-6, remedy=ELEMENT),
        Check("load of a buckling column over Euler's", column, "–", 0.99, 1.01, ELEMENT),
        Check("observed order of the buckling load", order, "–", 1.8, 2.2, ELEMENT),
    ]


def mechanics_checks(history: dict[str, np.ndarray], strains: tuple[float, ...]) -> list[Check]:
    """Convergence and balance of every load step, and the share of bending at every state."""
    force = np.abs(history["force_low"] + history["force_high"]) / np.abs(history["force_low"])
    elastic = sum(history[name] for name in ("stretching", "shear", "torsion", "bending"))
    share, moved = history["bending"] / elastic, history["last_step"].max()
    checks = [
        Check("last step to an equilibrium, rms", moved, "voxel", high=1e-7),
        Check("forces of the platens out of balance", force.max(), "–", high=1e-6),
    ]
    for strain in strains[1:]:
        step = np.abs(history["strain"] - strain).argmin()
        name = f"share of bending in the energy at {100 * strain:.1f} %"
        checks.append(Check(name, share[step], "–", 0.7, remedy=BEND))
    return checks


def image_checks(truth: Truth, options: TwinOptions, found: dict, cell_size: dict) -> list[Check]:
    """What the workflow sees in the reference against what was put there.

    found: `threshold.json`; cell_size: `cell_size.json`."""
    solid, wanted, size = solid_fraction(truth.network), 1 - options.porosity, options.cell_size
    seen, peak = 1 - found["porosity"], cell_size["cell_size"]
    first, second = "solid fraction at the threshold", "secondary peak of the autocorrelation"
    grey, large = "lower twin.noise, or give geometry.threshold", "take a larger twin.size"
    return [
        Check("true solid fraction", solid, "–", 0.99 * wanted, 1.01 * wanted, large),
        Check(first, seen, "–", 0.95 * solid, 1.05 * solid, grey),
        Check(second, peak, "voxel", size - 1, size + 1, f"{large}, or another twin.seed"),
    ]


def continuity(truth: Truth, state: int, rng: np.random.Generator) -> float:
    """Largest slope |du| / |dx| of u about the junctions. Pairs of points, at first SPAN apart, are
    halved down to STEP, each time the half over which u differs more: a jump of 1 voxel gives 1e5."""
    a = np.repeat(truth.junctions, 30, axis=0)
    a = a + rng.uniform(-2, 2, a.shape)
    way = rng.standard_normal(a.shape)
    b = a + SPAN * way / np.linalg.norm(way, axis=1, keepdims=True)
    at_a, at_b = truth.displacement(a, state), truth.displacement(b, state)
    for _ in range(int(np.ceil(np.log2(SPAN / STEP)))):
        middle = (a + b) / 2
        at = truth.displacement(middle, state)
        first = np.linalg.norm(at - at_a, axis=1) > np.linalg.norm(at_b - at, axis=1)
        first = first[:, None]
        a, at_a = np.where(first, a, middle), np.where(first, at_a, at)
        b, at_b = np.where(first, middle, b), np.where(first, at, at_b)
    return float((np.linalg.norm(at_b - at_a, axis=1) / np.linalg.norm(b - a, axis=1)).max())


def solid_voxels(truth: Truth, scan: np.ndarray) -> np.ndarray:
    """(q, 3) voxel centres within a strut of the reference, in voxels of the binned image, off the
    platens. scan: of the reference, `bin` times finer."""
    factor = scan.shape[0] // truth.network.body.shape[0]
    x = (np.argwhere(scan > 65) - (factor - 1) / 2) / factor
    body = truth.network.body
    x = x[(x[:, 1] > body.low + MARGIN) & (x[:, 1] < body.high - MARGIN)]
    return x[truth.strut(x)[2] < 0]


def residual_std(
    read: Callable[[int], np.ndarray], truth: Truth, state: int, points: np.ndarray
) -> float:
    """Standard deviation of I_0(x) - I_n(x + u(x)) over points (q, 3), by interpolating cubic
    splines; read(n): volume (nx, ny, nz) of state n, at the scan's own resolution."""
    greys = []
    for n in (0, state):
        volume = read(n)
        factor = volume.shape[0] / truth.network.body.shape[0]
        at = points + truth.displacement(points, n)
        at = factor * at + (factor - 1) / 2
        greys.append(
            ndimage.map_coordinates(volume, at.T, order=3, output=np.float64, mode="mirror")
        )
    return float(np.std(greys[0] - greys[1]))


def truth_checks(
    truth: Truth, options: TwinOptions, scans: Callable[[int], np.ndarray]
) -> list[Check]:
    """The displacement is continuous, and under it the scans differ by their noise.

    Without noise, by at most 3 grey levels: partial volumes and the sampling of curved struts."""
    scale = np.float32(100 if options.dtype == "uint16" else 1)
    points = solid_voxels(truth, scans(0) / scale)
    rng, checks = np.random.default_rng(options.seed), []
    shape = tuple(options.bin * n for n in options.shape)

    def noises(state):
        return np.float32(options.noise) * noise(options, state, 0, shape[0], shape)

    for state, strain in enumerate(truth.strains[1:], start=1):
        steepest = continuity(truth, state, rng)
        left = residual_std(lambda n: scans(n) / scale, truth, state, points)
        checks.append(
            Check(f"steepest slope of u at {100 * strain:.1f} %", steepest, "–", high=100.0)
        )
        name = f"residual under the truth at {100 * strain:.1f} %"
        if not options.noise:
            checks.append(Check(name, left, "grey level", high=3.0))
            continue
        own = residual_std(noises, truth, state, points)
        checks.append(Check(name, left, "grey level", own / 1.15, 1.15 * own))
    return checks


def check_twin(
    path: str, options: TwinOptions, found: dict, cell_size: dict, scans: Callable
) -> list[dict]:
    """All checks of a twin whose motion is at `path`; scans(n) reads the scan of a state."""
    truth = Truth.load(path)
    checks = element_checks()
    checks += mechanics_checks(load_history(path), truth.strains)
    checks += image_checks(truth, options, found, cell_size)
    checks += truth_checks(truth, options, scans)
    return [check.as_dict() for check in checks]
