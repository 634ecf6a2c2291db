"""Elements as pure functions of the reference coordinates."""

import numpy as np

HEX_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
     [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float,
)  # fmt: skip


def tet_p1(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """xi (Q, 3) -> N (Q, 4), dN (Q, 4, 3) with dN[q, a, j] = dN_a/dxi_j; unit simplex."""
    shape = np.column_stack([1 - xi.sum(axis=1), xi])
    slopes = np.vstack([-np.ones(3), np.eye(3)])
    return shape, np.broadcast_to(slopes, (len(xi), 4, 3))


P2_EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
"""Corners at the ends of the edge of nodes 4 to 9 of a quadratic tetrahedron (VTK's order)."""


def tet_p2(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """xi (Q, 3) -> N (Q, 10), dN (Q, 10, 3): corners L (2 L - 1), then edges 4 L_a L_b."""
    corner, slope = tet_p1(xi)
    a, b = P2_EDGES.T
    shape = np.hstack([corner * (2 * corner - 1), 4 * corner[:, a] * corner[:, b]])
    middle = 4 * (corner[:, a, None] * slope[:, b] + corner[:, b, None] * slope[:, a])
    return shape, np.concatenate([(4 * corner - 1)[:, :, None] * slope, middle], axis=1)


def hex_q1(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """xi (Q, 3) in [-1, 1]^3 -> N (Q, 8), dN (Q, 8, 3); VTK's order of the corners."""
    x, y, z = (1 + xi[:, d, None] * HEX_CORNERS[:, d] for d in range(3))  # (Q, 8) each
    slopes = np.stack([y * z, x * z, x * y], axis=2) * (HEX_CORNERS / 8)
    return x * y * z / 8, slopes


def gauss_tet(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss rule on the unit simplex, 1 (degree 1) or 4 points (degree 2): xi (Q, 3), w (Q,)."""
    if points == 1:
        return np.full((1, 3), 0.25), np.array([1 / 6])
    if points == 4:
        a, b = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
        xi = np.full((4, 3), a)
        xi[1:][np.eye(3, dtype=bool)] = b
        return xi, np.full(4, 1 / 24)
    raise ValueError(f"no tetrahedral Gauss rule with {points} points; use 1 or 4")


def gauss_hex() -> tuple[np.ndarray, np.ndarray]:
    """The 2 x 2 x 2 Gauss rule (degree 3) on [-1, 1]^3: xi (8, 3), w (8,)."""
    return HEX_CORNERS / np.sqrt(3), np.ones(8)
