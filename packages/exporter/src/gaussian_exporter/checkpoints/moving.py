"""Checkpoints of Gaussians that move: SpacetimeGaussians (lite), Deformable-3D-Gaussians, 4D Gaussian Splatting."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import ExportError
from ..families.classic import Cloud, cloud_of_vertices
from ..families.deformable import Deform
from ..families.gaussian4d import Gaussian4D, Rotation4D
from ..families.spacetime import Spacetime
from ..pieces.mlp import Linear
from .cfg_args import require_cfg_args
from .clouds import captured_of, unknown
from .files import existing, latest_iteration
from .kinds import other_family, refuse_other_properties, unfiltered
from .ply import Vertices, read_ply
from .torch_file import Weights, read_torch, read_weights
from .unread import refuse_settings


def read_spacetime(path: Path, ignored: Sequence[str] = ()) -> Spacetime:
    """The folder of a training of SpacetimeGaussians, or the PLY file of its lite model."""
    existing(path, "the folder of a SpacetimeGaussians training, or its point_cloud.ply")
    vertices = read_ply(latest_iteration(path) / "point_cloud.ply" if path.is_dir() else path)
    if "f_t_0" in vertices.names or "trbf_center" not in vertices.names:
        # The first has its own family; the second is not a model of this family.
        refuse_other_properties(vertices.names, vertices.path)

    def numbered(prefix: str, count: int) -> Floats:
        return vertices.columns(*(f"{prefix}_{i}" for i in range(count)))

    model = Spacetime(
        positions=vertices.columns("x", "y", "z"),
        centers=vertices.columns("trbf_center"),
        widths=vertices.columns("trbf_scale"),
        motion=numbered("motion", 9),
        rotations=numbered("rot", 4),
        turns=numbered("omega", 4),
        log_scales=numbered("scale", 3),
        opacity_logits=vertices.columns("opacity"),
        colors=numbered("f_dc", 3),
    )
    vertices.refuse_unread(ignored)
    return model


def read_deformable(folder: Path, ignored: Sequence[str] = ()) -> tuple[Cloud, Deform]:
    """The folder of a training of Deformable-3D-Gaussians: point_cloud/ and deform/ of the same iteration."""
    existing(folder, "the folder of a Deformable-3D-Gaussians training")
    point_cloud = latest_iteration(folder)
    network = folder / "deform" / point_cloud.name / "deform.pth"
    vertices: Vertices = read_ply(point_cloud / "point_cloud.ply")
    refuse_other_properties(vertices.names, vertices.path, ignored)
    weights = read_weights(existing(network, "the network of that iteration"))
    deform = deform_of(weights)
    weights.refuse_unread(ignored)
    return unfiltered(cloud_of_vertices(vertices), vertices.path), deform


def deform_of(weights: Weights) -> Deform:
    """The state_dict of its DeformNetwork."""
    if "branch_w.weight" in weights:
        raise ExportError(
            "checkpoint/unsupported",
            where=weights.where,
            expected="a network that adds to places (gaussian_warp)",
            found="one that moves them as rigid bodies (is_6dof: branch_w, branch_v)",
            remedy="train without --is_6dof",
        )

    def layer(name: str) -> Linear:
        return Linear(weights.get(f"{name}.weight"), weights.get(f"{name}.bias"))

    is_blender = "timenet.0.weight" in weights
    return Deform(
        layers=[layer(f"linear.{i}") for i in range(weights.under("linear").count())],
        position=layer("gaussian_warp"),
        rotation=layer("gaussian_rotation"),
        scale=layer("gaussian_scaling"),
        time_network=weights.under("timenet").linears() if is_blender else None,
        time_octaves=6 if is_blender else 10,
    )


def read_gaussian4d(
    path: Path,
    ignored: Sequence[str] = (),
    duration: Sequence[float] | None = None,
    rotation: Rotation4D = "reversed",
) -> Gaussian4D:
    """chkpnt*.pth of 4D Gaussian Splatting, or the folder with one, cfg_args beside it. `duration`: first and last
    second, time_duration of the configuration that it was trained with; `rotation`: see Gaussian4D."""
    existing(path, "the folder of a 4D Gaussian Splatting training, or its chkpnt*.pth")
    if path.is_dir():
        found = [(int(m[1]), p) for p in path.glob("chkpnt*.pth") if (m := re.fullmatch(r"chkpnt(\d+)\.pth", p.name))]
        best = path / "chkpnt_best.pth"
        path = max(found)[1] if found else existing(best, "a file chkpnt*.pth")
    content = read_torch(path)
    captured = captured_of(content)
    if captured is None or len(captured) != 19:
        raise unknown(path, content)
    settings = require_cfg_args(
        path.parent, "it says how the time was scaled and filtered (frame_ratio, prefilter_var)"
    )
    harmless = (
        "loaded_pth|extension|frame_ratio|num_extra_pts|num_pts|num_pts_ratio|prefilter_var|dataloader|time_duration"
    )
    harmless += "|rot_4d|gaussian_dim|force_sh_3d|batch_size|exhaust_test|config|seed"
    refuse_settings(path.parent / "cfg_args", settings, ignored, harmless)
    played = _seconds(path, settings, duration)
    return gaussian4d_of(path, captured, {**settings, "time_duration": played}, rotation)


def _seconds(path: Path, settings: dict[str, object], given: Sequence[float] | None) -> list[float]:
    """First and last second of the playback. The trainer divides those of its configuration by the frame ratio, and
    writes neither into cfg_args.
    """
    duration = settings.get("time_duration") if given is None else given
    if not isinstance(duration, (list, tuple)) or len(duration) != 2 or not float(duration[0]) < float(duration[1]):
        raise ExportError(
            "checkpoint/incomplete",
            where=str(path),
            expected="the first and the last second (time_duration), which the trainer does not save",
            found=repr(duration),
            remedy="give --time-duration START END, as in the configuration (configs/*.yaml)",
        )
    ratio = settings.get("frame_ratio", 1)
    divisor = float(ratio) if isinstance(ratio, (int, float)) and ratio > 1 else 1.0
    return [float(second) / divisor for second in duration]


def gaussian4d_of(
    path: Path, captured: Sequence[Any], settings: dict[str, Any], rotation: Rotation4D = "reversed"
) -> Gaussian4D:
    """Reads the tuple of `GaussianModel.capture` of 4D Gaussians; settings: time_duration and prefilter_var."""
    degree, positions, dc, rest, log_scales, rotations, opacity_logits = captured[:7]
    times, log_scales_t, rotations_r, is_turned, environment, degree_t = captured[13:]
    duration = settings["time_duration"]
    if getattr(environment, "size", 0):
        raise other_family(path, "4D Gaussian Splatting", "an environment map behind its Gaussians", "train without")
    terms = (int(degree) + 1) ** 2
    if int(degree_t) and not settings.get("force_sh_3d"):
        terms = 16 * (int(degree_t) + 1)
    variance = settings.get("prefilter_var", -1)

    def floats(x: Any) -> Floats:
        return np.asarray(x, np.float32)

    return Gaussian4D(
        positions=floats(positions),
        times=floats(times),
        log_scales=floats(log_scales),
        log_scales_t=floats(log_scales_t),
        rotations=floats(rotations),
        rotations_r=floats(rotations_r) if is_turned else None,
        opacity_logits=floats(opacity_logits),
        sh=np.concatenate([dc, rest], 1)[:, :terms].astype(np.float32),
        start=float(duration[0]),
        end=float(duration[1]),
        filter=max(0.0, float(variance)) if isinstance(variance, (int, float)) else 0.0,
        rotation=rotation,
    )
