"""A builder of ONNX graphs with fixed shapes, for operators that the WebGPU provider of ONNX Runtime runs.

Shapes are known while building, so a wrong one fails here, with the line that requested it, and not in a browser.
Numbers are float32; integers occur only as constants (shapes, axes, indices), never as results.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from math import prod
from typing import Literal

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from .arrays import AnyArray
from .errors import ExportError

# GridSample has a WebGPU kernel in opset 16 but not in 20; reductions take their axes as in opset 13.
OPSET = 17
IR_VERSION = 8
# A WebGPU device of default limits binds 8 storage buffers to a shader: 7 inputs and one output.
MAX_CONCAT_INPUTS = 7

# Tables with fewer numbers stay float32 also in compact files, because they save little.
MIN_COMPACT = 4096

# Operators that only give their input another shape: no kernel runs.
ALIASES = frozenset({"Reshape", "Unsqueeze", "Squeeze", "Flatten", "Identity"})

Shape = tuple[int, ...]
# Placeholder for the axis of instances while a graph is built: a prime of which no other size is a multiple, so that it
# is recognizable in products. In the file the axis is symbolic, under this name.
INSTANCES, INSTANCES_AXIS = 2**31 - 1, "B"
# Form of large tables in a file: float32, or 16 bits.
Weights = Literal["float32", "compact"]
Errors = Literal["relative", "even", "none"]
Number = float | int


@dataclass(frozen=True)
class Tensor:
    """A value in a graph, with a known shape: float32, or the type that `cast` converted it to."""

    graph: Graph
    name: str
    shape: Shape

    def __add__(self, other: Tensor | Number) -> Tensor:
        """Sum, broadcast."""
        return self.graph.binary("Add", self, other)

    def __sub__(self, other: Tensor | Number) -> Tensor:
        """Difference, broadcast."""
        return self.graph.binary("Sub", self, other)

    def __rsub__(self, other: Number) -> Tensor:
        """A number minus this tensor."""
        return self.graph.binary("Sub", self.graph.scalar(other), self)

    def __mul__(self, other: Tensor | Number) -> Tensor:
        """Product, broadcast."""
        return self.graph.binary("Mul", self, other)

    def __truediv__(self, other: Tensor | Number) -> Tensor:
        """Quotient, broadcast."""
        return self.graph.binary("Div", self, other)

    def __matmul__(self, other: Tensor) -> Tensor:
        """Matrix product; leading axes are a batch and broadcast."""
        if self.shape[-1] != other.shape[-2]:
            raise wrong_shape("MatMul", f"{self.shape[-1]} rows on the right", str(other.shape))
        batch = np.broadcast_shapes(self.shape[:-2], other.shape[:-2])
        return self.graph.node("MatMul", [self, other], (*batch, self.shape[-2], other.shape[-1]))

    def unary(self, operator: str) -> Tensor:
        """An operator of one argument that keeps the shape, by its ONNX name: Relu, Sigmoid, Exp, Sqrt, ..."""
        return self.graph.node(operator, [self], self.shape)

    def clip(self, low: Number, high: Number) -> Tensor:
        """Values clamped between two numbers."""
        return self.graph.node("Clip", [self, self.graph.scalar(low), self.graph.scalar(high)], self.shape)

    def sum(self, axis: int, keep: bool = False) -> Tensor:
        """Sum along one axis."""
        axis %= len(self.shape)
        axes = self.graph.integers([axis])
        return self.graph.node("ReduceSum", [self, axes], reduced(self.shape, [axis], keep), keepdims=int(keep))

    def length(self, axis: int, keep: bool = False) -> Tensor:
        """Euclidean length along one axis."""
        axis %= len(self.shape)
        return self.graph.node("ReduceL2", [self], reduced(self.shape, [axis], keep), axes=[axis], keepdims=int(keep))

    def product(self, axis: int) -> Tensor:
        """Product along one axis, which is removed."""
        return self.graph.node("ReduceProd", [self], reduced(self.shape, [axis], False), axes=[axis], keepdims=0)

    def mean(self, axes: Sequence[int], keep: bool = False) -> Tensor:
        """Mean along some axes."""
        return self.graph.node(
            "ReduceMean", [self], reduced(self.shape, axes, keep), axes=list(axes), keepdims=int(keep)
        )

    def reshape(self, *shape: int) -> Tensor:
        """Reshapes to another shape; no axis may be -1."""
        if prod(shape) != prod(self.shape):
            raise wrong_shape("Reshape", f"{prod(self.shape)} elements", str(shape))
        if shape == self.shape:
            return self
        # At most one size depends on the instances, which ONNX infers from -1.
        written = [-1 if size % INSTANCES == 0 else size for size in shape]
        return self.graph.node("Reshape", [self, self.graph.integers(written)], shape)

    def transpose(self, *axes: int) -> Tensor:
        """Permutes the axes."""
        return self.graph.node("Transpose", [self], tuple(self.shape[axis] for axis in axes), perm=list(axes))

    def part(self, start: int, stop: int, axis: int = -1) -> Tensor:
        """Elements start (inclusive) to stop (exclusive) along one axis."""
        axis %= len(self.shape)
        if not 0 <= start < stop <= self.shape[axis]:
            raise wrong_shape("Slice", f"0 <= start < stop <= {self.shape[axis]}", f"{start}, {stop}")
        if (start, stop) == (0, self.shape[axis]):
            return self
        ends = [self.graph.integers([number]) for number in (start, stop, axis)]
        return self.graph.node("Slice", [self, *ends], replaced(self.shape, axis, stop - start))

    def take(self, indices: Sequence[int], axis: int = 0) -> Tensor:
        """Elements at constant indices along one axis."""
        axis %= len(self.shape)
        shape = replaced(self.shape, axis, len(indices))
        return self.graph.node("Gather", [self, self.graph.integers(indices)], shape, axis=axis)

    def alongside(self, other: Tensor) -> Tensor:
        """Repeats the numbers for each instance if `other` has instances."""
        if other.shape[0] != INSTANCES or self.shape[0] == INSTANCES:
            return self
        return self.graph.zero().reshape(INSTANCES, *[1] * len(self.shape)) + self

    def expand(self, *shape: int) -> Tensor:
        """Repeated along axes of length 1."""
        if np.broadcast_shapes(self.shape, shape) != shape:
            raise wrong_shape("Expand", f"a shape that {self.shape} broadcasts to", str(shape))
        return self.graph.node("Expand", [self, self.graph.integers(shape)], shape)


def declared(shape: Shape) -> list[int | str]:
    """A shape in the form of the file."""
    return [INSTANCES_AXIS if size == INSTANCES else size for size in shape]


def replaced(shape: Shape, axis: int, size: int) -> Shape:
    """The shape with one axis of another size."""
    return (*shape[:axis], size, *shape[axis + 1 :])


def reduced(shape: Shape, axes: Sequence[int], keep: bool) -> Shape:
    """The shape after a reduction along axes."""
    gone = {axis % len(shape) for axis in axes}
    return tuple(1 if i in gone else size for i, size in enumerate(shape) if keep or i not in gone)


def wrong_shape(operator: str, expected: str, found: str) -> ExportError:
    """The error of an operator whose inputs have an unsupported shape."""
    return ExportError(
        "graph/invalid",
        where=f"operator {operator}",
        expected=expected,
        found=found,
        remedy="the checkpoint's parts do not fit one another; compare its configuration with its weights",
    )


class Graph:
    """One ONNX graph that is being built: first inputs, then operators on tensors, then outputs, then `model`."""

    def __init__(self, name: str, weights: Weights = "float32", instances: bool = False):
        """`name` is the graph's name in the file; `weights`: form of large tables of numbers; `instances`: whether
        values that differ between instances have an axis for them, before all others.
        """
        self.name = name
        self.lead: Shape = (INSTANCES,) if instances else ()
        self._weights = weights
        self._nodes: list[onnx.NodeProto] = []
        self._inputs: list[onnx.ValueInfoProto] = []
        self._outputs: list[onnx.ValueInfoProto] = []
        self._constants: dict[str, onnx.TensorProto] = {}
        self._by_value: dict[tuple[str, Shape, bytes], Tensor] = {}
        self._by_node: dict[tuple[str, tuple[str, ...], str], Tensor] = {}
        # Names of results that became outputs, by their former names.
        self._now: dict[str, str] = {}
        # Results and inputs that may differ from run to run; the smallest input of each instance.
        self._changing: set[str] = set()
        self._least: Tensor | None = None

    def input(self, name: str, *shape: int) -> Tensor:
        """A float32 input of fixed shape; one that differs between instances begins with `lead`."""
        self._inputs.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, declared(shape)))
        self._changing.add(name)
        tensor = Tensor(self, name, shape)
        if shape[: len(self.lead)] == self.lead and (self._least is None or prod(shape) < prod(self._least.shape)):
            self._least = tensor
        return tensor

    def zero(self) -> Tensor:
        """A zero (1), or one for each instance (B), that the runtime cannot recognize as constant, because it comes
        from an input. Adding it repeats shared values for all instances, and makes a kernel write a result that
        would otherwise be a copy.
        """
        if self._least is None:
            raise ValueError("there is no input to make a zero of")
        each = prod(self.lead)
        row = self._least.reshape(each, prod(self._least.shape) // each)
        total = row @ self.constant(np.zeros((row.shape[1], 1)), "zeros")
        return total.reshape(each)

    def written_again(self, tensor: Tensor) -> Tensor:
        """Returns an output that a recording of the commands (graph capture) repeats. ONNX Runtime copies reshaped
        results into outputs, and a copy is made in the first run and never again, so a kernel has to write those.
        Constants stay as they are, and pages read them once.
        """
        maker = next((node.op_type for node in self._nodes if tensor.name in node.output), None)
        if tensor.name not in self._changing or maker not in ALIASES or self._least is None:
            return tensor
        zero = self.zero()
        return tensor + (zero.reshape(*self.lead, *[1] * (len(tensor.shape) - 1)) if self.lead else zero)

    def constant(
        self, value: AnyArray | Sequence[Number], name: str = "constant", errors: Errors = "relative"
    ) -> Tensor:
        """Numbers baked into the file as float32. Equal arrays are stored once. Numbers that are not finite are
        refused.

        With `weights="compact"` large tables are stored in 16 bits and become float32 when the session is created:
        as float16 if errors may be `relative`; as whole numbers between each column's minimum and maximum if they
        must be equal everywhere (`even`: positions, and weights that sum to 1); not at all if they would do harm
        (`none`: covariances of needles would not remain positive definite).
        """
        array = np.ascontiguousarray(np.asarray(value, np.float32))
        if not np.isfinite(array).all():
            raise ExportError(
                "checkpoint/unreadable",
                where=f"constant {name} {array.shape}",
                expected="finite numbers",
                found=f"{int((~np.isfinite(array)).sum())} of {array.size} not finite",
                remedy="training diverged or the file is damaged; export an earlier checkpoint",
            )
        if self._weights == "float32" or errors == "none" or array.size < MIN_COMPACT:
            return self._initializer(array, name)
        return self._evenly_spaced(array, name) if errors == "even" else self._halved(array, name)

    def _halved(self, array: AnyArray, name: str) -> Tensor:
        if np.abs(array).max() > np.finfo(np.float16).max:
            return self._initializer(array, name)
        return self._widened(self._initializer(array.astype(np.float16), name))

    def _evenly_spaced(self, array: AnyArray, name: str) -> Tensor:
        columns = array.reshape(-1, array.shape[-1]).astype(np.float64)
        low, high = columns.min(0), columns.max(0)
        step = np.where(high > low, (high - low) / 65535, 1)
        whole = np.round((columns - low) / step).astype(np.uint16).reshape(array.shape)
        # Upper and lower bytes, because builds of the runtime for the web cannot convert uint16 to float32.
        upper, lower = (whole >> 8).astype(np.uint8), (whole & 255).astype(np.uint8)
        wide = self._widened(self._initializer(upper, name)) * 256 + self._widened(self._initializer(lower, name))
        return wide * self._initializer(step.astype(np.float32), name) + self._initializer(low.astype(np.float32), name)

    def _widened(self, stored: Tensor) -> Tensor:
        return self.node("Cast", [stored], stored.shape, to=TensorProto.FLOAT)

    def scalar(self, value: Number) -> Tensor:
        """One number, without axes."""
        return self._initializer(np.asarray(value, np.float32), "number")

    def integers(self, values: Sequence[int]) -> Tensor:
        """Constant int64 numbers: shapes, axes and indices, for which ONNX requires that type."""
        return self._initializer(np.asarray(list(values), np.int64), "integers")

    def _initializer(self, array: AnyArray, name: str) -> Tensor:
        key = (array.dtype.str, array.shape, blake2b(array.tobytes()).digest())
        if key not in self._by_value:
            unique = f"{name}_{len(self._constants)}"
            self._constants[unique] = numpy_helper.from_array(array, unique)
            self._by_value[key] = Tensor(self, unique, array.shape)
        return self._by_value[key]

    def node(
        self, operator: str, inputs: Sequence[Tensor], shape: Shape, **attributes: int | float | str | Sequence[int]
    ) -> Tensor:
        """Adds an operator of one result with the given shape. Equal operators on equal inputs share one node."""
        key = (operator, tuple(tensor.name for tensor in inputs), repr(sorted(attributes.items())))
        if key in self._by_node:
            return self._by_node[key]
        name = f"{operator.lower()}_{len(self._nodes)}"
        node = helper.make_node(operator, [tensor.name for tensor in inputs], [name], name=name)
        node.attribute.extend(helper.make_attribute(key, value) for key, value in attributes.items())
        self._nodes.append(node)
        if any(tensor.name in self._changing for tensor in inputs):
            self._changing.add(name)
        self._by_node[key] = Tensor(self, name, shape)
        return self._by_node[key]

    def binary(self, operator: str, left: Tensor, right: Tensor | Number) -> Tensor:
        """An operator of two arguments that broadcast."""
        other = right if isinstance(right, Tensor) else self.scalar(right)
        try:
            shape = np.broadcast_shapes(left.shape, other.shape)
        except ValueError as error:
            raise wrong_shape(operator, f"something that fits {left.shape}", str(other.shape)) from error
        return self.node(operator, [left, other], shape)

    def concat(self, tensors: Sequence[Tensor], axis: int) -> Tensor:
        """Tensors one after the other, in steps of at most MAX_CONCAT_INPUTS."""
        if len(tensors) == 1:
            return tensors[0]
        if len(tensors) > MAX_CONCAT_INPUTS:
            step = MAX_CONCAT_INPUTS
            groups = [self.concat(tensors[i : i + step], axis) for i in range(0, len(tensors), step)]
            return self.concat(groups, axis)
        axis %= len(tensors[0].shape)
        rest = {replaced(tensor.shape, axis, 0) for tensor in tensors}
        if len(rest) != 1:
            raise wrong_shape("Concat", "shapes that differ along one axis only", str([t.shape for t in tensors]))
        total = sum(tensor.shape[axis] for tensor in tensors)
        return self.node("Concat", tensors, replaced(tensors[0].shape, axis, total), axis=axis)

    def output(self, name: str, tensor: Tensor, half: bool = False) -> None:
        """Names a result, as float32 or, with `half`, cast to float16."""
        source = self._now.get(tensor.name, tensor.name)
        if half:
            self._nodes.append(helper.make_node("Cast", [source], [name], name=name, to=TensorProto.FLOAT16))
        elif not self._renamed(source, name):
            self._nodes.append(helper.make_node("Identity", [source], [name], name=name))
        kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
        self._outputs.append(helper.make_tensor_value_info(name, kind, declared(tensor.shape)))

    def _renamed(self, old: str, new: str) -> bool:
        """Gives a node's result the name of an output, which saves a copy. Does nothing if the result is already an
        output, or not of a node.
        """
        taken = {output.name for output in self._outputs}
        maker = next((node for node in self._nodes if old in node.output), None)
        if maker is None or old in taken:
            return False
        maker.output[0] = self._now[old] = new
        for node in self._nodes:
            for index, name in enumerate(node.input):
                if name == old:
                    node.input[index] = new
        return True

    def model(self, metadata: dict[str, str]) -> onnx.ModelProto:
        """The finished file, without unused nodes. ONNX's own checker and shape inference must agree with every
        declared shape.
        """
        self._nodes = self._needed_nodes()
        graph = helper.make_graph(
            self._nodes, self.name, self._inputs, self._outputs, list(self._used_constants().values())
        )
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="gaussian-splat-exporter"
        )
        model.ir_version = IR_VERSION
        helper.set_model_props(model, metadata)
        try:
            onnx.checker.check_model(model)
            onnx.shape_inference.infer_shapes(model, check_type=True, strict_mode=True)
        except (onnx.checker.ValidationError, onnx.shape_inference.InferenceError) as error:
            raise ExportError(
                "graph/invalid",
                where=f"graph {self.name}",
                expected="a graph that ONNX accepts",
                found=str(error).splitlines()[0],
                remedy="this is a fault of the exporter; please report it with the command that you ran",
            ) from error
        return model

    def _needed_nodes(self) -> list[onnx.NodeProto]:
        needed, found = {output.name for output in self._outputs}, []
        for node in reversed(self._nodes):
            if node.output[0] in needed:
                needed.update(node.input)
                found.append(node)
        return found[::-1]

    def _used_constants(self) -> dict[str, onnx.TensorProto]:
        used = {name for node in self._nodes for name in node.input}
        return {name: value for name, value in self._constants.items() if name in used}
