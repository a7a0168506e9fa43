"""Declares the meaning of a module's outputs: each tensor, and its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from ..contract import Json
from ..errors import ExportError
from .roles import Role

# In the order of a module that returns a tuple.
ATTRIBUTES = ("positions", "covariances", "scales", "rotations", "colors", "sh", "opacities")


@dataclass(frozen=True)
class Layout:
    """`names` are those of the outputs in the file, in the module's order; `words`: further fields of the contract."""

    kind: Literal["split", "packed", "image"]
    names: tuple[str, ...]
    words: Json
    # The input that receives an additional last output in the next run.
    state: str | None = None
    # Keys of the dict that the module returns, if they differ from the names.
    keys: Mapping[str, str] | None = None
    # Whether its colors are linear light.
    is_linear: bool = False

    @property
    def outputs(self) -> tuple[str, ...]:
        """All outputs of the file."""
        return self.names if self.state is None else (*self.names, f"next_{self.state}")

    def json(self) -> Json:
        """The contract's `outputs`."""
        if self.kind == "split":
            return {"layout": "split", **{name: name for name in self.names}, **self.words}
        return {"layout": self.kind, "gaussians" if self.kind == "packed" else "image": self.names[0], **self.words}


def split(
    *names: str | Mapping[str, str],
    scales: Literal["linear", "log"] = "linear",
    opacities: Literal["linear", "logit"] = "linear",
    rotations: Literal["wxyz", "xyzw"] = "wxyz",
    sh: Literal["coefficient-major", "channel-major"] = "coefficient-major",
    colors: Literal["srgb", "linear"] = "srgb",
    count: bool = False,
    state: str | None = None,
) -> Layout:
    """A tensor for each attribute: split("positions", "scales", "rotations", "colors", "opacities") in the order of
    the module's results. For a module that returns a dict, in any order, or with its own keys: split({"positions":
    "xyz", "opacities": "alpha", ...}). `scales="log"` and `opacities="logit"` for numbers before their activation;
    `colors="linear"` for linear light, which the file converts to sRGB. Without names: those five. `state`: the
    input with the role state() that receives, in the next run, the module's last result; without it, the only such
    input.
    """
    keys = names[0] if names and isinstance(names[0], Mapping) else None
    plain = tuple(keys) if keys is not None else tuple(name for name in names if isinstance(name, str))
    given = plain or ("positions", "scales", "rotations", "colors", "opacities")
    unknown = [name for name in given if name not in ATTRIBUTES]
    if unknown:
        raise ValueError(f"split() takes {', '.join(ATTRIBUTES)}; found {unknown[0]!r}")
    words: Json = {"opacityActivation": opacities}
    if "scales" in given:
        words |= {"scaleActivation": scales, "rotationOrder": rotations}
    if "sh" in given:
        words["shOrder"] = sh
    if count:
        words["count"] = "count"
    return Layout("split", (*given, "count") if count else given, words, state, keys, colors == "linear")


def packed(
    color: Literal["rgb", "sh"] = "rgb",
    opacities: Literal["linear", "logit"] = "linear",
    count: bool = False,
    columns: Sequence[str] | None = None,
    scales: Literal["linear", "log"] = "linear",
    rotations: Literal["wxyz", "xyzw"] = "wxyz",
) -> Layout:
    """One tensor [N,D]: position 3, covariance 6, color 3 or harmonics, opacity 1. `columns`: another order, as LGM's:
    ["positions", "opacities", "scales", "rotations", "colors"].
    """
    words: Json = {"color": color, "opacityActivation": opacities}
    if columns is not None:
        words["columns"] = list(columns)
        if "scales" in columns:
            words |= {"scaleActivation": scales, "rotationOrder": rotations}
    if color == "sh":
        words["shOrder"] = "coefficient-major"
    if count:
        words["count"] = "count"
    return Layout("packed", ("gaussians", "count") if count else ("gaussians",), words)


def image_output(state: str | None = None) -> Layout:
    """A post-processor: one image [1,3,H,W] in 0..1. `state`: as for split()."""
    return Layout("image", ("processed",), {}, state)


def with_state(layout: Layout, inputs: Mapping[str, Role]) -> Layout:
    """The layout, with the only input that has the role state() if it names none."""
    names = [name for name, role in inputs.items() if role.binding["role"] == "state"]
    return layout if layout.state is not None or len(names) != 1 else replace(layout, state=names[0])


