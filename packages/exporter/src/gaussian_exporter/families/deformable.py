"""Deformable-3D-Gaussians: a network of position and time computes the difference of each Gaussian from its canonical
state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import onnx

from ..arrays import Doubles, Floats
from ..contract import Facts, normalized_time
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..outputs import Gaussians, Options, finish
from ..pieces.covariance import PRODUCTS, covariance_of_half
from ..pieces.mlp import Linear, linear, mlp
from .classic import Cloud, usable


@dataclass(frozen=True)
class Deform:
    """The network: layers, of which the first and the one after `skip` take the codes of position and time (the latter
    beside the previous layer); time_network turns the time's code into another, if there is one; heads add to
    positions, quaternions of length 1 and standard deviations. Codes are x, sin and cos of x times powers of two.
    """

    layers: Sequence[Linear]
    position: Linear
    rotation: Linear
    scale: Linear
    time_network: Sequence[Linear] | None
    place_octaves: int = 10
    time_octaves: int = 10
    skip: int = 4


def export_deformable(cloud: Cloud, deform: Deform, facts: Facts, options: Options | None = None) -> onnx.ModelProto:
    """A generator of the cloud's Gaussians at a time from 0 to 1. Covariances are written, because the trainer's
    rasterizer does not normalize the changed quaternions, which affects the shapes.
    """
    options = options or Options()
    cloud = usable(cloud)
    graph = Graph("deformable", options.weights)
    time = graph.input("time", 1)
    places = graph.constant(code(cloud.positions, deform.place_octaves), "places", "none")
    check(deform, places.shape[1])
    hidden = trunk(deform, places, time_code(deform, time))
    scales = linear(hidden, deform.scale, "scales") + graph.constant(
        np.exp(np.float64(cloud.log_scales)), "scales_rest"
    )
    turns = cloud.rotations / np.linalg.norm(cloud.rotations, axis=1, keepdims=True)
    rotations = linear(hidden, deform.rotation, "rotations", graph.constant(turns + deform.rotation.bias, "turns"))
    count = len(cloud.positions)
    products = (rotations.reshape(count, 4, 1) * rotations.reshape(count, 1, 4)).reshape(count, 16)
    # 1 - 2(yy + zz) and similar terms, which are the quaternion's rotation only for length 1.
    matrices = products @ graph.constant(UNNORMED, "quaternion_products") + graph.constant(
        np.eye(3).reshape(1, 9), "one"
    )
    half = matrices.reshape(count, 3, 3) * scales.reshape(count, 1, 3)
    gaussians = Gaussians(
        positions=linear(hidden, deform.position, "positions") + graph.constant(cloud.positions, "rest", "even"),
        covariances=covariance_of_half(half),
        opacities=graph.constant(1 / (1 + np.exp(-np.clip(np.float64(cloud.opacity_logits), -88, 88))), "opacities"),
        sh=graph.constant(cloud.sh, "sh"),
    )
    return finish(graph, gaussians, [normalized_time()], reach(cloud, deform), facts, options)


# PRODUCTS for quaternions of any length, except for the diagonal: 1 - 2(yy + zz) instead of ww + xx - yy - zz.
UNNORMED: Floats = PRODUCTS.copy()
for _row in range(4):
    for _entry in (0, 4, 8):
        UNNORMED[5 * _row, _entry] = min(0, PRODUCTS[5 * _row, _entry]) * 2
    UNNORMED[0, (0, 4, 8)] = 0


def code(x: Doubles | Floats, octaves: int) -> Doubles:
    """x, then sin and cos of x times 1, 2, 4 ... (N, width (2 octaves + 1)); multiplied in float32, as trained."""
    parts = [np.float64(x)]
    for octave in range(octaves):
        angle = np.float64(np.float32(x) * np.float32(2**octave))
        parts += [np.sin(angle), np.cos(angle)]
    return np.concatenate(parts, 1)


def time_code(deform: Deform, time: Tensor) -> Tensor:
    """The code of the time (1, T)."""
    at = time.reshape(1, 1)
    angles = [at * float(2**octave) for octave in range(deform.time_octaves)]
    parts = [at, *(angle.unary(name) for angle in angles for name in ("Sin", "Cos"))]
    coded = time.graph.concat(parts, 1)
    return mlp(coded, deform.time_network, "time") if deform.time_network else coded


def trunk(deform: Deform, places: Tensor, time: Tensor) -> Tensor:
    """Input of the heads (N,W). Columns of time, position and the previous layer are multiplied separately, because the
    code of the time is one row for all Gaussians."""
    hidden: Tensor | None = None
    width, moments = places.shape[1], time.shape[1]
    for index, layer in enumerate(deform.layers):
        if index in (0, deform.skip + 1):
            weight = layer.weight
            of_time = linear(time, Linear(weight[:, width : width + moments], layer.bias), f"time_{index}")
            given = linear(places, Linear(weight[:, :width], np.zeros_like(layer.bias)), f"place_{index}", of_time)
            if hidden is not None:
                given = linear(hidden, Linear(weight[:, width + moments :], layer.bias), f"layer_{index}", given)
            hidden = given.unary("Relu")
        elif hidden is not None:
            hidden = linear(hidden, layer, f"layer_{index}").unary("Relu")
    assert hidden is not None
    return hidden


def check(deform: Deform, places: int) -> None:
    """Raises checkpoint/mismatch if the layers do not fit."""
    moments = deform.time_network[-1].outputs if deform.time_network else 2 * deform.time_octaves + 1
    first, after = deform.layers[0], deform.layers[deform.skip + 1]
    expected = (places + moments, places + moments + first.outputs)
    if (first.inputs, after.inputs) != expected:
        raise ExportError(
            "checkpoint/mismatch",
            where="deform.pth",
            expected=f"layers 0 and {deform.skip + 1} with {expected[0]} and {expected[1]} inputs",
            found=f"{first.inputs} and {after.inputs}",
            remedy="the network is not DeformNetwork of Deformable-3D-Gaussians with its own options",
        )


def deformed(cloud: Cloud, deform: Deform, time: float) -> Doubles:
    """Positions at a time, on numbers."""
    places = code(cloud.positions, deform.place_octaves)
    moment = code(np.array([[time]]), deform.time_octaves)
    for index, layer in enumerate(deform.time_network or []):
        moment = (np.maximum(moment, 0) if index else moment) @ np.float64(layer.weight).T + layer.bias
    codes = np.concatenate([places, np.repeat(moment, len(places), 0)], 1)
    x = codes
    for index, layer in enumerate(deform.layers):
        x = np.maximum(x @ np.float64(layer.weight).T + layer.bias, 0)
        x = np.concatenate([codes, x], 1) if index == deform.skip else x
    moved: Doubles = cloud.positions + x @ np.float64(deform.position.weight).T + deform.position.bias
    return moved


def reach(cloud: Cloud, deform: Deform) -> tuple[Doubles, Doubles]:
    """Corners around all centers at nine times, enlarged by a twentieth for motion between them."""
    all_of_it = [deformed(cloud, deform, time) for time in np.linspace(0, 1, 9)]
    low, high = np.min([at.min(0) for at in all_of_it], 0), np.max([at.max(0) for at in all_of_it], 0)
    slack = 0.05 * (high - low)
    return low - slack, high + slack
