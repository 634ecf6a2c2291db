"""A small frame of struts and its images, whose motion is known; lengths in voxels."""

import numpy as np

SHAPE = (44, 44, 44)
CENTRE = np.full(3, 21.5)
CORNERS = CENTRE + 11 * np.array(
    [[-1, -1, -1], [1, -1, 1], [-1, 1, 1], [1, 1, -1], [0.2, -0.1, 0.1]]
)
STRUTS = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)]
SECTION = {"l_k": "auto", "l_l": "auto", "l_e": "auto", "period": 35, "nu": 0.28}


def frame(points, lines=None):
    """Grey levels of struts of radius 1.4, 20 in the void and 110 inside, at points (n, 3); lines: their
    ends, those of STRUTS by default."""
    away = np.full(len(points), np.inf)
    for start, end in CORNERS[STRUTS] if lines is None else lines:
        along = end - start
        t = np.clip((points - start) @ along / (along @ along), 0, 1)
        away = np.minimum(away, np.linalg.norm(points - start - t[:, None] * along, axis=1))
    return 20 + 90 / (1 + np.exp((away - 1.4) / 0.35))


def image(back, seed=None, lines=None):
    """The frame moved: the voxel at x shows what was at back(x); noise of 1.5 with a seed."""
    voxels = np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), -1).reshape(-1, 3)
    grey = frame(back(voxels.astype(float)), lines).reshape(SHAPE)
    if seed is not None:
        grey += np.random.default_rng(seed).normal(scale=1.5, size=SHAPE)
    return grey.astype(np.float32)


def rms_error(u, truth):
    return float(np.sqrt(np.mean(np.sum((u - truth) ** 2, axis=1))))
