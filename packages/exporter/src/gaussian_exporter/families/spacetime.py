"""SpacetimeGaussians, lite: each Gaussian is visible around its own time, moves along a cubic curve and rotates
evenly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import onnx

from ..arrays import Doubles, Floats, sigmoid
from ..contract import Facts, normalized_time
from ..graph import Graph
from ..outputs import Gaussians, Options, finish


@dataclass(frozen=True)
class Spacetime:
    """positions (N,3) at the time of each, centers (N,1) of it, 0 to 1; widths (N,1): logarithm of its lifetime;
    motion (N,9): velocity, and the factors of the square and the cube; rotations (N,4) w x y z with turns (N,4)
    added in a unit of time; log_scales (N,3); opacity_logits (N,1); colors (N,3), plain.
    """

    positions: Floats
    centers: Floats
    widths: Floats
    motion: Floats
    rotations: Floats
    turns: Floats
    log_scales: Floats
    opacity_logits: Floats
    colors: Floats


def export_spacetime(model: Spacetime, facts: Facts, options: Options | None = None) -> onnx.ModelProto:
    """A generator of the Gaussians at a time from 0 to 1."""
    options = options or Options()
    graph = Graph("spacetime", options.weights, options.instances is not None)
    count = len(model.positions)
    time = graph.input("time", *graph.lead, 1)
    since = time.reshape(*graph.lead, 1, 1) - graph.constant(model.centers, "centers", "none")
    velocity, squares, cubes = (
        graph.constant(model.motion[:, i : i + 3], name) for i, name in ((0, "velocity"), (3, "squares"), (6, "cubes"))
    )
    moved = since * (velocity + since * (squares + since * cubes))
    share = since * graph.constant(np.exp(-np.float64(model.widths)), "shortness")
    opacities = graph.constant(sigmoid(model.opacity_logits), "opacities") * (share * share * -1.0).unary("Exp")
    gaussians = Gaussians(
        positions=moved + graph.constant(model.positions, "positions", "even"),
        scales=graph.constant(np.exp(np.float64(model.log_scales)), "scales"),
        rotations=since * graph.constant(model.turns, "turns") + graph.constant(model.rotations, "rotations"),
        opacities=opacities.reshape(*graph.lead, count, 1),
        colors=graph.constant(model.colors, "colors"),
    )
    return finish(graph, gaussians, [normalized_time()], reach(model), facts, options)


def reach(model: Spacetime) -> tuple[Doubles, Doubles]:
    """Corners around the visible centers at 65 times, enlarged by a hundredth."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for time in np.linspace(0, 1, 65):
        t = time - np.float64(model.centers)
        seen = np.exp(-((t * np.exp(-np.float64(model.widths))) ** 2))[:, 0] > 1 / 255
        at = model.positions + t * (model.motion[:, :3] + t * (model.motion[:, 3:6] + t * model.motion[:, 6:9]))
        # Positions of invisible Gaussians do not count; each Gaussian is visible at its own time.
        if seen.any():
            low, high = np.minimum(low, at[seen].min(0)), np.maximum(high, at[seen].max(0))
    low, high = np.minimum(low, model.positions.min(0)), np.maximum(high, model.positions.max(0))
    slack = 0.01 * (high - low)
    return low - slack, high + slack
