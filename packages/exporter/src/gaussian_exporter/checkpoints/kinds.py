"""Determines the family of a checkpoint from its content and the files beside it. Properties that change the meaning
of others are never ignored.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import ExportError
from ..families.classic import Cloud
from .unread import refuse_unread

# Properties of vertices in INRIA's layout, or without a meaning for Gaussians.
_PLAIN = r"x|y|z|nx|ny|nz|f_dc_[0-2]|f_rest_\d+|opacity|scale_[0-2]|rot_[0-3]|filter_3D|red|green|blue"
# A property that only one family writes: its name, and the remedy.
_BY_PROPERTY = {
    "f_t_0": (
        "SpacetimeGaussians, full",
        "its features become colors in a network of each pixel: train its lite model",
    ),
    "trbf_center": ("SpacetimeGaussians", "run gaussian-export spacetime"),
    "binding_0": (
        "GaussianAvatars",
        "run gaussian-export avatar with --smplx HEAD.npz, your FLAME: "
        '"GaussianAvatars" in packages/exporter/README.md',
    ),
    "f_anchor_feat_0": ("Scaffold-GS or Octree-GS", "run gaussian-export scaffold"),
    "f_offset_0": ("Scaffold-GS or Octree-GS", "run gaussian-export scaffold"),
}
# A file or folder beside point_cloud.ply, or beside the folder point_cloud, that only one family writes.
_BY_NEIGHBOR = {
    "deformation.pth": ("4DGaussians", "run gaussian-export hexplane"),
    "deform": ("Deformable-3D-Gaussians", "run gaussian-export deformable"),
    "mlp_ckpt": ("GauHuman", "its network moves SMPL: export a module of it (export_module)"),
    "flame_param.npz": _BY_PROPERTY["binding_0"],
    "skin.glb": ("LAM", "its positions are offsets from vertices of FLAME: export its module"),
    "embedding.json": ("SplattingAvatar", "it is one pose of an avatar; --ignore embedding.json exports the pose"),
    "opacity_mlp.pt": ("Scaffold-GS or Octree-GS", "run gaussian-export scaffold"),
    "checkpoints.pth": ("Scaffold-GS or Octree-GS", "run gaussian-export scaffold"),
}


def refuse_other_properties(names: Sequence[str], where: Path, ignored: Sequence[str] = ()) -> None:
    """Raises checkpoint/other-family for vertex properties that plain Gaussians do not have."""
    for name, (family, remedy) in _BY_PROPERTY.items():
        if name in names:
            raise other_family(where, family, f"the property {name}", remedy)
    if "scale_0" in names and "scale_2" not in names:
        remedy = "discs without a thickness are another rasterizer's; train with a 3D model"
        raise other_family(where, "2D Gaussian Splatting", "two scales a Gaussian", remedy)
    refuse_unread(where, "properties", names, (), ignored=ignored, harmless=_PLAIN)


def unfiltered(cloud: Cloud, where: Path) -> Cloud:
    """The cloud, refused if it has Mip-Splatting's 3D filter: a network that changes scales expects them without."""
    if cloud.filter == "mip":
        raise other_family(where, "an unknown family", "the property filter_3D beside a network", "train without it")
    return cloud


def refuse_neighbors(point_cloud: Path, ignored: Sequence[str] = ()) -> None:
    """Raises checkpoint/other-family if files beside a point cloud show that it is only a part of a model."""
    # OUT/point_cloud/iteration_N/point_cloud.ply: beside the file, or beside the folder point_cloud.
    for folder in (point_cloud.parent, point_cloud.parent.parent.parent):
        is_training = folder == point_cloud.parent or (folder / "point_cloud").is_dir()
        for name, (family, remedy) in _BY_NEIGHBOR.items():
            if is_training and name not in ignored and (folder / name).exists():
                raise other_family(point_cloud, family, f"{name} in {folder}", remedy)


def other_family(where: Path, family: str, found: str, remedy: str) -> ExportError:
    """The error of a checkpoint that another exporter reads, or none."""
    return ExportError(
        "checkpoint/other-family",
        where=str(where),
        expected="Gaussians as they are drawn",
        found=f"{found}: a checkpoint of {family}",
        remedy=remedy,
    )
