"""Skinned avatars: Gaussians bound to a skeleton, driven by pose and shape, with linear blend skinning in the graph.

The form is that of SMPL and similar models (blend shapes of body shape and of pose, joints that follow the shape,
one weight for each Gaussian and joint) without any of their data, so a rig of any license can be converted to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import Literal

import numpy as np
import onnx

from ..arrays import Floats, rotation_matrices
from ..contract import Facts, Input, camera_position, control, pose, shape
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..outputs import Gaussians, Options, finish
from ..pieces import harmonics
from ..pieces.covariance import covariance_of_half
from ..pieces.skeleton import (
    products_of_parts,
    quaternions_of_axis_angle,
    rotation_entries,
    skinning_matrices,
    unit_quaternions,
)
from ..pieces.view import direction_and_distance

PoseFormat = Literal["axis-angle", "quaternion"]


@dataclass(frozen=True, kw_only=True)
class Skinned:
    """N points at rest and a skeleton of J joints, parents first (root: parent -1).

    positions (N,3); weights (N,J), rows sum to 1; joints (J,3) at rest. Blend shapes, all optional: shape_directions
    (N,3,B) and joint_directions (J,3,B) move points and joints by the coefficients of `shape`, expression_directions
    (N,3,E) and expression_joint_directions (J,3,E) by those of `expression`, pose_directions (N,3,9(J-1)) by the
    entries of every non-root rotation less the identity.
    """

    positions: Floats
    weights: Floats
    joints: Floats
    parents: Sequence[int]
    joint_names: Sequence[str]
    shape_directions: Floats | None = None
    joint_directions: Floats | None = None
    expression_directions: Floats | None = None
    expression_joint_directions: Floats | None = None
    pose_directions: Floats | None = None


@dataclass(frozen=True, kw_only=True)
class Avatar(Skinned):
    """N Gaussians at rest on a skeleton: scales (N,3) standard deviations, rotations (N,4) w x y z, opacities (N,1)
    0..1, sh (N,(d+1)^2,3), beside the arrays of `Skinned`.
    """

    scales: Floats
    rotations: Floats
    opacities: Floats
    sh: Floats


@dataclass(frozen=True)
class Posed:
    """Points in world coordinates, placed (...,N,3); carried (...,N,3,4), the matrix of each; inputs of both."""

    placed: Tensor
    carried: Tensor
    inputs: list[Input]


def export_avatar(
    avatar: Avatar, facts: Facts, options: Options | None = None, pose_format: PoseFormat = "axis-angle"
) -> onnx.ModelProto:
    """A generator of N Gaussians from a pose (and a shape, an expression, a translation).

    With harmonics above degree 0, the camera's position is also an input: colors depend on the direction to the
    camera in the limb's own axes. `bounds` are those of the rest pose.
    """
    check(avatar)
    options = options or Options()
    graph = Graph("avatar", options.weights, options.instances is not None)
    body = posed(avatar, graph, pose_format)
    gaussians = skinned(avatar, graph, body)
    bounds = avatar.positions.min(0), avatar.positions.max(0)
    return finish(graph, gaussians, body.inputs, bounds, facts, options)


def posed(body: Skinned, graph: Graph, pose_format: PoseFormat) -> Posed:
    """Points of a skinned body for its inputs: pose, translation, and coefficients of the blend shapes that it has."""
    quaternions = pose_format == "quaternion"
    given = graph.input("pose", *graph.lead, len(body.parents), 4 if quaternions else 3)
    products = products_of_parts(unit_quaternions(given) if quaternions else quaternions_of_axis_angle(given))
    inputs = [pose("pose", body.joint_names, body.parents, quaternions)]
    points, joints = blended(body, graph, products, inputs)
    carried = blended_matrices(body, skinning_matrices(products, joints, body.parents))
    translation = row_of(graph, "translation", 3)
    inputs.append(control("translation", 0.0, -10.0, 10.0))
    count = len(body.positions)
    placed = (carried @ points.reshape(*points.shape, 1)).reshape(*graph.lead, count, 3) + translation
    return Posed(placed, carried, inputs)


def check(avatar: Avatar) -> None:
    """Raises checkpoint/mismatch for inconsistent arrays, parents after children, and weights that do not sum to 1."""
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


def blended(avatar: Skinned, graph: Graph, products: Tensor, inputs: list[Input]) -> tuple[Tensor, Tensor]:
    """Points x y z 1 (...,N,4) and joints (...,J,3) at rest, for the current shape, expression and pose. Adds the
    inputs that these need.
    """
    positions = graph.constant(avatar.positions, "positions", errors="even")
    ones = graph.constant(np.ones((1, 1)), "one").expand(len(avatar.positions), 1)
    points = graph.concat([positions, ones], 1)
    joints = graph.constant(avatar.joints, "joints")
    if avatar.shape_directions is not None and avatar.joint_directions is not None:
        count = avatar.shape_directions.shape[2]
        inputs.append(shape("shape", count))
        body = row_of(graph, "shape", count)
        points = along(body, avatar.shape_directions, points, "shape_directions")
        joints = along(body, avatar.joint_directions, joints, "joint_directions")
    if avatar.expression_directions is not None:
        count = avatar.expression_directions.shape[2]
        # Only one input has the role `shape`, so that pages can identify the coefficients of the body.
        inputs.append(control("expression", 0.0, -3.0, 3.0))
        face = row_of(graph, "expression", count)
        points = along(face, avatar.expression_directions, points, "expression_directions")
        if avatar.expression_joint_directions is not None:
            joints = along(face, avatar.expression_joint_directions, joints, "expression_joint_directions")
    if avatar.pose_directions is not None:
        count = len(avatar.parents)
        bends = rotation_entries(products.part(1, count, -2)).reshape(*graph.lead, 1, 9 * (count - 1))
        points = along(bends, avatar.pose_directions, points, "pose_directions")
    return points, joints


def row_of(graph: Graph, name: str, count: int) -> Tensor:
    """An input of `count` numbers, for each instance if there are any, as one row (...,1,count)."""
    return graph.input(name, *graph.lead, count).reshape(*graph.lead, 1, count)


def along(row: Tensor, directions: Floats, start: Tensor, name: str) -> Tensor:
    """Points (...,N,C): a start (N,C) or (...,N,C) plus directions (N,3,B) times coefficients (...,1,B). With C = 4
    the last column is unchanged.
    """
    graph, (count, columns) = row.graph, start.shape[-2:]
    table = graph.constant(directions.transpose(2, 0, 1), name)
    if columns > 3:
        none = graph.constant(np.zeros((1, 1, 1)), "none").expand(*table.shape[:2], columns - 3)
        table = graph.concat([table, none], 2)
    number, size = row.shape[-1], count * columns
    lead = row.shape[:-2]
    rows = row.reshape(prod(lead), number)
    begun = start.reshape(prod(start.shape[:-2]), size)
    ended = graph.node("Gemm", [rows, table.reshape(number, size), begun], (rows.shape[0], size))
    return ended.reshape(*lead, count, columns)


def blended_matrices(avatar: Skinned, matrices: Tensor) -> Tensor:
    """Blend (...,N,3,4) for each Gaussian of its joints' matrices (...,R,12), R joints or more."""
    graph, (count, joints) = matrices.graph, avatar.weights.shape
    weights = graph.constant(avatar.weights, "weights", errors="even")
    none = graph.constant(np.zeros((1, 1)), "no_weight").expand(count, matrices.shape[-2] - joints)
    blend = graph.concat([weights, none], 1) @ matrices
    return blend.reshape(*graph.lead, count, 3, 4)


