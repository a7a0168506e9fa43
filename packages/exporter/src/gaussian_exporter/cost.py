"""Cost of a graph, computed without a GPU: dispatches, bytes and multiplications of every node, and an estimated time.

The model follows the kernels of ONNX Runtime's WebGPU provider. A node is one dispatch that reads its inputs and writes
its outputs. Nodes that depend on constants alone run once, when the session is created. A reshape costs nothing, unless
its result is an output of the file, which needs a copy. Use the estimates only to compare graphs with one another.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import prod

import onnx
from onnx import helper

from .errors import ExportError
from .graph import ALIASES, INSTANCES_AXIS
from .placement import axis_of_instances

# Fitted, by relative squares, to ten recorded graphs of 30,000 to 2.5 million Gaussians measured on one NVIDIA H200:
# nine estimates are within 30 %, one (80,000 Gaussians) is half of the measured time. The bus could carry 4.8 TB/s; the
# kernels of the provider reach a quarter of it. Multiplications do not improve the fit, so they are shown and not
# counted.
MICROSECONDS_PER_DISPATCH = 7.4
BYTES_PER_SECOND = 1.26e12
# Rows and columns of the tiles that a Gemm or MatMul computes; tiles at the edges count fully.
TILE = 32
# Below both of these sizes a matrix product has a kernel without tiles.
SMALL = 8

ELEMENTWISE = frozenset(
    {"Add", "Sub", "Mul", "Div", "Pow", "Greater", "GreaterOrEqual", "Less", "LessOrEqual", "Equal"}
)
# Operators that read as many elements of their first input as they write.
PICKERS = frozenset({"Slice", "Gather", "GatherElements", "GatherND"})

Dims = tuple[int, ...]


@dataclass(frozen=True)
class NodeCost:
    """Cost of one node in every run. `read` and `written` are bytes, with each float32 number counted once. `flops` are
    those of matrix products and convolutions in whole tiles. `remark` names the slow kernel, empty if none. A node of
    0 dispatches does no work."""

    name: str
    operator: str
    dims: Dims
    dispatches: int
    read: int
    written: int
    flops: int
    remark: str

    @property
    def microseconds(self) -> float:
        """Estimated time on the GPU that the constants of this module describe."""
        return self.dispatches * MICROSECONDS_PER_DISPATCH + 1e6 * (self.read + self.written) / BYTES_PER_SECOND


@dataclass(frozen=True)
class Cost:
    """Cost of a run, node by node in the order of the file; nodes of constants are omitted."""

    nodes: Sequence[NodeCost]

    @property
    def dispatches(self) -> int:
        """Dispatches, and copies into outputs."""
        return sum(node.dispatches for node in self.nodes)

    @property
    def bytes(self) -> int:
        """Bytes read and written."""
        return sum(node.read + node.written for node in self.nodes)

    @property
    def flops(self) -> int:
        """Multiplications and additions of matrix products and convolutions."""
        return sum(node.flops for node in self.nodes)

    @property
    def milliseconds(self) -> float:
        """Sum of the nodes' estimates."""
        return sum(node.microseconds for node in self.nodes) / 1000


def cost_of(model: onnx.ModelProto, instances: int = 1) -> Cost:
    """The cost of a run; of `instances` at once if the file has an axis for them.

    Raises graph/invalid if a size is unknown, because the cost is then unknown, too.
    """
    values = _Values(model, instances)
    outputs = {output.name for output in model.graph.output}
    nodes = []
    for node in model.graph.node:
        if all(name in values.constants or not name for name in node.input):
            values.constants.update(node.output)
        else:
            nodes.append(_node_cost(node, values, outputs))
    return Cost(nodes)


def report(cost: Cost, rows: int = 12) -> Iterator[str]:
    """Lines of text: the most expensive nodes, then every operator, then the total."""
    yield f"{'node':28} {'operator':12} {'writes':22} {'read MB':>8} {'writ. MB':>8} {'GFLOP':>7} {'us':>7}  remark"
    dearest = sorted((node for node in cost.nodes if node.dispatches), key=lambda node: -node.microseconds)
    for node in dearest[:rows]:
        shape = "x".join(map(str, node.dims))
        yield (
            f"{node.name[:28]:28} {node.operator:12} {shape[:22]:22} {node.read / 1e6:8.2f} {node.written / 1e6:8.2f} "
            f"{node.flops / 1e9:7.2f} {node.microseconds:7.1f}  {node.remark}"
        )
    if len(dearest) > rows:
        rest = sum(node.microseconds for node in dearest[rows:])
        yield f"and {len(dearest) - rows} more, {rest:.1f} us together"
    yield ", ".join(f"{name} {count}" for name, count in _counted(dearest))
    yield (
        f"{cost.dispatches} dispatches, {cost.bytes / 1e6:.2f} MB read and written, {cost.flops / 1e9:.3f} GFLOP: "
        f"about {cost.milliseconds:.2f} ms a run at {MICROSECONDS_PER_DISPATCH:g} us a dispatch and "
        f"{BYTES_PER_SECOND / 1e12:g} TB/s"
    )


