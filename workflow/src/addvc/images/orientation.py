"""Whether the loading axis of the configuration can be that of the image: told by its platens and by
the outline of what is found in it, before hours of work on the wrong one."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from addvc.errors import GeometryError
from addvc.images.platens import find_platens, seen

AXES = "xyz"
LEAST_SHARE = 0.25  # of the image across the loading axis: who scans fills the image


def check_no_platens_elsewhere(volume: NDArray, axis: int) -> None:
    """GeometryError when an image (nx, ny, nz), without platens along `axis`, has one at both ends
    of another axis. One alone is no sign: a specimen may lie on a table."""
    for other in sorted({0, 1, 2} - {axis}):
        faces = find_platens(volume, other)
        if faces and all(seen(faces, volume.shape[other])):
            raise GeometryError(
                f"no platen along {AXES[axis]}, the loading axis, but clear ones along {AXES[other]}, "
                f"with faces at {faces[0]:.1f} and {faces[1]:.1f} of {volume.shape[other]} voxels: say "
                f"loading_axis: {AXES[other]}, or correct scans.axes, the order of axes in the files; "
                f"where what is bright along {AXES[other]} are no platens, say scans.platens: none"
            )


def check_outline(bounds: Sequence[Sequence[float]], shape: Sequence[int], axis: int) -> None:
    """GeometryError when an outline, two (low, high) in voxels across `axis`, is far thinner than the
    image (nx, ny, nz): that of one platen seen from its side, or of nothing."""
    across = [other for other in range(3) if other != axis]
    for other, (low, high) in zip(across, bounds, strict=True):
        if high - low < LEAST_SHARE * shape[other]:
            raise GeometryError(
                f"the outline of the specimen is {high - low:.1f} voxels wide along {AXES[other]}, the "
                f"image {shape[other]}, of which at least {LEAST_SHARE:.0%} is expected (seen along "
                f"{AXES[axis]}, the loading axis, it reaches over {np.round(bounds, 1).tolist()}): "
                "check loading_axis, and scans.axes, the order of axes in the files; or cut the scan to "
                "the specimen by scans.crop"
            )
