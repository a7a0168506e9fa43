"""Avatars whose Gaussians are bound to triangles of a skinned mesh, as those of GaussianAvatars to FLAME.

Each triangle has a frame: its first edge, its normal, and their cross product, with the center of the triangle as the
origin and a scale between its edge and its height. Positions, rotations and scales of Gaussians are relative to it
(Qian et al., GaussianAvatars, CVPR 2024, section 3.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import onnx

from ..arrays import Doubles, Floats, Integers, rotation_matrices
from ..contract import Facts
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..outputs import Gaussians, Options, finish
from ..pieces.covariance import covariance_of_half
from .avatar import PoseFormat, Skinned, in_four_rows, posed

# Keeps a triangle without an area from dividing by 0.
_TINY = 1e-10


@dataclass(frozen=True)
class BoundAvatar:
    """N Gaussians on F triangles of a mesh of V vertices.

    mesh: V vertices at rest, with its skeleton; faces (F,3) indices of vertices; binding (N) index of each Gaussian's
    triangle; positions (N,3), scales (N,3) standard deviations, rotations (N,4) w x y z: in the frame of the triangle;
    opacities (N,1) 0..1; sh (N,(d+1)^2,3) for directions in world axes.
    """

    mesh: Skinned
    faces: Integers
    binding: Integers
    positions: Floats
    scales: Floats
    rotations: Floats
    opacities: Floats
    sh: Floats


def export_bound(
    avatar: BoundAvatar, facts: Facts, options: Options | None = None, pose_format: PoseFormat = "axis-angle"
) -> onnx.ModelProto:
    """A generator of N Gaussians from a pose, an expression and a translation. `bounds` are those of the rest pose. The
    up axis is +y, FLAME's, unless `facts` declare another.
    """
    check(avatar)
    options = options or Options()
    avatar = without_unused(avatar)
    if facts.coordinates.up is None:
        facts = replace(facts, coordinates=replace(facts.coordinates, up="+y"))
    graph = Graph("bound_avatar", options.weights, options.instances is not None)
    mesh = posed(avatar.mesh, graph, pose_format)
    count = len(avatar.positions)
    frames = frames_of(mesh.placed, avatar.faces).take([int(face) for face in avatar.binding], -2)
    carried = frames.reshape(*graph.lead, count, 3, 4)
    ones = graph.constant(np.ones((1, 1)), "one").expand(count, 1)
    points = graph.concat([graph.constant(avatar.positions, "local"), ones], 1).reshape(count, 4, 1)
    half = graph.constant(rotation_matrices(avatar.rotations) * avatar.scales[:, None, :], "halves")
    gaussians = Gaussians(
        positions=(carried @ points).reshape(*graph.lead, count, 3),
        covariances=covariance_of_half(carried @ in_four_rows(half)),
        opacities=graph.constant(avatar.opacities, "opacities"),
        sh=graph.constant(avatar.sh, "sh"),
    )
    places = resting(avatar)
    return finish(graph, gaussians, mesh.inputs, (places.min(0), places.max(0)), facts, options)


def frames_of(vertices: Tensor, faces: Integers) -> Tensor:
    """Frames (...,F,12) of triangles of vertices (...,V,3): rows of 3x4 matrices, scaled axes and center."""
    a, b, c = (vertices.take([int(index) for index in faces[:, i]], -2) for i in range(3))
    edge, other = b - a, c - a
    length = edge.length(-1, keep=True) + _TINY
    first = edge / length
    normal = cross(first, other)
    second = normal / (normal.length(-1, keep=True) + _TINY)
    third = cross(first, second)
    scale = (length + (third * other).sum(-1, keep=True).unary("Abs")) * 0.5
    columns = [first * scale, second * scale, third * scale, (a + b + c) * (1 / 3)]
    lead = vertices.shape[:-2]
    matrices = vertices.graph.concat(columns, -1).reshape(*lead, len(faces), 4, 3)
    turned = matrices.transpose(*range(len(lead) + 1), len(lead) + 2, len(lead) + 1)
    return turned.reshape(*lead, len(faces), 12)


def cross(left: Tensor, right: Tensor) -> Tensor:
    """Cross product (...,3)."""
    after, before = [1, 2, 0], [2, 0, 1]
    return left.take(after, -1) * right.take(before, -1) - left.take(before, -1) * right.take(after, -1)


def resting(avatar: BoundAvatar) -> Doubles:
    """Positions (N,3) of the Gaussians in the rest pose."""
    a, b, c = (avatar.mesh.positions[avatar.faces[:, i]].astype(np.float64) for i in range(3))
    length = np.linalg.norm(b - a, axis=1, keepdims=True) + _TINY
    first = (b - a) / length
    normal = np.cross(first, c - a)
    second = normal / (np.linalg.norm(normal, axis=1, keepdims=True) + _TINY)
    third = np.cross(first, second)
    scale = (length + np.abs((third * (c - a)).sum(1, keepdims=True))) / 2
    axes = np.stack([first, second, third], 2) * scale[:, :, None]
    centers = (a + b + c) / 3
    places: Doubles = np.einsum("nab,nb->na", axes[avatar.binding], avatar.positions) + centers[avatar.binding]
    return places


def without_unused(avatar: BoundAvatar) -> BoundAvatar:
    """The avatar without triangles that carry no Gaussian, and without vertices of no triangle."""
    carrying, binding = np.unique(avatar.binding, return_inverse=True)
    kept, faces = np.unique(avatar.faces[carrying], return_inverse=True)
    tables = ("positions", "weights", "shape_directions", "expression_directions", "pose_directions")
    given = {name: getattr(avatar.mesh, name) for name in tables}
    mesh = replace(avatar.mesh, **{name: table[kept] for name, table in given.items() if table is not None})
    return replace(avatar, mesh=mesh, binding=binding.reshape(-1), faces=faces.reshape(-1, 3))


def check(avatar: BoundAvatar) -> None:
    """Raises checkpoint/mismatch for Gaussians of triangles, or triangles of vertices, that do not exist."""
    tables = {
        "binding": (avatar.binding, "triangles", len(avatar.faces)),
        "faces": (avatar.faces, "vertices", len(avatar.mesh.positions)),
    }
    for name, (indices, what, count) in tables.items():
        if not ((indices >= 0) & (indices < count)).all():
            raise ExportError(
                "checkpoint/mismatch",
                where=f"avatar: {name}",
                expected=f"indices of the {count} {what} of the mesh",
                found=f"{int(indices.min())} to {int(indices.max())}",
                remedy='give the head of the training, with teeth: "GaussianAvatars" in packages/exporter/README.md',
            )
