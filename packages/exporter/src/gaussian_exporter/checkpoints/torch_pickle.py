"""The pickle of a file of PyTorch, read with few known functions, and with bounds for steps and bytes.

A pickle is a program. Python's own reader in C allocates by numbers in the program, and copies lists as often as the
program says. The one in Python, which is used here, calls a function for each step, so that steps are counted.
"""

from __future__ import annotations

import io
import math
import pickle
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..arrays import AnyArray
from .untrusted import Budget, read_entry

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
_Unpickler: Any = pickle._Unpickler
# Steps of a pickle, at most, about half a second. A copied item counts as a step. Networks have thousands.
_STEPS = 500_000
# Axes of a tensor, and numbers along one, at most.
_AXES = 32
_EXTENT = 1 << 48
# Steps that torch.save does not write: they allocate by numbers in the file, or need a registry.
_REFUSED = (pickle.EXT1, pickle.EXT2, pickle.EXT4, pickle.BYTEARRAY8, pickle.NEXT_BUFFER, pickle.READONLY_BUFFER)


class Record:
    """An object of an unknown class: its state, or the arguments of its constructor."""

    def __init__(self, *arguments: object):
        """Keeps the arguments of the constructor that the pickle calls."""
        self.arguments = arguments
        self.state: dict[str, object] = {}

    def __setstate__(self, state: object) -> None:
        """The pickle's BUILD: keeps a state that is a mapping."""
        if isinstance(state, Mapping):
            self.state = {part_of_name(key): value for key, value in state.items()}

    def __setitem__(self, key: object, value: object) -> None:
        """The pickle's SETITEM on unknown mappings."""
        self.state[part_of_name(key)] = value

    def append(self, value: object) -> None:
        """The pickle's APPEND on unknown lists."""
        self.state[str(len(self.state))] = value


def part_of_name(key: object) -> str:
    """A key as part of a name. Other objects are not written out, because nested ones have endless texts."""
    return str(key) if isinstance(key, (str, int)) else type(key).__name__


class TorchUnpickler(_Unpickler):  # type: ignore[misc]
    """Reader of the pickle in an archive. `load` raises what pickle raises, and ValueError for too much."""

    def __init__(self, archive: zipfile.ZipFile, prefix: str, budget: Budget):
        """`prefix` is the folder in the archive, `budget` the account of the file."""
        super().__init__(io.BytesIO(read_entry(archive, f"{prefix}data.pkl", budget)))
        self._archive = archive
        self._prefix = prefix
        self._budget = budget
        self._steps = 0
        self._classes: dict[tuple[str, str], type[Record]] = {}
        self._storages: dict[tuple[str, str], AnyArray] = {}
        self._known: dict[tuple[str, str], Callable[..., Any]] = {
            ("torch._utils", "_rebuild_tensor_v2"): self._tensor,
            ("torch._utils", "_rebuild_tensor"): self._tensor,
            ("torch._utils", "_rebuild_parameter"): _parameter,
            ("collections", "OrderedDict"): self._ordered,
            ("torch", "Size"): self._size,
        }

    def count(self, steps: int = 1) -> None:
        """Charges steps. Raises ValueError for too many."""
        self._steps += steps
        if self._steps > _STEPS:
            raise ValueError(f"a pickle of more than {_STEPS} steps")

    def find_class(self, module: str, name: str) -> Any:
        """A known function, the type of a storage, or an inert class."""
        if (module, name) in self._known:
            return self._known[module, name]
        if module == "torch" and name in _STORAGES:
            return _STORAGES[name]
        # A separate class for each name: NEWOBJ needs a class, REDUCE anything callable.
        if (module, name) not in self._classes:
            self.count(100)
            self._classes[module, name] = type(name, (Record,), {})
        return self._classes[module, name]

    def persistent_load(self, pid: Any) -> AnyArray:
        """A storage, which the pickle refers to by its key. Tensors of the same storage get the same array."""
        _, kind, key, *_rest = pid
        if not isinstance(kind, str):
            raise ValueError(f"storage of an unknown type {kind!r:.80}")
        known = (kind, str(key))
        if known not in self._storages:
            data = read_entry(self._archive, f"{self._prefix}data/{key}", self._budget)
            self._storages[known] = self._numbers(data, kind)
        return self._storages[known]

    def _numbers(self, data: bytes, kind: str) -> AnyArray:
        if kind != "bf16":
            return np.frombuffer(data, np.dtype(kind).newbyteorder("<"))
        self._budget.take(2 * len(data))
        return (np.frombuffer(data, "<u2").astype(np.uint32) << 16).view(np.float32)

    def _tensor(
        self, storage: AnyArray, offset: int, size: Sequence[int], stride: Sequence[int], *_: object
    ) -> AnyArray:
        if len(size) > _AXES or any(not (isinstance(n, int) and 0 <= n < _EXTENT) for n in (offset, *size, *stride)):
            raise ValueError("a tensor without a usable size")
        if 0 in size:
            return np.zeros(tuple(size), storage.dtype)
        last = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True))
        if last >= storage.size:
            raise ValueError(f"a tensor {tuple(size)} that reaches beyond its {storage.size} numbers")
        # Strides of 0 repeat numbers, so that the size of the storage does not limit the copy.
        self._budget.take(math.prod(size) * storage.itemsize)
        steps = tuple(step * storage.itemsize for step in stride)
        return np.lib.stride_tricks.as_strided(storage[offset:], tuple(size), steps, writeable=False).copy()

    def _ordered(self, items: Iterable[Any] = ()) -> OrderedDict[Any, Any]:
        pairs = items if isinstance(items, (list, tuple, dict)) else ()
        self.count(len(pairs))
        return OrderedDict(pairs)

    def _size(self, items: Sequence[int] = ()) -> tuple[int, ...]:
        self.count(len(items))
        return tuple(items)


def _parameter(data: object, *_: object) -> object:
    return data


def _counted(step: Callable[[Any], None]) -> Callable[[Any], None]:
    def counted(reader: Any) -> None:
        reader.count()
        step(reader)

    return counted


def _built(reader: Any) -> None:
    """BUILD, whose copy of a state takes a step for each item."""
    state = reader.stack[-1]
    for part in state if isinstance(state, tuple) else (state,):
        reader.count(1 + (len(part) if isinstance(part, Mapping) else 0))
    _Unpickler.load_build(reader)


TorchUnpickler.dispatch = {
    **{key: _counted(step) for key, step in _Unpickler.dispatch.items() if bytes([key]) not in _REFUSED},
    pickle.BUILD[0]: _built,
}
