"""Plain Gaussians as trainers leave them: PLY files, and checkpoints of gsplat, nerfstudio and INRIA's trainer."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import AnyArray, Floats, sigmoid
from ..errors import ExportError, listed
from ..families.classic import Cloud, cloud_of_vertices, usable_degree
from .cfg_args import find_cfg_args, read_cfg_args
from .files import existing, latest_iteration
from .kinds import other_family, refuse_neighbors, refuse_other_properties
from .ply import read_ply
from .torch_file import read_torch
from .unread import refuse_settings, refuse_unread

# Constant of the spherical harmonic of degree 0: 1 / (2 sqrt(pi)).
_C0 = 0.28209479177387814
_GSPLAT = ("means", "scales", "quats", "opacities", "sh0", "shN")
_NERFSTUDIO = ("means", "scales", "quats", "opacities", "features_dc", "features_rest")
# Poses of training images, which checkpoints contain beside the Gaussians and which do not affect them.
_GSPLAT_KEYS = r"step|splats|pose_adjust(\..*)?"
# Metrics, cameras and colors of training images: none of them is part of a rendered view.
_NERFSTUDIO_KEYS = (
    r"datamanager\..*|_model\.(device_indicator_param|(camera_optimizer|lpips|psnr|ssim|bil_grids)(\..*)?)"
)
# gsplat's trainer of 3D Gaussians writes the rank into the name of a file, that of 2D Gaussians does not.
_GSPLAT_3D = re.compile(r".*_rank\d+\.pt")
_OWN = "export the model as a module of your own: gaussian_exporter.export_module"
# Lengths of the tuple of INRIA's `capture`, including the optimizer's state; fudan's 4DGS has more entries.
_CAPTURED, _CAPTURED_4D = 12, 19


def read_cloud(path: Path, ignored: Sequence[str] = ()) -> Cloud:
    """A PLY file in INRIA's layout; a checkpoint of gsplat (.pt), nerfstudio (.ckpt) or INRIA's trainer (chkpnt*.pth);
    or the folder of a training that contains one. `ignored`: tensors, properties of vertices and settings that
    change nothing; "2d" declares that a gsplat checkpoint without a rank in its name has 3D Gaussians.
    """
    path = newest_in(existing(path, "a PLY file, a checkpoint, or the folder of a training"))
    refuse_neighbors(path, ignored)
    with existing(path, "a training with a point cloud or a checkpoint").open("rb") as file:
        is_archive = file.read(2) == b"PK"
    kernel = refused_settings(path, ignored)
    if is_archive:
        if kernel is not None:
            remedy = "give its point_cloud.ply, which has the 3D filter of each Gaussian (filter_3D)"
            raise other_family(path, "Mip-Splatting", "kernel_size in cfg_args, and no 3D filter", remedy)
        return cloud_of_checkpoint(path, ignored)
    vertices = read_ply(path)
    refuse_other_properties(vertices.names, path, ignored)
    cloud = cloud_of_vertices(vertices)
    # A fused file of Mip-Splatting has its 3D filter in the scales; its other filter is only in the settings.
    return cloud if kernel is None else replace(cloud, filter="mip")


def refused_settings(path: Path, ignored: Sequence[str]) -> float | None:
    """Mip-Splatting's kernel_size of the cfg_args around a file; raises for unknown settings."""
    beside = find_cfg_args(path.parent)
    settings = {} if beside is None else read_cfg_args(beside)
    mip = (
        "|kernel_size|ray_jitter|resample_gt_image|load_allres|sample_more_highres" if "kernel_size" in settings else ""
    )
    refuse_settings(beside or path, settings, ignored, f"(?!){mip}")
    kernel = settings.get("kernel_size")
    if kernel is not None and kernel != 0.1 and "kernel_size" not in ignored:
        remedy = "train with kernel_size 0.1, or give --filter and --ignore kernel_size"
        raise other_family(beside or path, "Mip-Splatting", f"kernel_size={kernel}", remedy)
    return None if "kernel_size" in ignored else kernel  # type: ignore[return-value]


# Settings of gsplat and nerfstudio: lines of a training with opacity compensation, and of one whose cameras were turned
# so that +z is up.
_SETTINGS = {
    "cfg.yml": (r"antialiased: true", r"normalize_world_space: true"),
    "config.yml": (r"rasterize_mode: antialiased", r"orientation_method: (up|vertical|pca)"),
}


