"""Table 2's ultimate error: sub-voxel shifts by FFT, registered without noise."""

from collections.abc import Sequence

import numpy as np
from scipy import fft

from addvc.correlation.register import Stop, System, register

STOP = Stop(1e-6, 50)  # far below the error that is measured


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


def ultimate_error(
    system: System, coefficients: np.ndarray, shifts: Sequence[float], stop: Stop = STOP
) -> dict:
    """Error of a rigid shift (s, s, s), for each s: bias and standard deviation over nodes.

    `ultimate_error` is the standard deviation of a component over nodes, the mean over shifts."""
    rows = []
    for shift in shifts:
        moved = fft_shift(coefficients, [shift] * 3)
        start = np.zeros_like(system.reference.mesh.points)
        solution = register(system, moved, start, stop, f"shift {shift}")
        miss = solution.u - shift
        rows.append(
            {
                "shift": shift,
                "bias": float(miss.mean()),
                "std": float(miss.std()),
                "converged": solution.converged,
                "iterations": solution.iterations,
            }
        )
    return {
        "ultimate_error": float(np.mean([row["std"] for row in rows])),
        "unit": "voxel",
        "converged": all(row["converged"] for row in rows),
        "shifts": rows,
    }
