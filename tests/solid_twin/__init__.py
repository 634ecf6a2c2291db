"""A hyperelastic solid under compression, its images and its exact displacement: a second truth.

It shares nothing with the beam network of `addvc.twin`: other seeds, other struts, a continuum
in place of beams, occupancy of deformed elements in place of signed distances. README.md says how
to run it. Lengths in voxels, axes x, y, z, compression along y.

- `kernels`, `solid`: energy, force and tangent of quadratic tetrahedra, compressible neo-Hookean.
- `system`: the tangent on the free nodes, factorised.
- `platens`, `equilibrium`, `compression`: contact, Newton's method that only goes down in energy, steps.
- `foam`: a random open-cell foam as a level set, and its mesh.
- `raster`, `imaging`: occupancy of the deformed solid, scans.
- `fixture`: what `make.py` computed, kept in the repository; `scans.py` makes a case of it.
- `warp`, `bone`: any scan, compressed by the same solver and warped.
"""
