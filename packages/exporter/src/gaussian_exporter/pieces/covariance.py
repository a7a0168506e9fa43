"""Covariances, from scales and rotations or from any 3x3 half."""

import numpy as np

from ..arrays import Floats
from ..graph import Tensor
from .mlp import Linear, linear

# Entries of an upper triangle, row by row.
UPPER = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
# A rotation matrix is linear in the products of its quaternion's components: entry (row by row) -> (i, j, factor) of
# components i and j of (w x y z). Divided by |q|^2 it holds for quaternions of any length.
_TERMS = {
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
# The same table as a matrix (16,9): from all products of two components to the entries.
PRODUCTS: Floats = np.zeros((16, 9), np.float32)
for _entry, _terms in _TERMS.items():
    for _i, _j, _factor in _terms:
        PRODUCTS[4 * _i + _j, _entry] = _factor
# Keeps a zero quaternion from giving NaN: its Gaussian gets covariance 0, which a renderer refuses.
_TINY = 1e-30


def rotation_matrix(quaternions: Tensor) -> Tensor:
    """(...,3,3) of quaternions w x y z (...,4) of any length."""
    each = quaternions.shape[:-1]
    products = quaternions.reshape(*each, 4, 1) * quaternions.reshape(*each, 1, 4)
    squared = (quaternions * quaternions).sum(-1, keep=True) + _TINY
    graph = quaternions.graph
    table = graph.constant(PRODUCTS, "quaternion_products")
    return (products.reshape(*each, 16) @ table / squared).reshape(*each, 3, 3)


def covariance_of_half(half: Tensor) -> Tensor:
    """Upper triangles xx xy xz yy yz zz (...,6) of H H^T, for halves H (...,3,C); columns of zeros do no harm."""
    # Computes all products of two rows, then one product with a table that adds up those of an entry, because WebGPU
    # runs a product of small matrices for each Gaussian slowly.
    each, columns = half.shape[:-2], half.shape[-1]
    products = half.reshape(*each, 3, 1, columns) * half.reshape(*each, 1, 3, columns)
    table = np.zeros((6, 3, 3, columns), np.float32)
    for entry, (row, column) in enumerate(UPPER):
        table[entry, row, column] = 1
    rows, sums = products.reshape(*each, 9 * columns), table.reshape(6, -1)
    if len(each) > 1:
        return rows @ half.graph.constant(sums.T, "covariance_sums")
    return linear(rows, Linear(sums, np.zeros(6, np.float32)), "covariance_sums")


def covariance_of_scale_and_rotation(scales: Tensor, quaternions: Tensor) -> Tensor:
    """(...,6) of standard deviations (...,3) and quaternions w x y z (...,4) of any length."""
    return covariance_of_half(rotation_matrix(quaternions) * scales.reshape(*scales.shape[:-1], 1, 3))
