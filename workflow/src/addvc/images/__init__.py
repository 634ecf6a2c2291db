"""Volumes: reading scans, levels (bin, crop, pyramid), the specimen in its image, B-splines.

May import `config` and `errors` only. A volume is I[i, j, k] with x = i, y = j, z = k at
voxel centres, float32.
"""
