"""Scaffold-GS and Octree-GS: small networks compute Gaussians from anchors, again for every camera.

Every anchor writes its k Gaussians in every frame, in the same rows. A Gaussian that the networks switch off, or whose
level of detail this camera does not need, gets opacity 0. Compaction (Compress, NonZero) would make the GPU wait for
the CPU in every frame.
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
from ..pieces.mlp import Linear, linear, mlp
from ..pieces.view import direction_and_distance, distance_to

DistanceToLevel = Literal["floor", "round", "ceil", "progressive"]


@dataclass(frozen=True)
class Levels:
    """Octree-GS's levels of detail. levels and extra_levels (M,1); voxel_size and standard_distance in world units. An
    anchor is shown if its level is at most log_fork(standard_distance / distance) + extra level, rounded by `rule`."""

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
    scales; features (M,F); scales (M,6), positive. Networks end without their activation. `uses_distance` names the
    networks that take the distance after the direction; `appearance` (A) is the code of one training image, if
    there are any.
    """

    anchors: Floats
    offsets: Floats
    features: Floats
    scales: Floats
    opacity: Sequence[Linear]
    color: Sequence[Linear]
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
    check_bank(model)
    options = options or Options()
    graph = Graph("scaffold" if model.levels is None else "octree", options.weights)
    camera = graph.input("camera_position", 3)
    inputs = [camera_position()]
    anchors = graph.constant(model.anchors, "anchors", errors="even")
    seen = graph.concat(direction_and_distance(anchors, camera), 1)
    decoded = decode(model, graph, seen)
    opacity = decoded["opacity"].unary("Tanh")
    if model.levels is not None:
        resolution = graph.input("resolution_scale", 1)
        inputs.append(control("resolution_scale", 1.0, 0.25, 16.0, "coarseness"))
        opacity = opacity * presence(model.levels, anchors, camera, resolution)
    gaussians = place(model, graph, anchors, opacity, decoded)
    return finish(graph, gaussians, inputs, reach(model), facts, options)


def check(model: Scaffold) -> None:
    """Raises checkpoint/mismatch if a network does not fit the anchors."""
    k = model.gaussians_per_anchor
    level = int(model.levels is not None and model.levels.fed_to_networks)
    wanted = {"opacity": k, "color": 3 * k, "covariance": 7 * k}
    for name, outputs in wanted.items():
        layers: Sequence[Linear] = getattr(model, name)
        extra = len(model.appearance) if name == "color" and model.appearance is not None else 0
        inputs = model.features.shape[1] + 3 + (name in model.uses_distance) + level + extra
        if (layers[0].inputs, layers[-1].outputs) != (inputs, outputs):
            raise ExportError(
                "checkpoint/mismatch",
                where=f"the {name} network",
                expected=f"{inputs} inputs and {outputs} outputs ({k} Gaussians an anchor)",
                found=f"{layers[0].inputs} and {layers[-1].outputs}",
                remedy="compare cfg_args (feat_dim, n_offsets, add_*_dist, appearance_dim, add_level) with the files",
            )
        if len(layers) < 2:
            raise ExportError(
                "checkpoint/unsupported",
                where=f"the {name} network",
                expected="two layers or more",
                found="one",
                remedy="train with the networks of Scaffold-GS",
            )


def check_bank(model: Scaffold) -> None:
    """Raises checkpoint/mismatch if a feature bank takes other inputs than in the trainers."""
    if model.feature_bank is None:
        return
    expected = 4 if model.levels is None else 3 + model.levels.fed_to_networks
    first, last = model.feature_bank[0], model.feature_bank[-1]
    if (first.inputs, last.outputs) != (expected, 3):
        raise ExportError(
            "checkpoint/mismatch",
            where="the feature bank",
            expected=f"{expected} inputs and 3 outputs",
            found=f"{first.inputs} and {last.outputs}",
            remedy="compare cfg_args (use_feat_bank, add_level) with the files",
        )


def decode(model: Scaffold, graph: Graph, seen: Tensor) -> dict[str, Tensor]:
    """The networks' outputs (M, ...), without their activations: opacity, color, and for the covariance scales and
    rotations separately. seen (M,4): direction and distance.
    """
    known = [graph.constant(model.features, "features")]
    levels = model.levels
    if levels is not None and levels.fed_to_networks:
        known.append(graph.constant(levels.levels, "levels"))
    if model.feature_bank is not None:
        first, *rest = model.feature_bank
        # Scaffold-GS feeds direction and distance, Octree-GS the direction and, if any network has it, the level.
        weight = in_order(first.weight, 0, levels is None)
        weights = mlp(graph.concat([*known[1:], seen], 1), [Linear(weight, first.bias), *rest], "bank", "Softmax")
        known = [view_dependent(known[0], weights), *known[1:]]
    networks = {"opacity": model.opacity, "color": without_appearance(model), "covariance": model.covariance}
    inner = {name: hidden(model, graph, known, seen, name, layers) for name, layers in networks.items()}
    ends = {name: layers[-1] for name, layers in networks.items()}
    scales, rotations = parts_of_covariance(ends.pop("covariance"))
    return {
        **{name: linear(inner[name], end, f"{name}_end") for name, end in ends.items()},
        "scales": linear(inner["covariance"], scales, "scales_end"),
        "rotations": linear(inner["covariance"], rotations, "rotations_end"),
    }


