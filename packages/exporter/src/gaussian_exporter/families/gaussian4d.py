"""4D Gaussian Splatting: Gaussians of space and time, cut at the shown time.

A cut through a Gaussian of four dimensions has three dimensions: its covariance never changes, its center moves
evenly, and its opacity falls with the distance in time. So everything is baked except one product and one
exponential a Gaussian; and, if harmonics change with time, their sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Literal

import numpy as np
import onnx

from ..arrays import Doubles, Floats, covariances, sigmoid
from ..contract import Facts, normalized_time
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..outputs import Gaussians, Options, finish
from ..pieces.covariance import UPPER

Rotation4D = Literal["reversed", "straight"]
# A Gaussian is drawn while its factor of time (0..1) is above this.
_MIN = 0.05


@dataclass(frozen=True)
class Gaussian4D:
    """positions (N,3) and times (N,1); log_scales (N,3) and log_scales_t (N,1); rotations (N,4), and rotations_r (N,4)
    of the second quaternion of a rotation in four dimensions, None without; opacity_logits (N,1); sh (N,K,3), of which
    further sets of 16 belong to cos of the distance in time, and of twice it. start and end: seconds that are played;
    filter: variance of time that is added where there is one. rotation: the order of axes of the matrices that the two
    quaternions stand for. The trainer's code has reversed both axes since 2024-09-15, and no checkpoint says by which
    of the two it was trained."""

    positions: Floats
    times: Floats
    log_scales: Floats
    log_scales_t: Floats
    rotations: Floats
    rotations_r: Floats | None
    opacity_logits: Floats
    sh: Floats
    start: float
    end: float
    filter: float = 0.0
    rotation: Rotation4D = "reversed"


def export_gaussian4d(model: Gaussian4D, facts: Facts, options: Options | None = None) -> onnx.ModelProto:
    """A generator of the cuts at a time from 0 to 1, which maps to `start` to `end`."""
    options = options or Options()
    graph = Graph("gaussian4d", options.weights)
    time = graph.input("time", 1)
    cut = cuts(model)
    now = time * float(model.end - model.start) + float(model.start)
    since = now.reshape(1, 1) - graph.constant(model.times, "times", "none")
    share = ((since * since) * graph.constant(-0.5 / cut.variances, "shortness")).unary("Exp")
    # Gaussians that are not drawn get opacity 0, so that every Gaussian keeps its row.
    seen = graph.node("Greater", [share, graph.scalar(_MIN)], share.shape)
    share = graph.node("Where", [seen, share, graph.scalar(0.0)], share.shape)
    gaussians = Gaussians(
        positions=since * graph.constant(cut.velocities, "velocities")
        + graph.constant(model.positions, "positions", "even"),
        covariances=graph.constant(cut.covariances, "covariances", "none"),
        opacities=share * graph.constant(sigmoid(model.opacity_logits), "opacities"),
        sh=harmonics(model, graph, since),
    )
    return finish(graph, gaussians, [normalized_time()], reach(model, cut), facts, options)


def harmonics(model: Gaussian4D, graph: Graph, since: Tensor) -> Tensor:
    """Harmonics (N,(d+1)^2,3): constant ones, and those that depend on the time."""
    count, terms = model.sh.shape[:2]
    if terms not in (1, 4, 9, 16, 32, 48):
        raise ExportError(
            "checkpoint/unsupported",
            where="harmonics",
            expected="1, 4, 9 or 16 of them, or 32 or 48 with those of time",
            found=str(terms),
            remedy="train with sh_degree 3 where sh_degree_t is above 0",
        )
    total = graph.constant(model.sh[:, :16], "sh")
    for order in range(1, terms // 16):
        wave = (since * (2 * pi * order / (model.end - model.start))).unary("Cos").reshape(count, 1, 1)
        total = total + wave * graph.constant(model.sh[:, 16 * order : 16 * (order + 1)], f"sh_{order}")
    return total


@dataclass(frozen=True)
class Cuts:
    """covariances (N,6) of any cut; velocities (N,3) of its center; variances (N,1) in time."""

    covariances: Doubles
    velocities: Doubles
    variances: Doubles


def cuts(model: Gaussian4D) -> Cuts:
    """The parts of a cut that do not depend on time."""
    scales, scale_t = np.exp(np.float64(model.log_scales)), np.exp(np.float64(model.log_scales_t))
    if model.rotations_r is None:
        # The trainer uses the scale of time itself as the variance.
        return Cuts(covariances(scales, model.rotations), np.zeros((len(scales), 3)), scale_t + model.filter)
    turns = rotations_4d(model.rotations, model.rotations_r)
    turns = turns[:, ::-1, ::-1] if model.rotation == "reversed" else turns
    half = turns * np.concatenate([scales, scale_t], 1)[:, None, :]
    full = half @ half.transpose(0, 2, 1)
    across, variance = full[:, :3, 3], full[:, 3:, 3]
    cut = full[:, :3, :3] - across[:, :, None] * across[:, None, :] / variance[:, :, None]
    upper = np.stack([cut[:, row, column] for row, column in UPPER], 1)
    return Cuts(upper, across / variance, variance + model.filter)


def rotations_4d(left: Floats, right: Floats) -> Doubles:
    """Matrices (N,4,4) of two quaternions w x y z of any length but 0, time last."""
    a, b, c, d = (np.float64(left) / np.linalg.norm(np.float64(left), axis=1, keepdims=True)).T
    p, q, r, s = (np.float64(right) / np.linalg.norm(np.float64(right), axis=1, keepdims=True)).T
    from_left = np.stack([a, -b, -c, -d, b, a, -d, c, c, d, a, -b, d, -c, b, a], 1).reshape(-1, 4, 4)
    from_right = np.stack([p, q, r, s, -q, p, -s, r, -r, s, p, -q, -s, -r, q, p], 1).reshape(-1, 4, 4)
    product: Doubles = from_left @ from_right
    return product


def reach(model: Gaussian4D, cut: Cuts) -> tuple[Doubles, Doubles]:
    """Corners around all centers while they are visible: they move evenly, so both ends are enough."""
    lives = np.sqrt(-2 * np.log(_MIN) * cut.variances)
    ends = [np.clip(model.times + sign * lives, model.start, model.end) - model.times for sign in (-1, 1)]
    places = np.concatenate([model.positions + end * cut.velocities for end in ends])
    return places.min(0), places.max(0)
