"""PyTorch's files (torch.save and TorchScript) read without PyTorch.

Both are zip archives of raw tensors and one pickle with the position of each tensor. A pickle may name any function
to call; here only the few that rebuild tensors are known, and everything else becomes an inert record. So untrusted
files can be read, and exporting needs no PyTorch, which takes gigabytes.
"""

from __future__ import annotations

import math
import pickle
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import AnyArray, Floats
from ..errors import ExportError, listed
from ..pieces.mlp import Linear
from .files import existing
from .unread import refuse_unread

_STORAGES = {
    "FloatStorage": "f4",
    "DoubleStorage": "f8",
    "HalfStorage": "f2",
    "BFloat16Storage": "bf16",
    "LongStorage": "i8",
    "IntStorage": "i4",
    "ShortStorage": "i2",
    "CharStorage": "i1",
    "ByteStorage": "u1",
    "BoolStorage": "?",
}


# Numbers of a tensor that repeats those of its storage, at most.
_REPEATED = 1 << 20
# Items of all nested dicts and lists of a file, at most, and their depth.
_ITEMS = 1_000_000
_DEPTH = 64


class Record:
    """An object of an unknown class: its state, or the arguments of its constructor."""

    def __init__(self, *arguments: object):
        """Keeps the arguments of the constructor that the pickle calls."""
        self.arguments = arguments
        self.state: dict[str, object] = {}

    def __setstate__(self, state: object) -> None:
        """The pickle's BUILD: keeps a state that is a mapping."""
        if isinstance(state, Mapping):
            self.state = {str(key): value for key, value in state.items()}

    def __setitem__(self, key: object, value: object) -> None:
        """The pickle's SETITEM on unknown mappings."""
        self.state[str(key)] = value

    def append(self, value: object) -> None:
        """The pickle's APPEND on unknown lists."""
        self.state[str(len(self.state))] = value


def _rebuild_tensor(storage: AnyArray, offset: int, size: Sequence[int], stride: Sequence[int], *_: object) -> AnyArray:
    last = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True))
    if 0 in size:
        return np.zeros(tuple(size), storage.dtype)
    # Strides of 0 repeat numbers. A copy of them could take any memory.
    if math.prod(size) > max(storage.size, _REPEATED):
        raise ValueError(f"a tensor {tuple(size)} of {storage.size} numbers, repeated")
    if min(stride, default=0) < 0 or offset < 0 or last >= storage.size:
        raise ValueError(f"a tensor {tuple(size)} that reaches beyond its {storage.size} numbers")
    steps = tuple(step * storage.itemsize for step in stride)
    return np.lib.stride_tricks.as_strided(storage[offset:], tuple(size), steps, writeable=False).copy()


_KNOWN: dict[tuple[str, str], Callable[..., Any]] = {
    ("torch._utils", "_rebuild_tensor_v2"): _rebuild_tensor,
    ("torch._utils", "_rebuild_tensor"): _rebuild_tensor,
    ("torch._utils", "_rebuild_parameter"): lambda data, *_: data,
    ("collections", "OrderedDict"): OrderedDict,
    ("torch", "Size"): tuple,
}


class _Reader(pickle.Unpickler):
    def __init__(self, archive: zipfile.ZipFile, prefix: str):
        super().__init__(archive.open(f"{prefix}data.pkl"))
        self._archive = archive
        self._prefix = prefix

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in _KNOWN:
            return _KNOWN[module, name]
        if module == "torch" and name in _STORAGES:
            return _STORAGES[name]
        # A separate class for each name: NEWOBJ needs a class, REDUCE anything callable.
        return type(name, (Record,), {})

    def persistent_load(self, pid: Any) -> AnyArray:
        _, kind, key, *_rest = pid
        entry = self._archive.getinfo(f"{self._prefix}data/{key}")
        # torch.save does not compress.
        if entry.file_size > entry.compress_size + (1 << 26):
            raise ValueError(f"a compressed storage of {entry.file_size} bytes")
        data = self._archive.read(entry)
        if kind == "bf16":
            return (np.frombuffer(data, "<u2").astype(np.uint32) << 16).view(np.float32)
        if not isinstance(kind, str):
            raise ValueError(f"storage of an unknown type {kind!r}")
        return np.frombuffer(data, np.dtype(kind).newbyteorder("<"))


def read_torch(path: Path) -> object:
    """Reads all content of the file: tensors as arrays, dicts and lists as such, other objects as Record."""
    try:
        with zipfile.ZipFile(existing(path, "a file of torch.save or torch.jit.save")) as archive:
            prefix = next((name[: -len("data.pkl")] for name in archive.namelist() if name.endswith("data.pkl")), None)
            if prefix is None:
                raise ValueError(f"a zip archive of {listed(archive.namelist())}")
            return _Reader(archive, prefix).load()
    except (
        *(zipfile.BadZipFile, pickle.UnpicklingError, ValueError, KeyError, EOFError, TypeError, IndexError),
        *(RecursionError, MemoryError, OverflowError, AttributeError),
    ) as error:
        raise _unreadable(path, str(error) or type(error).__name__) from error


def read_tensors(path: Path) -> dict[str, AnyArray]:
    """All tensors of a file by their dotted names, as in a state_dict."""
    content = read_torch(path)
    found: dict[str, AnyArray] = {}
    # A stack instead of recursion, because a pickle may be nested to any depth, and contain itself.
    left: list[tuple[object, str, int]] = [(content, "", 0)]
    visited = 0
    while left:
        value, name, depth = left.pop()
        visited += 1
        if visited > _ITEMS or depth > _DEPTH:
            raise _unreadable(path, f"more than {_ITEMS} items, or lists deeper than {_DEPTH}")
        if isinstance(value, np.ndarray):
            found[name] = value
            continue
        dot = f"{name}." if name else ""
        children = [(child, f"{dot}{key}", depth + 1) for key, child in _children(value)]
        if len(left) + len(children) > _ITEMS:
            raise _unreadable(path, f"more than {_ITEMS} items")
        left.extend(reversed(children))
    return found


def _children(value: object) -> Iterable[tuple[object, object]]:
    if isinstance(value, Record):
        return value.state.items()
    if isinstance(value, Mapping):
        return value.items()
    return enumerate(value) if isinstance(value, (list, tuple)) else ()


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
