"""Scaffold-GS and Octree-GS: anchors that a few small networks turn into Gaussians, anew for every camera.

Every anchor makes its k Gaussians in every frame, in the same rows: a Gaussian that the networks switch off, or whose
level of detail is not wanted from here, gets opacity 0. Listing the living ones (Compress, NonZero) would stop the GPU
in every frame to ask the CPU.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log
from typing import Literal

import numpy as np
import onnx

from ..arrays import Floats
from ..contract import Facts, camera_position, control
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..outputs import Gaussians, Options, finish
from ..pieces.mlp import Linear, mlp
from ..pieces.view import direction_and_distance

DistanceToLevel = Literal["floor", "round", "ceil", "progressive"]


@dataclass(frozen=True)
class Levels:
    """What Octree-GS adds. levels and extra_levels (M,1); voxel_size and standard_distance in world units; an anchor of
    level l is shown where l is at most log_fork(standard_distance / distance) + extra level, rounded as `rule` says."""

    levels: Floats
    extra_levels: Floats
    voxel_size: float
    standard_distance: float
    fork: float = 2.0
    rule: DistanceToLevel = "round"
    fed_to_networks: bool = False


@dataclass(frozen=True)
class Scaffold:
    """A trained model of M anchors with k Gaussians each. anchors (M,3); offsets (M,k,3) in units of the first three
    scales; features (M,F); scales (M,6), positive. Networks end without their activation. `uses_distance` says which of
    them take the distance after the direction; `appearance` (A) is the code of one training image, if there are any."""

    anchors: Floats
    offsets: Floats
    features: Floats
    scales: Floats
    opacity: Sequence[Linear]
    colour: Sequence[Linear]
    covariance: Sequence[Linear]
    feature_bank: Sequence[Linear] | None = None
    uses_distance: tuple[str, ...] = ()
    appearance: Floats | None = None
    levels: Levels | None = None

    @property
    def gaussians_per_anchor(self) -> int:
        """k."""
        return int(self.offsets.shape[1])


def export_scaffold(model: Scaffold, facts: Facts, options: Options | None = None) -> onnx.ModelProto:
    """A generator of M*k Gaussians, k consecutive rows for each anchor, from the camera's position."""
    check(model)
    options = options or Options()
    graph = Graph("scaffold" if model.levels is None else "octree", options.weights)
    camera = graph.input("camera_position", 3)
    inputs = [camera_position()]
    anchors = graph.constant(model.anchors, "anchors", errors="even")
    seen = direction_and_distance(anchors, camera)
    decoded = decode(model, graph, *seen)
    opacity = decoded["opacity"].unary("Tanh")
    if model.levels is not None:
        resolution = graph.input("resolution_scale", 1)
        inputs.append(control("resolution_scale", 1.0, 0.25, 16.0, "coarseness"))
        opacity = opacity * presence(model.levels, anchors, camera, resolution)
    gaussians = place(model, graph, anchors, opacity, decoded)
    return finish(graph, gaussians, inputs, reach(model), facts, options)


def check(model: Scaffold) -> None:
    """Raises checkpoint/mismatch where a network does not fit the anchors."""
    k = model.gaussians_per_anchor
    level = int(model.levels is not None and model.levels.fed_to_networks)
    wanted = {"opacity": k, "colour": 3 * k, "covariance": 7 * k}
    for name, outputs in wanted.items():
        layers: Sequence[Linear] = getattr(model, name)
        extra = len(model.appearance) if name == "colour" and model.appearance is not None else 0
        inputs = model.features.shape[1] + 3 + (name in model.uses_distance) + level + extra
        if (layers[0].inputs, layers[-1].outputs) != (inputs, outputs):
            raise ExportError(
                "checkpoint/mismatch",
                where=f"the {name} network",
                expected=f"{inputs} inputs and {outputs} outputs ({k} Gaussians an anchor)",
                found=f"{layers[0].inputs} and {layers[-1].outputs}",
                remedy="compare cfg_args (feat_dim, n_offsets, add_*_dist, appearance_dim, add_level) with the files",
            )


