"""Bounds of untrusted files: what a file may unpack to is a multiple of what it weighs."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import AnyArray
from ..errors import ExportError
from .files import existing

# Bytes that a file may unpack to: some for every file, and some for each of its bytes.
_FREE = 1 << 26
_PER_BYTE = 16
# Bytes of a text of settings, at most.
_TEXT = 1 << 20


class Budget:
    """Account of the bytes that one file unpacks to. They are charged before they are allocated."""

    def __init__(self, path: Path):
        """`path` is the file, whose size determines the limit."""
        size = path.stat().st_size
        self._allowed = self._left = _FREE + _PER_BYTE * size
        self._found = f"more than {self._allowed} bytes in a file of {size}"

    def take(self, count: int) -> None:
        """Charges bytes. Raises ValueError if the file has too many."""
        self._left -= count
        if self._left < 0:
            raise ValueError(self._found)


def read_entry(archive: zipfile.ZipFile, name: str, budget: Budget) -> bytes:
    """Content of a file of an archive, charged by its unpacked size. Raises KeyError, ValueError, BadZipFile."""
    entry = archive.getinfo(name)
    budget.take(entry.file_size)
    return archive.read(entry)


def read_arrays(path: Path, what: str, remedy: str, only: Collection[str] | None = None) -> dict[str, AnyArray]:
    """Arrays of a .npz file by their names, without objects; those of the names `only`, if given. `what` and `remedy`
    are for messages.
    """
    try:
        budget = Budget(existing(path, what))
        # numpy takes other files for pickles, and proposes to run their code.
        if not zipfile.is_zipfile(path):
            raise ValueError("no archive of arrays")
        with np.load(path, allow_pickle=False) as archive:
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise ValueError("a single array")
            names = [name for name in archive.files if only is None or name in only]
            for entry in archive.zip.infolist() if archive.zip else []:
                budget.take(entry.file_size if entry.filename.removesuffix(".npy") in names else 0)
            return {name: archive[name] for name in names}
    except (
        *(zipfile.BadZipFile, ValueError, EOFError, AttributeError, KeyError),
        *(MemoryError, OverflowError, RecursionError, NotImplementedError),
    ) as error:
        raise ExportError(
            "checkpoint/unreadable", where=str(path), expected=what, found=str(error)[:300], remedy=remedy
        ) from error


def read_text(path: Path) -> str:
    """A text of settings. Raises ValueError for one that is too long."""
    size = path.stat().st_size
    if size > _TEXT:
        raise ValueError(f"{size} bytes, of {_TEXT} at most")
    return path.read_text(encoding="utf-8", errors="replace")


def read_json(path: Path) -> Any:
    """A file of JSON. Raises ValueError for anything else, also for lists that are nested too deeply."""
    try:
        return json.loads(read_text(path))
    except (RecursionError, MemoryError) as error:
        raise ValueError("lists that are nested too deeply") from error
