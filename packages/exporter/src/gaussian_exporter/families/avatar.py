"""Skinned avatars: Gaussians bound to a skeleton, driven by pose and shape, with linear blend skinning in the graph.

The shape of SMPL and its kin (blend shapes of body shape and of pose, joints that follow the shape, one weight for each
Gaussian and joint) without any of their data: a rig of any licence can be brought in this form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import onnx

from ..arrays import Floats, rotation_matrices
from ..contract import Facts, Input, camera_position, control, pose, shape
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..outputs import Gaussians, Options, finish
from ..pieces import harmonics
from ..pieces.covariance import covariance_of_half, rotation_matrix
from ..pieces.skeleton import posed_joints, relative_to_parent, rotation_of_axis_angle, skinning_matrices
from ..pieces.view import direction_and_distance

PoseFormat = Literal["axis-angle", "quaternion"]


@dataclass(frozen=True)
class Avatar:
    """N Gaussians at rest and a skeleton of J joints, parents first (root: parent -1).

    positions (N,3), scales (N,3) standard deviations, rotations (N,4) w x y z, opacities (N,1) 0..1, sh (N,(d+1)^2,3);
    weights (N,J), rows sum to 1; joints (J,3) at rest. Blend shapes, all optional: shape_directions (N,3,B) and
    joint_directions (J,3,B) move Gaussians and joints by the coefficients of `shape`, expression_directions (N,3,E) by
    those of `expression`, pose_directions (N,3,9(J-1)) by the entries of every non-root rotation less the identity.
    """

    positions: Floats
    scales: Floats
    rotations: Floats
    opacities: Floats
    sh: Floats
    weights: Floats
    joints: Floats
    parents: Sequence[int]
    joint_names: Sequence[str]
    shape_directions: Floats | None = None
    joint_directions: Floats | None = None
    expression_directions: Floats | None = None
    pose_directions: Floats | None = None


def export_avatar(
    avatar: Avatar, facts: Facts, options: Options | None = None, pose_format: PoseFormat = "axis-angle"
) -> onnx.ModelProto:
    """A generator of N Gaussians from a pose (and a shape, an expression, a translation).

    With harmonics above degree 0 the camera's position is an input too: colours are looked up in the direction that the
    camera has from the limb's own frame. `bounds` are those of the rest pose.
    """
    check(avatar)
    options = options or Options()
    graph = Graph("avatar", options.weights, options.instances is not None)
    quaternions = pose_format == "quaternion"
    given = graph.input("pose", *graph.lead, len(avatar.parents), 4 if quaternions else 3)
    rotations = rotation_matrix(given) if quaternions else rotation_of_axis_angle(given)
    inputs = [pose("pose", avatar.joint_names, avatar.parents, quaternions)]
    positions, joints = blended(avatar, graph, rotations, inputs)
    frames = posed_joints(rotations, relative_to_parent(joints, avatar.parents), avatar.parents)
    carried = graph.constant(avatar.weights, "weights", errors="even") @ skinning_matrices(frames, joints)
    translation = row_of(graph, "translation", 3)
    inputs.append(control("translation", 0.0, -10.0, 10.0))
    gaussians = skinned(avatar, graph, positions, carried, translation, inputs)
    bounds = avatar.positions.min(0), avatar.positions.max(0)
    return finish(graph, gaussians, inputs, bounds, facts, options)


def check(avatar: Avatar) -> None:
    """Raises checkpoint/mismatch for arrays that do not fit, parents after children, weights that do not sum to 1."""
    count, joints = len(avatar.positions), len(avatar.parents)
    shapes = {
        "positions": (count, 3),
        "scales": (count, 3),
        "rotations": (count, 4),
        "opacities": (count, 1),
        "weights": (count, joints),
        "joints": (joints, 3),
    }
    for name, expected in shapes.items():
        _demand(getattr(avatar, name).shape == expected, name, str(expected), str(getattr(avatar, name).shape))
    _demand(avatar.sh.shape[1] in (1, 4, 9, 16), "sh", "1, 4, 9 or 16 coefficients", str(avatar.sh.shape))
    _demand(len(avatar.joint_names) == joints, "joint_names", f"{joints} names", str(len(avatar.joint_names)))
    ordered = all(-1 <= parent < joint for joint, parent in enumerate(avatar.parents))
    _demand(ordered, "parents", "every parent before its children, -1 for a root", str(list(avatar.parents)))
    worst = float(np.abs(avatar.weights.sum(1, dtype=np.float64) - 1).max())
    _demand(worst < 1e-3, "weights", "rows that sum to 1", f"a row that is off by {worst:.3g}")
    both = (avatar.shape_directions is None) == (avatar.joint_directions is None)
    _demand(both, "shape_directions", "directions of Gaussians and of joints, or neither", "one of them")


def _demand(holds: bool, where: str, expected: str, found: str) -> None:
    if not holds:
        raise ExportError(
            "checkpoint/mismatch",
            where=f"avatar: {where}",
            expected=expected,
            found=found,
            remedy="write the avatar's arrays as gaussian_exporter.families.avatar.Avatar describes them",
        )


def blended(avatar: Avatar, graph: Graph, rotations: Tensor, inputs: list[Input]) -> tuple[Tensor, Tensor]:
    """Positions (N,3) and joints (J,3) at rest, of this shape, expression and pose. Adds the inputs it needs."""
    positions = graph.constant(avatar.positions, "positions", errors="even")
    joints = graph.constant(avatar.joints, "joints")
    if avatar.shape_directions is not None and avatar.joint_directions is not None:
        count = avatar.shape_directions.shape[2]
        inputs.append(shape("shape", count))
        body = row_of(graph, "shape", count)
        positions = positions + along(body, avatar.shape_directions, "shape_directions")
        joints = joints + along(body, avatar.joint_directions, "joint_directions")
    if avatar.expression_directions is not None:
        count = avatar.expression_directions.shape[2]
        # The role `shape` is there once only, so that a page knows which coefficients are the body's.
        inputs.append(control("expression", 0.0, -3.0, 3.0))
        expression = row_of(graph, "expression", count)
        positions = positions + along(expression, avatar.expression_directions, "expression_directions")
    if avatar.pose_directions is not None:
        count = len(avatar.parents)
        bends = rotations.part(1, count, -3) - graph.constant(np.eye(3)[None], "identity")
        bends = bends.reshape(*graph.lead, 1, 9 * (count - 1))
        positions = positions + along(bends, avatar.pose_directions, "pose_directions")
    return positions, joints


def row_of(graph: Graph, name: str, count: int) -> Tensor:
    """An input of `count` numbers, of each instance if there are such, as one row (...,1,count)."""
    return graph.input(name, *graph.lead, count).reshape(*graph.lead, 1, count)


def along(row: Tensor, directions: Floats, name: str) -> Tensor:
    """Offsets (...,N,3): directions (N,3,B) times coefficients (...,1,B)."""
    count = directions.shape[0]
    table = directions.transpose(2, 0, 1).reshape(directions.shape[2], count * 3)
    return (row @ row.graph.constant(table, name)).reshape(*row.shape[:-2], count, 3)


def skinned(
    avatar: Avatar, graph: Graph, positions: Tensor, carried: Tensor, translation: Tensor, inputs: list[Input]
) -> Gaussians:
    """Gaussians in the world; carried (...,N,12) is each one's blend of its joints' matrices."""
    count = len(avatar.positions)
    each = (*graph.lead, count)
    turn = carried.part(0, 9).reshape(*each, 3, 3)
    placed = (turn * positions.reshape(*positions.shape[:-1], 1, 3)).sum(-1) + carried.part(9, 12) + translation
    half = graph.constant(rotation_matrices(avatar.rotations) * avatar.scales[:, None, :], "halves")
    # The blend's own matrix also stretches where joints disagree; covariances follow it exactly.
    stretched = (turn.reshape(*each, 3, 3, 1) * half.reshape(count, 1, 3, 3)).sum(-2)
    sh = graph.constant(avatar.sh, "sh")
    if avatar.sh.shape[1] > 1:
        camera = row_of(graph, "camera_position", 3)
        inputs.append(camera_position())
        direction, _ = direction_and_distance(placed, camera)
        # Transposed, the blend turns the direction back into the frame that the harmonics were trained in.
        own = (turn * direction.reshape(*each, 3, 1)).sum(-2)
        length = ((own * own).sum(-1, keep=True) + 1e-20).unary("Sqrt")
        colours = harmonics.colour(own / length, sh)
    else:
        colours = graph.constant(np.maximum(avatar.sh[:, 0] * np.float64(0.28209479177387814) + 0.5, 0), "colors")
    return Gaussians(
        positions=placed,
        covariances=covariance_of_half(stretched),
        opacities=graph.constant(avatar.opacities, "opacities"),
        colors=colours,
    )