def hidden(
    model: Scaffold, graph: Graph, known: Sequence[Tensor], seen: Tensor, name: str, layers: Sequence[Linear]
) -> Tensor:
    """Input of a network's last layer (M,H).

    Features that do not depend on the view are multiplied once, when the session is created. A run multiplies only
    direction and distance, and adds the two products.
    """
    first, *rest = layers[:-1]
    weight = in_order(first.weight, model.features.shape[1], name in model.uses_distance)
    if model.feature_bank is not None:
        x = linear(graph.concat([*known, seen], 1), Linear(weight, first.bias), f"{name}_0")
    else:
        of_known = Linear(np.ascontiguousarray(weight[:, :-4]), first.bias)
        baked = linear(graph.concat(known, 1), of_known, f"{name}_known")
        x = linear(seen, Linear(np.ascontiguousarray(weight[:, -4:]), first.bias), f"{name}_seen", baked)
    for index, layer in enumerate(rest):
        x = linear(x.unary("Relu"), layer, f"{name}_{index + 1}")
    return x.unary("Relu")


def in_order(weight: Floats, features: int, uses_distance: bool) -> Floats:
    """A first layer's columns (features, direction, perhaps distance, perhaps level) in the order of the graph:
    features, perhaps level, direction, distance, the last zero if it is unused.
    """
    direction = features + 3
    distance = weight[:, direction : direction + 1] if uses_distance else np.zeros((len(weight), 1), np.float32)
    level = weight[:, direction + uses_distance :]
    return np.concatenate([weight[:, :features], level, weight[:, features:direction], distance], 1)


def parts_of_covariance(end: Linear) -> tuple[Linear, Linear]:
    """The covariance's last layer, 7 outputs for each Gaussian, as two layers: 3 for its scales, 4 for its rotation."""
    weight, bias = end.weight.reshape(-1, 7, end.inputs), end.bias.reshape(-1, 7)
    return (
        Linear(weight[:, :3].reshape(-1, end.inputs), bias[:, :3].reshape(-1)),
        Linear(weight[:, 3:].reshape(-1, end.inputs), bias[:, 3:].reshape(-1)),
    )


def without_appearance(model: Scaffold) -> Sequence[Linear]:
    """The color network with one image's appearance code folded into its first bias."""
    if model.appearance is None:
        return model.color
    first, own = model.color[0], len(model.appearance)
    code = first.weight[:, -own:].astype(np.float64) @ model.appearance.astype(np.float64)
    return [Linear(first.weight[:, :-own], (first.bias + code).astype(np.float32)), *model.color[1:]]


def view_dependent(features: Tensor, weights: Tensor) -> Tensor:
    """Scaffold-GS's feature bank: features (M,F), and the same at lower resolutions, mixed by weights (M,3)."""
    count = features.shape[1]
    quarter = features.take([i * 4 % count for i in range(count)], 1)
    half = features.take([i * 2 % count for i in range(count)], 1)
    mixed = [part * weights.part(i, i + 1) for i, part in enumerate((quarter, half, features))]
    return mixed[0] + mixed[1] + mixed[2]


def presence(levels: Levels, anchors: Tensor, camera: Tensor, resolution: Tensor) -> Tensor:
    """Weight of each anchor for this camera (M,1): 1, 0, or, with the rule `progressive`, between."""
    graph = anchors.graph
    center = levels.voxel_size / 2 / np.float64(levels.fork) ** levels.levels
    distance = distance_to(anchors + graph.constant(center, "half_voxels"), camera)
    nearness = (distance * resolution).unary("Log") * (-1 / log(levels.fork))
    wanted = nearness + graph.constant(levels.extra_levels + log(levels.standard_distance, levels.fork), "extra_levels")
    own = graph.constant(levels.levels, "levels")
    if levels.rule == "progressive":
        top = float(levels.levels.max() - levels.levels.min())
        # Whole levels below count fully, and the current level by its fraction: both are this one ramp.
        return ((wanted + 1.0).clip(0.9999, top + 0.9999) - own).clip(0, 1)
    # level <= rounded(wanted), without rounding, because levels are whole numbers. The coarsest level is always shown.
    slack = {"floor": 0.0, "round": 0.5, "ceil": 1.0}[levels.rule]
    compare = "Greater" if levels.rule == "ceil" else "GreaterOrEqual"
    shown = graph.node(compare, [wanted + slack, own], own.shape)
    coarsest = graph.constant((levels.levels <= 0).astype(np.float32), "coarsest")
    return graph.node("Where", [shown, graph.constant(np.ones_like(levels.levels), "one"), coarsest], own.shape)


def place(model: Scaffold, graph: Graph, anchors: Tensor, opacity: Tensor, decoded: dict[str, Tensor]) -> Gaussians:
    """Gaussians (M*k) from the networks' outputs. Each has its final shape before the last operator, because a reshape
    of an output is a copy.
    """
    count, k = model.offsets.shape[:2]
    total = count * k
    reach = graph.constant(model.offsets * model.scales[:, None, :3], "offsets")
    widest = graph.constant(model.scales[:, None, 3:], "widest").expand(count, k, 3).reshape(total, 3)
    return Gaussians(
        positions=(reach + anchors.reshape(count, 1, 3)).reshape(total, 3),
        scales=decoded["scales"].reshape(total, 3).unary("Sigmoid") * widest,
        rotations=decoded["rotations"].reshape(total, 4),
        opacities=opacity.reshape(total, 1).unary("Relu"),
        colors=decoded["color"].reshape(total, 3).unary("Sigmoid"),
    )


def reach(model: Scaffold) -> tuple[Floats, Floats]:
    """Corners around all centers, which do not depend on the camera."""
    centers = (model.anchors[:, None] + model.offsets * model.scales[:, None, :3]).reshape(-1, 3)
    return centers.min(0), centers.max(0)
