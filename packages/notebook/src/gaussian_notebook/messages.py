"""Messages of the element: the binary framing of docs/guide/changing-scenes.md."""

import struct
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

#: A NumPy array, a PyTorch tensor on any device, or nested lists.
Arrays: TypeAlias = Any

_NAMES = ("positions", "scales", "rotations", "opacities", "sh", "colors")
_WIDTHS = {"positions": 3, "scales": 3, "rotations": 4, "opacities": 1, "colors": 3}
_FILTERS = {"classic": 0, "antialiased": 4, "mip": 8}
_RANGE, _RAW = 1, 2
#: Degree of spherical harmonics, by the number K of coefficients of a channel.
_DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}


_HEADER = struct.Struct("<4s4B4I3d")


def _floats(value: Arrays) -> npt.NDArray[np.float32]:
    """Returns a contiguous little-endian float32 array. A tensor may be on a GPU, and require gradients."""
    if hasattr(value, "detach"):
        value = value.detach().cpu().numpy()
    return np.ascontiguousarray(value, dtype="<f4")


def message(
    arrays: Mapping[str, Arrays], *, step: int = 0, first: int | None = None, raw: bool = False, filter: str = "classic"
) -> bytes:
    """Returns the message of a scene of N splats, or of a range of one.

    Args:
        arrays: By name: `positions` [N, 3] in world units, `scales` [N, 3] standard deviations in world units,
            `rotations` [N, 4] quaternions (w, x, y, z) of any length above 0, `opacities` [N] 0..1, and either `sh`
            [N, K, 3] with K = 1, 4, 9 or 16, or `colors` [N, 3] 0..1. A range has those that change.
        step: A number of the sender, 0..2³² - 1, such as its iteration.
        first: Index of the first splat of a range. None: the message is a whole scene.
        raw: Whether `scales` are natural logarithms and `opacities` logits, as trainers store them.
        filter: Screen-space filter of the training: `classic`, `antialiased` or `mip`.

    Raises:
        ValueError: For unknown names, for missing arrays, and for shapes that do not match.
    """
    unknown = set(arrays) - set(_NAMES)
    if unknown:
        raise ValueError(f"arrays: expected {', '.join(_NAMES)}, found {', '.join(sorted(unknown))}")
    if filter not in _FILTERS:
        raise ValueError(f"filter: expected {', '.join(_FILTERS)}, found {filter!r}")
    found = {name: _floats(arrays[name]) for name in _NAMES if arrays.get(name) is not None}
    missing = [name for name in _NAMES[:4] if name not in found]
    if first is None and missing:
        raise ValueError(f"{missing[0]}: expected an array, because a whole scene has all attributes, found none")
    if ("sh" in found) + ("colors" in found) not in ((1,) if first is None else (0, 1)):
        raise ValueError("sh: expected either sh or colors")
    if not found:
        raise ValueError("arrays: expected one or more, found none")
    count = len(next(iter(found.values())))
    degree = 0
    for name, array in found.items():
        shape: tuple[int, ...] = (count, _WIDTHS[name]) if name in _WIDTHS else (count, *array.shape[1:2], 3)
        if name == "opacities" and array.ndim == 1:
            shape = (count,)
        if array.shape != shape:
            raise ValueError(f"{name}: expected the shape {shape}, found {array.shape}")
        if name == "sh":
            if array.shape[1] not in _DEGREES:
                raise ValueError(f"sh: expected 1, 4, 9 or 16 coefficients for each channel, found {array.shape[1]}")
            degree = _DEGREES[array.shape[1]]
    flags = (0 if first is None else _RANGE) | (_RAW if raw else 0) | _FILTERS[filter]
    bits = sum(1 << k for k, name in enumerate(_NAMES) if name in found)
    header = _HEADER.pack(b"GSUP", 1, flags, bits, degree, step, first or 0, count, 0, 0.0, 0.0, 0.0)
    return header + b"".join(array.tobytes() for array in found.values())


def _places(data: bytes | bytearray) -> tuple[int, int, dict[str, tuple[int, int]]]:
    """Returns the first splat and the count of a message, and for each array its byte offset and its bytes a splat."""
    _, _, _, bits, degree, _, first, count, *_ = _HEADER.unpack_from(data)
    places, at = {}, _HEADER.size
    for k, name in enumerate(_NAMES):
        if bits & 1 << k:
            width = 4 * _WIDTHS.get(name, 3 * (degree + 1) ** 2)
            places[name] = (at, width)
            at += width * count
    return first, count, places


def apply(scene: bytearray, change: bytes) -> None:
    """Writes the arrays of a range into the message of its scene, which gets the number of the range.

    Raises:
        ValueError: If the scene lacks an array of the range, or a splat of it.
    """
    first, count, changed = _places(change)
    _, total, places = _places(scene)
    if first + count > total:
        raise ValueError(f"first: expected a range within {total} splats, found {first} to {first + count}")
    for name, (at, width) in changed.items():
        if places.get(name, (0, 0))[1] != width:
            raise ValueError(f"{name}: expected an array of the scene, found one that it does not have")
        to = places[name][0] + width * first
        scene[to : to + width * count] = change[at : at + width * count]
    scene[8:12] = change[8:12]
