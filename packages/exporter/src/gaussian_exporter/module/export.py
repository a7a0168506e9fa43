"""`export_module`: exporter, opset and options that stay on the GPU, names, contract, and a comparison with PyTorch."""

from __future__ import annotations

import contextlib
import inspect
import io
import logging
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import onnx

from ..arrays import AnyArray
from ..contract import Coordinates, Filter, Json, metadata
from ..errors import ExportError
from ..placement import RULES, Finding, gpu_findings, told
from .finish import finish_graph
from .layouts import Layout, fitted, split, tensors_of
from .roles import Role

# Largest difference to PyTorch, as a share of the largest number of an output.
_ALLOWED = 1e-3
# What TorchScript's exporter writes best, and what PyTorch's own writes and still has all kernels.
_OPSETS = {"dynamo": RULES["exportOpset"], "TorchScript": 17}


@dataclass(frozen=True)
class ExportReport:
    """What was written: by which exporter, how far from PyTorch each output is, and what would leave the GPU."""

    path: Path
    exporter: str
    opset: int
    contract: Json
    errors: dict[str, float]
    findings: list[Finding]
    notes: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        """For people."""
        inputs = cast(dict[str, Json], self.contract["inputs"])
        lines = [f"{self.path}: {self.path.stat().st_size:,} bytes, exporter {self.exporter}, opset {self.opset}"]
        lines += [f"  input {name}: {binding['role']}" for name, binding in inputs.items()]
        lines += [
            f"  output {name}: differs from PyTorch by {error:.1e} at most" for name, error in self.errors.items()
        ]
        lines += [f"  {note}" for note in [*self.notes, *told(self.findings)]]
        if not self.findings:
            lines.append("  WebGPU: every node has a kernel, shapes are fixed, the commands can be recorded")
        return "\n".join([*lines, f'  <gaussian-splat src="{self.path.name}" alt="" camera-controls></gaussian-splat>'])


def export_module(
    module: Any,
    inputs: Mapping[str, Role],
    outputs: Layout | None = None,
    *,
    out: str | Path,
    name: str | None = None,
    license: str = "not stated",
    attribution: str = "not stated",
    n_max: int | None = None,
    coordinates: Coordinates | None = None,
    antialiased: bool = False,
    filter: Filter | None = None,
    fps: float | None = None,
    batched: bool = False,
    quiet: bool = False,
) -> ExportReport:
    """Writes a torch.nn.Module as a generator with its contract, compares it with PyTorch, and prints what came of it.

    `inputs`: a role for each argument of `forward`, in its order: {"t": time(), "twist": control(-1, 1)}. `outputs`:
    what it returns, split() by default: positions, scales, rotations, colors, opacities. Both of PyTorch's exporters
    are tried; the first whose file computes what the module computes is kept. `batched`: the module takes a batch
    before every input, [1,72] where the role says [72]; pictures have one anyway. Raises graph/invalid where neither
    exporter does.
    """
    import torch

    layout, path = outputs or split(), Path(out)
    module = module if isinstance(module, torch.nn.Module) else _module_of(module, torch)
    module.eval()
    refuse_other_arguments(module, inputs)
    stays = [role.binding["role"] in ("image", "state") or not batched for role in inputs.values()]
    wrapped = _wrapped(module, layout, stays, torch)
    tries = _tries(inputs)
    try:
        expected = [_in_torch(wrapped, values, torch) for values in tries]
    except ExportError:
        raise
    except Exception as error:  # whatever the module says of what it is given
        raise _does_not_take(module, inputs, batched, error) from error
    _require_finite(expected[0], layout)
    given = {"version": 1, "name": name or path.stem}
    facts = _facts(inputs, n_max, fps, antialiased, filter)
    contract: Json = {**given, "inputs": {}, "outputs": layout.json(), **facts}
    contract |= {"coordinates": (coordinates or Coordinates()).json(), "license": license, "attribution": attribution}
    refusals = []
    for exporter in _OPSETS:
        try:
            model = _export(wrapped, inputs, layout, exporter, torch)
            finish_graph(model, layout, inputs, expected, n_max)
            contract["inputs"] = _bindings(model, inputs, layout)
            complete = contract | _bounds(wrapped, inputs, layout, torch) | _rows(model, layout, n_max, expected)
            onnx.helper.set_model_props(model, metadata(complete))
            errors = _errors(model, tries, expected, layout)
        except Exception as error:  # an exporter may fail in any way of its own
            refusals.append(f"{exporter}: {type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}")
            continue
        worst = max(errors.values(), default=0.0)
        if not worst <= _ALLOWED:
            refusals.append(f"{exporter}: computes other numbers than PyTorch (by {worst:.1e})")
            continue
        path.write_bytes(model.SerializeToString())
        unused = [f"input {each} is not used: the file has none" for each in inputs if each not in contract["inputs"]]  # type: ignore[operator]
        notes = [*(f"not taken: {refusal}" for refusal in refusals), *unused]
        findings = gpu_findings(model)
        report = ExportReport(path, exporter, model.opset_import[0].version, complete, errors, findings, notes)
        if not quiet:
            print(report)
        return report
    raise ExportError(
        "graph/invalid",
        where=f"module {type(module).__name__}",
        expected="a file that computes what the module computes, by one of PyTorch's exporters",
        found="; ".join(refusals),
        remedy="write what they stumble over in other operations, and keep shapes the same for every input",
    )


