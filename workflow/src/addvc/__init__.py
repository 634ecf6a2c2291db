"""addvc: architecture-driven digital volume correlation of cellular materials.

Seven folders, from the image to the page; an import only ever goes to the left:
images, fem, geometry, correlation, analysis, report (and twin, which sees images and fem only).
Conventions (axes, voxel centres, units, sign of u) are on one page: workflow/README.md.
"""

__version__ = "0.1.0"
