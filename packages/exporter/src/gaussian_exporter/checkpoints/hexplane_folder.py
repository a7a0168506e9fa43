"""The folder that 4DGaussians leaves: point_cloud.ply and deformation.pth of an iteration, cfg_args."""

from __future__ import annotations

from pathlib import Path

from ..arrays import Floats
from ..errors import ExportError
from ..families.classic import Cloud, cloud_of_vertices
from ..families.hexplane import PLANES, Deformation
from ..pieces.mlp import Linear
from .cfg_args import require_cfg_args
from .files import existing, latest_iteration
from .kinds import refuse_other_properties
from .ply import read_ply
from .torch_file import Weights, read_weights

# The trainer's own defaults, which hold where a cfg_args does not say otherwise.
_DEFAULTS = {"no_dx": False, "no_ds": False, "no_dr": False, "no_do": True, "no_dshs": True}
_REFUSED = {
    "no_grid": "without its planes",
    "empty_voxel": "with a grid of empty voxels",
    "apply_rotation": "with rotations that are multiplied",
}


def read_hexplane(folder: Path) -> tuple[Cloud, Deformation]:
    """Reads the latest iteration."""
    point_cloud = latest_iteration(existing(folder, "the folder of a 4DGaussians training"))
    why = "it says which heads of the network are used (no_do, no_dshs), which no file of weights tells"
    settings = _DEFAULTS | require_cfg_args(folder, why)
    for name, what in _REFUSED.items():
        if settings.get(name):
            raise _unsupported(folder, f"a model {what} ({name})")
    if settings.get("grid_pe"):
        raise _unsupported(folder, "a model with encoded plane features (grid_pe)")
    weights = read_weights(point_cloud / "deformation.pth")
    vertices = read_ply(point_cloud / "point_cloud.ply")
    refuse_other_properties(vertices.names, vertices.path)
    cloud = cloud_of_vertices(vertices)
    return cloud, deformation_of(weights.under("deformation_net"), settings)


def deformation_of(weights: Weights, settings: dict[str, object]) -> Deformation:
    """The network deformation_net of a state_dict; settings hold the trainer's no_dx, no_ds, no_dr, no_do, no_dshs."""

    def head(name: str, switch: str | None) -> list[Linear]:
        return [] if switch and settings[switch] else weights.under(name).linears()

    return Deformation(
        box=weights.get("grid.aabb"),
        resolutions=read_planes(weights.under("grid.grids")),
        trunk=weights.under("feature_out").linears(),
        position=head("pos_deform", "no_dx") or None,
        scale=head("scales_deform", "no_ds") or None,
        rotation=head("rotations_deform", "no_dr") or None,
        opacity=head("opacity_deform", "no_do") or None,
        sh=head("shs_deform", "no_dshs") or None,
        mask=head("static_mlp", None) if settings.get("static_mlp") else None,
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
