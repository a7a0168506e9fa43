"""4DGS: Gaussians that move, by six feature planes over space and time (HexPlane) and a small network.

Gaussians are looked up at their resting positions, so the three planes of space never change: their product is baked
into the file, and only the three planes that hold time are sampled in a frame. Exactly the Gaussians of the checkpoint
are written, without padding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import prod

import numpy as np
import onnx

from ..arrays import Doubles, Floats, sigmoid
from ..contract import Facts, normalized_time
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..outputs import Gaussians, Options, finish
from ..pieces.mlp import Linear, mlp
from ..planes import sample_plane
from .classic import Cloud, usable

# Axes of the six planes, in the order in which checkpoints number them; axis 3 is time.
PLANES = list(combinations(range(4), 2))
TIME = 3


@dataclass(frozen=True)
class Deformation:
    """How Gaussians move. box (2,3): the corners that plane coordinates -1 and 1 stand for; resolutions: for each six
    planes (C,H,W) over the axes of PLANES, the first axis along W; trunk: the network after the planes. A head that is
    None leaves its part at rest. Heads add to position, log scale, quaternion, opacity logit and harmonics; `mask`
    multiplies what they are added to."""

    box: Floats
    resolutions: Sequence[Sequence[Floats]]
    trunk: Sequence[Linear]
    position: Sequence[Linear] | None
    scale: Sequence[Linear] | None
    rotation: Sequence[Linear] | None
    opacity: Sequence[Linear] | None = None
    sh: Sequence[Linear] | None = None
    mask: Sequence[Linear] | None = None


def export_hexplane(
    cloud: Cloud, deformation: Deformation, facts: Facts, options: Options | None = None
) -> onnx.ModelProto:
    """A generator of the cloud's Gaussians at a time from 0 to 1."""
    cloud = usable(cloud)
    check(cloud, deformation)
    options = options or Options()
    graph = Graph("hexplane", options.weights, options.instances is not None)
    time = graph.input("time", *graph.lead, 1)
    hidden = mlp(features(cloud, deformation, graph, time), deformation.trunk, "trunk").unary("Relu")
    return finish(
        graph, move(cloud, deformation, hidden), [normalized_time()], reach(cloud, deformation), facts, options
    )


def check(cloud: Cloud, deformation: Deformation) -> None:
    """Raises checkpoint/mismatch where planes, network and Gaussians do not fit."""
    channels = sum(planes[0].shape[0] for planes in deformation.resolutions)
    wanted = {"planes and trunk": (channels, deformation.trunk[0].inputs)}
    heads = {"position": 3, "scale": 3, "rotation": 4, "opacity": 1, "sh": cloud.sh[0].size, "mask": 1}
    for name, size in heads.items():
        head: Sequence[Linear] | None = getattr(deformation, name)
        if head is not None:
            wanted[f"outputs of the {name} head"] = (size, head[-1].outputs)
            wanted[f"inputs of the {name} head"] = (deformation.trunk[-1].outputs, head[0].inputs)
    for where, (expected, found) in wanted.items():
        if expected != found:
            raise ExportError(
                "checkpoint/mismatch",
                where=where,
                expected=str(expected),
                found=str(found),
                remedy="point_cloud.ply and deformation.pth must be of one training and iteration",
            )


def plane_coordinates(cloud: Cloud, deformation: Deformation) -> Doubles:
    """Resting positions in the planes' coordinates (N,3), -1 to 1 inside the box."""
    low, high = deformation.box.astype(np.float64)
    result: Doubles = (cloud.positions - low) * (2 / (high - low)) - 1
    return result


def reach(cloud: Cloud, deformation: Deformation) -> tuple[Doubles, Doubles]:
    """Corners around all centres at all times: at the planes' own times, between which features run straight, and a
    hundredth of the scene wider for what the network bends on the way."""
    low, high = cloud.positions.min(0).astype(np.float64), cloud.positions.max(0).astype(np.float64)
    if deformation.position is None:
        return low, high
    at = plane_coordinates(cloud, deformation)
    steps = max(planes[PLANES.index((0, TIME))].shape[1] for planes in deformation.resolutions)
    still = [
        np.prod([sample_plane(planes[i], at[:, a], at[:, b]) for i, (a, b) in enumerate(PLANES) if b != TIME], 0)
        for planes in deformation.resolutions
    ]
    for time in np.linspace(0, 1, steps):
        now = np.concatenate([at, np.full((len(at), 1), time)], 1)
        moving = [
            np.prod([sample_plane(planes[i], now[:, a], now[:, b]) for i, (a, b) in enumerate(PLANES) if b == TIME], 0)
            for planes in deformation.resolutions
        ]
        x = np.concatenate([a * b for a, b in zip(still, moving, strict=True)], 1)
        hidden = np.maximum(applied(deformation.trunk, x), 0)
        rest = cloud.positions * (applied(deformation.mask, hidden) if deformation.mask else 1)
        placed = rest + applied(deformation.position, hidden)
        low, high = np.minimum(low, placed.min(0)), np.maximum(high, placed.max(0))
    slack = 0.01 * (high - low)
    return low - slack, high + slack


