"""Infers the contract of a file that has none from the names of its inputs and outputs: canonical names, or those of
Visionary's exporters.

One rule set with pages and shells (packages/core/src/contract: infer.ts, visionary.ts); tests/fixtures/inference.json
tests both.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import onnx

from .contract import VERSION, Json
from .header import Tensor
from .written import Fault, bare, rules_of

_ROWS: Json = {"order": "row-major"}
_CANONICAL: dict[str, Json] = {
    "view": {**_ROWS, "axes": "RDF"},
    "projection": {**_ROWS, "axes": "RDF"},
    "view_projection": _ROWS,
    "camera_position": {},
    "viewport": {},
    "time": {"unit": "seconds"},
    "frame": {},
    "seed": {},
    "pose": {},
    "shape": {},
    "image": {},
}
_POSES: dict[tuple[object, ...], Json] = {
    (3,): {"format": "axis-angle"},
    (4,): {"format": "quaternion", "quaternionOrder": "wxyz"},
    (3, 3): {"format": "matrix"},
}
# Visionary plays 0.4 cycles per second.
_VISIONARY_CYCLE_SECONDS = 2.5


def infer(model: onnx.ModelProto) -> tuple[Json, list[Fault]]:
    """Returns the inferred contract; with faults `contract/inference`, one for each unknown input and one for unknown
    outputs, it is incomplete.
    """
    stored = {tensor.name for tensor in model.graph.initializer}
    inputs = [Tensor(value) for value in model.graph.input if value.name not in stored]
    outputs = [Tensor(value) for value in model.graph.output]
    profile = _visionary_outputs(outputs)
    bindings: Json = {}
    faults: list[Fault] = []
    for tensor in inputs:
        binding = _visionary_input(tensor.name) if profile else _canonical_input(tensor)
        if binding is None:
            known = "camera, view or matrix, proj, time, t" if profile else ", ".join(_CANONICAL)
            faults.append(_fault(f"input {tensor.name}", f"one of the names {known}", "another name", tensor.name))
        else:
            bindings[tensor.name] = binding
    written = profile or _canonical_outputs({tensor.name: tensor for tensor in reversed(outputs)})
    if written is None:
        expected = (
            "outputs named gaussians; or positions, opacities, covariances (or scales and rotations) and colors "
            "(or sh); or image"
        )
        faults.append(_fault("outputs", expected, ", ".join(each.name for each in outputs[:20]) or "none"))
    has_cycle = profile is not None and any(each["role"] == "time" for each in bindings.values())  # type: ignore[index]
    cycle: Json = {"duration": _VISIONARY_CYCLE_SECONDS} if has_cycle else {}
    return {"version": VERSION, "inputs": bindings, "outputs": written or {}, **cycle}, faults


def _canonical_input(tensor: Tensor) -> Json | None:
    if tensor.name not in _CANONICAL:
        return None
    details = _CANONICAL[tensor.name]
    if tensor.name == "pose":
        dims = tensor.dims or ()
        joint = (dims[1:] if len(dims) > 2 and dims[0] == 1 else dims)[1:]
        details = _POSES.get(joint, {"format": "parameters"})
    return {"role": tensor.name, **details}


def _canonical_outputs(named: Mapping[str, Tensor]) -> Json | None:
    count: Json = {"count": "count"} if "count" in named else {}
    if "gaussians" in named:
        is_plain = (named["gaussians"].dims or ())[-1:] == (13,)
        color: Json = {"color": "rgb"} if is_plain else {"color": "sh", "shOrder": "coefficient-major"}
        return {"layout": "packed", "gaussians": "gaussians", **color, "opacityActivation": "linear", **count}
    if "positions" in named and "opacities" in named:
        is_factored = "scales" in named and "rotations" in named
        if not (is_factored or "covariances" in named) or not ("sh" in named or "colors" in named):
            return None
        axes: Json = {"scales": "scales", "scaleActivation": "linear", "rotations": "rotations"}
        shape: Json = {**axes, "rotationOrder": "wxyz"} if is_factored else {"covariances": "covariances"}
        color = {"sh": "sh", "shOrder": _sh_order(named["sh"])} if "sh" in named else {"colors": "colors"}
        opacities: Json = {"opacities": "opacities", "opacityActivation": "linear"}
        return {"layout": "split", "positions": "positions", **shape, **color, **opacities, **count}
    return {"layout": "image", "image": "image"} if "image" in named else None


def _sh_order(tensor: Tensor) -> str:
    """Coefficient-major if the shape allows both orders."""
    rules = rules_of({"layout": "split", "shOrder": "coefficient-major"}, "sh")
    return "coefficient-major" if tensor.dims is None or _fits(tensor, rules) else "channel-major"


def _visionary_outputs(outputs: Sequence[Tensor]) -> Json | None:
    rules = rules_of({"layout": "visionary"}, "gaussians")
    rows = next((each for each in outputs if re.match("gauss", each.name, re.I) and _fits(each, rules)), None)
    others = [each for each in outputs if rows is not None and each.name != rows.name]
    color = next((each for each in others if re.search("color|sh|rgb", each.name, re.I)), None)
    if rows is None or color is None:
        return None
    columns = (color.dims or ())[-1:]
    is_plain = columns == (4,) or (columns == (3,) and re.search("rgb", color.name, re.I))
    count: Json = {"count": "num_points"} if any(each.name == "num_points" for each in outputs) else {}
    return {"layout": "visionary", "gaussians": rows.name, "colors" if is_plain else "sh": color.name, **count}


def _visionary_input(name: str) -> Json | None:
    """The camera looks along +z with x left and y up, and time is a fraction of a cycle. An input `projection_matrix`
    gets the projection; Visionary itself feeds it the camera.
    """
    lower = name.lower()
    role = "projection" if "proj" in lower else "view" if re.search("camera|view|matrix", lower) else None
    if role is not None:
        return {"role": role, "order": "column-major", "axes": "LUF"}
    return {"role": "time", "unit": "normalized"} if "time" in lower or lower == "t" else None


def _fits(tensor: Tensor, rules: Sequence[Sequence[int | str]]) -> bool:
    return tensor.dims is not None and 0 not in tensor.dims and bare(tensor.dims, rules) is not None


def _fault(where: str, expected: str, found: str, tensor: str = "") -> Fault:
    remedy = "export the model with gaussian-export, or write NAME.contract.json next to it: see docs/contract.md"
    return Fault("inference", tensor, where, f"a contract, or {expected}", f"no contract and {found}", remedy)
