"""Runs a file on the CPU and checks its outputs against the contract."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np
import onnx
from onnx import helper

from .arrays import AnyArray
from .contract import Json, of_metadata
from .errors import ExportError
from .written import Fault, bounds_faults, read, value_faults

# Sizes that replace symbolic dimensions: pixels of each side of an image, and rows of Gaussians of another model.
SYMBOLIC = {"image": 64, "depth": 64, "gaussians": 16}
# Fractions of the duration. Simple ones would test a looping motion in the same state each time.
SHARES = (0.13, 0.25, 0.37, 0.5, 0.62, 0.75, 0.89, 1.0)


def default_feeds(model: onnx.ModelProto, contract: Json) -> dict[str, AnyArray]:
    """Values for every input: declared defaults, zeros, and a camera five units in front of the bounds' center; for a
    file with instances, those of one.
    """
    bindings = _bindings(contract)
    # An input that is an initializer, too, keeps its stored value, as in pages.
    stored = {tensor.name for tensor in model.graph.initializer}
    given = (value for value in model.graph.input if value.name not in stored)
    return {value.name: _default(value, bindings.get(value.name), contract) for value in given}


def _default(value: onnx.ValueInfoProto, binding: Json | None, contract: Json) -> AnyArray:
    tensor = value.type.tensor_type
    dtype = helper.tensor_dtype_to_np_dtype(tensor.elem_type)
    if binding is None:
        raise _violation("unbound-input", value.name, "a role for every input", "none", "name it in the contract")
    symbolic = SYMBOLIC.get(str(binding["role"]), 1)
    shape = [dim.dim_value or symbolic for dim in tensor.shape.dim]
    if "instances" in contract and shape and tensor.shape.dim[0].dim_value == 0:
        shape[0] = 1
    if binding["role"] == "camera_position":
        box = cast(dict[str, list[float]], contract.get("bounds", {"min": [0.0] * 3, "max": [0.0] * 3}))
        low, high = np.array(box["min"]), np.array(box["max"])
        eye: AnyArray = (low + high) / 2 - [0, 0, np.linalg.norm(high - low) + 5]
        return eye.astype(dtype).reshape(shape)
    if binding["role"] in ("view", "camera_to_world", "projection", "view_projection"):
        return np.eye(4).astype(dtype).reshape(shape)
    if binding["role"] == "viewport":
        return np.array([640, 480], dtype).reshape(shape)
    if binding["role"] == "intrinsics":
        return np.array([1, 0, 0.5, 0, 1, 0.5, 0, 0, 1] if _flat(shape) == 9 else [1, 1, 0.5, 0.5], dtype).reshape(
            shape
        )
    if binding["role"] == "pose" and "default" not in binding:
        unit = {"matrix": np.eye(3).reshape(-1), "quaternion": _no_turn(binding.get("quaternionOrder"))}
        joint = unit.get(str(binding["format"]), np.zeros(1))
        return np.tile(joint, _flat(shape) // len(joint)).astype(dtype).reshape(shape)
    if binding["role"] == "gaussians":
        return _gaussians(binding, shape).astype(dtype).reshape(shape)
    if binding["role"] == "depth":
        # Depth images: 0 in the first columns, then a surface that recedes.
        across = np.linspace(0, 1, shape[-1], endpoint=False)
        return np.broadcast_to(np.where(across < 0.25, 0, 0.5 + 10 * across), shape).astype(dtype)
    if binding["role"] == "image":
        return np.random.default_rng(0).random(shape).astype(dtype)
    return np.broadcast_to(np.asarray(binding.get("default", 0.0)).astype(dtype).reshape(-1), _flat(shape)).reshape(
        shape
    )


def _no_turn(order: object) -> AnyArray:
    """The identity quaternion."""
    return np.array([0, 0, 0, 1] if order == "xyzw" else [1, 0, 0, 0])


def _gaussians(binding: Json, shape: list[int]) -> AnyArray:
    """An attribute of the Gaussians of another model: small and round."""
    size, attribute = _flat(shape), binding["attribute"]
    color = 0.5 if binding.get("color") == "rgb" or attribute == "colors" else 0.1
    opacity = 0.0 if binding.get("opacityActivation") == "logit" else 0.5
    ball = [0.01, 0, 0, 0.01, 0, 0.01]
    if attribute == "packed":
        return np.tile([0, 0, 0, *ball, *[color] * (shape[-1] - 10), opacity], size // shape[-1])
    if attribute == "covariances":
        row = ball if shape[-1] == 6 else [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01]
        return np.tile(row, size // len(row))
    if attribute == "rotations":
        return np.tile(_no_turn(binding.get("rotationOrder")), size // 4)
    scale = np.log(0.1) if binding.get("scaleActivation") == "log" else 0.1
    numbers = {"positions": 0.0, "scales": scale, "opacities": opacity, "count": 1.0}
    return np.full(size, numbers.get(str(attribute), color))


def _flat(shape: list[int]) -> int:
    return int(np.prod(shape))


@contextmanager
def running(doing: str) -> Iterator[None]:
    """Raises errors of ONNX Runtime as contract/run."""
    try:
        yield
    except Exception as error:  # the runtime has a class for each of its errors
        found = " ".join(str(error).split())[:400]
        remedy = "correct the export; the message names the node"
        raise _violation("run", f"{doing} the model with ONNX Runtime on the CPU", "no error", found, remedy) from error


def check_outputs(
    model: onnx.ModelProto, feeds: dict[str, AnyArray] | None = None, path: Path | None = None
) -> dict[str, AnyArray]:
    """Runs the model on the CPU provider of onnxruntime, at defaults twice, at other times, and at both ends of its
    controls; returns its outputs at defaults.

    Raises contract/... for shapes and numbers that the contract does not allow, contract/run for a model that
    ONNX Runtime does not run, contract/not-deterministic for results that differ from run
    to run without a seed; needs onnxruntime. `path`: of a file with external data beside it.
    """
    import onnxruntime as ort

    contract = of_metadata({prop.key: prop.value for prop in model.metadata_props}, model.graph.name)
    given = default_feeds(model, contract) | (feeds or {})
    options = ort.SessionOptions()
    options.log_severity_level = 4
    _refuse_beyond_pages(model)
    with running("loading"):
        given_model = model.SerializeToString() if path is None else str(path)
        session = ort.InferenceSession(given_model, options, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]

    def run(state: dict[str, AnyArray]) -> dict[str, AnyArray]:
        with running("running"):
            return dict(zip(names, session.run(None, given | state), strict=True))

    first = run({})
    _raise_first(contract, first, "defaults", True)
    if not any(binding["role"] == "seed" for binding in _bindings(contract).values()):
        for name, values in run({}).items():
            if not np.array_equal(values, first[name], equal_nan=True):
                raise _violation("not-deterministic", name, "the same result twice", "a difference", "declare a seed")
    for label, is_default, state in _states(contract, given):
        _raise_first(contract, run(state), label, is_default)
    return first


def difference(model: onnx.ModelProto, other: onnx.ModelProto) -> float:
    """Runs two models of the same contract at its defaults. Returns the largest difference between their outputs,
    relative to the largest number of each tensor. Raises contract/run if it is above 1e-5; needs onnxruntime.
    """
    import onnxruntime as ort

    contract = of_metadata({prop.key: prop.value for prop in model.metadata_props}, model.graph.name)
    feeds = default_feeds(model, contract)
    results = []
    for each in (model, other):
        with running("running"):
            session = ort.InferenceSession(each.SerializeToString(), providers=["CPUExecutionProvider"])
            results.append([np.asarray(value, np.float64) for value in session.run(None, feeds)])
    scales = [max(1e-30, float(np.abs(value).max(initial=0))) for value in results[0]]
    worst = max(float(np.abs(a - b).max(initial=0)) / scale for a, b, scale in zip(*results, scales, strict=True))
    if not worst <= _MAX_DIFFERENCE:
        remedy = "report this with the file"
        raise _violation("run", "the model in parts", f"{_MAX_DIFFERENCE} of the numbers", f"{worst:.1e}", remedy)
    return float(worst)


_MAX_DIFFERENCE = 1e-5
# Bytes of a tensor that the 32-bit memory of a page cannot hold.
_MAX_BYTES = 1 << 32


def _refuse_beyond_pages(model: onnx.ModelProto) -> None:
    """Raises contract/run for a tensor of a known size that no page can hold, although this machine may."""
    try:
        graph = onnx.shape_inference.infer_shapes(model).graph
    except onnx.shape_inference.InferenceError:
        return
    for value in [*graph.value_info, *graph.output]:
        tensor = value.type.tensor_type
        size = math.prod(dim.dim_value for dim in tensor.shape.dim if dim.HasField("dim_value"))
        found = size * helper.tensor_dtype_to_np_dtype(tensor.elem_type).itemsize if tensor.elem_type else 0
        if found >= _MAX_BYTES:
            raise _violation(
                "run", value.name, "less than 4 GiB in a tensor", f"{found:,} bytes", "gaussian-export parts FILE OUT"
            )


def _raise_first(contract: Json, results: dict[str, AnyArray], label: str, is_default: bool) -> None:
    # Bounds hold at all times, with defaults of all other inputs.
    bounded = contract if is_default else {key: value for key, value in contract.items() if key != "bounds"}
    named = {name: each for name, each in results.items() if name in cast(Json, contract["outputs"]).values()}
    alone = [named]
    if "instances" in contract:
        count = len(next(iter(named.values())))
        alone = [{name: values[i] for name, values in named.items()} for i in range(count)]
    for one in alone:
        for fault in faults_of(bounded, one):
            raise fault.error(f" (run with {label})")


def faults_of(contract: Json, results: dict[str, AnyArray]) -> Iterator[Fault]:
    """All faults of the outputs of one run."""
    faults, attributes = read(cast(Json, contract["outputs"]), results, cast("int | None", contract.get("nMax")))
    yield from faults
    yield from value_faults(attributes)
    yield from bounds_faults(contract, attributes)


def _bindings(contract: Json) -> dict[str, Json]:
    return cast(dict[str, Json], contract["inputs"])


def _states(contract: Json, given: dict[str, AnyArray]) -> Iterator[tuple[str, bool, dict[str, AnyArray]]]:
    """Other times; all controls at their minimum, and all at their maximum, because visitors can set these."""
    end = cast(float, contract.get("duration", 1.0))
    for share in SHARES:
        if clocks := clocks_at(share * end, contract, given):
            yield f"{share} of the time", True, clocks
    ranges = {name: cast(Any, each)["range"] for name, each in _bindings(contract).items() if each["role"] == "control"}
    for end in (0, 1) if ranges else ():
        label = f"controls at {('their minimum', 'their maximum')[end]}"
        yield label, False, {name: np.full_like(given[name], limits[end]) for name, limits in ranges.items()}


def clocks_at(seconds: float, contract: Json, given: dict[str, AnyArray]) -> dict[str, AnyArray]:
    """Values at a time for the inputs with the roles time and frame."""
    duration = cast(float, contract.get("duration", np.inf))
    rate = cast(float, contract.get("fps", 0.0))
    # The end of the duration belongs to the last frame; in float64, 29/25 s times 25 is less than 29.
    last = np.ceil(duration * rate - 1e-6) - 1 if rate > 0 else 0
    values = {
        ("time", "seconds"): seconds,
        ("time", "normalized"): seconds / duration,
        ("frame", None): max(0, min(np.floor(seconds * rate + 1e-6), last)),
    }
    found = {name: values.get((str(each["role"]), each.get("unit"))) for name, each in _bindings(contract).items()}  # type: ignore[arg-type]
    return {name: np.full_like(given[name], x) for name, x in found.items() if x is not None and name in given}


def _violation(code: str, where: str, expected: str, found: str, remedy: str) -> ExportError:
    return ExportError(f"contract/{code}", where=where, expected=expected, found=found, remedy=remedy)
