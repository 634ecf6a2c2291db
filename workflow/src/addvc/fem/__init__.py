"""Finite elements: P1 tetrahedra and Q1 hexahedra, quadrature, shell, K, L, assembly,
factors; frames of beams, and what they carry.

May import `images`, `config` and `errors` only, and knows nothing of correlation. Nodes are (n, 3)
float64 in voxels, cells (m, 4) or (m, 8) int32; node fields are (n, 3), flattened node by node
(x, y, z).
"""
