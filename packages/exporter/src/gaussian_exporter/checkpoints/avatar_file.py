"""Avatars as one .npz file whose arrays are named as the fields of families.avatar.Avatar."""

from __future__ import annotations

import zipfile
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np

from ..arrays import AnyArray
from ..errors import ExportError, listed
from ..families.avatar import Avatar
from .files import existing


def read_avatar(path: Path) -> Avatar:
    """Reads an avatar; numbers become float32."""
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
    given = {field.name: arrays[field.name] for field in known if field.name in arrays}
    lists = {"parents": [int(x) for x in given["parents"]], "joint_names": [str(x) for x in given["joint_names"]]}
    return Avatar(**{k: np.asarray(v, np.float32) for k, v in given.items() if k not in lists}, **lists)  # type: ignore[arg-type]


def read_npz(path: Path) -> dict[str, AnyArray]:
    """All arrays of a .npz file, without objects."""
    try:
        with np.load(existing(path, "a .npz file"), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (zipfile.BadZipFile, ValueError, EOFError, AttributeError) as error:
        raise ExportError(
            "checkpoint/unreadable",
            where=str(path),
            expected="a .npz file of plain arrays",
            found=str(error),
            remedy="write it with numpy.savez, without objects in it",
        ) from error
