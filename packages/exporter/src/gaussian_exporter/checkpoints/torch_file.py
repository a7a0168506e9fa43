"""PyTorch's files (torch.save and TorchScript) read without PyTorch.

Both are zip archives of raw tensors and one pickle with the position of each tensor. A pickle may name any function
to call; here only the few that rebuild tensors are known, and everything else becomes an inert record. So untrusted
files can be read, and exporting needs no PyTorch, which takes gigabytes.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import AnyArray, Floats
from ..errors import ExportError, listed
from ..pieces.mlp import Linear
from .files import existing
from .torch_pickle import Record, TorchUnpickler, part_of_name
from .unread import refuse_unread
from .untrusted import Budget

# Items of all nested dicts and lists of a file, their depth, and the letters of all names, at most.
_ITEMS = 200_000
_DEPTH = 64
_LETTERS = 1 << 24


def read_torch(path: Path) -> object:
    """Reads all content of the file: tensors as arrays, dicts and lists as such, other objects as Record."""
    try:
        budget = Budget(existing(path, "a file of torch.save or torch.jit.save"))
        with zipfile.ZipFile(path) as archive:
            prefix = next((name[: -len("data.pkl")] for name in archive.namelist() if name.endswith("data.pkl")), None)
            if prefix is None:
                raise ValueError(f"a zip archive of {listed(archive.namelist())}")
            return TorchUnpickler(archive, prefix, budget).load()
    except ExportError:
        raise
    # The program of a stranger may cause any error.
    except Exception as error:
        raise _unreadable(path, str(error)[:300] or type(error).__name__) from error


def read_tensors(path: Path) -> dict[str, AnyArray]:
    """All tensors of a file by their dotted names, as in a state_dict."""
    found: dict[str, AnyArray] = {}
    # A stack instead of recursion, because a pickle may be nested to any depth, and contain itself.
    left: list[tuple[object, tuple[str, ...]]] = [(read_torch(path), ())]
    visited = letters = 0
    while left:
        value, keys = left.pop()
        visited += 1
        if isinstance(value, np.ndarray):
            letters += sum(map(len, keys))
            if letters <= _LETTERS:
                found[".".join(keys)] = value
        children = _children(value)
        if len(keys) > _DEPTH or letters > _LETTERS or visited + len(left) + len(children) > _ITEMS:
            raise _unreadable(path, f"more than {_ITEMS} items, {_DEPTH} lists within each other, or endless names")
        left.extend((child, (*keys, part_of_name(key))) for key, child in reversed([*children.items()]))
    return found


def _children(value: object) -> Mapping[Any, object]:
    if isinstance(value, Record):
        return value.state
    if isinstance(value, dict):
        return value
    return dict(enumerate(value)) if isinstance(value, (list, tuple)) else {}


def _unreadable(path: Path, found: str) -> ExportError:
    return ExportError(
        "checkpoint/unreadable",
        where=str(path),
        expected="a zip archive of PyTorch 1.6 or later with tensors in it",
        found=found,
        remedy="if the file is older, load it in PyTorch and torch.save its state_dict again",
    )


class Weights:
    """Named tensors of one file, requested with the shape that the model needs."""

    def __init__(self, tensors: Mapping[str, AnyArray], where: str, file: Weights | None = None, prefix: str = ""):
        """`where` is the file's name, for messages; `file` and `prefix` describe a part of another instance."""
        self.tensors = tensors
        self.where = where
        self._prefix = prefix
        # Names of all tensors in the file that were read, by any part of it.
        self._read: set[str] = set() if file is None else file._read

    def __contains__(self, name: str) -> bool:
        """Whether there is a tensor of that name."""
        return name in self.tensors

    def get(self, name: str) -> Floats:
        """A tensor as float32. Raises checkpoint/incomplete if it is missing."""
        if name not in self.tensors:
            raise ExportError(
                "checkpoint/incomplete",
                where=self.where,
                expected=f"a tensor '{name}'",
                found=listed(list(self.tensors)),
                remedy="check that the file belongs to this family of models and is not the optimizer's state",
            )
        self._read.add(self._prefix + name)
        return np.asarray(self.tensors[name], np.float32)

    def refuse_unread(self, ignored: Sequence[str] = (), harmless: str = "(?!)") -> None:
        """Raises checkpoint/other-family for unread tensors."""
        names = [self._prefix + name for name in self.tensors]
        refuse_unread(self.where, "tensors", names, self._read, ignored=ignored, harmless=harmless)

    def under(self, prefix: str) -> Weights:
        """The tensors whose names begin with `prefix.`, without it."""
        start = f"{prefix}."
        found = {name[len(start) :]: value for name, value in self.tensors.items() if name.startswith(start)}
        return Weights(found, f"{self.where}: {prefix}", self, self._prefix + start)

    def count(self) -> int:
        """Number of numbered layers."""
        return len({name.split(".")[0] for name in self.tensors if name.split(".")[0].isdigit()})

    def linears(self) -> list[Linear]:
        """All linear layers of a Sequential, in the order of their numbers. At least one."""
        numbers = sorted({int(n.split(".")[0]) for n in self.tensors if n.split(".")[0].isdigit()})
        layers = [Linear(self.get(f"{n}.weight"), self.get(f"{n}.bias")) for n in numbers]
        if not layers:
            self.get("0.weight")
        for before, after in pairwise(layers):
            if before.outputs != after.inputs:
                raise ExportError(
                    "checkpoint/mismatch",
                    where=self.where,
                    expected=f"a layer of {before.outputs} inputs",
                    found=f"one of {after.inputs}",
                    remedy="the layers are not one Sequential; check which network the file holds",
                )
        return layers


def read_weights(path: Path) -> Weights:
    """All tensors of a file, requested by name."""
    return Weights(read_tensors(path), str(path))
