"""Which nodes of a file would leave the GPU, found without a GPU.

A node without a WebGPU kernel runs on the CPU, in the middle of the graph. In every frame the page then waits for all
earlier GPU work, including its own drawing. A graph with one such node cannot be captured, which costs 2.5 to 11 times
more JavaScript time. The list of kernels was measured, operator by operator, with ONNX Runtime's native WebGPU provider
(onnxruntime-webgpu 1.27.0). tests/test_webgpu.py compares these rules with the provider's placement of each node.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Literal

import onnx
from onnx import TensorProto, helper

from .contract import METADATA_KEY
from .errors import ExportError
from .graph import ALIASES

# The rules are those of the checker of pages and shells: this is a copy of packages/core/src/onnx/webgpu-rules.ts.
RULES: dict[str, Any] = json.loads(files(__package__).joinpath("webgpu_rules.json").read_text(encoding="utf-8"))
KERNELS = frozenset(RULES["kernels"])
INSTEAD: dict[str, str] = RULES["instead"]
_EXPORT = f"export opset {RULES['exportOpset']}"

Kind = Literal["fallback", "failure", "wrong", "inexact", "slow"]


@dataclass(frozen=True)
class Finding:
    """One reason why a file does not stay on the GPU (fallback), does not run (failure), computes other numbers there
    than on the CPU (wrong), loses digits for some inputs (inexact), or is slow.
    """

    kind: Kind
    node: str
    operator: str
    reason: str
    remedy: str
    # Name of the affected tensor, or of the node's first output.
    tensor: str = ""

    @property
    def is_refused(self) -> bool:
        """Whether pages refuse the file for this reason, instead of running it on the CPU."""
        return self.kind == "failure" and self.operator in ("Cast", "file", "bfloat16")

    def error(self) -> ExportError:
        """The error to raise if the file is refused."""
        return ExportError(
            "contract/operator",
            where=f"{self.operator} {self.node}".strip(),
            expected="what ONNX Runtime in a page can run",
            found=self.reason,
            remedy=self.remedy,
        )

    def __str__(self) -> str:
        """One line of text."""
        return f"{self.kind}: {self.operator} '{self.node}': {self.reason}; {self.remedy}"


def finding_lines(findings: Sequence[Finding]) -> list[str]:
    """Findings as lines of text: for each remedy the first finding, and the number of others."""
    by_remedy: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        by_remedy.setdefault((finding.kind, finding.remedy), []).append(finding)
    return [
        str(first) + (f" (and {len(more)} more of this kind)" if more else "") for first, *more in by_remedy.values()
    ]


def axis_of_instances(model: onnx.ModelProto) -> str | None:
    """The symbol of the axis of instances in the file's own contract, if any."""
    for prop in model.metadata_props:
        if prop.key == METADATA_KEY:
            try:
                return str(json.loads(prop.value.removeprefix("\ufeff"))["instances"]["axis"])
            except (ValueError, KeyError, TypeError, RecursionError):
                # A faulty contract has no axis; its faults are reported elsewhere.
                return None
    return None


def _size(dim: onnx.TensorShapeProto.Dimension, axis: str | None) -> int | None:
    """A size, or None if the file does not declare it. The axis of instances is a number in every session."""
    if axis is not None and dim.dim_param == axis:
        return 1
    return dim.dim_value if dim.HasField("dim_value") else None


class _Values:
    """Types, sizes and producers of all values, from shape inference."""

    def __init__(self, model: onnx.ModelProto):
        try:
            graph = onnx.shape_inference.infer_shapes(model).graph
        except onnx.shape_inference.InferenceError:
            # The file has operators of an unknown domain, so only its own declarations are used.
            graph = model.graph
        self.axis = axis_of_instances(model)
        self.makers = {name: node for node in graph.node for name in node.output}
        self.functions = {(function.domain, function.name) for function in model.functions}
        self.constants = {initializer.name for initializer in graph.initializer}
        self.constants |= {node.output[0] for node in graph.node if node.op_type == "Constant"}
        self.types = {initializer.name: initializer.data_type for initializer in graph.initializer}
        self.dims: dict[str, list[int | None]] = {}
        self.dims |= {initializer.name: list(initializer.dims) for initializer in graph.initializer}
        for value in [*graph.input, *graph.value_info, *graph.output]:
            tensor = value.type.tensor_type
            self.types[value.name] = tensor.elem_type
            self.dims[value.name] = [_size(d, self.axis) for d in tensor.shape.dim]