def decode(model: Scaffold, graph: Graph, direction: Tensor, distance: Tensor) -> dict[str, Tensor]:
    """The networks' outputs (M, ...), without their activations."""
    features = graph.constant(model.features, "features")
    levels = model.levels
    level = [graph.constant(levels.levels, "levels")] if levels is not None and levels.fed_to_networks else []
    if model.feature_bank is not None:
        weights = mlp(graph.concat([direction, *level], 1), model.feature_bank, "bank", "Softmax")
        features = view_dependent(features, weights)
    near = graph.concat([features, direction, *level], 1)
    far = graph.concat([features, direction, distance, *level], 1) if model.uses_distance else near
    networks = {"opacity": model.opacity, "colour": without_appearance(model), "covariance": model.covariance}
    return {name: mlp(far if name in model.uses_distance else near, layers, name) for name, layers in networks.items()}


def without_appearance(model: Scaffold) -> Sequence[Linear]:
    """The colour network with one image's appearance code folded into its first bias."""
    if model.appearance is None:
        return model.colour
    first, own = model.colour[0], len(model.appearance)
    code = first.weight[:, -own:].astype(np.float64) @ model.appearance.astype(np.float64)
    return [Linear(first.weight[:, :-own], (first.bias + code).astype(np.float32)), *model.colour[1:]]


def view_dependent(features: Tensor, weights: Tensor) -> Tensor:
    """Scaffold-GS's feature bank: features (M,F), and the same at lower resolutions, mixed by weights (M,3)."""
    count = features.shape[1]
    quarter = features.take([i * 4 % count for i in range(count)], 1)
    half = features.take([i * 2 % count for i in range(count)], 1)
    mixed = [part * weights.part(i, i + 1) for i, part in enumerate((quarter, half, features))]
    return mixed[0] + mixed[1] + mixed[2]


def presence(levels: Levels, anchors: Tensor, camera: Tensor, resolution: Tensor) -> Tensor:
    """How present each anchor is from here (M,1): 1, 0, or, with the rule `progressive`, between."""
    graph = anchors.graph
    centre = levels.voxel_size / 2 / np.float64(levels.fork) ** levels.levels
    _, distance = direction_and_distance(anchors + graph.constant(centre, "half_voxels"), camera)
    nearness = (distance * resolution).unary("Log") * (-1 / log(levels.fork))
    wanted = nearness + graph.constant(levels.extra_levels + log(levels.standard_distance, levels.fork), "extra_levels")
    own = graph.constant(levels.levels, "levels")
    if levels.rule == "progressive":
        top = float(levels.levels.max() - levels.levels.min())
        # Whole levels below count fully, the level it falls into by its fraction: both are this one ramp.
        return ((wanted + 1.0).clip(0.9999, top + 0.9999) - own).clip(0, 1)
    # level <= rounded(wanted), without rounding: levels are whole numbers. The coarsest is always there.
    slack = {"floor": 0.0, "round": 0.5, "ceil": 1.0}[levels.rule]
    compare = "Greater" if levels.rule == "ceil" else "GreaterOrEqual"
    shown = graph.node(compare, [wanted + slack, own], own.shape)
    coarsest = graph.constant((levels.levels <= 0).astype(np.float32), "coarsest")
    return graph.node("Where", [shown, graph.constant(np.ones_like(levels.levels), "one"), coarsest], own.shape)


def place(model: Scaffold, graph: Graph, anchors: Tensor, opacity: Tensor, decoded: dict[str, Tensor]) -> Gaussians:
    """Gaussians (M*k) from what the networks said."""
    count, k = model.offsets.shape[:2]
    total = count * k
    reach = graph.constant(model.offsets * model.scales[:, None, :3], "offsets")
    widest = graph.constant(model.scales[:, None, 3:], "widest")
    shape = decoded["covariance"].reshape(count, k, 7)
    return Gaussians(
        positions=(reach + anchors.reshape(count, 1, 3)).reshape(total, 3),
        scales=(shape.part(0, 3).unary("Sigmoid") * widest).reshape(total, 3),
        rotations=shape.part(3, 7).reshape(total, 4),
        opacities=opacity.unary("Relu").reshape(total, 1),
        colors=decoded["colour"].unary("Sigmoid").reshape(total, 3),
    )


def reach(model: Scaffold) -> tuple[Floats, Floats]:
    """Corners around all centres, which no camera moves."""
    centres = (model.anchors[:, None] + model.offsets * model.scales[:, None, :3]).reshape(-1, 3)
    return centres.min(0), centres.max(0)
