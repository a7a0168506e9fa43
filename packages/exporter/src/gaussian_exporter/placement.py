"""Which nodes of a file would leave the GPU, found without a GPU.

A node without a WebGPU kernel runs on the CPU, in the middle of the graph: in every frame the page waits for all GPU
work before it, its own drawing included; and a graph with one such node cannot be captured, which costs 2.5 to 11 times
more JavaScript time. What has a kernel was measured, operator by operator, with ONNX Runtime's native WebGPU
provider (onnxruntime-webgpu 1.27.0); tests/test_webgpu.py compares these rules with where the provider really puts
each node.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import onnx
from onnx import TensorProto, helper

from .graph import ALIASES, INSTANCES_AXIS
from .pieces.convolution import is_wrong_on_webgpu

# Operators of ai.onnx with a float32 kernel. Control flow (If) has one too, but ends capture.
_KERNEL_NAMES = """
    Abs Acos Acosh Add And ArgMax ArgMin Asin Asinh Atan Atanh AveragePool BatchNormalization Cast Ceil Clip
    Concat Conv ConvTranspose Cos Cosh CumSum DepthToSpace Div Einsum Elu Equal Erf Exp Expand Flatten Floor
    Gather GatherElements GatherND Gelu Gemm GlobalAveragePool GlobalMaxPool Greater GreaterOrEqual GridSample
    HardSigmoid HardSwish Identity InstanceNormalization LayerNormalization LeakyRelu Less LessOrEqual Log
    LpNormalization MatMul MaxPool Mul Neg Not Pad Pow RMSNormalization Range Reciprocal ReduceL1 ReduceL2
    ReduceLogSum ReduceLogSumExp ReduceMax ReduceMean ReduceMin ReduceProd ReduceSum ReduceSumSquare Relu
    Reshape Resize ScatterElements ScatterND Shape Sigmoid Sin Sinh Slice Softmax Softplus Split Sqrt Squeeze
    Sub Tan Tanh ThresholdedRelu Tile TopK Transpose Unsqueeze Where
