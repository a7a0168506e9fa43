"""Avatars as one .npz file whose arrays are named as the fields of families.avatar.Avatar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np

from ..arrays import AnyArray
from ..errors import ExportError, listed
from ..families.avatar import Avatar
from .unread import refuse_unread
from .untrusted import read_arrays


def read_avatar(path: Path, ignored: Sequence[str] = ()) -> Avatar:
    """Reads an avatar; numbers become float32."""
    if path.is_dir():
        raise _folder(path)
    arrays = read_npz(path)
    known = fields(Avatar)
    missing = [field.name for field in known if field.default is MISSING and field.name not in arrays]
    if missing:
        raise ExportError(
            "checkpoint/incomplete",
            where=str(path),
            expected=f"arrays {listed(missing)}",
            found=f"arrays {listed(list(arrays))}",
            remedy="gaussian_exporter.families.avatar.Avatar says what each array holds",
        )
    refuse_unread(path, "arrays", arrays, [field.name for field in known], ignored=ignored)
    given = {field.name: arrays[field.name] for field in known if field.name in arrays}
    lists = {"parents": [int(x) for x in given["parents"]], "joint_names": [str(x) for x in given["joint_names"]]}
    return Avatar(**{k: np.asarray(v, np.float32) for k, v in given.items() if k not in lists}, **lists)  # type: ignore[arg-type]


# Files that identify the folder of an avatar repository: pattern, name of the repository, reason of the refusal.
_FOLDERS = (
    ("**/flame_param.npz", "GaussianAvatars", "it moves FLAME, which --smplx HEAD.npz gives"),
    ("**/mlp_ckpt", "GauHuman", "its network moves SMPL"),
    ("**/offset.ply", "LAM", "skin.glb and animation.glb beside offset.ply are a mesh of FLAME"),
    ("**/smplx_params*", "an avatar of SMPL-X (ExAvatar, LHM)", "its network moves SMPL-X"),
    ("**/transforms_train.json", "a data set", "it holds images, not an avatar"),
)


def _folder(path: Path) -> ExportError:
    found = next(((name, why) for pattern, name, why in _FOLDERS if next(path.glob(pattern), None)), None)
    archives = sorted(str(each.relative_to(path)) for each in path.rglob("*.npz"))[:4]
    name, why = found or ("an unknown avatar", f"a folder with {listed(archives)}" if archives else "no .npz in it")
    return ExportError(
        "checkpoint/other-family",
        where=str(path),
        expected="one .npz file with the arrays of gaussian_exporter.families.avatar.Avatar",
        found=f"a folder of {name}: {why}",
        remedy="export a module that holds the body: gaussian_exporter.export_module, inputs {'pose': pose(joints)}",
    )


def read_npz(path: Path) -> dict[str, AnyArray]:
    """All arrays of a .npz file, without objects."""
    remedy = "write it with numpy.savez, without objects in it; Gaussians at rest need --smplx MODEL.npz"
    return read_arrays(path, "a .npz file of plain arrays", remedy)