def generator(inputs: Mapping[str, Role], outputs: Layout | None = None, **facts: Any) -> Callable[[Any], Any]:
    """A decorator of a module class, or of a function of tensors: it gets `export(out)`, which is `export_module`.

    @generator({"t": time(), "twist": control(-1, 1)}, split("positions", "covariances", "colors", "opacities"))
    """

    def decorate(what: Any) -> Any:
        def export(self: Any, out: str | Path, **more: Any) -> ExportReport:
            return export_module(self, inputs, outputs, out=out, **{**facts, **more})

        what.export = export if inspect.isclass(what) else lambda out, **more: export(what, out, **more)
        return what

    return decorate


def refuse_other_arguments(module: Any, inputs: Mapping[str, Role]) -> None:
    """Raises argument/value where `forward` takes more or fewer arguments than there are roles."""
    try:
        inspect.signature(module.forward).bind(*inputs)
    except TypeError as error:
        raise ExportError(
            "argument/value",
            where=f"forward{inspect.signature(module.forward)}",
            expected="a role for each argument, in its order",
            found=f"{', '.join(inputs) or 'none'} ({error})",
            remedy="name them in inputs={...}",
        ) from error


def _module_of(function: Callable[..., Any], torch: Any) -> Any:
    class Function(torch.nn.Module):  # type: ignore[misc]
        def forward(self, *given: Any) -> Any:
            return function(*given)

    return Function()


def _does_not_take(module: Any, inputs: Mapping[str, Role], batched: bool, error: Exception) -> ExportError:
    given = ", ".join(f"{name} {[1, *r.shape] if batched else list(r.shape)}" for name, r in inputs.items())
    if batched:
        remedy = "leave batched out, if it takes no batch; time(shape=...) and control(shape=...) say other shapes"
    else:
        remedy = "give batched=True, if it takes a batch; time(shape=...) and control(shape=...) say other shapes"
    return ExportError(
        "argument/value",
        where=f"module {type(module).__name__}, run with its inputs' defaults: {given}",
        expected="tensors",
        found=f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}",
        remedy=remedy,
    )


def _wrapped(module: Any, layout: Layout, stays: Sequence[bool], torch: Any) -> Any:
    class Named(torch.nn.Module):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.module = module

        def forward(self, *given: Any) -> Any:
            taken = [x if stay else x[None] for x, stay in zip(given, stays, strict=True)]
            tensors = tensors_of(self.module(*taken), layout)
            return tuple(fitted(n, t, layout, torch) for n, t in zip(layout.outputs, tensors, strict=True))

    return Named().eval()


def _tries(inputs: Mapping[str, Role]) -> list[dict[str, AnyArray]]:
    """All defaults; then every input at its other values, together, as many times as the richest has some."""
    most = max((len(role.samples) for role in inputs.values()), default=1)
    return [{name: role.samples[i % len(role.samples)] for name, role in inputs.items()} for i in range(most)]


def _in_torch(wrapped: Any, values: Mapping[str, AnyArray], torch: Any) -> list[AnyArray]:
    with torch.no_grad():
        return [tensor.cpu().numpy() for tensor in wrapped(*(torch.from_numpy(x.copy()) for x in values.values()))]


def _require_finite(tensors: Sequence[AnyArray], layout: Layout) -> None:
    for name, values in zip(layout.outputs, tensors, strict=True):
        wrong = int((~np.isfinite(values)).sum())
        if wrong:
            raise ExportError(
                "contract/violation",
                where=f"output {name} of the module, at its inputs' defaults",
                expected="finite numbers",
                found=f"{wrong} of {values.size} that are not",
                remedy="this is PyTorch's own result: look for a division by zero, or a root of a negative number",
            )