"""
KERNELS = frozenset(_KERNEL_NAMES.split())
INSTEAD = {
    "Compress": "keep every row and write opacity 0 into the dead ones",
    "NonZero": "keep every row and write opacity 0 into the dead ones",
    "Round": "Floor(x + 0.5), or compare with a shifted number",
    "Sign": "Where(x > 0, 1, -1)",
    "Min": "Where(a < b, a, b), or Clip",
    "Max": "Where(a > b, a, b), Relu or Clip",
    "Or": "add masks as floats",
    "Sum": "Add",
    "Mean": "Add and Mul",
    "PRelu": "LeakyRelu, or Where",
    "LogSoftmax": "Log(Softmax(x))",
    "SpaceToDepth": "Reshape and Transpose",
    "Det": "write the determinant out in Mul and Sub",
}
NEWEST_OPSET = 26
NEWEST_IR = 13
# A Split binds its input, its outputs and nothing else: the adapter measured had 10 storage buffers for a shader.
MOST_SPLIT_OUTPUTS = 9
# CumSum lets each thread add up its whole prefix.
LONGEST_CUMSUM = 4096

Kind = Literal["fallback", "failure", "wrong", "slow"]


@dataclass(frozen=True)
class Finding:
    """One reason why a file will not stay on the GPU (fallback), not run (failure), compute
    other numbers there than on the CPU (wrong), or be slow."""

    kind: Kind
    node: str
    operator: str
    reason: str
    remedy: str

    def __str__(self) -> str:
        """One line for people."""
        return f"{self.kind}: {self.operator} '{self.node}': {self.reason}; {self.remedy}"


def _size(dim: onnx.TensorShapeProto.Dimension) -> int | None:
    """A size, or None where the file leaves it open. The axis of instances is a number in every session."""
    if dim.dim_param == INSTANCES_AXIS:
        return 1
    return dim.dim_value if dim.HasField("dim_value") else None


class _Values:
    """What shape inference knows of every value."""

    def __init__(self, model: onnx.ModelProto):
        try:
            graph = onnx.shape_inference.infer_shapes(model).graph
        except onnx.shape_inference.InferenceError:
            # Operators of a foreign domain; what the file itself declares must do.
            graph = model.graph
        self.constants = {initializer.name for initializer in graph.initializer}
        self.constants |= {node.output[0] for node in graph.node if node.op_type == "Constant"}
        self.types = {initializer.name: initializer.data_type for initializer in graph.initializer}
        self.dims: dict[str, list[int | None]] = {}
        self.dims |= {initializer.name: list(initializer.dims) for initializer in graph.initializer}
        for value in [*graph.input, *graph.value_info, *graph.output]:
            tensor = value.type.tensor_type
            self.types[value.name] = tensor.elem_type
            self.dims[value.name] = [_size(d) for d in tensor.shape.dim]


def gpu_findings(model: onnx.ModelProto) -> list[Finding]:
    """Everything that would keep a file from running wholly on the GPU with its graph captured; empty if nothing."""
    values = _Values(model)
    opset = next((entry.version for entry in model.opset_import if entry.domain in ("", "ai.onnx")), 0)
    found = list(_of_file(model, opset, values))
    for node in model.graph.node:
        # What hangs on constants alone is computed once, when the session is made.
        if node.input and all(name in values.constants or not name for name in node.input):
            values.constants.update(node.output)
            found += _of_constants(node, values)
            continue
        found += [finding for rule in _RULES for finding in rule(node, opset, values)]
    return [*found, *_of_copies(model, values)]


def _of_copies(model: onnx.ModelProto, values: _Values) -> Iterator[Finding]:
    """Outputs that no kernel writes. A file without inputs runs once and is none the worse for it."""
    makers = {name: node for node in model.graph.node for name in node.output}
    for output in model.graph.output if model.graph.input else []:
        maker = makers.get(output.name)
        operator = "constant" if maker is None or output.name in values.constants else maker.op_type
        if operator in ALIASES or operator == "constant":
            reason = f"{output.name} is copied, which a recording of the commands does not repeat: it runs unrecorded"
            remedy = "let a kernel write it: add a zero that comes from an input"
            yield Finding("slow", maker.name if maker else output.name, operator, reason, remedy)


def _of_file(model: onnx.ModelProto, opset: int, values: _Values) -> Iterator[Finding]:
    if opset > NEWEST_OPSET or model.ir_version > NEWEST_IR:
        found = f"opset {opset}, IR {model.ir_version}"
        yield Finding(
            "failure", "", "file", f"{found} are newer than {NEWEST_OPSET} and {NEWEST_IR}", "export opset 17"
        )
    for value in [*model.graph.input, *model.graph.output]:
        if value.name not in values.constants and None in values.dims.get(value.name, []):
            reason = f"{value.name} has a symbolic or unknown size, so the graph cannot be captured"
            yield Finding("fallback", value.name, "shape", reason, "export fixed shapes")
        if values.types.get(value.name) == TensorProto.FLOAT16:
            reason = f"{value.name} is float16, which needs shader-f16 (Chromium hides it on NVIDIA under Linux)"
            yield Finding("failure", value.name, "type", reason, "offer a float32 file, too")


def _of_constants(node: onnx.NodeProto, values: _Values) -> Iterator[Finding]:
    kind = values.types.get(node.input[0])
    if node.op_type == "Cast" and kind in (TensorProto.UINT16, TensorProto.INT16, TensorProto.DOUBLE):
        reason = f"{node.input[0]} is {helper.tensor_dtype_to_np_dtype(kind)}, which builds for the web cannot cast"
        yield Finding("failure", node.name, "Cast", reason, "store uint8 (two of them for 16 bits), float16 or int32")


def _kernel(node: onnx.NodeProto, opset: int, values: _Values) -> Iterator[Finding]:
    if node.domain not in ("", "ai.onnx"):
        reason = f"domain {node.domain} is not part of ONNX"
        yield Finding("failure", node.name, node.op_type, reason, "write it in operators of ai.onnx")
    elif node.op_type in ("If", "Loop", "Scan"):
        yield Finding("fallback", node.name, node.op_type, "control flow ends capture", "unroll it")
    elif node.op_type not in KERNELS and node.op_type != "Constant":
        remedy = INSTEAD.get(node.op_type, "write it in other operators")
        yield Finding("fallback", node.name, node.op_type, "no WebGPU kernel", remedy)
    elif node.op_type == "GridSample" and opset >= 20:
        yield Finding("fallback", node.name, node.op_type, "kernels end with opset 19", "export opset 17")


def _types(node: onnx.NodeProto, opset: int, values: _Values) -> Iterator[Finding]:
    handled = (TensorProto.INT64, TensorProto.DOUBLE)
    used = [name for name in [*node.input, *node.output] if name not in values.constants]
    wide = [name for name in used if values.types.get(name) in handled]
    # Indices of Gather and its kin may be int64, and a Cast may make them; anything else is arithmetic.
    if node.op_type in ("Cast", "ArgMax", "ArgMin", "TopK", "Shape"):
        wide = [name for name in wide if name in node.input]
    elif node.op_type in ("Gather", "GatherElements", "GatherND", "ScatterND", "ScatterElements"):
        wide = [name for name in wide if name in (node.input[0], node.output[0])]
    if wide:
        kind = helper.tensor_dtype_to_np_dtype(values.types[wide[0]])
        remedy = "compute in int32 and cast last, or bake the numbers"
        yield Finding("fallback", node.name, node.op_type, f"{wide[0]} is {kind}, without WebGPU kernels", remedy)


def _sizes(node: onnx.NodeProto, opset: int, values: _Values) -> Iterator[Finding]:
    if node.op_type == "Split" and len(node.output) > MOST_SPLIT_OUTPUTS:
        reason = f"{len(node.output)} outputs need more storage buffers than a shader may bind"
        yield Finding("failure", node.name, "Split", reason, f"split into at most {MOST_SPLIT_OUTPUTS}, or use Gather")
    if node.op_type == "Conv" and len(values.dims.get(node.input[1], [])) == 4:
        outputs, inputs, size = (side or 0 for side in values.dims[node.input[1]][:3])
        if is_wrong_on_webgpu(inputs, outputs, size):
            reason = f"{inputs} channels to {outputs} come out wrong (seen with onnxruntime-webgpu 1.27.0)"
            yield Finding("wrong", node.name, "Conv", reason, "pad the channels going in to a multiple of 4")
    if node.op_type == "CumSum":
        longest = max((size or 0 for size in values.dims.get(node.input[0], [])), default=0)
        if longest > LONGEST_CUMSUM:
            reason = f"over {longest} elements it takes their square in steps"
            yield Finding("slow", node.name, "CumSum", reason, "leave compaction to the renderer")


_RULES: list[Callable[[onnx.NodeProto, int, _Values], Iterator[Finding]]] = [_kernel, _types, _sizes]