def _counted(nodes: Sequence[NodeCost]) -> list[tuple[str, int]]:
    names = [node.operator for node in nodes]
    return sorted(((name, names.count(name)) for name in set(names)), key=lambda pair: (-pair[1], pair[0]))


class _Values:
    """Sizes and element types of every value, with the given size of the axis of instances."""

    def __init__(self, model: onnx.ModelProto, instances: int):
        fixed = onnx.ModelProto()
        fixed.CopyFrom(model)
        axis = axis_of_instances(model) or INSTANCES_AXIS
        for value in [*fixed.graph.input, *fixed.graph.output]:
            for dim in value.type.tensor_type.shape.dim:
                if dim.dim_param == axis:
                    dim.dim_value = instances
        try:
            graph = onnx.shape_inference.infer_shapes(fixed, data_prop=True).graph
        except onnx.shape_inference.InferenceError:
            # The file has operators of an unknown domain, so only its own declarations are used.
            graph = fixed.graph
        self.constants = {each.name for each in graph.initializer}
        self._dims: dict[str, Dims] = {each.name: tuple(each.dims) for each in graph.initializer}
        self._types = {each.name: each.data_type for each in graph.initializer}
        for value in [*graph.input, *graph.value_info, *graph.output]:
            tensor = value.type.tensor_type
            known = all(dim.HasField("dim_value") for dim in tensor.shape.dim)
            if known and tensor.HasField("shape"):
                self._dims[value.name] = tuple(dim.dim_value for dim in tensor.shape.dim)
                self._types[value.name] = tensor.elem_type

    def dims(self, name: str) -> Dims:
        """The shape of a value. Raises graph/invalid if it depends on the run."""
        if name not in self._dims:
            raise ExportError(
                "graph/invalid",
                where=f"value {name}",
                expected="sizes that the file alone determines",
                found="a size that is known in a run only",
                remedy="export with fixed shapes",
            )
        return self._dims[name]

    def bytes(self, name: str) -> int:
        """Bytes of a value."""
        width = helper.tensor_dtype_to_np_dtype(self._types[name]).itemsize if name in self._types else 4
        return prod(self.dims(name)) * width


def _node_cost(node: onnx.NodeProto, values: _Values, outputs: set[str]) -> NodeCost:
    dims = values.dims(node.output[0])
    written = sum(values.bytes(name) for name in node.output if name)
    inputs = list(dict.fromkeys(name for name in node.input if name))
    if node.op_type in PICKERS:
        read = written
    elif node.op_type in ALIASES:
        read = written
        if node.output[0] not in outputs:
            return NodeCost(node.name, node.op_type, dims, 0, 0, 0, 0, "")
        return NodeCost(
            node.name, node.op_type, dims, 1, read, written, 0, "a copy into an output, lost in recorded runs"
        )
    else:
        read = sum(values.bytes(name) for name in inputs)
    flops, remark = 0, ""
    if node.op_type in ("MatMul", "Gemm"):
        flops, remark = _product(node, values)
    elif node.op_type == "Conv":
        flops = 2 * prod(dims) * prod(values.dims(node.input[1])[1:])
    elif node.op_type in ELEMENTWISE:
        remark = _broadcast(values.dims(node.input[0]), values.dims(node.input[1]))
    return NodeCost(node.name, node.op_type, dims, 1, read, written, flops, remark)


def _product(node: onnx.NodeProto, values: _Values) -> tuple[int, str]:
    left, right = values.dims(node.input[0]), values.dims(node.input[1])
    *batch, rows, columns = values.dims(node.output[0])
    turned = {attribute.name: attribute.i for attribute in node.attribute}
    inner = left[-2] if turned.get("transA") else left[-1]
    if node.op_type == "MatMul" and columns < SMALL and inner < SMALL:
        return 2 * prod(batch) * rows * columns * inner, ""
    if len(right) == 2:
        # Batches of one row are rows of one product; other batches are each padded to tiles.
        rows, batch = (prod(batch), []) if rows == 1 else (rows, batch)
    whole = -(-rows // TILE) * TILE * (-(-columns // TILE) * TILE)
    is_wide = left[-1] % 4 == 0 and right[-1] % 4 == 0
    return 2 * prod(batch) * whole * inner, "" if is_wide else "one number at a time: widths are no multiples of 4"


def _broadcast(left: Dims, right: Dims) -> str:
    """The reason why a binary operator gets the slow kernel, which computes the index of each number; else empty."""
    if left == right or prod(left) == 1 >= len(left) or prod(right) == 1 >= len(right):
        return ""
    if any(dims and dims[-1] % 4 == 0 for dims in (left, right)):
        return ""
    shared = 1
    for a, b in zip(reversed(left), reversed(right), strict=False):
        if a != b:
            break
        shared *= a
    return "" if shared % 4 == 0 else "broadcast, each number looked up separately"