def applied(layers: Sequence[Linear], x: Doubles) -> Doubles:
    """What the graph's `mlp` computes, on numbers."""
    for index, layer in enumerate(layers):
        x = (np.maximum(x, 0) if index else x) @ layer.weight.T.astype(np.float64) + layer.bias
    return x


def features(cloud: Cloud, deformation: Deformation, graph: Graph, time: Tensor) -> Tensor:
    """The planes' features (..., N, sum of C)."""
    at = plane_coordinates(cloud, deformation)
    count = len(at)
    each = (*graph.lead, count)
    if graph.lead:
        column = time.reshape(*graph.lead, 1, 1) + graph.constant(np.zeros((count, 1)), "rows")
    else:
        column = time.reshape(1, 1).expand(count, 1)
    grids = []
    for axis in range(TIME):
        coordinate = graph.constant(at[:, [axis]], f"coordinate_{'xyz'[axis]}", errors="even").alongside(time)
        # All instances are rows of one long picture.
        grids.append(graph.concat([coordinate, column], -1).reshape(1, prod(each), 1, 2))
    columns = []
    for level, planes in enumerate(deformation.resolutions):
        channels = planes[0].shape[0]
        still = np.prod(
            [sample_plane(planes[i], at[:, a], at[:, b]) for i, (a, b) in enumerate(PLANES) if b != TIME], 0
        )
        moving = [
            sample_in_time(graph.constant(planes[i][None], f"plane_{level}_{'xyz'[a]}t"), grids[a], channels)
            for i, (a, b) in enumerate(PLANES)
            if b == TIME
        ]
        product = (moving[0] * moving[1] * moving[2]).reshape(channels, prod(each)).transpose(1, 0)
        columns.append(product.reshape(*each, channels) * graph.constant(still, f"still_{level}"))
    return graph.concat(columns, -1)


def sample_in_time(plane: Tensor, grid: Tensor, channels: int) -> Tensor:
    """Values (1,C,N,1) of one plane."""
    shape = (1, channels, grid.shape[1], 1)
    return plane.graph.node("GridSample", [plane, grid], shape, mode="bilinear", padding_mode="border", align_corners=1)


def move(cloud: Cloud, deformation: Deformation, hidden: Tensor) -> Gaussians:
    """The Gaussians where the heads put them. hidden (...,N,W), after its ReLU."""
    graph = hidden.graph
    mask = mlp(hidden, deformation.mask, "mask") if deformation.mask else None

    def moved(rest: Floats, head: Sequence[Linear] | None, name: str) -> Tensor:
        still = graph.constant(rest, name, errors="even" if name == "positions" else "relative")
        if head is None:
            return still
        return mlp(hidden, head, f"{name}_head") + (still if mask is None or name == "rotations" else still * mask)

    scales: Tensor
    if deformation.scale is None:
        scales = graph.constant(np.exp(np.float64(cloud.log_scales)), "scales")
    else:
        scales = moved(cloud.log_scales, deformation.scale, "log_scales").unary("Exp")
    if deformation.opacity is None:
        opacities = graph.constant(sigmoid(cloud.opacity_logits), "opacities")
    else:
        logits = np.clip(cloud.opacity_logits, -88, 88)
        opacities = moved(logits, deformation.opacity, "opacity_logits").unary("Sigmoid")
    sh = moved(cloud.sh.reshape(len(cloud.sh), -1), deformation.sh, "sh")
    sh = sh.reshape(*sh.shape[:-1], *cloud.sh.shape[1:])
    return Gaussians(
        positions=moved(cloud.positions, deformation.position, "positions"),
        scales=scales,
        rotations=moved(cloud.rotations, deformation.rotation, "rotations"),
        opacities=opacities,
        sh=sh,
    )
