"""From the image to meshes: cell size, threshold, surface, tetrahedra, meso meshes, grid, skeleton,
frame of struts.

May import `images`, `fem`, `config` and `errors` only. Fig. 4 to 9 of the paper.
"""
