"""Poses of a skeleton: rotations of joints, and where they carry the bones."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..graph import Tensor

# Row i: the entries (row by row) of the matrix that is the cross product with axis i.
_CROSS = np.zeros((3, 9), np.float32)
_CROSS[0, 5], _CROSS[0, 7] = -1, 1
_CROSS[1, 2], _CROSS[1, 6] = 1, -1
_CROSS[2, 1], _CROSS[2, 3] = -1, 1


def rotation_of_axis_angle(pose: Tensor) -> Tensor:
    """Rotation matrices (...,J,3,3) of axes times angles in radians (...,J,3), Rodrigues' formula; smooth at 0."""
    graph, joints = pose.graph, pose.shape[:-1]
    angle = ((pose * pose).sum(-1, keep=True) + 1e-16).unary("Sqrt")
    cross = (pose / angle @ graph.constant(_CROSS, "cross")).reshape(*joints, 3, 3)
    turned = cross * angle.unary("Sin").reshape(*joints, 1, 1)
    # 1 - cos(a) as 2 sin(a/2)^2, which keeps its digits at small angles.
    half = (angle * 0.5).unary("Sin")
    bent = cross @ cross * (half * half * 2.0).reshape(*joints, 1, 1)
    return turned + bent + graph.constant(np.eye(3)[None], "identity")


def relative_to_parent(joints: Tensor, parents: Sequence[int]) -> Tensor:
    """Joint positions (...,J,3) as seen from the parent's; a root's as it is."""
    difference = np.eye(len(parents), dtype=np.float32)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            difference[joint, parent] = -1
    return joints.graph.constant(difference, "from_parent") @ joints


def levels_of(parents: Sequence[int]) -> list[list[int]]:
    """Joints by their distance from the root. Parents must come before children."""
    depth: list[int] = []
    for parent in parents:
        depth.append(0 if parent < 0 else depth[parent] + 1)
    return [[joint for joint, own in enumerate(depth) if own == level] for level in range(max(depth) + 1)]


def posed_joints(rotations: Tensor, offsets: Tensor, parents: Sequence[int]) -> Tensor:
    """Each joint's frame in the world (...,J,4,4). rotations (...,J,3,3) and offsets (J,3) or (...,J,3) are relative to
    the parent.

    One product for each level of the tree: a product for each joint would be as many dispatches as joints.
    """
    graph, count = rotations.graph, len(parents)
    last_row = graph.constant(np.tile(np.array([[[0, 0, 0, 1]]]), (count, 1, 1)), "last_row").alongside(rotations)
    offsets = offsets.alongside(rotations)
    local = graph.concat([graph.concat([rotations, offsets.reshape(*offsets.shape, 1)], -1), last_row], -2)
    levels = levels_of(parents)
    frames = [local.take(levels[0], -3)]
    for above, level in pairwise(levels):
        carried = frames[-1].take([above.index(parents[joint]) for joint in level], -3)
        frames.append(carried @ local.take(level, -3))
    order = [joint for level in levels for joint in level]
    return graph.concat(frames, -3).take([order.index(joint) for joint in range(count)], -3)


def skinning_matrices(frames: Tensor, joints: Tensor) -> Tensor:
    """What each joint does to a point at rest (...,J,12): nine numbers of a matrix, row by row, then a translation.
    frames (...,J,4,4) from posed_joints, joints (J,3) or (...,J,3) at rest."""
    each = frames.shape[:-2]
    upper = frames.part(0, 3, -2)
    turn = upper.part(0, 3, -1)
    at_rest = joints.reshape(*joints.shape[:-1], 1, 3)
    shift = upper.part(3, 4, -1).reshape(*each, 3) - (turn * at_rest).sum(-1)
    return frames.graph.concat([turn.reshape(*each, 9), shift], -1)
