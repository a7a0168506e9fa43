"""Covariances, from scales and rotations or from any 3x3 half."""

import numpy as np

from ..graph import Tensor

ROWS = [0, 0, 0, 1, 1, 2]
COLUMNS = [0, 1, 2, 1, 2, 2]
# A rotation matrix is linear in the products of its quaternion's parts: entry (row by row) -> (i, j, factor) of parts
# i and j of (w x y z). Divided by |q|^2 it holds for quaternions of any length.
_PRODUCTS = {
    0: [(0, 0, 1), (1, 1, 1), (2, 2, -1), (3, 3, -1)],
    1: [(1, 2, 2), (0, 3, -2)],
    2: [(1, 3, 2), (0, 2, 2)],
    3: [(1, 2, 2), (0, 3, 2)],
    4: [(0, 0, 1), (1, 1, -1), (2, 2, 1), (3, 3, -1)],
    5: [(2, 3, 2), (0, 1, -2)],
    6: [(1, 3, 2), (0, 2, -2)],
    7: [(2, 3, 2), (0, 1, 2)],
    8: [(0, 0, 1), (1, 1, -1), (2, 2, -1), (3, 3, 1)],
}
# Keeps a zero quaternion from giving NaN: its Gaussian gets covariance 0, which a renderer refuses.
_TINY = 1e-30


def rotation_matrix(quaternions: Tensor) -> Tensor:
    """(...,3,3) of quaternions w x y z (...,4) of any length."""
    each = quaternions.shape[:-1]
    table = np.zeros((16, 9), np.float32)
    for entry, terms in _PRODUCTS.items():
        for i, j, factor in terms:
            table[4 * i + j, entry] = factor
    products = quaternions.reshape(*each, 4, 1) * quaternions.reshape(*each, 1, 4)
    squared = (quaternions * quaternions).sum(-1, keep=True) + _TINY
    graph = quaternions.graph
    return (products.reshape(*each, 16) @ graph.constant(table, "quaternion_products") / squared).reshape(*each, 3, 3)


def covariance_of_half(half: Tensor) -> Tensor:
    """Upper triangles xx xy xz yy yz zz (...,6) of H H^T, for halves H (...,3,3)."""
    # Two gathers and a sum beat a batched product of 3x3 matrices, which WebGPU runs one small workgroup at a time.
    return (half.take(ROWS, -2) * half.take(COLUMNS, -2)).sum(-1)


def covariance_of_scale_and_rotation(scales: Tensor, quaternions: Tensor) -> Tensor:
    """(...,6) of standard deviations (...,3) and quaternions w x y z (...,4) of any length."""
    return covariance_of_half(rotation_matrix(quaternions) * scales.reshape(*scales.shape[:-1], 1, 3))