def with_settings(cloud: Cloud, checkpoint: Path, name: str) -> Cloud:
    """The cloud with the filter and the up axis that the settings around its checkpoint declare."""
    # OUT/ckpts/ckpt_N_rank0.pt and OUT/nerfstudio_models/step-N.ckpt; a copy may be beside the file.
    around = [folder / name for folder in checkpoint.resolve().parents[:2] if (folder / name).is_file()]
    if not around:
        note = f"no {name} around {checkpoint.name}, so filter and up axis are those of --filter and --up"
        return replace(cloud, note=note)
    text = around[0].read_text(errors="replace")
    compensates, is_turned = (re.search(rf"^\s*{line}\s*$", text, re.MULTILINE) for line in _SETTINGS[name])
    return replace(cloud, filter="antialiased" if compensates else "classic", up="+z" if is_turned else None)


def newest_in(path: Path) -> Path:
    """The file of the last iteration in the folder of a training; a file is returned unchanged."""
    if not path.is_dir():
        return path
    for inside, pattern in (("ckpts", r"ckpt_(\d+)_rank0\.pt"), ("nerfstudio_models", r"step-(\d+)\.ckpt")):
        found = [(int(m[1]), p) for p in (path / inside).glob("*") if (m := re.fullmatch(pattern, p.name))]
        if found:
            return max(found)[1]
    return latest_iteration(path) / "point_cloud.ply"


def cloud_of_checkpoint(path: Path, ignored: Sequence[str] = ()) -> Cloud:
    """Gaussians of a file of torch.save."""
    content: Any = read_torch(path)
    if isinstance(content, Mapping) and isinstance(content.get("splats"), Mapping):
        return gsplat(path, content, ignored)
    if isinstance(content, Mapping) and isinstance(content.get("pipeline"), Mapping):
        harmless = "step|pipeline|optimizers|schedulers|scalers"
        refuse_unread(path, "entries", map(str, content), (), ignored=ignored, harmless=harmless)
        return nerfstudio(path, content["pipeline"], ignored)
    captured = captured_of(content)
    if captured is not None and len(captured) == _CAPTURED_4D:
        raise other_family(path, "4D Gaussian Splatting", "Gaussians of space and time", "run gaussian-export 4dgs")
    if captured is not None and len(captured) == _CAPTURED:
        return inria(path, captured)
    if captured is not None:
        expected = f"{_CAPTURED} of INRIA's trainer, or {_CAPTURED_4D} of 4D Gaussian Splatting"
        raise other_family(
            path, "an unknown family", f"a captured model of {len(captured)} parts, not {expected}", _OWN
        )
    raise unknown(path, content)


def captured_of(content: object) -> Sequence[Any] | None:
    """The tuple of `GaussianModel.capture`, if the content of a file is (captured, iteration)."""
    is_pair = isinstance(content, (list, tuple)) and len(content) == 2 and isinstance(content[0], (list, tuple))
    return content[0] if is_pair else None  # type: ignore[index]


# Parameters that only one network has: from images to Gaussians, or of an avatar. Its file contains weights.
_FROM_IMAGES = {
    "encoder.epipolar_transformer.": "pixelSplat",
    "encoder.depth_predictor.corr_refine_net.": "MVSplat",
    "encoder.gaussian_regressor.": "DepthSplat",
    "encoder.aggregator.": "AnySplat",
    "network_with_offset.": "Splatter Image",
    "network_wo_offset.": "Splatter Image",
    "unet.down_blocks.0.nets.": "LGM",
    "gs_tokens": "TokenGS",
}
_AVATARS = {
    "deformer.non_rigid.": "3DGS-Avatar",
    "deformation_dec": "HUGS",
    "human_gaussian.": "ExAvatar",
    "exp_color_mlp.": "gaussian-head",
}


def network_of(content: object) -> tuple[str, bool] | None:
    """Name of the published network of a state_dict, alone or as an entry of the file, and whether it is an avatar."""
    parts = list(content) if isinstance(content, (list, tuple)) else [content]
    entries = [part for part in parts if isinstance(part, Mapping)]
    states = [*entries, *(value for each in entries for value in each.values() if isinstance(value, Mapping))]
    names = [str(name).removeprefix("module.") for state in states for name in state]
    for mark, network in (_FROM_IMAGES | _AVATARS).items():
        if any(name.startswith(mark) for name in names):
            return network, mark in _AVATARS
    return None


def unknown(path: Path, content: object) -> ExportError:
    """The error of a file that no known trainer writes."""
    if (found := network_of(content)) is not None:
        network, is_avatar = found
        inputs = "pose(...), shape(...)" if is_avatar else "image(views=2)"
        remedy = f"load it into its class, and export that: gaussian_exporter.export_module, inputs {inputs}"
        what = "moves the Gaussians of an avatar" if is_avatar else "turns images into Gaussians"
        return other_family(path, network, f"weights of a network that {what}", remedy)
    names = [str(key) for key in content] if isinstance(content, Mapping) else [type(content).__name__]
    return ExportError(
        "checkpoint/other-family",
        where=str(path),
        expected="a checkpoint of gsplat, nerfstudio or INRIA's trainer",
        found=f"a PyTorch file with {listed(names)}",
        remedy="gaussian-export --help lists the families; a model of your own: gaussian_exporter.export_module",
    )


