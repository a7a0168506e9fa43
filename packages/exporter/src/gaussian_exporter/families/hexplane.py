"""4DGS: Gaussians that move, by six feature planes over space and time (HexPlane) and a small network.

The planes are sampled at the resting positions of the Gaussians, so the three planes of space never change. Their
product is baked into the file, and a frame samples only the three planes with a time axis. The file contains exactly
the Gaussians of the checkpoint, without padding.
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
from ..pieces.mlp import Linear, beside, convolved, linear, mlp, rows_of, stacked
from ..planes import sample_plane
from .classic import Cloud, usable

# Axes of the six planes, in the order in which checkpoints number them; axis 3 is time.
PLANES = list(combinations(range(4), 2))
TIME = 3


@dataclass(frozen=True)
class Deformation:
    """Animated Gaussians. box (2,3): the corners at plane coordinates -1 and 1; resolutions: for each six planes
    (C,H,W) over the axes of PLANES, the first axis along W; trunk: the network after the planes. A head that is
    None leaves its attribute at rest. Heads add to position, log scale, quaternion, opacity logit and harmonics;
    `mask` multiplies the values before the addition.
    """

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
    columns = features(cloud, deformation, graph, time)
    hidden = columns.reshape(1, *columns.shape, 1)
    for index, layer in enumerate(deformation.trunk):
        hidden = convolved(hidden, layer, f"trunk_{index}").unary("Relu")
    gaussians = move(cloud, deformation, hidden)
    return finish(graph, gaussians, [normalized_time()], reach(cloud, deformation), facts, options)


def check(cloud: Cloud, deformation: Deformation) -> None:
    """Raises checkpoint/mismatch if planes, network and Gaussians do not fit."""
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
    """Corners around all centers at all times: at the planes' own times, between which features are linear, enlarged
    by a hundredth of the scene for the nonlinearity of the network.
    """
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
    """Evaluates the graph's `mlp` in NumPy, to compute the bounds."""
    for index, layer in enumerate(layers):
        x = (np.maximum(x, 0) if index else x) @ layer.weight.T.astype(np.float64) + layer.bias
    return x


def features(cloud: Cloud, deformation: Deformation, graph: Graph, time: Tensor) -> Tensor:
    """The planes' features (sum of C, rows), a column for each Gaussian of each instance, in the order of sampling."""
    at = plane_coordinates(cloud, deformation)
    products, still = [], []
    for level, planes in enumerate(deformation.resolutions):
        of_level = dict(zip(PLANES, planes, strict=True))
        moving = [of_level[axis, TIME] for axis in range(TIME)]
        products.append(sampled_in_time(graph, moving, at, time, level))
        at_rest = [sample_plane(plane, at[:, a], at[:, b]) for (a, b), plane in of_level.items() if b != TIME]
        still.append(graph.constant(np.prod(at_rest, 0).T, f"still_{level}"))
    product, rest = graph.concat(products, 0), graph.concat(still, 0)
    channels, count = rest.shape
    if graph.lead:
        product, rest = product.reshape(channels, *graph.lead, count), rest.reshape(channels, 1, count)
    return (product * rest).reshape(channels, prod(product.shape[1:]))


def sampled_in_time(graph: Graph, planes: Sequence[Floats], at: Doubles, time: Tensor, level: int) -> Tensor:
    """The product (C, rows) of the planes of x, y and z with time, in one sampling of all three."""
    height, width = (max(plane.shape[axis] for plane in planes) for axis in (1, 2))
    # Pads smaller planes with their border, as border padding would sample them.
    whole = [np.pad(p, ((0, 0), (0, height - p.shape[1]), (0, width - p.shape[2])), "edge") for p in planes]
    across = [(np.clip(at[:, i], -1, 1) + 1) * share(p.shape[2], width) - 1 for i, p in enumerate(planes)]
    down = [share(plane.shape[1], height) for plane in planes]
    x = graph.constant(np.stack(across)[..., None], f"across_{level}", errors="even")
    y = graph.constant(np.reshape(down, (3, 1, 1)) - 1, "down").expand(*x.shape)
    rest = graph.concat([x, y], 2)
    by_time = graph.constant(np.stack([np.zeros(3), down], 1), "by_time")
    count, channels = len(at), planes[0].shape[0]
    if graph.lead:
        moved = time.reshape(1, *graph.lead, 1, 1) * by_time.reshape(3, 1, 1, 2)
        grid = rest.reshape(3, 1, count, 2) + moved
    else:
        grid = rest + time * by_time.reshape(3, 1, 2)
    rows = prod(grid.shape[1:-1])
    values = graph.node(
        "GridSample",
        [graph.constant(np.stack(whole), f"planes_{level}"), grid.reshape(3, rows, 1, 2)],
        (3, channels, rows, 1),
        mode="bilinear",
        padding_mode="border",
        align_corners=1,
    )
    return values.product(0).reshape(channels, rows)


