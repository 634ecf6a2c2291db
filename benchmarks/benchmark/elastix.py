"""The peer: B-spline registration without mechanics by elastix [Klein2010], through itk-elastix.

Images I[i, j, k] go in as they are, so that ITK's x is our k: points are turned round on the way in
and out. The mean square of the difference in grey is minimised by adaptive stochastic gradient
descent, coarse to fine.
"""

import re
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import itk
import numpy as np
from scipy import ndimage


@dataclass(frozen=True)
class ElastixOptions:
    """Final grid `spacing` in voxels; `levels` of the pyramid; `iterations` a level; `samples`
    drawn at each iteration; `affine`: an affine registration comes first; `mask`: samples are
    drawn near the solid of the reference only."""

    spacing: float
    levels: int = 4
    iterations: int = 500
    samples: int = 4096
    affine: bool = False
    mask: bool = True

    def maps(self) -> itk.ParameterObject:
        """The parameter maps: elastix's own defaults but for what `changed` says."""
        maps = itk.ParameterObject.New()
        for kind in ["affine", "bspline"] if self.affine else ["bspline"]:
            found = maps.GetDefaultParameterMap(kind, self.levels, float(self.spacing))
            for name, value in self.changed().items():
                found[name] = (str(value),)
            maps.AddParameterMap(found)
        return maps

    def changed(self) -> dict[str, str | int]:
        """What differs from elastix's defaults."""
        return {
            "Metric": "AdvancedMeanSquares",
            "MaximumNumberOfIterations": self.iterations,
            "NumberOfSpatialSamples": self.samples,
            "ImageSampler": "RandomCoordinate",
            "NewSamplesEveryIteration": "true",
            "ErodeMask": "false",
            "RandomSeed": 2417,
            "WriteResultImage": "false",
        }


def elastix(
    reference: np.ndarray, deformed: np.ndarray, options: ElastixOptions, mask: np.ndarray | None
) -> tuple[itk.ParameterObject, float]:
    """The transform of I_r to I_d, volumes (nx, ny, nz), and the CPU seconds that it took; mask
    (nx, ny, nz) bool: where samples are drawn."""
    images = [
        itk.image_from_array(np.ascontiguousarray(v, np.float32)) for v in (reference, deformed)
    ]
    given = {"parameter_object": options.maps(), "log_to_console": False}
    if options.mask and mask is not None:
        given["fixed_mask"] = itk.image_from_array(mask.astype(np.uint8))
    start = time.process_time()
    _, transform = itk.elastix_registration_method(*images, **given)
    return transform, time.process_time() - start


def displacement(
    transform: itk.ParameterObject, shape: tuple[int, int, int], points: np.ndarray
) -> np.ndarray:
    """u (n, 3) at points (n, 3) of the reference, voxels, by transformix."""
    with tempfile.TemporaryDirectory() as folder:
        written = Path(folder, "points.txt")
        rows = "\n".join(" ".join(f"{x:.9g}" for x in p) for p in points[:, ::-1])
        written.write_text(f"point\n{len(points)}\n{rows}\n")
        itk.transformix_filter(
            itk.image_from_array(np.zeros(shape, np.float32)),
            transform,
            fixed_point_set_file_name=str(written),
            output_directory=folder,
            log_to_console=False,
        )
        text = Path(folder, "outputpoints.txt").read_text()
    found = re.findall(r"Deformation = \[ (\S+) (\S+) (\S+) \]", text)
    return np.array(found, float)[:, ::-1]


def near_solid(smooth: np.ndarray, threshold: float, voxels: int = 4) -> np.ndarray:
    """(nx, ny, nz) bool: so many steps from a voxel of the blurred reference above the threshold."""
    return ndimage.binary_dilation(smooth > threshold, iterations=voxels)
