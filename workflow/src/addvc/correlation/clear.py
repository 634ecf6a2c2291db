"""Which voxels say something: those whose gradient stands out of the noise.

The voxels of a void add nothing but noise, time and memory, and at large strain those beside a strut
meet other struts and pull the wrong way.
"""

import numpy as np

from addvc.errors import CorrelationError
from addvc.images.spline import DEGREE, gradient_length

MAXWELL_MEDIAN = 1.538  # median length of a vector of three normal deviates of variance one
STRONG = 99  # percentile of the gradients that stands for those of the structure
CLEARLY = 0.25  # of that is enough, however noisy
BLANK = 1e-5  # of the grey level: less is round-off


def clear_voxels(
    coefficients: np.ndarray, stride: int, clear: float, degree: int = DEGREE
) -> np.ndarray:
    """Whether the gradient exceeds `clear` times the noise: bool, at every `stride`-th voxel centre
    from stride // 2 on along each axis.

    The noise is that of the median voxel, which lies in the void. A quarter of the strong gradients
    is enough: in a texture, which has no void, most voxels take part. Raises CorrelationError for a
    blank image."""
    kept = (slice(stride // 2, None, stride),) * 3
    length = gradient_length(coefficients, degree)[kept]
    noise, strong = np.median(length) / MAXWELL_MEDIAN, np.percentile(length, STRONG)
    if strong <= BLANK * np.abs(coefficients).max():
        raise CorrelationError(
            f"the gradient of the reference is at most {strong:.1e} grey level a voxel at {STRONG} % "
            "of its voxels: it is blank; check the scan"
        )
    return length > min(clear * noise, CLEARLY * strong)


def clear_points(
    coefficients: np.ndarray, stride: int, clear: float, degree: int = DEGREE
) -> np.ndarray:
    """The centres of these voxels (Q, 3)."""
    lines = lattice(coefficients.shape, stride)
    index = np.nonzero(clear_voxels(coefficients, stride, clear, degree))
    return np.column_stack([line[i] for line, i in zip(lines, index, strict=True)])


def lattice(shape: tuple[int, int, int], stride: int) -> list[np.ndarray]:
    """Coordinates of every `stride`-th voxel centre along each axis."""
    return [np.arange(stride // 2, n, stride, dtype=float) for n in shape]


def thinning(voxels: int, most: float) -> int:
    """The stride that leaves at most some `most` of so many voxels."""
    return max(1, int(np.ceil((voxels / most) ** (1 / 3))))