def gpu_findings(model: onnx.ModelProto) -> list[Finding]:
    """All findings that keep a file from running entirely on the GPU with its graph captured; empty without any."""
    values = _Values(model)
    opset = next((entry.version for entry in model.opset_import if entry.domain in ("", "ai.onnx")), 0)
    found = list(_of_file(model, opset, values))
    for node in model.graph.node:
        # The runtime dequantizes constants in each run.
        found += _miscomputed(node, values)
        # Nodes that depend on constants alone run once, when the session is created.
        if is_folded(node, values):
            values.constants.update(node.output)
            found += _casts(node, opset, values)
            continue
        found += [finding for rule in _RULES for finding in rule(node, opset, values)]
    return [*found, *_of_copies(model, values)]


def is_folded(node: onnx.NodeProto, values: _Values) -> bool:
    """Whether a node is computed when the session is created: it has constant inputs, or returns the shape of a tensor
    of fixed shape.
    """
    if node.op_type == "Shape" and None not in values.dims.get(node.input[0], [None]):
        return True
    return bool(node.input) and all(name in values.constants or not name for name in node.input)


def _of_copies(model: onnx.ModelProto, values: _Values) -> Iterator[Finding]:
    """Outputs that are reshaped results, which no kernel writes. This does not matter for a file without inputs, which
    runs once, nor for constants, which are read once.
    """
    makers = {name: node for node in model.graph.node for name in node.output}
    for output in model.graph.output if model.graph.input else []:
        maker = makers.get(output.name)
        if maker is not None and output.name not in values.constants and maker.op_type in ALIASES:
            reason = f"{output.name} is copied, which a recording of the commands does not repeat: it runs unrecorded"
            remedy = "let a kernel write it: add a zero that comes from an input"
            yield Finding("slow", maker.name, maker.op_type, reason, remedy, output.name)


def _of_file(model: onnx.ModelProto, opset: int, values: _Values) -> Iterator[Finding]:
    narrow = sorted(name for name, kind in values.types.items() if kind == TensorProto.BFLOAT16)
    if narrow:
        reason = f"{narrow[0]} is bfloat16, which pages neither store nor cast"
        yield Finding("failure", narrow[0], "bfloat16", reason, "export it in float32: module.float()")
    newest = RULES["newestOpset"], RULES["newestIr"]
    if opset > newest[0] or model.ir_version > newest[1]:
        found = f"opset {opset}, IR {model.ir_version}"
        yield Finding("failure", "", "file", f"{found} are newer than {newest[0]} and {newest[1]}", _EXPORT)
    for value in [*model.graph.input, *model.graph.output]:
        if value.name not in values.constants and not _is_fixed(value, values.axis):
            reason = f"{value.name} has a symbolic or unknown size, so the graph cannot be recorded"
            yield Finding("fallback", value.name, "shape", reason, "export fixed shapes", value.name)
        if values.types.get(value.name) == TensorProto.FLOAT16:
            reason = (
                f"{value.name} is float16, which needs the device feature shader-f16 (Chromium hides it on NVIDIA "
                "under Linux): without it the whole model runs on the CPU"
            )
            yield Finding("failure", value.name, "type", reason, "offer a float32 file, too", value.name)