def share(size: int, of: int) -> float:
    """The fraction of a padded plane's length that the plane's own points take."""
    return (size - 1) / (of - 1) if of > 1 else 0.0


def move(cloud: Cloud, deformation: Deformation, hidden: Tensor) -> Gaussians:
    """The Gaussians with the changes of the heads. hidden (1, W, rows, 1), after its ReLU."""
    graph, count = hidden.graph, len(cloud.positions)
    at_rest = {
        "position": graph.constant(cloud.positions, "positions", errors="even"),
        "scale": graph.constant(cloud.log_scales, "log_scales"),
        "rotation": graph.constant(cloud.rotations, "rotations"),
        "opacity": graph.constant(np.clip(cloud.opacity_logits, -88, 88), "opacity_logits"),
        "sh": graph.constant(cloud.sh.reshape(count, -1), "sh"),
    }
    heads = {name: layers for name in at_rest if (layers := getattr(deformation, name)) is not None}
    now = at_rest | moved(deformation, graph, hidden, heads, at_rest)
    sh = now["sh"]
    return Gaussians(
        positions=now["position"],
        scales=graph.constant(np.exp(np.float64(cloud.log_scales)), "scales") if "scale" not in heads else None,
        log_scales=now["scale"] if "scale" in heads else None,
        rotations=now["rotation"],
        opacities=graph.constant(sigmoid(cloud.opacity_logits), "opacities") if "opacity" not in heads else None,
        opacity_logits=now["opacity"] if "opacity" in heads else None,
        sh=sh.reshape(*sh.shape[:-1], *cloud.sh.shape[1:]),
    )


def moved(
    deformation: Deformation,
    graph: Graph,
    hidden: Tensor,
    heads: dict[str, Sequence[Linear]],
    at_rest: dict[str, Tensor],
) -> dict[str, Tensor]:
    """Attributes that a head changes, at the current time. Heads of one depth run as one network: few dispatches."""
    if not heads:
        return {}
    sizes = {name: layers[-1].outputs for name, layers in heads.items()}
    total, count = sum(sizes.values()), at_rest["position"].shape[0]
    rest = graph.concat([at_rest[name] for name in heads], 1)
    if graph.lead or deformation.mask is not None:
        changes = together(hidden, list(heads.values())).reshape(*graph.lead, count, total)
        if deformation.mask is not None:
            mask = mlp(rows_of(hidden), deformation.mask, "mask").reshape(*graph.lead, count, 1)
            # The mask does not apply to rotations.
            free = np.concatenate([np.full(size, name == "rotation", np.float32) for name, size in sizes.items()])
            rest = rest * (mask * graph.constant(1 - free, "masked") + graph.constant(free, "free"))
        changes = changes + rest
    else:
        changes = together(hidden, list(heads.values()), rest)
    ends = np.cumsum(list(sizes.values()))
    return {name: changes.part(int(end - sizes[name]), int(end)) for name, end in zip(sizes, ends, strict=True)}


def together(hidden: Tensor, heads: Sequence[Sequence[Linear]], plus: Tensor | None = None) -> Tensor:
    """Outputs (rows, sum of outputs) of several networks on the same columns (1, W, rows, 1), and `plus`."""
    if len({len(layers) for layers in heads}) > 1:
        rows = rows_of(hidden)
        apart = hidden.graph.concat([mlp(rows, layers, "head") for layers in heads], 1)
        return apart if plus is None else apart + plus
    first, *rest = zip(*heads, strict=True)
    one = [stacked(first), *(beside(layers) for layers in rest)]
    bias = hidden.graph.constant(one[-1].bias, "heads_bias")
    x = hidden
    for index, layer in enumerate(one[:-1]):
        x = convolved(x, layer, f"heads_{index}").unary("Relu")
    return linear(rows_of(x), one[-1], "heads_end", None if plus is None else plus + bias)
