"""Classic 3DGS: every Gaussian as trained.

With its harmonics the file is constant, so a page runs it once. With `colors="view"` the harmonics are evaluated in
the graph from the camera's position, which makes the output 13 numbers a Gaussian instead of up to 58.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import onnx

from ..arrays import AnyArray, Floats, covariances, sigmoid
from ..checkpoints.ply import Vertices
from ..contract import Facts, Filter, Up, camera_position
from ..errors import ExportError
from ..graph import Graph
from ..outputs import Gaussians, Options, finish
from ..pieces import harmonics
from ..pieces.view import direction_and_distance

Colors = Literal["sh", "view"]


@dataclass(frozen=True)
class Cloud:
    """Gaussians of a PLY file: positions (N,3), log_scales (N,3), rotations (N,4) w x y z, opacity_logits (N,1), sh
    (N,(degree+1)^2,3). filter, up: those of the training, if its settings declare them. note: what they do not declare.
    """

    positions: Floats
    log_scales: Floats
    rotations: Floats
    opacity_logits: Floats
    sh: Floats
    filter: Filter | None = field(default=None, kw_only=True)
    up: Up | None = field(default=None, kw_only=True)
    note: str | None = field(default=None, kw_only=True)


def cloud_of_vertices(vertices: Vertices) -> Cloud:
    """INRIA's columns. Raises for harmonics of a degree other than 0 to 3."""
    dc = vertices.columns("f_dc_0", "f_dc_1", "f_dc_2")
    rest = vertices.numbered("f_rest_")
    usable_degree(rest.shape[1] / 3, vertices.path)
    # The file holds all of red's coefficients, then green's, then blue's.
    rest = rest.reshape(len(vertices), 3, -1).transpose(0, 2, 1)
    cloud = Cloud(
        vertices.columns("x", "y", "z"),
        vertices.columns("scale_0", "scale_1", "scale_2"),
        vertices.columns("rot_0", "rot_1", "rot_2", "rot_3"),
        vertices.columns("opacity"),
        np.concatenate([dc[:, None], rest], 1),
    )
    return filtered(cloud, vertices.columns("filter_3D")) if "filter_3D" in vertices.names else cloud


def usable_degree(rest: float, where: Path) -> None:
    """Raises checkpoint/unsupported for harmonics of a degree above 3; `rest`: coefficients after the first."""
    if rest not in (0, 3, 8, 15):
        raise ExportError(
            "checkpoint/unsupported",
            where=str(where),
            expected="1, 4, 9 or 16 coefficients of harmonics (0, 9, 24 or 45 properties f_rest_*)",
            found=f"{rest + 1:g}",
            remedy="harmonics are read up to degree 3",
        )


def filtered(cloud: Cloud, widths: Floats) -> Cloud:
    """Mip-Splatting's Gaussians as they are drawn: at least as wide as the filter of their cameras, and with opacities
    reduced accordingly.
    """
    squared = np.exp(2 * np.float64(cloud.log_scales))
    wider = squared + np.float64(widths) ** 2
    fainter = np.sqrt(squared.prod(1, keepdims=True) / wider.prod(1, keepdims=True))
    opacity = np.clip(sigmoid(cloud.opacity_logits) * fainter, 1e-12, 1 - 1e-7)
    logits = np.log(opacity) - np.log1p(-opacity)
    wide = (0.5 * np.log(wider)).astype(np.float32)
    return replace(cloud, log_scales=wide, opacity_logits=logits.astype(np.float32), filter="mip")


def usable(cloud: Cloud) -> Cloud:
    """Without Gaussians that cannot be drawn."""
    kept = usable_rows(cloud)
    names = ("positions", "log_scales", "rotations", "opacity_logits", "sh")
    return replace(cloud, **{name: getattr(cloud, name)[kept] for name in names})


def usable_rows(cloud: Cloud) -> AnyArray:
    """Whether each Gaussian (N) can be drawn: it is finite, its quaternion not 0. Opacities may be infinite."""
    sh = cloud.sh.reshape(len(cloud.sh), -1)
    numbers = np.concatenate([cloud.positions, cloud.log_scales, cloud.rotations, sh], 1)
    kept: AnyArray = (
        np.isfinite(numbers).all(1) & (np.abs(cloud.rotations).max(1) > 0) & ~np.isnan(cloud.opacity_logits[:, 0])
    )
    if not kept.any():
        raise ExportError(
            "checkpoint/unreadable",
            where="the Gaussians",
            expected="at least one that can be drawn",
            found=f"{len(kept)} with numbers that are not finite",
            remedy="training diverged; export an earlier checkpoint",
        )
    return kept


def export_classic(
    cloud: Cloud, facts: Facts, options: Options | None = None, colors: Colors = "sh"
) -> onnx.ModelProto:
    """A generator of the cloud's Gaussians, activated: opacities 0..1, covariances in world units squared."""
    options = options or Options()
    cloud = usable(cloud)
    if facts.filter is None and not facts.antialiased:
        facts = replace(facts, filter=cloud.filter)
    if facts.coordinates.up is None:
        facts = replace(facts, coordinates=replace(facts.coordinates, up=cloud.up))
    graph = Graph("classic", options.weights)
    positions = graph.constant(cloud.positions, "positions", errors="even")
    sh = graph.constant(cloud.sh, "sh")
    inputs = []
    seen = None
    if colors == "view":
        camera = graph.input("camera_position", 3)
        inputs.append(camera_position())
        seen = harmonics.color(direction_and_distance(positions, camera)[0], sh)
    scales = np.exp(np.float64(cloud.log_scales))
    turns = cloud.rotations / np.linalg.norm(cloud.rotations, axis=1, keepdims=True)
    axes = options.wants_axes
    gaussians = Gaussians(
        positions=positions,
        covariances=None if axes else graph.constant(covariances(scales, cloud.rotations), "covariances", "none"),
        scales=graph.constant(scales, "scales") if axes else None,
        rotations=graph.constant(turns, "rotations") if axes else None,
        opacities=graph.constant(sigmoid(cloud.opacity_logits), "opacities"),
        colors=seen,
        sh=sh if seen is None else None,
    )
    bounds = cloud.positions.min(0), cloud.positions.max(0)
    if options.layout is None and not axes:
        # Most columns never change, so one operator copies them beside the colors.
        options = replace(options, layout="packed")
    return finish(graph, gaussians, inputs, bounds, facts, options)
