"""The output folder of 4DGaussians: point_cloud.ply and deformation.pth of an iteration, cfg_args."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..arrays import Floats
from ..errors import ExportError
from ..families.classic import Cloud, cloud_of_vertices
from ..families.hexplane import PLANES, Deformation
from ..pieces.mlp import Linear
from .cfg_args import require_cfg_args
from .files import existing, latest_iteration
from .kinds import refuse_other_properties, unfiltered
from .ply import read_ply
from .torch_file import Weights, read_weights

# The trainer's own defaults, which apply unless a cfg_args overrides them.
_DEFAULTS = {"no_dx": False, "no_ds": False, "no_dr": False, "no_do": True, "no_dshs": True}
_REFUSED = {
    "no_grid": "without its planes",
    "empty_voxel": "with a grid of empty voxels",
    "apply_rotation": "with rotations that are multiplied",
}


# Heads of the network, and the settings that turn them off.
_SWITCHES = {
    "pos_deform": "no_dx",
    "scales_deform": "no_ds",
    "rotations_deform": "no_dr",
    "opacity_deform": "no_do",
    "shs_deform": "no_dshs",
}


def read_hexplane(folder: Path, ignored: Sequence[str] = ()) -> tuple[Cloud, Deformation]:
    """Reads the latest iteration."""
    point_cloud = latest_iteration(existing(folder, "the folder of a 4DGaussians training"))
    why = "it names the heads of the network in use (no_do, no_dshs), which no file of weights contains"
    settings = _DEFAULTS | require_cfg_args(folder, why)
    for name, what in _REFUSED.items():
        if settings.get(name):
            raise _unsupported(folder, f"a model {what} ({name})")
    if settings.get("grid_pe"):
        raise _unsupported(folder, "a model with encoded plane features (grid_pe)")
    weights = read_weights(point_cloud / "deformation.pth")
    vertices = read_ply(point_cloud / "point_cloud.ply")
    refuse_other_properties(vertices.names, vertices.path, ignored)
    cloud = unfiltered(cloud_of_vertices(vertices), vertices.path)
    deformation = deformation_of(weights.under("deformation_net"), settings)
    off = "|".join(head for head, switch in _SWITCHES.items() if settings[switch])
    # Networks of the trainer's first versions, which its forward pass does not call.
    weights.refuse_unread(ignored, rf"timenet\..*|.*_poc|deformation_net\.({off}|static_mlp)\..*")
    return cloud, deformation


def deformation_of(weights: Weights, settings: dict[str, object]) -> Deformation:
    """The network deformation_net of a state_dict; settings hold the trainer's no_dx, no_ds, no_dr, no_do, no_dshs."""

    def head(name: str) -> list[Linear] | None:
        return None if settings[_SWITCHES[name]] else weights.under(name).linears()

    return Deformation(
        box=weights.get("grid.aabb"),
        resolutions=read_planes(weights.under("grid.grids")),
        trunk=weights.under("feature_out").linears(),
        position=head("pos_deform"),
        scale=head("scales_deform"),
        rotation=head("rotations_deform"),
        opacity=head("opacity_deform"),
        sh=head("shs_deform"),
        mask=weights.under("static_mlp").linears() if settings.get("static_mlp") else None,
    )


def read_planes(weights: Weights) -> list[list[Floats]]:
    """Six planes (C,H,W) for each resolution, at least one."""
    count = 1 + max((int(name.split(".")[0]) for name in weights.tensors), default=0)
    return [[weights.get(f"{level}.{plane}")[0] for plane in range(len(PLANES))] for level in range(count)]


def _unsupported(folder: Path, found: str) -> ExportError:
    return ExportError(
        "checkpoint/unsupported",
        where=str(folder / "cfg_args"),
        expected="planes over space and time, and heads that add",
        found=found,
        remedy="train with the default switches of 4DGaussians",
    )
