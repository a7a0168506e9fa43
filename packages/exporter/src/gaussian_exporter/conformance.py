"""Running a file on the CPU and holding what it writes against the contract."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np
import onnx
from onnx import helper

from .arrays import AnyArray
from .contract import Json, of_metadata
from .errors import ExportError

# Rounding may leave an eigenvalue below 0 by this share of the largest.
_NEGATIVE = {"float32": 1e-5, "float16": 5e-3}


def default_feeds(model: onnx.ModelProto, contract: Json) -> dict[str, AnyArray]:
    """Something for every input: declared defaults, zeros, and a camera five units in front of the bounds' centre; of a
    file of several instances for one."""
    bindings = cast(dict[str, Json], contract["inputs"])
    return {value.name: _default(value, bindings.get(value.name), contract) for value in model.graph.input}


def _default(value: onnx.ValueInfoProto, binding: Json | None, contract: Json) -> AnyArray:
    tensor = value.type.tensor_type
    shape = [dim.dim_value or 1 for dim in tensor.shape.dim]
    dtype = helper.tensor_dtype_to_np_dtype(tensor.elem_type)
    if binding is None:
        raise _violation(value.name, "a role for every input", "none", "name it in the contract")
    if binding["role"] == "camera_position":
        box = cast(dict[str, list[float]], contract.get("bounds", {"min": [0.0] * 3, "max": [0.0] * 3}))
        low, high = np.array(box["min"]), np.array(box["max"])
        eye: AnyArray = (low + high) / 2 - [0, 0, np.linalg.norm(high - low) + 5]
        return eye.astype(dtype).reshape(shape)
    if binding["role"] in ("view", "camera_to_world", "projection", "view_projection"):
        return np.eye(4).astype(dtype).reshape(shape)
    if binding["role"] == "intrinsics":
        return np.array([1, 0, 0.5, 0, 1, 0.5, 0, 0, 1] if _flat(shape) == 9 else [1, 1, 0.5, 0.5], dtype).reshape(
            shape
        )
    if binding.get("format") == "matrix" and "default" not in binding:
        return np.tile(np.eye(3).reshape(-1), _flat(shape) // 9).astype(dtype).reshape(shape)
    if binding["role"] == "image":
        return np.random.default_rng(0).random(shape).astype(dtype)
    return np.broadcast_to(np.asarray(binding.get("default", 0.0)).astype(dtype).reshape(-1), _flat(shape)).reshape(
        shape
    )


def _flat(shape: list[int]) -> int:
    return int(np.prod(shape))


def check_outputs(model: onnx.ModelProto, feeds: dict[str, AnyArray] | None = None) -> dict[str, AnyArray]:
    """Runs the model on the CPU provider of onnxruntime, at defaults twice and at both ends of its controls; returns
    its outputs at defaults.

    Raises contract/violation for numbers that are not finite, opacities outside 0..1, covariances that are no
    covariances, or results that differ from run to run; needs onnxruntime.
    """
    import onnxruntime as ort

    contract = of_metadata({prop.key: prop.value for prop in model.metadata_props}, model.graph.name)
    given = default_feeds(model, contract) | (feeds or {})
    session = ort.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    first, second = (dict(zip(names, session.run(None, given), strict=True)) for _ in range(2))
    for name, values in first.items():
        if not np.array_equal(values, second[name], equal_nan=True):
            raise _violation(name, "the same result twice", "a difference", "declare a seed")
    ends = [dict(zip(names, session.run(None, given | end), strict=True)) for end in _ends_of_controls(contract, given)]
    for results in (first, *ends):
        _check_values(cast(dict[str, Any], contract["outputs"]), results, "instances" in contract)
    return first


def _ends_of_controls(contract: Json, given: dict[str, AnyArray]) -> Iterator[dict[str, AnyArray]]:
    """All controls at the least, and all at the most that their ranges allow: people will go there."""
    bindings = cast(dict[str, Any], contract["inputs"])
    ranges = {name: each["range"] for name, each in bindings.items() if each["role"] == "control"}
    for end in (0, 1) if ranges else ():
        yield {name: np.full_like(given[name], limits[end]) for name, limits in ranges.items()}


def _check_values(outputs: dict[str, Any], results: dict[str, AnyArray], instances: bool) -> None:
    for name, values in results.items():
        if not np.isfinite(values).all():
            wrong = int((~np.isfinite(values)).sum())
            raise _violation(name, "finite numbers", f"{wrong} of {values.size} that are not", "train longer or prune")
    for check in _checks(outputs, results, instances):
        check()


def _checks(outputs: dict[str, Any], values: dict[str, AnyArray], instances: bool) -> Iterator[Callable[[], None]]:
    if outputs["layout"] == "image":
        return
    covariances: AnyArray | None
    # Rows of all instances, one after the other.
    flat = {name: array.reshape(-1, *array.shape[2:]) if instances else array for name, array in values.items()}
    # A batch of one is no other Gaussians.
    values = {name: array[0] if array.ndim > 2 and array.shape[0] == 1 else array for name, array in flat.items()}
    if outputs["layout"] == "packed" and "columns" in outputs:
        return
    if outputs["layout"] == "packed":
        rows = values[outputs["gaussians"]]
        covariances, opacities = rows[:, 3:9], rows[:, -1]
    else:
        opacities = values[outputs["opacities"]]
        covariances = values[outputs["covariances"]] if "covariances" in outputs else None
    if outputs["opacityActivation"] == "linear":
        yield lambda: _check_opacities(opacities)
    if covariances is not None:
        yield lambda: _check_covariances(covariances)
    if "scales" in outputs:
        scales = values[outputs["scales"]] if outputs["scaleActivation"] == "linear" else np.zeros(1)
        yield lambda: _check_axes(scales, values[outputs["rotations"]])


def _check_opacities(opacities: AnyArray) -> None:
    low, high = float(opacities.min()), float(opacities.max())
    if low < 0 or high > 1:
        raise _violation("opacities", "0 to 1", f"{low:.4g} to {high:.4g}", "apply the sigmoid in the graph")


def _check_covariances(covariances: AnyArray) -> None:
    wide = covariances.astype(np.float64)
    full = wide if wide.shape[-2:] == (3, 3) else wide[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    values = np.linalg.eigvalsh(full)
    wrong = values[:, 0] < -_NEGATIVE[str(covariances.dtype)] * np.maximum(values[:, 2], 1e-30)
    if wrong.any():
        found = f"{int(wrong.sum())} of {len(wrong)} with a negative eigenvalue, the first in row {int(wrong.argmax())}"
        raise _violation("covariances", "positive semi-definite matrices", found, "build them as H H^T")


def _check_axes(scales: AnyArray, rotations: AnyArray) -> None:
    if (scales < 0).any():
        raise _violation("scales", "0 or more", f"{float(scales.min()):.4g}", "apply the exponential in the graph")
    if (np.abs(rotations).max(1) == 0).any():
        raise _violation("rotations", "quaternions of a length above 0", "0 0 0 0", "normalise them in the graph")


def _violation(where: str, expected: str, found: str, remedy: str) -> ExportError:
    return ExportError("contract/violation", where=where, expected=expected, found=found, remedy=remedy)
