"""Checks a file against its contract before it runs: names, shapes, element types, rows, versions, operators, files.

One rule set with the checker of pages and shells (packages/core/src/contract: parse-contract.ts, check-contract.ts,
check-file.ts, instances.ts); tests/fixtures/verdicts.json and instances.json hold both.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import onnx
from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError, best_match
from onnx import TensorProto, helper

from .contract import REPEATED
from .placement import RULES, gpu_findings, operators_of
from .written import FIELDS, Fault, FaultCode, bare, degree_of, rules_of

_SCHEMA: dict[str, Any] = json.loads(files(__package__).joinpath("contract_schema.json").read_text(encoding="utf-8"))
_OLDEST_OPSET = 7
_MAX_EXTERNAL_FILES = 256
_DOMAINS = ("", "ai.onnx", "com.microsoft", "ai.onnx.ml")
_FLOATS, _INTEGERS = ("float32", "float16"), ("int32", "int64")
# Roles of inputs that cannot have an axis of instances.
_SHARED_ROLES = ("gaussians", "image", "depth", "state")
_ONE: list[Sequence[int | str]] = [(1,), ()]
_POSES: dict[str, tuple[int, list[Sequence[int | str]]]] = {
    "axis-angle": (3, [("J", 3), ("P",)]),
    "quaternion": (4, [("J", 4), ("P",)]),
    "matrix": (9, [("J", 3, 3), ("J", 9), ("P",)]),
    "parameters": (1, [("P",)]),
}
_IMAGES: list[Sequence[int | str]] = [(1, 3, "H", "W"), (1, 4, "H", "W"), (3, "H", "W"), (4, "H", "W")]
_INPUTS: dict[str, tuple[list[Sequence[int | str]], Sequence[str]]] = {
    **dict.fromkeys(("view", "camera_to_world", "projection", "view_projection"), ([(4, 4), (16,)], ("float32",))),
    "intrinsics": ([(3, 3), (4,)], ("float32",)),
    "camera_position": ([(3,)], ("float32",)),
    "viewport": ([(2,)], ("float32",)),
    "time": (_ONE, ("float32",)),
    "frame": (_ONE, _INTEGERS),
    "seed": (_ONE, _INTEGERS),
    "shape": ([("B",)], ("float32",)),
    "depth": ([(1, 1, "H", "W"), (1, "H", "W"), ("H", "W")], _FLOATS),
    "image": ([*_IMAGES, ("V", 3, "H", "W"), ("V", 4, "H", "W")], _FLOATS),
}
Dims = tuple[int | str | None, ...]


class Tensor:
    """An input or output as the file declares it; dims are None if the file does not declare the rank."""

    def __init__(self, value: onnx.ValueInfoProto, axis: str | None = None):
        """`axis`: that of instances, which is removed."""
        self.name = value.name
        tensor = value.type.tensor_type
        self.dims: Dims | None = None
        kind = value.type.WhichOneof("value")
        self.dtype = {"sequence_type": "sequence", "optional_type": "optional", "map_type": "map"}.get(kind or "", "")
        if kind == "tensor_type":
            self.dtype = _dtype(tensor.elem_type)
            if tensor.HasField("shape"):
                self.dims = tuple(
                    d.dim_value if d.HasField("dim_value") else d.dim_param or None for d in tensor.shape.dim
                )
        self.declared = self.dims
        self.has_axis = axis is not None and bool(self.dims) and self.dims is not None and self.dims[0] == axis
        if self.has_axis and self.dims is not None:
            self.dims = self.dims[1:]

    def __str__(self) -> str:
        """For people."""
        return f"{self.dtype} {_shown(self.dims) if self.dims is not None else 'of unknown shape'}"


def _dtype(number: int) -> str:
    names: dict[int, str] = {TensorProto.STRING: "string", TensorProto.BOOL: "bool", TensorProto.UNDEFINED: "undefined"}
    return names.get(number) or str(helper.tensor_dtype_to_np_dtype(number))


def _shown(dims: Sequence[object]) -> str:
    return f"[{', '.join('?' if dim is None else str(dim) for dim in dims)}]"


def contract_faults(contract: object) -> Iterator[Fault]:
    """Faults of the JSON itself: against the schema, and between its fields."""
    error: ValidationError | None = best_match(Draft202012Validator(_SCHEMA).iter_errors(contract))
    if error is not None:
        place = "".join(f".{part}" if isinstance(part, str) else f"[{part}]" for part in error.absolute_path)
        yield _fault("schema", "", f"contract{place}", "what contract.schema.json allows", error.message[:200], _DOCS)
    elif isinstance(contract, Mapping):
        yield from _conflicts(contract)


def _conflicts(contract: Mapping[str, Any]) -> Iterator[Fault]:
    def conflict(where: str, expected: str, found: str, remedy: str) -> Fault:
        return _fault("conflict", "", f"contract.{where}", expected, found, remedy)

    seen: dict[str, str] = {}
    for name, binding in contract["inputs"].items():
        role, where = binding["role"], f"inputs.{name}"
        if role == "time" and binding["unit"] == "normalized" and "duration" not in contract:
            yield conflict(
                f"{where}.unit",
                "a duration, because time is normalized",
                "none",
                "declare duration in seconds",
            )
        if role == "control":
            (low, high), default = binding["range"], binding["default"]
            values = default if isinstance(default, list) else [default]
            if not low <= high:
                yield conflict(f"{where}.range", "the smallest value first", str([low, high]), "exchange the two")
            elif any(not low <= value <= high for value in values):
                remedy = "widen the range or change the default"
                yield conflict(f"{where}.default", f"a value within {low}..{high}", str(default), remedy)
        if role == "pose":
            parents, joints = binding.get("parents"), binding.get("joints")
            if parents and joints and len(parents) != len(joints):
                yield conflict(f"{where}.parents", f"{len(joints)}, as joints", str(len(parents)), "list as many")
            elif parents and any(parent >= joint for joint, parent in enumerate(parents)):
                yield conflict(f"{where}.parents", "parents before their children", str(parents), "reorder the joints")
        kind = f"gaussians ({binding['attribute']})" if role == "gaussians" else role
        if role not in REPEATED and seen.setdefault(kind, name) != name:
            yield conflict(where, f"one input with the role {kind}", f"{seen[kind]} and {name}", "feed one of them")
    outputs = contract["outputs"]
    named: dict[str, str] = {}
    for field in FIELDS:
        if field in outputs and named.setdefault(outputs[field], field) != field:
            other = named[outputs[field]]
            yield conflict(f"outputs.{field}", "an output of its own", f"that of {other}", "name another output")
    columns = outputs.get("columns") if outputs["layout"] == "packed" else None
    if columns is not None:
        shape = ["covariances"] if "covariances" in columns else ["scales", "rotations"]
        wanted = ["positions", *shape, "colors" if outputs["color"] == "rgb" else "sh", "opacities"]
        if sorted(wanted) != sorted(columns):
            yield conflict("outputs.columns", ", ".join(wanted), ", ".join(columns), "name each attribute once")
        for field in ("scaleActivation", "rotationOrder") if len(shape) == 2 else ():
            if field not in outputs:
                yield conflict(f"outputs.{field}", "a value, since columns has scales", "nothing", "declare it")
    bounds = contract.get("bounds")
    if bounds and any(low > high for low, high in zip(bounds["min"], bounds["max"], strict=True)):
        yield conflict("bounds", "min at or below max", "min above max", "exchange the two")


def header_faults(model: onnx.ModelProto, contract: Mapping[str, Any] | None, folder: Path) -> list[Fault]:
    """All faults of the file that are found before it runs; those of its contract, too, if it has one in order."""
    faults = [*_versions(model), *_operators(model), *_external(model, folder)]
    return [*faults, *(_tensors(model, contract) if contract is not None else [])]


def _versions(model: onnx.ModelProto) -> Iterator[Fault]:
    opset = next((entry.version for entry in model.opset_import if entry.domain in ("", "ai.onnx")), None)
    remedy = f"export with opset_version={RULES['exportOpset']}"
    if model.ir_version > RULES["newestIr"]:
        yield _fault("opset", "", "IR version", f"at most {RULES['newestIr']}", str(model.ir_version), remedy)
    is_needed = any(domain in ("", "ai.onnx") for domain, _ in operators_of(model))
    if is_needed if opset is None else not _OLDEST_OPSET <= opset <= RULES["newestOpset"]:
        yield _fault("opset", "", "opset", f"{_OLDEST_OPSET} to {RULES['newestOpset']}", str(opset), remedy)


def _operators(model: onnx.ModelProto) -> Iterator[Fault]:
    own = {(function.domain, function.name) for function in model.functions}
    for domain, name in sorted(operators_of(model)):
        if domain not in _DOMAINS and (domain, name) not in own:
            remedy = "export the model with standard operators"
            yield _fault("operator", "", f"operator {domain}:{name}", "operators of ONNX", f"domain {domain}", remedy)
    opset = next((entry.version for entry in model.opset_import if entry.domain in ("", "ai.onnx")), 99)
    for node in model.graph.node:
        since = 13 if node.op_type == "ReduceSum" else 18
        has_it = any(attribute.name == "noop_with_empty_axes" for attribute in node.attribute)
        if node.op_type.startswith("Reduce") and opset < since and has_it:
            expected = f"attributes of opset {opset}, as the file declares"
            found = "noop_with_empty_axes, of a later opset"
            yield _fault("operator", "", f"operator {node.op_type}", expected, found, "export with opset 18")
            break
    for finding in gpu_findings(model):
        if finding.is_refused and finding.operator != "file":
            where, expected = f"operator {finding.operator}", "types that ONNX Runtime in a page computes"
            yield _fault("operator", "", where, expected, finding.reason, finding.remedy)


def _external(model: onnx.ModelProto, folder: Path) -> Iterator[Fault]:
    needed: dict[str, int] = {}
    for tensor in model.graph.initializer:
        if tensor.data_location == TensorProto.EXTERNAL:
            entry = {each.key: each.value for each in tensor.external_data}
            end = int(entry.get("offset", 0) or 0) + int(entry.get("length", 0) or 0)
            location = entry.get("location", "")
            needed[location] = max(needed.get(location, 0), end)
    if len(needed) > _MAX_EXTERNAL_FILES:
        expected = f"at most {_MAX_EXTERNAL_FILES} files of weights beside a model"
        remedy = "write the weights into one file: onnx.save_model(model, path, save_as_external_data=True)"
        yield _fault("external-data", "", "external data", expected, str(len(needed)), remedy)
        return
    for location, size in needed.items():
        where = f"external data {location!r}"
        parts = re.split(r"[/\\]", location)
        if not location or re.match(r"[a-z][a-z0-9+.-]*:", location, re.I) or not parts[0] or ".." in parts:
            remedy = "save the model with plain file names"
            yield _fault("external-data", "", where, "a path inside the folder of the model", "another", remedy)
        elif not (folder / location).is_file():
            remedy = "put it beside the model; it holds weights"
            yield _fault("external-data", "", where, "this file beside the model", "none", remedy)
        elif (found := (folder / location).stat().st_size) < size:
            yield _fault("external-data", "", where, f"at least {size} bytes", str(found), "copy the file again")


def _tensors(model: onnx.ModelProto, contract: Mapping[str, Any]) -> Iterator[Fault]:
    axis = contract["instances"]["axis"] if "instances" in contract else None
    stored = {tensor.name for tensor in model.graph.initializer}
    inputs = {v.name: Tensor(v, axis) for v in model.graph.input if v.name not in stored}
    outputs = {value.name: Tensor(value, axis) for value in model.graph.output}
    yield from _instances(list(inputs.values()), outputs, contract)
    for name, tensor in inputs.items():
        binding = contract["inputs"].get(name)
        if binding is None:
            remedy = "add it to the contract's inputs, for example as a control with range and default"
            yield _fault("unbound-input", name, f"input {name}", "a role in the contract", f"none for {tensor}", remedy)
        else:
            yield from _input(tensor, binding, outputs)
    for name, binding in contract["inputs"].items():
        if name not in inputs:
            yield _missing("input", name, binding["role"], inputs)
        yield from _depth_of_generator(name, binding["role"], contract["outputs"]["layout"])
    yield from _outputs(outputs, contract)


def _instances(inputs: Sequence[Tensor], outputs: Mapping[str, Tensor], contract: Mapping[str, Any]) -> Iterator[Fault]:
    """The axis of instances must be the first dimension of every output that the contract names and of at least one
    input, and must occur nowhere else. The other dimensions of outputs must be numbers."""
    if "instances" not in contract:
        return
    axis, bindings, named = contract["instances"]["axis"], contract["inputs"], contract["outputs"]

    def fault(where: str, expected: str, found: str, remedy: str, tensor: str = "") -> Fault:
        return _fault("instances", tensor, where, expected, found, remedy)

    if named["layout"] == "image":
        yield fault("instances", "a model that writes Gaussians", "a post-processor", "leave out instances")
        return
    state = next((name for name, binding in bindings.items() if binding["role"] == "state"), None)
    if state is not None:
        remedy = "leave out instances: each would need a state of its own"
        yield fault(f"input {state}", "a model without a state", "an input with the role state", remedy, state)
        return
    tensors = [outputs[named[field]] for field in FIELDS if named.get(field) in outputs]
    written = [tensor for tensor in tensors if tensor.declared is not None]
    for tensor in written:
        where, found = f"output {tensor.name}", _shown(tensor.declared or ())
        if not tensor.has_axis:
            remedy = f"export it with the symbolic axis {axis} before all others"
            yield fault(where, f"{axis} as its first dimension", found, remedy, tensor.name)
        # Fixed sizes give each instance the same offset in every run.
        elif any(not isinstance(dim, int) for dim in tensor.dims or ()):
            remedy = "fix N; rows that do not live may lie behind a count, or have the opacity 0"
            yield fault(where, f"numbers behind {axis}", found, remedy, tensor.name)
    for tensor in (*inputs, *written):
        if axis in (tensor.declared or ())[1:]:
            expected, remedy = f"{axis} as the first dimension only", "name this axis as no other, and put it first"
            yield fault(f"tensor {tensor.name}", expected, _shown(tensor.declared or ()), remedy, tensor.name)
    for tensor in inputs:
        if tensor.has_axis and bindings.get(tensor.name, {}).get("role") in _SHARED_ROLES:
            found, remedy = _shown(tensor.declared or ()), "export it without the axis"
            yield fault(f"input {tensor.name}", "a tensor that all instances share", found, remedy, tensor.name)
    if not any(tensor.has_axis for tensor in inputs):
        remedy = "leave out instances: all would be alike"
        yield fault("instances", f"an input whose first dimension is {axis}", "none", remedy)


def _depth_of_generator(name: str, role: str, layout: str) -> Iterator[Fault]:
    """Only post-processors receive the depth of a frame."""
    if role == "depth" and layout != "image":
        expected, found = "a post-processor, with the layout image", f"a model with the layout {layout}"
        remedy = "remove the input: no frame is drawn before a generator runs"
        yield _fault("schema", name, f"input {name} ({role})", expected, found, remedy)


def _input(tensor: Tensor, binding: Mapping[str, Any], outputs: Mapping[str, Tensor]) -> Iterator[Fault]:
    role = binding["role"]
    where = f"input {tensor.name} ({role})"
    if role == "pose":
        rule: tuple[list[Sequence[int | str]], Sequence[str]] = (_POSES[binding["format"]][1], ("float32",))
    elif role == "gaussians":
        attribute = binding["attribute"]
        field = "gaussians" if attribute == "packed" else attribute
        layout = "packed" if attribute == "packed" else "split"
        rule = (rules_of({**binding, "layout": layout}, field), ("int32",) if attribute == "count" else _FLOATS)
    elif role in ("control", "state"):
        kinds = (*_FLOATS, "int32") if role == "state" else ("float32", *_INTEGERS)
        rule = ([tuple(d if isinstance(d, int) and d > 0 else "size" for d in tensor.dims or ("size",))], kinds)
    else:
        rule = _INPUTS[role]
    faults = list(_tensor(tensor, *rule, where))
    yield from faults
    if faults or tensor.dims is None:
        return
    size = 1
    for dim in tensor.dims:
        size *= dim if isinstance(dim, int) else 1
    if role == "state":
        written = outputs.get(binding["output"])
        if written is None:
            yield _missing("output", binding["output"], "state", outputs)
        elif (written.dims, written.dtype) != (tensor.dims, tensor.dtype):
            remedy = "export both in the same shape and element type"
            yield _fault("shape", tensor.name, where, f"{tensor}, as the output", str(written), remedy)
    lengths = {"default": size, "names": size}
    if role == "pose":
        numbers = _POSES[binding["format"]][0]
        if size % numbers:
            yield _fault("shape", tensor.name, where, f"{numbers} numbers for each joint", str(size), "correct format")
        elif binding["format"] != "parameters":
            lengths |= {"joints": size // numbers, "parents": size // numbers}
    for field, expected in lengths.items():
        value = binding.get(field)
        if role in ("control", "shape", "pose") and isinstance(value, list) and len(value) != expected:
            found = f"a list of {len(value)}"
            yield _fault("shape", tensor.name, f"{where}, {field}", f"a list of {expected}", found, "correct it")
    if role == "control" and tensor.dtype in _INTEGERS:
        limit = 2**31 if tensor.dtype == "int32" else 2**53
        given = binding["default"] if isinstance(binding["default"], list) else [binding["default"]]
        wrong = [x for x in [*binding["range"], *given] if x != int(x) or not -limit <= x < limit]
        if wrong:
            yield _fault(
                "conflict", tensor.name, where, f"whole numbers that {tensor.dtype} holds", str(wrong[0]), _DOCS
            )


def _tensor(tensor: Tensor, shapes: list[Sequence[int | str]], kinds: Sequence[str], where: str) -> Iterator[Fault]:
    allowed = " or ".join(_shown(shape) for shape in shapes)
    if tensor.dims is None:
        yield _fault("shape", tensor.name, where, allowed, "no shape in the file", "declare the shape at export")
    elif 0 in tensor.dims or bare(tensor.dims, shapes) is None:
        remedy = "export the tensor in this shape; fixed sizes must be numbers, not symbols"
        yield _fault("shape", tensor.name, where, allowed, _shown(tensor.dims), remedy)
    if tensor.dtype not in kinds:
        remedy = f"cast it to {kinds[0]} at export"
        yield _fault("dtype", tensor.name, where, " or ".join(kinds), tensor.dtype, remedy)


def _outputs(written: Mapping[str, Tensor], contract: Mapping[str, Any]) -> Iterator[Fault]:
    outputs = contract["outputs"]
    shapes: list[tuple[str, Tensor, Dims]] = []
    for field in FIELDS:
        if field not in outputs:
            continue
        tensor = written.get(outputs[field])
        if tensor is None:
            yield _missing("output", outputs[field], field, written)
            continue
        rules = rules_of(outputs, field)
        where = f"output {tensor.name} ({field})"
        yield from _tensor(tensor, rules, _INTEGERS if field == "count" else _FLOATS, where)
        dims = None if tensor.dims is None else bare(tensor.dims, rules)
        if dims is not None and field not in ("count", "image"):
            shapes.append((field, tensor, dims))
    n_max = contract.get("nMax")
    fixed = [(tensor, dims[0]) for _, tensor, dims in shapes if isinstance(dims[0], int)]
    for tensor, count in fixed:
        where, found = f"output {tensor.name}", f"N = {count}"
        if count != fixed[0][1]:
            expected = f"N = {fixed[0][1]}, as {fixed[0][0].name} has"
            yield _fault(
                "rows", tensor.name, where, expected, found, "write the same number of rows for every attribute"
            )
        if n_max is not None and count > n_max and "count" not in outputs:
            yield _fault("rows", tensor.name, where, f"at most nMax = {n_max} rows", found, "raise nMax")
    if shapes and not fixed and n_max is None:
        name = shapes[0][1].name
        yield _fault("rows", name, f"output {name}", "a number of rows, or nMax", "neither", "declare nMax")
    declared = contract.get("shDegree")
    if declared is not None and shapes:
        degrees = [(tensor, degree_of(outputs, field, dims)) for field, tensor, dims in shapes]
        # Plain colors count as degree 0.
        with_degree, degree = next(((t, d) for t, d in degrees if d is not None), (shapes[0][1], 0))
        if degree != declared and ("sh" not in outputs or any(field == "sh" for field, _, _ in shapes)):
            expected = f"harmonics of degree {declared}, as the contract declares"
            where, remedy = f"output {with_degree.name}", "correct shDegree in the contract, or leave it out"
            yield _fault("sh-degree", with_degree.name, where, expected, f"degree {degree} ({with_degree})", remedy)
    floats = [tensor for _, tensor, _ in shapes if tensor.dtype in _FLOATS]
    wanted = contract.get("dtype") or (floats[0].dtype if floats else "")
    for tensor in floats:
        if tensor.dtype != wanted:
            remedy = "write all Gaussian outputs in one element type, and declare that one"
            yield _fault("dtype", tensor.name, f"output {tensor.name}", wanted, tensor.dtype, remedy)


def _missing(kind: str, name: str, role: str, there: Mapping[str, Tensor]) -> Fault:
    found = f"{kind}s {', '.join(list(there)[:20])}" if there else f"no {kind}s"
    remedy = "correct the name in the contract, or export the model with it"
    return _fault("missing-tensor", name, f"{kind} {name} ({role})", f"an {kind} of this name", found, remedy)


def _fault(code: FaultCode, tensor: str, where: str, expected: str, found: str, remedy: str) -> Fault:
    return Fault(code, tensor, where, expected, found, remedy)


_DOCS = "correct it; see docs/contract.md"
