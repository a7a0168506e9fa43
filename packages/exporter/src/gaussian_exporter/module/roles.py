"""Roles of a module's inputs: the binding in the contract, the shape, and values to test the module with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import AnyArray
from ..contract import Json


@dataclass(frozen=True)
class Role:
    """An input of a page. `samples[0]` is its default; the others reach the ends of its range."""

    binding: Json
    shape: tuple[int, ...]
    samples: Sequence[AnyArray]
    # A value at which lengths and differences are 0, if a page can set one. It reveals a dropped small addend.
    zero: AnyArray | None = None

    @property
    def default(self) -> AnyArray:
        """The initial value in a page."""
        return self.samples[0]


def _floats(shape: tuple[int, ...], *values: object) -> list[AnyArray]:
    return [np.broadcast_to(np.asarray(value, np.float32), shape).copy() for value in values]


# Fractions of the duration. Simple ones would test a looping motion in the same state each time.
_SHARES = (0.0, 0.131, 0.367, 0.5, 0.618, 0.887, 1.0)


def time(duration: float | None = None, normalized: bool = False, shape: Sequence[int] = (1,)) -> Role:
    """Seconds or, with `normalized`, a fraction 0..1 of the duration, which is then required. `duration` is the length
    of the model in seconds, if it has one, and becomes the page's.
    """
    if normalized and duration is None:
        raise ValueError("time(normalized=True) needs duration=SECONDS")
    unit = "normalized" if normalized else "seconds"
    end = 1.0 if normalized else (duration or 1.0)
    sizes = tuple(shape)
    binding: Json = {"role": "time", "unit": unit, "_duration": duration}
    return Role(binding, sizes, _floats(sizes, *(s * end for s in _SHARES)))


def control(
    low: float,
    high: float,
    default: float | Sequence[float] | None = None,
    *,
    label: str | None = None,
    step: float | None = None,
    shape: Sequence[int] = (1,),
) -> Role:
    """A slider for visitors, with the text `label`. Default: 0 if that is within the range, else its middle."""
    middle = 0.0 if low <= 0 <= high else (low + high) / 2
    value = middle if default is None else default
    named: Json = {"label": label} if label is not None else {}
    stepped: Json = {"step": step} if step is not None else {}
    plain = value if isinstance(value, (int, float)) else [float(x) for x in value]
    binding: Json = {"role": "control", "range": [low, high], "default": plain, **stepped, **named}
    sizes = tuple(shape)
    rest = np.reshape(np.asarray(plain, np.float32), sizes) if isinstance(plain, list) else plain
    zero = np.zeros(sizes, np.float32) if low <= 0 <= high else None
    middle = low + 0.5 * (high - low)
    return Role(binding, sizes, _floats(sizes, rest, low, high, low + 0.618 * (high - low), middle), zero)


def pose(
    joints: int | Sequence[str],
    parents: Sequence[int] | None = None,
    *,
    format: Literal["axis-angle", "quaternion", "matrix", "parameters"] = "axis-angle",
    rest: Sequence[float] | None = None,
    flat: bool = False,
) -> Role:
    """[J,3] axis-angle in radians, [J,4] quaternions w x y z, [J,3,3] rotation matrices, or [P] parameters; joints by
    name or number. `flat`: all in one row, [72] for 24 joints.
    """
    count = joints if isinstance(joints, int) else len(joints)
    joint: tuple[int, ...] = {"axis-angle": (3,), "quaternion": (4,), "matrix": (3, 3), "parameters": ()}[format]
    sizes = (count * int(np.prod(joint)),) if flat or not joint else (count, *joint)
    units: dict[str, list[float]] = {"quaternion": [1, 0, 0, 0], "matrix": [1, 0, 0, 0, 1, 0, 0, 0, 1]}
    unit = units.get(format, [0])
    still = np.tile(np.asarray(unit, np.float32), count * int(np.prod(joint)) // len(unit)).reshape(sizes)
    if rest is not None:
        still = np.asarray(rest, np.float32).reshape(sizes)
    binding: Json = {"role": "pose", "format": format}
    if format == "quaternion":
        binding["quaternionOrder"] = "wxyz"
    if not isinstance(joints, int):
        binding["joints"] = list(joints)
    if parents is not None:
        binding["parents"] = [int(parent) for parent in parents]
    binding["default"] = [float(x) for x in still.reshape(-1)]
    zero = np.tile(np.asarray(unit, np.float32), still.size // len(unit)).reshape(sizes)
    return Role(binding, sizes, [still, *(_bent(still, size, format) for size in (0.2, 0.6))], zero)


def _bent(still: AnyArray, size: float, format: str) -> AnyArray:
    rng = np.random.default_rng(0)
    if format != "matrix":
        return (still + size * rng.normal(size=still.shape)).astype(np.float32)
    turns = [np.linalg.qr(m + size * rng.normal(size=(3, 3)))[0] for m in still.reshape(-1, 3, 3)]
    proper = [turn * np.sign(np.linalg.det(turn)) for turn in turns]
    return np.asarray(proper, np.float32).reshape(still.shape)


def shape(count: int, names: Sequence[str] | None = None) -> Role:
    """[count] coefficients of a body or an expression; zeros by default."""
    binding: Json = {"role": "shape", "default": [0.0] * count}
    if names is not None:
        binding["names"] = list(names)
    return Role(binding, (count,), _floats((count,), 0, np.linspace(-1, 1, count)), np.zeros(count, np.float32))


def camera() -> Role:
    """[3]: the eye, in world units."""
    return Role({"role": "camera_position"}, (3,), _floats((3,), [0, 0, -5], [3, -1, -4], [-2, 1.5, 5]))


def _matrices() -> list[AnyArray]:
    turned = np.eye(4, dtype=np.float32)
    turned[:3, :3] = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    found = [np.eye(4, dtype=np.float32), turned]
    for matrix in found:
        matrix[2, 3] = 5
    return [matrix.copy() for matrix in found]


def view(axes: str = "RDF", column_major: bool = False) -> Role:
    """[4,4] world to camera; axes RDF as in OpenCV, or RUB as in OpenGL."""
    order = "column-major" if column_major else "row-major"
    matrices = [matrix.T.copy() if column_major else matrix for matrix in _matrices()]
    return Role({"role": "view", "order": order, "axes": axes}, (4, 4), matrices)


def camera_to_world(axes: str = "RDF") -> Role:
    """[4,4] camera to world, the inverse of view(); its last column is the eye."""
    inverses = [np.linalg.inv(matrix).astype(np.float32) for matrix in _matrices()]
    return Role({"role": "camera_to_world", "order": "row-major", "axes": axes}, (4, 4), inverses)


def intrinsics(normalized: bool = False) -> Role:
    """[3,3]: fx 0 cx, 0 fy cy, 0 0 1, in pixels or as fractions of the image's width and height."""
    unit = "normalized" if normalized else "pixels"
    sides = [(1.0, 1.0)] if normalized else [(640.0, 480.0), (1920.0, 1080.0)]
    found = [[[0.8 * w, 0, w / 2], [0, 0.8 * w, h / 2], [0, 0, 1]] for w, h in sides]
    return Role({"role": "intrinsics", "unit": unit}, (3, 3), _floats((3, 3), *found))


