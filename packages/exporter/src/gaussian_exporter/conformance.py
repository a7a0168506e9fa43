"""Running a file on the CPU and holding what it writes against the contract."""

from __future__ import annotations

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

# No simple shares of a period: a loop would be tried in the same state again and again.
SHARES = (0.13, 0.25, 0.37, 0.5, 0.62, 0.75, 0.89, 1.0)


def default_feeds(model: onnx.ModelProto, contract: Json) -> dict[str, AnyArray]:
    """Something for every input: declared defaults, zeros, and a camera five units in front of the bounds' centre; of a
    file of several instances for one."""
    bindings = _bindings(contract)
    return {value.name: _default(value, bindings.get(value.name), contract) for value in model.graph.input}


def _default(value: onnx.ValueInfoProto, binding: Json | None, contract: Json) -> AnyArray:
    tensor = value.type.tensor_type
    shape = [dim.dim_value or 1 for dim in tensor.shape.dim]
    dtype = helper.tensor_dtype_to_np_dtype(tensor.elem_type)
    if binding is None:
        raise _violation("unbound-input", value.name, "a role for every input", "none", "name it in the contract")
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
    if binding.get("format") == "matrix" and "default" not in binding:
        return np.tile(np.eye(3).reshape(-1), _flat(shape) // 9).astype(dtype).reshape(shape)
    if binding["role"] == "depth":
        # Nothing in the first columns, then a surface that recedes.
        across = np.linspace(0, 1, shape[-1], endpoint=False)
        return np.broadcast_to(np.where(across < 0.25, 0, 0.5 + 10 * across), shape).astype(dtype)
    if binding["role"] == "image":
        return np.random.default_rng(0).random(shape).astype(dtype)
    return np.broadcast_to(np.asarray(binding.get("default", 0.0)).astype(dtype).reshape(-1), _flat(shape)).reshape(
        shape
    )


def _flat(shape: list[int]) -> int:
    return int(np.prod(shape))


@contextmanager
def running(doing: str) -> Iterator[None]:
    """What ONNX Runtime says of a model, as contract/run."""
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


def _raise_first(contract: Json, results: dict[str, AnyArray], label: str, is_default: bool) -> None:
    # Bounds speak of all times, and of defaults of everything else.
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
    """Everything that is wrong with what one run wrote."""
    faults, attributes = read(cast(Json, contract["outputs"]), results, cast("int | None", contract.get("nMax")))
    yield from faults
    yield from value_faults(attributes)
    yield from bounds_faults(contract, attributes)


def _bindings(contract: Json) -> dict[str, Json]:
    return cast(dict[str, Json], contract["inputs"])


def _states(contract: Json, given: dict[str, AnyArray]) -> Iterator[tuple[str, bool, dict[str, AnyArray]]]:
    """Other times; all controls at the least, and all at the most that their ranges allow: people will go there."""
    clocks = {name: each for name, each in _bindings(contract).items() if each["role"] == "time" and name in given}
    for share in SHARES if clocks else ():
        ends = {n: 1.0 if b["unit"] == "normalized" else contract.get("duration", 1.0) for n, b in clocks.items()}
        yield f"{share} of the time", True, {n: np.full_like(given[n], share * cast(float, ends[n])) for n in ends}
    ranges = {name: cast(Any, each)["range"] for name, each in _bindings(contract).items() if each["role"] == "control"}
    for end in (0, 1) if ranges else ():
        label = f"controls at {('least', 'most')[end]}"
        yield label, False, {name: np.full_like(given[name], limits[end]) for name, limits in ranges.items()}


def _violation(code: str, where: str, expected: str, found: str, remedy: str) -> ExportError:
    return ExportError(f"contract/{code}", where=where, expected=expected, found=found, remedy=remedy)
