"""The output folder of Scaffold-GS or Octree-GS: point_cloud.ply of anchors, three or four networks, cfg_args."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast, get_args

import numpy as np

from ..arrays import Floats
from ..errors import ExportError
from ..families.scaffold import DistanceToLevel, Levels, Scaffold
from .cfg_args import find_cfg_args, read_cfg_args, require_cfg_args
from .files import existing, latest_iteration
from .ply import Vertices, read_ply
from .torch_file import Weights, read_weights
from .unread import refuse_unread

_REQUIRED = {"opacity": "opacity_mlp", "color": "color_mlp", "covariance": "cov_mlp"}
_NETWORKS = {**_REQUIRED, "feature_bank": "feature_bank_mlp"}
# The name in files of Scaffold-GS before 2024.
_OLD_FEATURE_BANK = "mlp_feature_bank"


def read_scaffold(folder: Path, appearance: int = 0, ignored: Sequence[str] = ()) -> Scaffold:
    """Reads the latest iteration. `appearance`: index of the training image whose code is baked in, if the model has
    codes.
    """
    point_cloud = latest_iteration(existing(folder, "the folder of a Scaffold-GS or Octree-GS training"))
    vertices = read_ply(point_cloud / "point_cloud.ply")
    networks = read_networks(point_cloud, ignored)
    settings = settings_of(folder, "level" in vertices.names)
    anchors = read_anchors(vertices)
    levels = read_levels(vertices, settings)
    code = read_appearance(networks.get("appearance"), appearance)
    model = Scaffold(
        **anchors,
        opacity=networks["opacity"].linears(),
        color=networks["color"].linears(),
        covariance=networks["covariance"].linears(),
        feature_bank=networks["feature_bank"].linears() if "feature_bank" in networks else None,
        uses_distance=tuple(
            name
            for name, word in (("opacity", "opacity"), ("covariance", "cov"), ("color", "color"))
            if settings.get(f"add_{word}_dist", _takes_distance(networks[name], anchors["features"], name, code))
        ),
        appearance=code,
        levels=levels,
    )
    # INRIA's layout requires these properties, but anchors do not use them.
    vertices.refuse_unread(ignored, r"opacity|rot_[0-3]")
    for weights in networks.values():
        weights.refuse_unread(ignored)
    return model


def _takes_distance(network: Weights, features: Floats, name: str, appearance: Floats | None) -> bool:
    """Whether a network of Scaffold-GS has one more input than features, direction and the code of an appearance. The
    first versions always have it, and no setting for it.
    """
    extra = len(appearance) if name == "color" and appearance is not None else 0
    return bool(network.linears()[0].inputs == features.shape[1] + 4 + extra)


def settings_of(folder: Path, has_levels: bool) -> dict[str, object]:
    """Reads cfg_args, which Octree-GS requires; for Scaffold-GS the shapes of the networks contain the same facts."""
    if has_levels:
        return require_cfg_args(folder, "it says how distances become levels (dist2level, fork, add_level)")
    path = find_cfg_args(folder)
    return {} if path is None else read_cfg_args(path)


def read_networks(folder: Path, ignored: Sequence[str] = ()) -> dict[str, Weights]:
    """Either one file of state_dicts, checkpoints.pth, or a file with a traced network for each."""
    united = folder / "checkpoints.pth"
    if united.exists():
        weights = read_weights(united)
        names = {**_NETWORKS, "appearance": "appearance"}
        roots = {name.split(".")[0] for name in weights.tensors}
        if _OLD_FEATURE_BANK in roots:
            names["feature_bank"] = _OLD_FEATURE_BANK
        refuse_unread(united, "networks", sorted(roots), names.values(), ignored=ignored)
        found = {role: weights.under(name) for role, name in names.items()}
        return {role: weights for role, weights in found.items() if weights.tensors or role in _REQUIRED}
    files = {**_NETWORKS, "appearance": "embedding_appearance"}
    there = sorted(path.stem for path in folder.glob("*.pt"))
    refuse_unread(folder, "networks", there, files.values(), ignored=ignored)
    return {
        role: read_weights(folder / f"{name}.pt")
        for role, name in files.items()
        if role in _REQUIRED or (folder / f"{name}.pt").exists()
    }


def read_anchors(vertices: Vertices) -> dict[str, Floats]:
    """Anchors, offsets, features and scales, activated."""
    offsets = vertices.numbered("f_offset_")
    if offsets.shape[1] % 3 or not offsets.shape[1]:
        vertices.columns("f_offset_0", "f_offset_1", "f_offset_2")
    scales = vertices.columns(*(f"scale_{i}" for i in range(6)))
    return {
        "anchors": vertices.columns("x", "y", "z"),
        # Stored as all x, all y, all z.
        "offsets": np.ascontiguousarray(offsets.reshape(len(vertices), 3, -1).transpose(0, 2, 1)),
        "features": vertices.numbered("f_anchor_feat_"),
        "scales": np.exp(np.float64(scales)).astype(np.float32),
    }


def read_levels(vertices: Vertices, settings: dict[str, object]) -> Levels | None:
    """Octree-GS's levels, or None for Scaffold-GS."""
    if "level" not in vertices.names:
        return None
    voxel_size, standard_distance = (float(x) for x in vertices.columns("info")[:2, 0])
    rule = settings.get("dist2level", "round")
    if rule not in get_args(DistanceToLevel):
        raise ExportError(
            "checkpoint/unsupported",
            where="cfg_args: dist2level",
            expected=f"one of {', '.join(get_args(DistanceToLevel))}",
            found=repr(rule),
            remedy="export with one of these rules written into cfg_args",
        )
    fork = settings.get("fork", 2)
    return Levels(
        vertices.columns("level"),
        vertices.columns("extra_level"),
        voxel_size,
        standard_distance,
        float(fork) if isinstance(fork, (int, float)) else 2.0,
        cast(DistanceToLevel, rule),
        bool(settings.get("add_level")),
    )


def read_appearance(weights: Weights | None, index: int) -> Floats | None:
    """One row of the embedding, or None if the model has none."""
    if weights is None:
        return None
    name = next((name for name in weights.tensors if name.endswith("weight")), "weight")
    table = weights.get(name)
    if not 0 <= index < len(table):
        raise ExportError(
            "argument/value",
            where="--appearance",
            expected=f"a number from 0 to {len(table) - 1}",
            found=str(index),
            remedy="give the index of a training image",
        )
    row: Floats = table[index]
    return row