def state(shape: Sequence[int], default: float = 0.0) -> Role:
    """Output of the module in the previous run, under the name that split(state=...) gives it."""
    sizes = tuple(shape)
    rng = np.random.default_rng(0)
    binding: Json = {"role": "state", "default": default}
    samples = [*_floats(sizes, default), rng.normal(size=sizes).astype(np.float32)]
    return Role(binding, sizes, samples, np.zeros(sizes, np.float32))


def projection(axes: str = "RDF") -> Role:
    """[4,4] camera to clip space, depth 0..1."""
    near, far = 0.1, 100.0
    deep = [[1.5, 0, 0, 0], [0, -1.5, 0, 0], [0, 0, far / (far - near), -near * far / (far - near)], [0, 0, 1, 0]]
    return Role({"role": "projection", "order": "row-major", "axes": axes}, (4, 4), _floats((4, 4), deep))


def view_projection() -> Role:
    """[4,4] world to clip space."""
    whole = [projection().default @ matrix for matrix in _matrices()]
    return Role({"role": "view_projection", "order": "row-major"}, (4, 4), whole)


def viewport() -> Role:
    """[2]: width and height in pixels."""
    return Role({"role": "viewport"}, (2,), _floats((2,), [640, 480], [1920, 1080]))


def image(width: int, height: int, views: int = 1, examples: Sequence[object] | None = None) -> Role:
    """[1,3,H,W], or [V,3,H,W] of several views: red, green and blue planes in 0..1, top row first. `examples`: images
    of that shape to compare the file at, in place of noise, which means nothing to a detector.
    """
    rng, sizes = np.random.default_rng(0), (views, 3, height, width)
    if examples is not None:
        return Role({"role": "image"}, sizes, [np.asarray(x, np.float32).reshape(sizes) for x in examples])
    images = [rng.random(sizes).astype(np.float32) for _ in range(2)]
    return Role({"role": "image"}, sizes, images, np.zeros(sizes, np.float32))


