"""The Gaussian Generator contract, version 1, as the JSON that lies in a file's metadata under `gaussian_contract`.

Everything this package knows about the words of the contract is in this module.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from .errors import ExportError

METADATA_KEY = "gaussian_contract"
VERSION = 1

Role = Literal[
    "view", "projection", "view_projection", "camera_position", "viewport", "time", "frame", "seed", "pose", "shape",
    "control", "gaussians", "image",
]  # fmt: skip
Layout = Literal["packed", "split"]
DType = Literal["float32", "float16"]
Json = dict[str, object]


@dataclass(frozen=True)
class Skeleton:
    """Joint names and the index of each joint's parent, -1 for the root; parents come before their children."""

    joints: Sequence[str]
    parents: Sequence[int]

    def json(self) -> Json:
        """As the contract writes it."""
        return {"joints": list(self.joints), "parents": list(self.parents)}


@dataclass(frozen=True)
class Input:
    """One ONNX input and the role that feeds it. `default` and `range` are flat numbers; `unit` belongs to a time
    ("seconds" or "normalized"), `format` to a pose ("axis-angle", "quaternion", "parameters")."""

    name: str
    role: Role
    shape: Sequence[int]
    default: Sequence[float] | None = None
    range: tuple[float, float] | None = None
    unit: str | None = None
    format: str | None = None
    skeleton: Skeleton | None = None
    label: str | None = None

    def json(self) -> Json:
        """As the contract writes it: absent facts are left out."""
        facts: Json = {"name": self.name, "role": self.role, "shape": list(self.shape), "dtype": "float32"}
        optional: Json = {
            "default": None if self.default is None else list(self.default),
            "range": None if self.range is None else list(self.range),
            "unit": self.unit,
            "format": self.format,
            "skeleton": None if self.skeleton is None else self.skeleton.json(),
            "label": self.label,
        }
        return facts | {key: value for key, value in optional.items() if value is not None}


@dataclass(frozen=True)
class Output:
    """One ONNX output: what it holds, and the numbers' shape."""

    name: str
    kind: str
    shape: Sequence[int]

    def json(self, dtype: DType) -> Json:
        """As the contract writes it."""
        return {"name": self.name, "kind": self.kind, "shape": list(self.shape), "dtype": dtype}


@dataclass(frozen=True)
class Coordinates:
    """World axes: which points up, the handedness, and metres in a unit (0 where nobody knows)."""

    up: Literal["x", "y", "z", "-x", "-y", "-z"] = "-y"
    handedness: Literal["right", "left"] = "right"
    metres_per_unit: float | None = None

    def json(self) -> Json:
        """As the contract writes it."""
        scale = {} if self.metres_per_unit is None else {"metresPerUnit": self.metres_per_unit}
        return {"up": self.up, "handedness": self.handedness, **scale}


@dataclass(frozen=True)
class Facts:
    """What only the person who exports can know."""

    name: str
    license: str
    attribution: str
    antialiased: bool = False
    coordinates: Coordinates = field(default_factory=Coordinates)
    duration: float | None = None
    fps: float | None = None


@dataclass(frozen=True)
class Contract:
    """All that a page must know to run a generator. `bounds` is (min xyz, max xyz) in world units, or None for
    post-processors, which write images and no Gaussians."""

    facts: Facts
    dtype: DType
    inputs: Sequence[Input]
    outputs: Sequence[Output]
    layout: Layout | None = None
    n_max: int | None = None
    sh_degree: int | None = None
    bounds: tuple[Sequence[float], Sequence[float]] | None = None

    def json(self) -> Json:
        """The object that is written; keys in the order a reader wants them."""
        facts = self.facts
        result: Json = {"version": VERSION, "name": facts.name}
        if self.n_max is not None:
            result["nMax"] = self.n_max
        result["dtype"] = self.dtype
        if self.sh_degree is not None:
            result["shDegree"] = self.sh_degree
        if self.bounds is not None:
            result["bounds"] = {"min": list(self.bounds[0]), "max": list(self.bounds[1])}
        for key, value in (("duration", facts.duration), ("fps", facts.fps)):
            if value is not None:
                result[key] = value
        if self.layout is not None:
            result["coordinates"] = facts.coordinates.json()
            result["antialiased"] = facts.antialiased
        result |= {"license": facts.license, "attribution": facts.attribution}
        result["inputs"] = [given.json() for given in self.inputs]
        result["outputs"] = self._outputs()
        return result

    def _outputs(self) -> Json:
        tensors = [output.json(self.dtype) for output in self.outputs]
        if self.layout is None:
            return {"layout": "image", "tensors": tensors}
        color = "sh" if self.sh_degree else "linear"
        activations: Json = {"opacity": "linear", "scale": "linear", "color": color}
        order: Json = {"rotation": "wxyz", "sh": "coefficient-major"}
        return {"layout": self.layout, "tensors": tensors, "activations": activations, "order": order}

    def metadata(self) -> dict[str, str]:
        """The file's metadata_props."""
        return {METADATA_KEY: json.dumps(self.json(), ensure_ascii=False, allow_nan=False)}


def of_metadata(metadata: dict[str, str], where: str) -> Json:
    """The contract of a file's metadata_props. Raises ExportError where there is none."""
    try:
        found = json.loads(metadata[METADATA_KEY])
    except (KeyError, ValueError) as error:
        raise ExportError(
            "contract/violation",
            where=where,
            expected=f"metadata '{METADATA_KEY}' with JSON in it",
            found="none" if isinstance(error, KeyError) else str(error),
            remedy="export the model with gaussian-export, or write NAME.contract.json next to it",
        ) from error
    if not isinstance(found, dict) or found.get("version") != VERSION:
        raise ExportError(
            "contract/violation",
            where=where,
            expected=f"a contract of version {VERSION}",
            found=str(found)[:80],
            remedy="export the model again with this version",
        )
    return found