def _export(wrapped: Any, inputs: Mapping[str, Role], layout: Layout, exporter: str, torch: Any) -> onnx.ModelProto:
    args = tuple(torch.from_numpy(role.default.copy()) for role in inputs.values())
    names = {"input_names": list(inputs), "output_names": list(layout.outputs), "opset_version": _OPSETS[exporter]}
    # What an exporter has to say of its failures is said in their errors.
    logging.getLogger("torch").setLevel(logging.CRITICAL)
    with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
        warnings.simplefilter("ignore")
        if exporter == "dynamo":
            program = torch.onnx.export(wrapped, args, dynamo=True, external_data=False, verbose=False, **names)
            return cast(onnx.ModelProto, onnx.ModelProto.FromString(program.model_proto.SerializeToString()))
        file = io.BytesIO()
        torch.onnx.export(wrapped, args, file, dynamo=False, **names)
        return onnx.load_from_string(file.getvalue())


def _bindings(model: onnx.ModelProto, inputs: Mapping[str, Role], layout: Layout) -> Json:
    there = {value.name for value in model.graph.input}
    return {
        name: {key: value for key, value in role.binding.items() if not key.startswith("_")}
        | ({"output": layout.outputs[-1]} if role.binding["role"] == "state" else {})
        for name, role in inputs.items()
        if name in there
    }


def _facts(
    inputs: Mapping[str, Role], n_max: int | None, fps: float | None, antialiased: bool, filter: Filter | None
) -> Json:
    durations = [role.binding["_duration"] for role in inputs.values() if role.binding.get("_duration")]
    facts: Json = {"duration": durations[0]} if durations else {}
    if fps is not None:
        facts["fps"] = fps
    compensates = antialiased or filter in ("antialiased", "mip")
    return {**facts, "antialiased": compensates, **({} if filter is None else {"filter": filter})}


def _bounds(wrapped: Any, inputs: Mapping[str, Role], layout: Layout, torch: Any) -> Json:
    """A box around the centres at defaults, at 24 times where the module knows the time, and a tenth more."""
    if layout.kind == "image":
        return {}
    rest = {name: role.default for name, role in inputs.items()}
    clocks = [name for name, role in inputs.items() if role.binding["role"] == "time"]
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for share in np.linspace(0, 1, 24) if clocks else [0.0]:
        moment = {name: (inputs[name].samples[-1] * share).astype(np.float32) for name in clocks}
        centres = _in_torch(wrapped, rest | moment, torch)[0][:, :3]
        centres = centres[np.isfinite(centres).all(1)]
        if len(centres):
            low, high = np.minimum(low, centres.min(0)), np.maximum(high, centres.max(0))
    if not np.isfinite([low, high]).all() or any(role.binding["role"] == "image" for role in inputs.values()):
        return {}
    slack = 0.1 * (high - low) + 1e-6
    return {"bounds": {"min": [float(x) for x in low - slack], "max": [float(x) for x in high + slack]}}


def _rows(model: onnx.ModelProto, layout: Layout, n_max: int | None, expected: Sequence[Sequence[AnyArray]]) -> Json:
    if layout.kind == "image":
        return {}
    first = model.graph.output[0].type.tensor_type.shape.dim[0]
    if first.HasField("dim_value"):
        return {"nMax": int(first.dim_value)}
    if n_max is None:
        most = max(len(tensors[0]) for tensors in expected)
        raise ExportError(
            "argument/value",
            where="n_max",
            expected="the most Gaussians that a run writes, since their number differs from run to run",
            found=f"none; {most} were seen",
            remedy=f"give n_max={2 * most}; or keep every row and write opacity 0 into the dead ones, which is faster",
        )
    return {"nMax": n_max}


def _errors(
    model: onnx.ModelProto,
    tries: Sequence[Mapping[str, AnyArray]],
    expected: Sequence[Sequence[AnyArray]],
    layout: Layout,
) -> dict[str, float]:
    """Largest difference of each output to PyTorch's, as a share of the largest number in it."""
    import onnxruntime as ort

    options = ort.SessionOptions()
    options.log_severity_level = 4
    session = ort.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    there = {value.name for value in session.get_inputs()}
    errors = dict.fromkeys(layout.outputs, 0.0)
    for values, wanted in zip(tries, expected, strict=True):
        feeds = {name: value for name, value in values.items() if name in there}
        for name, mine, theirs in zip(layout.outputs, session.run(list(layout.outputs), feeds), wanted, strict=True):
            errors[name] = max(errors[name], _difference(np.asarray(mine, np.float64), np.asarray(theirs, np.float64)))
    return errors


def _difference(mine: AnyArray, theirs: AnyArray) -> float:
    if mine.shape != theirs.shape:
        return float("inf")
    both = ~(np.isfinite(mine) | np.isfinite(theirs))
    apart = np.where(both, 0, np.abs(mine - theirs))
    scale = max(float(np.abs(theirs[np.isfinite(theirs)]).max(initial=0)), 1e-12)
    # A number that one has and the other has not.
    return float(np.nan_to_num(apart, nan=np.inf, posinf=np.inf).max(initial=0)) / scale
