"""A synthetic in-situ compression test of an open-cell foam between two platens.

May import `images`, `fem`, `config` and `errors` only. Lengths are voxels of the binned
image, axes x, y, z; compression is along y; I_reference(x) = I_state(x + u(x)).

- `TwinOptions.from_config(dict)`; `SIZES`: shape of the binned image of each size.
- `make_foam(options) -> Network`: beams of the reference.
- `compress(network, options) -> [Motion], [LoadStep]`: positions and rotations of the beam nodes in
  equilibrium, reference first. `Motion` is the seam: mechanics of any kind may take its place.
- `image(network, motion, options, state) -> (bin nx, bin ny, bin nz)`; `write_scan(path, volume)`.
- `save_foam`, `load_foam`; `save_motions(path, network, motions, options, history)`, `load_motions`;
  `write_network`, `write_history` for others to read.
- `Truth.load(path)`: `displacement(points, state)`, `strut(points)`, `junctions`, `platens`,
  `strains`. `junctions(network) -> (n, 3)`.
"""

from __future__ import annotations

from .compression import LoadStep, compress
from .foam import make_skeleton
from .imaging import image, write_scan
from .motion import Motion
from .options import SIZES, Specimen, TwinOptions, specimen
from .raster import fit_radius, solid_fraction
from .store import (
    load_foam,
    load_motions,
    save_foam,
    save_motions,
    write_history,
    write_network,
)
from .struts import Network, junctions, subdivide
from .truth import Truth

__all__ = [
    "SIZES",
    "LoadStep",
    "Motion",
    "Network",
    "Specimen",
    "Truth",
    "TwinOptions",
    "compress",
    "image",
    "junctions",
    "load_foam",
    "load_motions",
    "make_foam",
    "save_foam",
    "save_motions",
    "solid_fraction",
    "specimen",
    "write_history",
    "write_network",
    "write_scan",
]


def make_foam(options: TwinOptions) -> Network:
    """The reference: struts of the foam with radii that give the porosity."""
    return fit_radius(subdivide(make_skeleton(options), options), 1 - options.porosity)