def gsplat(path: Path, content: Mapping[str, Any], ignored: Sequence[str] = ()) -> Cloud:
    """gsplat's simple_trainer: {"splats": state_dict}, a file for each rank."""
    ranks = [path]
    match = re.fullmatch(r"(.*_rank)0(\.pt)", path.name)
    while match and (more := path.with_name(f"{match[1]}{len(ranks)}{match[2]}")).exists():
        ranks.append(more)
    files = [content["splats"], *(read_torch(more)["splats"] for more in ranks[1:])]  # type: ignore[index]
    if "features" in files[0]:
        remedy = "train without app_opt: its colors come from a network that knows the training images"
        raise other_family(path, "gsplat with appearance optimisation", "features in place of harmonics", remedy)
    refuse_unread(path, "entries", map(str, content), (), ignored=ignored, harmless=_GSPLAT_KEYS, family="gsplat")
    for file in files:
        refuse_unread(path, "tensors of splats", map(str, file), _GSPLAT, ignored=ignored, family="gsplat")
    if not _GSPLAT_3D.fullmatch(path.name) and "2d" not in ignored:
        remedy = (
            "train a 3D model; if it is one, give --ignore 2d, or name the file ckpt_STEP_rank0.pt as its trainer does"
        )
        found = (
            "no rank in the file's name, as gsplat's trainer of 2D Gaussians writes it (their third scale is untrained)"
        )
        raise other_family(path, "2D Gaussian Splatting", found, remedy)
    parts = {name: np.concatenate([table(path, file, name) for file in files]) for name in _GSPLAT}
    sh = np.concatenate([parts["sh0"], parts["shN"]], 1)
    own = Cloud(parts["means"], parts["scales"], parts["quats"], parts["opacities"].reshape(-1, 1), degrees(path, sh))
    return with_settings(own, path, "cfg.yml")


def nerfstudio(path: Path, pipeline: Mapping[str, Any], ignored: Sequence[str] = ()) -> Cloud:
    """nerfstudio's splatfacto: the state of its pipeline. Without harmonics its colors go through a sigmoid."""
    # Trainings on several GPUs wrap the model.
    pipeline = {re.sub(r"(^|\.)module\.", r"\1", name): value for name, value in pipeline.items()}
    prefix = next((p for p in ("_model.gauss_params.", "_model.") if f"{p}means" in pipeline), None)
    if prefix is None:
        raise unknown(path, pipeline)
    read = [prefix + name for name in _NERFSTUDIO]
    refuse_unread(path, "tensors", pipeline, read, ignored=ignored, harmless=_NERFSTUDIO_KEYS, family="nerfstudio")
    own = {name: table(path, pipeline, prefix + name) for name in _NERFSTUDIO}
    dc = own["features_dc"].reshape(-1, 1, 3)
    if own["features_rest"].shape[1] == 0:
        dc = ((sigmoid(dc) - 0.5) / _C0).astype(np.float32)
    sh = np.concatenate([dc, own["features_rest"].reshape(len(dc), -1, 3)], 1)
    cloud = Cloud(own["means"], own["scales"], own["quats"], own["opacities"].reshape(-1, 1), degrees(path, sh))
    return with_settings(cloud, path, "config.yml")


def inria(path: Path, captured: Sequence[Any]) -> Cloud:
    """INRIA's GaussianModel.capture: degree, positions, harmonics, scales, rotations, opacities, and the optimizer."""
    degree, positions, dc, rest, scales, rotations, opacities = captured[:7]
    if scales.shape[1] != 3:
        raise other_family(path, "2D Gaussian Splatting", f"{scales.shape[1]} scales a Gaussian", "train a 3D model")
    # Harmonics above the active degree are not drawn yet during the training.
    sh = np.concatenate([dc, rest], 1)[:, : (int(degree) + 1) ** 2]
    return Cloud(*(np.asarray(x, np.float32) for x in (positions, scales, rotations, opacities.reshape(-1, 1), sh)))


def table(path: Path, tensors: Mapping[str, Any], name: str) -> Floats:
    """A tensor of a state_dict as float32."""
    if not isinstance(tensors.get(name), np.ndarray):
        raise ExportError(
            "checkpoint/incomplete",
            where=str(path),
            expected=f"a tensor '{name}'",
            found=listed([str(key) for key in tensors]),
            remedy="give the checkpoint as the trainer wrote it",
        )
    return np.asarray(tensors[name], np.float32)


def degrees(path: Path, sh: AnyArray) -> Floats:
    """Harmonics (N,K,3), refused if K fits no degree up to 3."""
    usable_degree(sh.shape[1] - 1, path)
    return np.asarray(sh, np.float32)
