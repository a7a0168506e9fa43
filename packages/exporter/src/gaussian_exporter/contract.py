"""The Gaussian Generator contract, version 1, as JSON in a file's metadata under `gaussian_contract`. This module
contains all knowledge of this package about the contract.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from .errors import ExportError
from .graph import INSTANCES_AXIS

METADATA_KEY = "gaussian_contract"
VERSION = 1

Layout = Literal["packed", "split"]
# Tensors of a split layout that define the shape: covariances, or scales and rotations.
Shape = Literal["covariances", "axes"]
ScaleActivation = Literal["linear", "log"]
OpacityActivation = Literal["linear", "logit"]
DType = Literal["float32", "float16"]
Filter = Literal["classic", "antialiased", "mip"]
Up = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Json = dict[str, object]

MATRICES = ("view", "camera_to_world", "intrinsics", "projection", "view_projection")
# Roles that several inputs may have: their names distinguish them, or their conventions.
REPEATED = frozenset({"pose", "shape", "control", "image", "state", *MATRICES})


@dataclass(frozen=True)
class Input:
    """One ONNX input: its name, and its entry in the contract with the role that feeds it."""

    name: str
    binding: Json


def camera_position(name: str = "camera_position") -> Input:
    """[3]: the eye, in world units."""
    return Input(name, {"role": "camera_position"})


def normalized_time(name: str = "time") -> Input:
    """[1]: fraction 0..1 of the contract's duration, which must be declared."""
    return Input(name, {"role": "time", "unit": "normalized"})


def pose(name: str, joints: Sequence[str], parents: Sequence[int], quaternions: bool) -> Input:
    """[J,3] axis-angle in radians, or [J,4] quaternions w x y z; default: no rotation."""
    rest = [1.0, 0.0, 0.0, 0.0] if quaternions else [0.0, 0.0, 0.0]
    kind: Json = {"format": "quaternion", "quaternionOrder": "wxyz"} if quaternions else {"format": "axis-angle"}
    skeleton: Json = {"joints": list(joints), "parents": [int(parent) for parent in parents]}
    return Input(name, {"role": "pose", **kind, **skeleton, "default": rest * len(joints)})


def shape(name: str, count: int) -> Input:
    """[count]: coefficients of a body; default zeros."""
    return Input(name, {"role": "shape", "default": [0.0] * count})


def control(name: str, default: float | Sequence[float], low: float, high: float, label: str | None = None) -> Input:
    """Float32 of any shape: a control for visitors. One default for all elements, or one for each."""
    value = default if isinstance(default, (int, float)) else list(default)
    named = {} if label is None else {"label": label}
    return Input(name, {"role": "control", "range": [low, high], "default": value, **named})


def image(name: str = "image") -> Input:
    """[1,3,H,W]: red, green and blue planes in 0..1, top row first."""
    return Input(name, {"role": "image"})


@dataclass(frozen=True)
class Coordinates:
    """Coordinate system of the Gaussians: which axis points up (-y if nothing declares it), the handedness, meters in a
    unit if known.
    """

    up: Up | None = None
    handedness: Literal["right", "left"] = "right"
    meters_per_unit: float | None = None

    @staticmethod
    def of(given: Any) -> Coordinates:
        """Converts Coordinates, a dict of these fields or of the contract's, or an up axis alone; `y` is +y."""
        if given is None or isinstance(given, Coordinates):
            fields = vars(given or Coordinates())
        else:
            fields = dict(given) if isinstance(given, Mapping) else {"up": given}
        fields = {"meters_per_unit" if key == "metresPerUnit" else key: value for key, value in fields.items()}
        up = fields.get("up") or "-y"
        fields["up"] = f"+{up}" if up in ("x", "y", "z") else up
        is_known = fields["up"] in get_args(Up) and fields.get("handedness", "right") in ("right", "left")
        if not is_known or fields.keys() - {"up", "handedness", "meters_per_unit"}:
            raise ExportError(
                "argument/value",
                where="coordinates",
                expected=f"up, one of {', '.join(get_args(Up))}; handedness, right or left; meters_per_unit",
                found=repr(given),
                remedy='write coordinates={"up": "+y"}, or Coordinates(up="+y")',
            )
        return Coordinates(**fields)

    def json(self) -> Json:
        """Returns the form of the contract."""
        scale = {} if self.meters_per_unit is None else {"metresPerUnit": self.meters_per_unit}
        return {"up": self.up or "-y", "handedness": self.handedness, **scale}


