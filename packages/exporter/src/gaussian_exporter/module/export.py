"""`export_module`: chooses exporter, opset and options that stay on the GPU, sets names and contract, and compares
with PyTorch.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import onnx

from ..arrays import AnyArray
from ..conformance import SHARES, check_outputs
from ..contract import REPEATED, Coordinates, Filter, Json, metadata
from ..errors import ExportError, listed, require_package
from ..outputs import refuse_place, save
from ..placement import Finding, finding_lines, gpu_findings
from ..written import box_of, read
from .capture import OPSETS, captured, cause, keeping_modes, widened
from .finish import finish_graph
from .layouts import Layout, split, with_state
from .quantize import decibels, quantize_weights
from .roles import Role
from .trial import (
    describe_difference,
    difference,
    in_torch,
    said,
    sensitivity,
    tried,
    weights_of,
    wrapped_module,
)

# Largest allowed difference to PyTorch, as a fraction of the largest number of an output.
_ALLOWED = 1e-3
# For a module that is sensitive to its inputs: a multiple of its own change, up to a limit beyond which a set of
# inputs proves nothing.
_SENSITIVE, _MOST = 4.0, 2e-2


@dataclass(frozen=True)
class ExportReport:
    """Result of an export: the exporter, differences of the outputs to PyTorch, and nodes that would leave the GPU."""

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
        lines += [f"  {note}" for note in [*self.notes, *finding_lines(self.findings)]]
        if all(finding.kind == "inexact" for finding in self.findings):
            lines.append("  WebGPU: every node has a kernel, shapes are fixed, the commands can be recorded")
        return "\n".join([*lines, f"  {self.html()}"])

    def html(self) -> str:
        """The HTML element that shows it: with playback if it has a time, and with controls for the inputs of
        visitors.
        """
        inputs = cast(dict[str, Json], self.contract["inputs"])
        roles = {str(binding["role"]) for binding in inputs.values()}
        file, shown = escape(self.path.name), {"control", "pose", "shape", "image"}
        words = [f'src="{file}"', f'alt="{escape(str(self.contract["name"]))}"', "camera-controls"]
        if cast(Json, self.contract["outputs"])["layout"] == "image":
            shown.remove("image")
            words[0] = f'src="scene.ply" postprocess="{file}"'
        words += ["autoplay loop"] if roles & {"time", "frame"} else []
        words += ["controls-panel"] if roles & shown else []
        return f"<gaussian-splat {' '.join(words)}></gaussian-splat>"


@keeping_modes
def export_module(
    module: Any,
    inputs: Mapping[str, Role],
    outputs: Layout | None = None,
    *,
    out: str | Path,
    name: str | None = None,
    license: str | None = None,
    attribution: str | None = None,
    n_max: int | None = None,
    coordinates: Coordinates | Mapping[str, Any] | None = None,
    antialiased: bool = False,
    filter: Filter | None = None,
    fps: float | None = None,
    batched: bool = False,
    weights: Literal["float32", "int8"] = "float32",
    quiet: bool = False,
) -> ExportReport:
    """Writes a torch.nn.Module as a generator with its contract, compares it with PyTorch, and prints the result.

    `inputs`: a role for each argument of `forward`, in its order: {"t": time(), "twist": control(-1, 1)}.
    `outputs`: the tensors that it returns, split() by default: positions, scales, rotations, colors, opacities.
    Both of PyTorch's exporters are tried, and the first whose file computes the same as the module is kept.
    `batched`: the module takes a batch before every input, [1,72] if the role has [72], and [1,1] for a time or a
    control; images always have one. `weights="int8"`: tables of convolutions and products in 8 bits, a quarter of the
    file, compared with PyTorch in dB. `coordinates`: which axis is up, {"up": "+y"}; -y without it.
    Raises graph/invalid if neither exporter succeeds, and contract/violation if its outputs have another shape than
    split() declares, or numbers out of range.
    """
    require_package("onnxruntime", "module")
    import torch

    refuse_place(Path(out))
    layout, path = with_state(outputs or split(), inputs), Path(out)
    module = module if isinstance(module, torch.nn.Module) else _module_of(module, torch)
    module, narrow = widened(module.eval(), torch)
    refuse_other_arguments(module, inputs)
    _refuse_repeated(inputs)
    tries, expected = tried(module, inputs, layout, batched, n_max, torch)
    wrapped = wrapped_module(module, inputs, layout, batched, torch)
    allowed = [
        [max(_ALLOWED, _SENSITIVE * each) for each in row] for row in sensitivity(wrapped, tries, expected, torch)
    ]
    _refuse_sensitive(allowed, layout, tries)
    bounds = _bounds(wrapped, inputs, layout, torch)
    given = {"version": 1, "name": name or path.stem}
    facts = _facts(inputs, n_max, fps, antialiased, filter)
    contract: Json = {**given, "inputs": {}, "outputs": layout.json(), **facts}
    credits = {"license": license, "attribution": attribution}
    contract |= {"coordinates": Coordinates.of(coordinates).json()}
    contract |= {key: text for key, text in credits.items() if text is not None}
    refusals: list[str] = []
    for exporter in OPSETS:
        try:
            model = captured(wrapped, inputs, layout.outputs, exporter, torch)
            finish_graph(model, layout, inputs, expected, n_max)
            contract["inputs"] = _bindings(model, inputs, layout)
            complete = contract | bounds | _rows(model, layout, n_max, expected)
            onnx.helper.set_model_props(model, metadata(complete))
            errors, worst = _errors(_outputs(model, tries, layout), tries, expected, layout, allowed)
        except Exception as error:  # an exporter may fail in any way of its own
            refusals.append(f"{exporter}: {cause(error)}")
            continue
        if worst:
            refusals.append(f"{exporter}: computes other numbers than PyTorch: {worst}")
            continue
        rounded: list[str] = []
        if weights == "int8":
            count = quantize_weights(model)
            written = _outputs(model, tries, layout)
            errors, _ = _errors(written, tries, expected, layout, allowed)
            fidelity = _fidelity(written, expected, layout, allowed)
            rounded = [f"{count} tables of weights in 8 bits; {fidelity} to PyTorch"]
        findings = gpu_findings(model)
        for finding in findings:
            if finding.is_refused:
                raise finding.error()
        try:
            check_outputs(model, {n: x for n, x in tries[0].items() if n in contract["inputs"]})  # type: ignore[operator]
        except ExportError as error:
            # The other exporter may write a file that keeps the contract.
            refusals.append(f"{exporter}: {error}")
            continue
        save(model, path)
        unused = [f"input {each} is not used: the file has none" for each in inputs if each not in contract["inputs"]]  # type: ignore[operator]
        doubles = [name for _, name, each in weights_of(module) if each.dtype == torch.float64]
        narrowed = [f"weights of 16 bits became float32: {listed(narrow)}"] if narrow else []
        narrowed += [f"float64, which pages do not cast, became float32: {listed(doubles)}"] if doubles else []
        vague = sum(max(row) > _MOST for row in allowed)
        if vague:
            narrowed.append(f"{vague} of {len(tries)} sets of inputs prove nothing: the module itself jumps at them")
        notes = [*(f"not taken: {refusal}" for refusal in refusals), *unused, *narrowed, *rounded]
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
    """A decorator of a module class, or of a function of tensors, which then has `export(out)`: see `export_module`.
    @generator({"t": time(), "twist": control(-1, 1)}, split("positions", "covariances", "colors", "opacities"))
    """

    def decorate(what: Any) -> Any:
        def export(self: Any, out: str | Path, **more: Any) -> ExportReport:
            return export_module(self, inputs, outputs, out=out, **{**facts, **more})

        what.export = export if inspect.isclass(what) else lambda out, **more: export(what, out, **more)
        return what

    return decorate


def refuse_other_arguments(module: Any, inputs: Mapping[str, Role]) -> None:
    """Raises argument/value if `forward` takes more or fewer arguments than there are roles."""
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


def _refuse_repeated(inputs: Mapping[str, Role]) -> None:
    """Raises contract/conflict, before the work, for a role that two inputs have and a contract allows once."""
    first: dict[str, str] = {}
    for name, role in inputs.items():
        kind = " ".join(str(role.binding[key]) for key in ("role", "attribute") if key in role.binding)
        if kind in first and kind not in REPEATED:
            raise ExportError(
                "contract/conflict",
                where=f"inputs {first[kind]} and {name}",
                expected=f"one input with the role {kind}",
                found="two",
                remedy="give one input for both",
            )
        first.setdefault(kind, name)


def _module_of(function: Callable[..., Any], torch: Any) -> Any:
    class Function(torch.nn.Module):  # type: ignore[misc]
        def forward(self, *given: Any) -> Any:
            return function(*given)

    return Function()


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
    """A box around the centers at defaults, at 24 times if the module has a time, enlarged by a tenth."""
    if layout.kind == "image":
        return {}
    rest = {name: role.default for name, role in inputs.items()}
    clocks = [name for name, role in inputs.items() if role.binding["role"] == "time"]
    boxes = []
    for share in (*np.linspace(0, 1, 24), *SHARES) if clocks else (0.0,):
        moment = {name: (inputs[name].samples[-1] * share).astype(np.float32) for name in clocks}
        tensors = in_torch(wrapped, rest | moment, torch)
        box = box_of(read(layout.json(), dict(zip(layout.outputs, tensors, strict=True)))[1])
        boxes += [] if box is None else [box]
    # Images, frames and previous outputs may move the centers anywhere.
    if not boxes or any(role.binding["role"] in ("image", "frame", "state") for role in inputs.values()):
        return {}
    low, high = np.min([box[0] for box in boxes], 0), np.max([box[1] for box in boxes], 0)
    slack = 0.1 * (high - low) + 1e-6
    return {"bounds": {"min": [float(x) for x in low - slack], "max": [float(x) for x in high + slack]}}


def _rows(model: onnx.ModelProto, layout: Layout, n_max: int | None, expected: Sequence[Sequence[AnyArray]]) -> Json:
    if layout.kind == "image":
        return {}
    first = model.graph.output[0].type.tensor_type.shape.dim[0]
    if first.HasField("dim_value"):
        return {"nMax": int(first.dim_value)}
    if n_max is None:
        maximum = max(len(tensors[0]) for tensors in expected)
        raise ExportError(
            "argument/value",
            where="n_max",
            expected="the most Gaussians that a run writes, since the file may write another number in each",
            found=f"none; {maximum} were seen",
            remedy=f"keep every row, and write opacity 0 into the unused ones; or give n_max={2 * maximum}",
        )
    return {"nMax": n_max}


def _outputs(model: onnx.ModelProto, tries: Sequence[Mapping[str, AnyArray]], layout: Layout) -> list[list[AnyArray]]:
    """Runs the file on the CPU, and returns its outputs for each set of inputs."""
    import onnxruntime as ort

    options = ort.SessionOptions()
    options.log_severity_level = 4
    session = ort.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    there = {value.name for value in session.get_inputs()}
    feeds = ({name: value for name, value in values.items() if name in there} for values in tries)
    return [session.run(list(layout.outputs), each) for each in feeds]


def _fidelity(
    written: Sequence[Sequence[AnyArray]],
    expected: Sequence[Sequence[AnyArray]],
    layout: Layout,
    allowed: Sequence[Sequence[float]],
) -> str:
    """For each output its lowest ratio to the noise in dB, over the inputs at which the module does not jump."""
    kept = [rows for *rows, limits in zip(written, expected, allowed, strict=True) if max(limits) <= _MOST]
    lowest = (min(decibels(mine[i], theirs[i]) for mine, theirs in kept) for i in range(len(layout.outputs)))
    return ", ".join(f"{name} {value:.1f} dB" for name, value in zip(layout.outputs, lowest, strict=True))


def _errors(
    written: Sequence[Sequence[AnyArray]],
    tries: Sequence[Mapping[str, AnyArray]],
    expected: Sequence[Sequence[AnyArray]],
    layout: Layout,
    allowed: Sequence[Sequence[float]],
) -> tuple[dict[str, float], str]:
    """Largest difference of each output to PyTorch's, as a fraction of the largest number in it, and a sentence on the
    output that exceeds what is allowed the most; sets at which the module itself jumps are left out."""
    errors, worst, excess = dict.fromkeys(layout.outputs, 0.0), "", 1.0
    for found, values, wanted, limits in zip(written, tries, expected, allowed, strict=True):
        if max(limits, default=0.0) > _MOST:
            continue
        for name, mine, theirs, limit in zip(layout.outputs, found, wanted, limits, strict=True):
            error = difference(mine, theirs)
            if not error <= excess * limit:
                excess, worst = error / limit, f"{name} {describe_difference(mine, theirs)}, {said(values, tries)}"
            errors[name] = max(errors[name], error)
    return errors, worst


def _refuse_sensitive(
    allowed: Sequence[Sequence[float]], layout: Layout, tries: Sequence[Mapping[str, AnyArray]]
) -> None:
    """Raises argument/value if no set of inputs is one at which a file can be compared."""
    if min(max(row, default=0.0) for row in allowed) <= _MOST:
        return
    worst = max(range(len(layout.outputs)), key=lambda i: allowed[0][i])
    raise ExportError(
        "argument/value",
        where=f"output {layout.outputs[worst]} of the module",
        expected="inputs at which a file can be compared with PyTorch",
        found=f"a change by {allowed[0][worst] / _SENSITIVE:.1e} of its largest number when they change by a millionth,"
        f" {said(tries[0], tries)}",
        remedy="noise means nothing to some networks: give photographs, image(..., examples=[photo])",
    )