def skinned(avatar: Avatar, graph: Graph, body: Posed) -> Gaussians:
    """Gaussians in world coordinates."""
    placed, carried = body.placed, body.carried
    half = graph.constant(rotation_matrices(avatar.rotations) * avatar.scales[:, None, :], "halves")
    # The blended matrix also stretches if joints disagree; covariances follow it exactly.
    stretched = carried @ in_four_rows(half)
    sh = graph.constant(avatar.sh, "sh")
    if avatar.sh.shape[1] > 1:
        camera = row_of(graph, "camera_position", 3)
        body.inputs.append(camera_position())
        direction, _ = direction_and_distance(placed, camera)
        # Transposed, the blend rotates the direction back to the axes in which the harmonics were trained.
        own = (carried * direction.reshape(*direction.shape, 1)).sum(-2).part(0, 3)
        colors = harmonics.color(own / (own.length(-1, keep=True) + 1e-10), sh)
    else:
        colors = graph.constant(np.maximum(avatar.sh[:, 0] * np.float64(0.28209479177387814) + 0.5, 0), "colors")
    return Gaussians(
        positions=placed,
        covariances=covariance_of_half(stretched),
        opacities=graph.constant(avatar.opacities, "opacities"),
        colors=colors,
    )


def in_four_rows(half: Tensor) -> Tensor:
    """Constant halves (N,3,3) as (N,4,4) with zeros around, for which there are faster kernels."""
    count, table = half.shape[0], np.zeros((9, 16), np.float32)
    for row in range(3):
        for column in range(3):
            table[3 * row + column, 4 * row + column] = 1
    return (half.reshape(count, 9) @ half.graph.constant(table, "wider")).reshape(count, 4, 4)