def operators_of(model: onnx.ModelProto) -> set[tuple[str, str]]:
    """Domain and name of each operator, those of subgraphs and functions included."""
    found: set[tuple[str, str]] = set()
    nodes = [*model.graph.node, *(node for function in model.functions for node in function.node)]
    while nodes:
        node = nodes.pop()
        found.add((node.domain, node.op_type))
        for attribute in node.attribute:
            graphs = [*([attribute.g] if attribute.HasField("g") else []), *attribute.graphs]
            nodes += [inner for graph in graphs for inner in graph.node]
    return found


def _is_fixed(value: onnx.ValueInfoProto, axis: str | None) -> bool:
    tensor = value.type.tensor_type
    return tensor.HasField("shape") and None not in [_size(dim, axis) for dim in tensor.shape.dim]


def _casts(node: onnx.NodeProto, opset: int, values: _Values) -> Iterator[Finding]:
    for name in [*node.input, *node.output] if node.op_type == "Cast" else ():
        kind = values.types.get(name)
        if kind in (TensorProto.UINT16, TensorProto.INT16, TensorProto.DOUBLE):
            reason = f"{name} is {helper.tensor_dtype_to_np_dtype(kind)}, which builds for the web cannot cast"
            remedy = "store uint8 (two of them for 16 bits), float16, int32 or float32"
            yield Finding("failure", node.name, "Cast", reason, remedy)
            return


def _of(kind: Kind, node: onnx.NodeProto, reason: str, remedy: str) -> Finding:
    return Finding(kind, node.name or node.output[0], node.op_type, reason, remedy, node.output[0])


_NO_KERNEL = "WebGPU has no kernel for it: every run is interrupted by a wait for the GPU"


def _kernel(node: onnx.NodeProto, opset: int, values: _Values) -> Iterator[Finding]:
    if node.domain == "com.microsoft" and node.op_type in RULES["contrib"]:
        if node.op_type in RULES["miscomputed"]:
            yield _of("wrong", node, RULES["miscomputed"][node.op_type], "write it in operators of ai.onnx")
    elif node.domain not in ("", "ai.onnx"):
        remedy = "write it in operators of ai.onnx"
        if (node.domain, node.op_type) in values.functions:
            return
        if node.domain == "com.microsoft":
            yield _of("fallback", node, _NO_KERNEL, remedy)
        else:
            yield _of("failure", node, f"domain {node.domain} is not part of ONNX", remedy)
    elif node.op_type in RULES["controlFlow"]:
        yield _of("fallback", node, "control flow ends the recording", "unroll it")
    elif node.op_type not in KERNELS:
        remedy = INSTEAD.get(node.op_type, "write it in other operators")
        yield _of("fallback", node, _NO_KERNEL, remedy)
    elif node.op_type == "GridSample" and opset > RULES["gridSampleOpset"]:
        reason = f"WebGPU has kernels for it up to opset {RULES['gridSampleOpset']}"
        yield _of("fallback", node, f"{reason}: every run is interrupted by a wait for the GPU", _EXPORT)


def _inexact(node: onnx.NodeProto, opset: int, values: _Values) -> Iterator[Finding]:
    if node.op_type in RULES["inexact"]:
        reason = "its variance loses digits where the mean is 100 times the deviation or more"
        yield _of("inexact", node, reason, "subtract the mean first if its inputs have a large one")
    attributes = {attribute.name: attribute for attribute in node.attribute}
    if node.op_type == "Resize" and "antialias" in attributes and attributes["antialias"].i:
        reason = "WebGPU does not resize with antialias, so the whole model runs on the CPU"
        yield _of("failure", node, reason, "resize before, or without antialias")
    if node.op_type == "Pow" and len({values.types.get(name) for name in node.input} - {None}) > 1:
        reason = "its exponent has another type than its base: it runs unrecorded"
        yield _of("fallback", node, reason, "write the exponent as a float, or multiply")


