"""PLY files of trainers: one element `vertex` of scalar properties, binary or ascii."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import AnyArray, Floats
from ..errors import ExportError, listed
from .files import existing
from .unread import refuse_unread

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_LONGEST_HEADER = 1 << 16


class Vertices:
    """The element `vertex` of a PLY file, as columns."""

    def __init__(self, path: Path, rows: AnyArray):
        """`rows` is a structured array with a field for each property."""
        self.path = path
        self.rows = rows
        self.names: tuple[str, ...] = rows.dtype.names or ()
        self._read: set[str] = set()

    def __len__(self) -> int:
        """Number of vertices."""
        return len(self.rows)

    def columns(self, *names: str) -> Floats:
        """Properties as float32 columns (N, len(names)). Raises checkpoint/incomplete for one that is missing."""
        missing = [name for name in names if name not in self.names]
        if missing:
            raise ExportError(
                "checkpoint/incomplete",
                where=str(self.path),
                expected=f"properties {listed(missing)}",
                found=f"properties {listed(self.names, 12)}",
                remedy="check that the file belongs to this family of models; gaussian-export --help lists them",
            )
        self._read.update(names)
        return np.stack([self.rows[name].astype(np.float32) for name in names], 1)

    def refuse_unread(self, ignored: Sequence[str] = (), harmless: str = "(?!)") -> None:
        """Raises checkpoint/other-family for unread properties; normals change nothing."""
        known = f"n[xyz]|{harmless}"
        refuse_unread(self.path, "properties", self.names, self._read, ignored=ignored, harmless=known)

    def numbered(self, prefix: str) -> Floats:
        """Properties prefix0, prefix1, ... as columns in the order of their numbers; (N,0) without any."""
        rest = [name.removeprefix(prefix) for name in self.names if name.startswith(prefix)]
        numbers = sorted(int(number) for number in rest if number.isdigit())
        return self.columns(*(f"{prefix}{n}" for n in numbers)) if numbers else np.zeros((len(self), 0), np.float32)


def read_ply(path: Path) -> Vertices:
    """Reads a PLY file. Raises ExportError for anything else."""
    data = existing(path, "a PLY file").read_bytes().removeprefix(b"\xef\xbb\xbf")
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise _unreadable(path, "a PLY header", _what(data))
    body = data.index(b"\n", end) + 1
    lines = [line.split() for line in data[:end].decode("ascii", "replace").splitlines()]
    encoding, count, dtype = _header(path, lines)
    if encoding == "ascii":
        return Vertices(path, _ascii_rows(path, data[body:], count, dtype))
    if len(data) - body < count * dtype.itemsize:
        raise _unreadable(path, f"{count} vertices of {dtype.itemsize} bytes", f"{len(data) - body} bytes")
    stored = dtype.newbyteorder("<" if encoding == "binary_little_endian" else ">")
    return Vertices(path, np.frombuffer(data, stored, count, body))


def _header(path: Path, lines: list[list[str]]) -> tuple[str, int, np.dtype[np.void]]:
    encoding, count, fields, element = "", -1, list[tuple[str, str]](), ""
    for line in lines:
        match line:
            case ["format", kind, _]:
                encoding = kind
            case ["element", name, number]:
                if name == "vertex" and element:
                    raise _unreadable(path, "vertex as the first element", f"element {element} before it")
                element = name
                count = int(number) if name == "vertex" and number.isdigit() else count
            case ["property", kind, name] if element == "vertex" and kind in _TYPES:
                fields.append((name, _TYPES[kind]))
            case ["property", *rest] if element == "vertex":
                raise _unreadable(path, "scalar properties of vertices", " ".join(rest))
    if encoding not in ("ascii", "binary_little_endian", "binary_big_endian") or count < 1 or not fields:
        raise _unreadable(path, "a format, and an element vertex with properties", f"{encoding}, {count} vertices")
    if len({name for name, _ in fields}) < len(fields):
        raise _unreadable(path, "properties with different names", "one name twice")
    return encoding, count, np.dtype(fields)


def _ascii_rows(path: Path, body: bytes, count: int, dtype: np.dtype[np.void]) -> AnyArray:
    width = len(dtype.names or ())
    try:
        numbers = np.array(body.split()[: count * width], np.float64).reshape(count, width)
    except ValueError as error:
        raise _unreadable(path, f"{count} lines of {width} numbers", str(error)) from error
    rows = np.zeros(count, dtype)
    for index, name in enumerate(dtype.names or ()):
        rows[name] = numbers[:, index]
    return rows


def _what(data: bytes) -> str:
    if data.startswith(b"version https://git-lfs"):
        return "a git-LFS pointer"
    return f"bytes {data[:16]!r}"


def _unreadable(path: Path, expected: str, found: str) -> ExportError:
    return ExportError(
        "checkpoint/unreadable",
        where=str(path),
        expected=expected,
        found=found,
        remedy="check that the file was downloaded or written completely",
    )