@dataclass(frozen=True)
class Facts:
    """Facts from the caller, which no checkpoint contains. `duration` in seconds, `fps` in frames per second."""

    name: str
    license: str
    attribution: str
    antialiased: bool = False
    # The filter of the training, if antialiased does not define it.
    filter: Filter | None = None
    coordinates: Coordinates = field(default_factory=Coordinates)
    duration: float | None = None
    fps: float | None = None


@dataclass(frozen=True)
class GaussianOutputs:
    """Form of the Gaussians. sh_degree is None for plain colors; names are those of the layout's tensors."""

    layout: Layout
    shape: Shape
    n_max: int
    dtype: DType
    sh_degree: int | None
    bounds: tuple[Sequence[float], Sequence[float]]
    # Maximum number of instances in one run; None if the outputs have no axis of instances.
    instances: int | None = None
    scale_activation: ScaleActivation = "linear"
    opacity_activation: OpacityActivation = "linear"

    def json(self) -> Json:
        """The contract's `outputs`."""
        sh: Json = {} if self.sh_degree is None else {"shOrder": "coefficient-major"}
        if self.layout == "packed":
            color = "rgb" if self.sh_degree is None else "sh"
            return {"layout": "packed", "gaussians": "gaussians", "color": color, "opacityActivation": "linear", **sh}
        shape = ["covariances"] if self.shape == "covariances" else ["scales", "rotations"]
        axes = {"scaleActivation": self.scale_activation, "rotationOrder": "wxyz"} if self.shape == "axes" else {}
        names = ["positions", *shape, "colors" if self.sh_degree is None else "sh", "opacities"]
        return {
            "layout": "split",
            **{name: name for name in names},
            **axes,
            "opacityActivation": self.opacity_activation,
            **sh,
        }


def gaussian_contract(facts: Facts, inputs: Sequence[Input], outputs: GaussianOutputs) -> Json:
    """The contract of a generator, keys in reading order."""
    if facts.duration is None and any(given.binding.get("unit") == "normalized" for given in inputs):
        raise ExportError(
            "argument/value",
            where="duration",
            expected="the seconds that time 0 to 1 plays",
            found="none",
            remedy="give --duration SECONDS",
        )
    low, high = outputs.bounds
    written: Json = {"nMax": outputs.n_max, "dtype": outputs.dtype}
    if outputs.instances is not None:
        written["instances"] = {"axis": INSTANCES_AXIS, "most": outputs.instances}
    if outputs.sh_degree is not None:
        written["shDegree"] = outputs.sh_degree
    playing = {key: value for key, value in (("duration", facts.duration), ("fps", facts.fps)) if value is not None}
    return {
        "version": VERSION,
        "name": facts.name,
        "inputs": {given.name: given.binding for given in inputs},
        "outputs": outputs.json(),
        **written,
        "bounds": {"min": list(low), "max": list(high)},
        **playing,
        "coordinates": facts.coordinates.json(),
        "antialiased": facts.antialiased or facts.filter in ("antialiased", "mip"),
        **({} if facts.filter is None else {"filter": facts.filter}),
        "license": facts.license,
        "attribution": facts.attribution,
    }


def image_contract(facts: Facts, inputs: Sequence[Input]) -> Json:
    """The contract of a post-processor, whose output is called `processed`."""
    return {
        "version": VERSION,
        "name": facts.name,
        "inputs": {given.name: given.binding for given in inputs},
        "outputs": {"layout": "image", "image": "processed"},
        "license": facts.license,
        "attribution": facts.attribution,
    }


def metadata(contract: Json) -> dict[str, str]:
    """The file's metadata_props."""
    return {METADATA_KEY: json.dumps(contract, ensure_ascii=False, allow_nan=False)}


def of_metadata(props: dict[str, str], where: str) -> Json:
    """The contract of a file's metadata_props. Raises contract/inference without one."""
    try:
        found = json.loads(props[METADATA_KEY].removeprefix("\ufeff"))
    except (KeyError, ValueError, RecursionError) as error:
        raise ExportError(
            "contract/inference" if isinstance(error, KeyError) else "contract/json",
            where=where,
            expected=f"metadata '{METADATA_KEY}' with JSON in it",
            found="none" if isinstance(error, KeyError) else str(error),
            remedy="export the model with gaussian-export, or write NAME.contract.json next to it",
        ) from error
    if not isinstance(found, dict) or found.get("version") != VERSION:
        raise ExportError(
            "contract/version" if isinstance(found, dict) and "version" in found else "contract/schema",
            where=where,
            expected=f"a contract of version {VERSION}",
            found=str(found)[:80],
            remedy="export the model again with this version",
        )
    return found