def _types(node: onnx.NodeProto, opset: int, values: _Values) -> Iterator[Finding]:
    handled = (TensorProto.INT64, TensorProto.DOUBLE)
    used = [name for name in [*node.input, *node.output] if name and name not in values.constants]
    wide = [name for name in used if values.types.get(name) in handled]
    # Indices of Gather and similar operators may be int64, and a Cast may create them; other uses are arithmetic.
    if node.op_type in RULES["makers"]:
        wide = [name for name in wide if name in node.input]
    elif node.op_type in RULES["indexed"]:
        wide = [name for name in wide if name in (node.input[0], node.output[0])]
    if wide:
        kind = helper.tensor_dtype_to_np_dtype(values.types[wide[0]])
        remedy = "compute in int32 and cast last, or bake the numbers"
        yield _of("fallback", node, f"{wide[0]} is {kind}, for which WebGPU has no kernels", remedy)


def _sizes(node: onnx.NodeProto, opset: int, values: _Values) -> Iterator[Finding]:
    maximum = RULES["maxSplitOutputs"]
    if node.op_type == "Split" and len(node.output) > maximum:
        reason = f"a Split into {len(node.output)} binds more buffers than a shader may"
        reason += ", and the whole model runs on the CPU"
        yield _of("failure", node, reason, f"split into at most {maximum}, or use Gather")
    maker = values.makers.get(node.input[0]) if node.op_type == "MatMul" else None
    if maker is not None and maker.op_type == "Transpose" and len(values.dims.get(node.input[1], [0, 0])) == 1:
        reason = "ONNX Runtime's optimiser loses the transposition of a matrix times a vector"
        remedy = "make the vector a matrix of one column: (R.T @ t[:, None])[:, 0]"
        yield _of("slow", node, f"{reason}, so pages load the file without fusions", remedy)
    if node.op_type == "CumSum":
        longest = max((size or 0 for size in values.dims.get(node.input[0], [])), default=0)
        if longest > RULES["longestCumSum"]:
            reason = f"over {longest} elements it takes their square in steps"
            yield _of("slow", node, reason, "leave compaction to the renderer")


def _miscomputed(node: onnx.NodeProto, values: _Values) -> Iterator[Finding]:
    """A node that the WebGPU provider computes wrongly for all inputs."""
    if node.op_type == "Conv" and (channels := miscomputed_convolution(node, values.dims.get(node.input[1], []))):
        reason = f"WebGPU computes {channels[0]} channels to {channels[1]} wrongly, so the whole model runs on the CPU"
        yield _of("wrong", node, reason, "pad the channels going in to a multiple of 4")
    is_blocked = any(each.name == "block_size" and each.i > 0 for each in node.attribute)
    if node.op_type == "DequantizeLinear" and is_blocked and len(values.dims.get(node.input[0], [])) == 1:
        reason = "WebGPU computes blocks of one dimension wrongly, so the whole model runs on the CPU"
        yield _of("wrong", node, reason, "quantize a matrix of one row, and reshape it")


def miscomputed_convolution(node: onnx.NodeProto, dims: Sequence[int | None]) -> tuple[int, int] | None:
    """Input and output channels of a convolution that the WebGPU provider computes wrongly: of one or two dimensions
    and one group, from a multiple of 3 that is not one of 4 to a multiple of 4, with a kernel of more than one
    pixel. None for others.
    """
    given = {attribute.name: helper.get_attribute_value(attribute) for attribute in node.attribute}
    if len(dims) not in (3, 4) or given.get("group", 1) != 1 or None in dims:
        return None
    outputs, inputs, *kernel = (size or 0 for size in dims)
    sizes = [*given.get("kernel_shape", kernel), *given.get("strides", [1])]
    is_wrong = inputs > 3 and inputs % 3 == 0 and inputs % 4 != 0 and outputs % 4 == 0 and max(sizes) > 1
    return (inputs, outputs) if is_wrong else None


_RULES: list[Callable[[onnx.NodeProto, int, _Values], Iterator[Finding]]] = [_kernel, _types, _sizes, _casts, _inexact]
