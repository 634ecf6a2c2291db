"""Table 2's ultimate error: sub-voxel shifts by FFT, registered without noise and with it."""

from collections.abc import Sequence

import numpy as np
from scipy import fft

from addvc.correlation.gauss_newton import rms
from addvc.correlation.register import Stop, System, register
from addvc.correlation.uncertainty import SEED, Noise, a_priori, a_priori_white
from addvc.images.spline import spline_value

STOP = Stop(1e-6, 50)  # far below the error that is measured
NOISY = Stop(1e-4, 50)


def fft_shift(volume: np.ndarray, shift: Sequence[float]) -> np.ndarray:
    """I(x - shift) of a volume taken as periodic (nx, ny, nz): the material moves by `shift`."""
    spectrum = fft.rfftn(volume.astype(np.float32))
    for axis, distance in enumerate(shift):
        n = volume.shape[axis]
        frequency = fft.rfftfreq(n) if axis == 2 else fft.fftfreq(n)
        phase = np.exp(-2j * np.pi * frequency * distance)
        if n % 2 == 0:  # the Nyquist frequency has no phase of its own
            phase[n // 2] = np.cos(np.pi * distance)
        shape = [1, 1, 1]
        shape[axis] = -1
        spectrum *= phase.reshape(shape)
    return np.ascontiguousarray(fft.irfftn(spectrum, volume.shape), dtype=np.float32)


def shift_error(
    system: System, moved: np.ndarray, shift: float, start: np.ndarray, stop: Stop
) -> tuple[np.ndarray, dict]:
    """u (n, 3) from `start` (n, 3) for an image moved by (shift, shift, shift), given by its spline
    coefficients (nx, ny, nz), and its error: bias and standard deviation over all components. Voxels."""
    solution = register(system, moved, start, stop, f"shift {shift}")
    miss = solution.u - shift
    return solution.u, {
        "shift": shift,
        "bias": float(miss.mean()),
        "std": float(miss.std()),
        "converged": solution.converged,
        "iterations": solution.iterations,
    }


def ultimate_error(
    system: System,
    coefficients: np.ndarray,
    shifts: Sequence[float],
    stop: Stop = STOP,
    noise: Noise | None = None,
) -> dict:
    """Error of a rigid shift (s, s, s), for each s: bias and standard deviation over nodes.

    `ultimate_error` is the standard deviation of a component over nodes, the mean over shifts. With
    `noise`, also what is found when it is added, and what was to be expected of it."""
    rng, rows, noisy = np.random.default_rng(SEED), [], []
    for shift in shifts:
        moved = fft_shift(coefficients, [shift] * 3)
        start = np.zeros_like(system.reference.mesh.points)
        u, row = shift_error(system, moved, shift, start, stop)
        rows.append(row)
        if noise is not None:  # that of both images: the reference is sampled once for all
            moved += np.float32(np.sqrt(2)) * noise.volume(moved.shape, rng)
            noisy.append(shift_error(system, moved, shift, u, NOISY)[1])
    result = {
        "ultimate_error": float(np.mean([row["std"] for row in rows])),
        "unit": "voxel",
        "converged": all(row["converged"] for row in rows),
        "shifts": rows,
    }
    return result if noise is None else result | with_noise(system, coefficients, noise, noisy)


def with_noise(system: System, coefficients: np.ndarray, noise: Noise, rows: list[dict]) -> dict:
    """The standard deviation found with noise, and the two that were to be expected: of noise as the
    images have it, and of white noise of the same deviation at the points. All in voxels; the noise of
    the voxels and at the points in grey levels.

    coefficients (nx, ny, nz) of the image; rows of `shift_error` with noise, one per shift."""
    reference = system.reference
    field = noise.volume(coefficients.shape, np.random.default_rng(SEED))
    sigma = float(spline_value(field, reference.quadrature.points, reference.degree)[0].std())
    expected = a_priori(system, coefficients.shape, noise)
    white = a_priori_white(system, sigma)
    return {
        "with_noise": float(np.sqrt(np.mean([row["std"] ** 2 for row in rows]))),
        "a_priori": float(rms(expected) / np.sqrt(3)),
        "a_priori_white": float(rms(white) / np.sqrt(3)),
        "noise": noise.std,
        "noise_at_points": sigma,
        "noisy_shifts": rows,
    }
