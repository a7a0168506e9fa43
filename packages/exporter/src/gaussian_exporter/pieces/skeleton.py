"""Poses of a skeleton: rotations of joints, and the transforms of points at rest."""

from collections.abc import Sequence

import numpy as np

from ..arrays import Floats
from ..graph import Tensor
from .covariance import PRODUCTS
from .mlp import Linear, linear

# Rows are padded to a multiple of this number, because the provider multiplies four at a time; one of the padding rows
# is the parent of roots.
_AT_ONCE = 4
_TINY = 1e-10


def quaternions_of_axis_angle(pose: Tensor) -> Tensor:
    """Unit quaternions w x y z (...,J,4) of axes times angles in radians (...,J,3); smooth at 0."""
    angle = pose.length(-1, keep=True) + _TINY
    half = angle * 0.5
    # Normalized again, because sines of some GPUs are accurate only to 1e-4, and such errors accumulate along the path
    # to the root.
    return unit_quaternions(pose.graph.concat([half.unary("Cos"), pose * (half.unary("Sin") / angle)], -1))


def unit_quaternions(quaternions: Tensor) -> Tensor:
    """Quaternions (...,J,4) of any length, normalized."""
    return quaternions / (quaternions.length(-1, keep=True) + _TINY)


def products_of_parts(quaternions: Tensor) -> Tensor:
    """All products of two components (...,J,16); every entry of a rotation matrix is a sum of these."""
    each = quaternions.shape[:-1]
    return (quaternions.reshape(*each, 4, 1) * quaternions.reshape(*each, 1, 4)).reshape(*each, 16)


def rotation_entries(products: Tensor) -> Tensor:
    """Entries of rotation matrices less the identity's (...,J,9), row by row; products (...,J,16) as above."""
    return linear(products, Linear(PRODUCTS.T, -np.eye(3, dtype=np.float32).ravel()), "bends")


def skinning_matrices(products: Tensor, joints: Tensor, parents: Sequence[int]) -> Tensor:
    """Transforms (...,R,12) of points at rest by each joint: rows of a 3x4 matrix. R is the least multiple of 4
    above the number of joints; the rows beyond the joints are unused. products (...,J,16) of unit quaternions relative
    to the parent; joints (J,3) or (...,J,3) at rest.

    A joint rotates points around its rest position, then its parent rotates the result around its own, up to the root:
    a product of matrices along the path. Each step doubles the length of the path that a matrix covers, so a tree of
    depth 15 takes 4 products of all joints instead of 15.
    """
    graph, count = products.graph, len(parents)
    rows = -(-(count + 1) // _AT_ONCE) * _AT_ONCE
    turned = linear(joints, _around_a_point(), "around").reshape(*joints.shape[:-1], 16, 16)
    lead = products.shape[:-2]
    local = (products.reshape(*lead, count, 1, 16) @ turned).reshape(*lead, count, 4, 4)
    nothing = graph.constant(np.tile(np.eye(4), (rows - count, 1, 1)), "identity").alongside(products)
    moved = graph.concat([local, nothing], -3)
    above = [parent if parent >= 0 else count for parent in parents] + [count] * (rows - count)
    for _ in range(_doublings(parents) - 1):
        moved = moved.take(above, -3) @ moved
        above = [above[joint] for joint in above]
    # The last product needs no lowest row, because it is always 0 0 0 1.
    upper = [4 * joint + row for joint in above for row in range(3)]
    first = moved.reshape(*lead, rows * 4, 4).take(upper, -2).reshape(*lead, rows, 3, 4)
    return (first @ moved).reshape(*lead, rows, 12)


def _doublings(parents: Sequence[int]) -> int:
    """Number of products until the deepest joint has reached the root, 1 or more. Parents must come before children."""
    depth: list[int] = []
    for parent in parents:
        depth.append(0 if parent < 0 else depth[parent] + 1)
    return max(1, max(depth).bit_length())


def _around_a_point() -> Linear:
    """For a point (3), the matrix (16x16, row by row) from products of a quaternion's components to the 4x4 matrix
    that rotates space around that point.
    """
    weight: Floats = np.zeros((3, 16, 16), np.float32)
    bias: Floats = np.zeros((16, 16), np.float32)
    squares = np.eye(4, dtype=np.float32).ravel()
    turn = PRODUCTS.reshape(16, 3, 3)
    for row in range(3):
        for column in range(3):
            bias[:, 4 * row + column] = turn[:, row, column]
            # The point itself minus its rotated position.
            weight[column, :, 4 * row + 3] -= turn[:, row, column]
        weight[row, :, 4 * row + 3] += squares
    bias[:, 15] = squares
    return Linear(weight.reshape(3, 256).T, bias.ravel())