def tensors_of(result: Any, layout: Layout) -> list[Any]:
    """The module's tensors in the order of the layout."""
    if hasattr(result, "_asdict"):
        result = result._asdict()
    if isinstance(result, dict):
        keys = [(layout.keys or {}).get(name, name) for name in layout.outputs]
        missing = [key for key in keys if key not in result]
        if missing:
            raise _mismatch(f"a tensor {missing[0]!r} in the dict", ", ".join(map(str, result)), _BY_KEY)
        return [result[key] for key in keys]
    tensors = list(result) if isinstance(result, (tuple, list)) else [result]
    if len(tensors) != len(layout.outputs):
        remedy = (
            _IN_ORDER
            if layout.kind != "image"
            else 'if the second is kept for the next run: image_output(state="NAME")'
        )
        raise _mismatch(f"{len(layout.outputs)} tensors ({', '.join(layout.outputs)})", str(len(tensors)), remedy)
    return tensors


def fitted(name: str, tensor: Any, layout: Layout, torch: Any) -> Any:
    """The tensor in the contract's shape, if it contains the same Gaussians: a leading 1 dropped, covariances as their
    upper triangle, rotation matrices as quaternions, one scale a splat three times, colors without their alpha.
    """
    if layout.state is not None and name == layout.outputs[-1]:
        return tensor
    if name == "count":
        return (tensor.reshape(1) if tensor.numel() == 1 else tensor).to(torch.int32)
    x = tensor.float() if tensor.dtype != torch.float32 else tensor
    if layout.kind == "image":
        return x[:, :3] if x.dim() == 4 else x[None, :3]
    # Covariances and rotations may be matrices, and harmonics have two axes after the rows.
    are_matrices = name in ("covariances", "rotations") and x.dim() > 2 and x.shape[-2:] == (3, 3)
    wide = 3 if name == "sh" or are_matrices else 2
    while x.dim() > wide and x.shape[0] == 1:
        x = x[0]
    if name == "rotations" and are_matrices and x.dim() == 3:
        # While a module is exported, its tensors have no values.
        if not (torch.jit.is_tracing() or torch.compiler.is_compiling()):
            turned_back = x @ x.transpose(1, 2) - torch.eye(3, device=x.device)
            if not ((turned_back.abs() < 1e-2).all() and (x.det() > 0).all()):
                raise _mismatch("rotations, as quaternions or rotation matrices", "other 3x3 matrices", _NO_ROTATION)
        wxyz = _quaternions(x.reshape(-1, 9), torch)
        return wxyz if layout.words["rotationOrder"] == "wxyz" else torch.cat([wxyz[:, 1:], wxyz[:, :1]], -1)
    if name == "covariances" and are_matrices and x.dim() == 3:
        upper = x.reshape(-1, 9)
        return torch.stack([upper[:, i] for i in (0, 1, 2, 4, 5, 8)], -1)
    if name == "scales" and (x.dim() == 1 or (x.dim() == 2 and x.shape[-1] == 1)):
        return x.reshape(-1, 1).expand(-1, 3).clone()
    if name == "colors" and x.dim() == 2:
        return _srgb(x[:, :3], torch) if layout.is_linear else x[:, :3]
    if name == "opacities" and x.dim() == 1:
        return x[:, None]
    return x


def _srgb(linear: Any, torch: Any) -> Any:
    """The transfer function of IEC 61966-2-1."""
    clamped = linear.clamp(0, 1)
    return torch.where(clamped <= 0.0031308, clamped * 12.92, 1.055 * clamped.clamp(min=0.0031308) ** (1 / 2.4) - 0.055)


def _quaternions(rows: Any, torch: Any) -> Any:
    """w x y z, of any length, of rotation matrices: a column of 4 q q^T whose diagonal, 4 at most, is 1 or more,
    because the four sum to 4.
    """
    a, b, c, d, e, f, g, h, i = rows.unbind(-1)
    w = torch.stack([1 + a + e + i, h - f, c - g, d - b], -1)
    x = torch.stack([h - f, 1 + a - e - i, b + d, c + g], -1)
    y = torch.stack([c - g, b + d, 1 - a + e - i, f + h], -1)
    z = torch.stack([d - b, c + g, f + h, 1 - a - e + i], -1)
    for column, place in ((y, 2), (x, 1), (w, 0)):
        z = torch.where(column[:, place : place + 1] >= 1, column, z)
    return z


_NO_ROTATION = "take the scales out of them; R S S^T R^T is 'covariances'"
_IN_ORDER = "name what it returns, in its order: outputs=split('positions', 'covariances', 'colors', 'opacities')"
_ONE_IMAGE = 'return the image alone; with what the next run is given: inputs={..., "NAME": state([1, 3, H, W])}'
_BY_KEY = "say which key is what: outputs=split({'positions': 'xyz', 'covariances': 'cov', 'colors': 'rgb', ...})"


def _mismatch(expected: str, found: str, remedy: str = _IN_ORDER) -> ExportError:
    return ExportError(
        "argument/value",
        where="what the module returns",
        expected=expected,
        found=found,
        remedy=remedy,
    )