# Numbers of a row of each tensor of Gaussians, and a row at rest.
_ROWS: dict[str, list[float]] = {
    "positions": [0, 0, 0],
    "covariances": [0.01, 0, 0, 0.01, 0, 0.01],
    "scales": [0.1, 0.1, 0.1],
    "rotations": [1, 0, 0, 0],
    "colors": [0.5, 0.5, 0.5],
    "opacities": [1],
}


def gaussians(
    attribute: Literal["positions", "covariances", "scales", "rotations", "colors", "opacities"],
    rows: int,
    *,
    scales: Literal["linear", "log"] = "linear",
    opacities: Literal["linear", "logit"] = "linear",
    rotations: Literal["wxyz", "xyzw"] = "wxyz",
) -> Role:
    """[rows,K]: a tensor of the generator before this one in a chain, as that one writes it. The one before runs only
    when its own inputs change: an encoder of a photograph once, and this module in each frame.
    """
    binding: Json = {"role": "gaussians", "attribute": attribute}
    said: dict[str, tuple[str, str]] = {
        "scales": ("scaleActivation", scales),
        "rotations": ("rotationOrder", rotations),
    }
    said["opacities"] = ("opacityActivation", opacities)
    if attribute in said:
        binding |= dict([said[attribute]])
    rest, rng = np.array(_ROWS[attribute], np.float32), np.random.default_rng(0)
    sizes = (rows, len(rest))
    return Role(binding, sizes, [*_floats(sizes, rest), (rest * rng.uniform(0.5, 1, sizes)).astype(np.float32)])


def depth(width: int, height: int) -> Role:
    """[1,1,H,W], for a post-processor: depth of the frame along the axis of the camera, in world units, of the splat
    that halves the transmittance; 0 if none does.
    """
    rng, sizes = np.random.default_rng(1), (1, 1, height, width)
    surface = rng.uniform(0.5, 20, sizes).astype(np.float32)
    holes = np.where(rng.random(sizes) < 0.2, 0, surface).astype(np.float32)
    return Role({"role": "depth"}, sizes, [surface, holes], np.zeros(sizes, np.float32))


def frame() -> Role:
    """[1] int32: index of a frame."""
    return Role({"role": "frame"}, (1,), [np.zeros(1, np.int32), np.ones(1, np.int32)])


def seed() -> Role:
    """[1] int32: seed of random numbers."""
    return Role({"role": "seed"}, (1,), [np.zeros(1, np.int32), np.full(1, 7, np.int32)])
