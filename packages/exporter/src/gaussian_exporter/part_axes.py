"""Which axes of a result and of its inputs belong together, for operators that compute their result in parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import onnx
from onnx import numpy_helper

# For each input, by its index, the axis that is split with an axis of the output.
Axes = dict[int, int]
# Attributes of an operator by name.
Given = Mapping[str, Any]

_ELEMENTWISE = frozenset(
    (
        *("Abs", "Add", "And", "BiasGelu", "Cast", "Ceil", "Clip"),
        *("Cos", "Div", "Elu", "Equal", "Erf", "Exp", "Expand"),
        *("FastGelu", "Floor", "Gelu", "Greater", "GreaterOrEqual", "HardSigmoid", "LeakyRelu"),
        *("Less", "LessOrEqual", "Log", "Max", "Min", "Mul", "Neg"),
        *("Not", "Or", "Pow", "PRelu", "QuickGelu", "Reciprocal", "Relu"),
        *("Sigmoid", "Sin", "Softplus", "Sqrt", "Sub", "Tanh", "Where"),
    )
)
# Operators that compute each channel (axis 1) alone: the number of inputs after the first that have one row for each.
_BY_CHANNEL = {"MaxPool": 0, "AveragePool": 0, "GlobalAveragePool": 0, "Resize": 0, "InstanceNormalization": 2}
# Reductions, with the operator that joins those of two parts.
SUMS = {"ReduceSum": "Add", "ReduceMax": "Max", "ReduceMin": "Min"}


class Graph(Protocol):
    """Sizes of the values of a graph, and its weights."""

    @property
    def stored(self) -> Mapping[str, onnx.TensorProto]:
        """Weights by name."""

    def dims(self, name: str) -> tuple[int, ...]:
        """Sizes of a value; -1 for a size that the file does not fix."""


def summed_axes(node: onnx.NodeProto, given: Given, graph: Graph) -> Axes:
    """Axes of the inputs over which the operator sums, if partial sums can be added."""
    kind = node.op_type
    if kind == "MatMul" and min(len(graph.dims(name)) for name in node.input) > 1:
        return {i: len(graph.dims(name)) - (1, 2)[i] for i, name in enumerate(node.input)}
    if kind == "Gemm":
        return {0: 0 if given.get("transA") else 1, 1: 1 if given.get("transB") else 0}
    if kind in ("Conv", "ConvTranspose") and given.get("group", 1) == 1:
        return {0: 1, 1: 1 if kind == "Conv" else 0}
    if kind in SUMS and len(axes := _reduced_axes(node, given, graph)) == 1:
        return {0: axes[0]}
    return {}


def _reduced_axes(node: onnx.NodeProto, given: Given, graph: Graph) -> list[int]:
    rank = len(graph.dims(node.input[0]))
    axes = given.get("axes", range(rank))
    if len(node.input) > 1 and node.input[1] in graph.stored:
        axes = numpy_helper.to_array(graph.stored[node.input[1]]).reshape(-1)
    return [int(axis) % rank for axis in axes]


def split_axes(node: onnx.NodeProto, given: Given, graph: Graph) -> dict[int, Axes]:
    """For each axis of the result that can be split: the axes of inputs that are split with it."""
    kind, rank = node.op_type, len(graph.dims(node.output[0]))
    ranks = [len(graph.dims(name)) if name else 0 for name in node.input]
    named = [i for i, name in enumerate(node.input) if name and not (kind == "Expand" and i)]
    own = {k: {i: k - rank + ranks[i] for i in named if k - rank + ranks[i] >= 0} for k in range(rank)}
    broadcast = {k: {i: j for i, j in each.items() if graph.dims(node.input[i])[j] != 1} for k, each in own.items()}
    if kind in _ELEMENTWISE:
        return broadcast
    if kind == "MatMul" and min(ranks) > 1:
        return {**broadcast, rank - 2: {0: ranks[0] - 2}, rank - 1: {1: ranks[1] - 1}}
    if kind == "Gemm":
        bias = {i: ranks[2] - 2 + i for i in range(2) if len(ranks) > 2 and ranks[2] - 2 + i >= 0}
        added = [{2: j} if (j := bias.get(i)) is not None and graph.dims(node.input[2])[j] > 1 else {} for i in (0, 1)]
        return {
            0: {0: 1 if given.get("transA") else 0, **added[0]},
            1: {1: 0 if given.get("transB") else 1, **added[1]},
        }
    if kind in ("Conv", "ConvTranspose"):
        group, bias = given.get("group", 1), {2: 0} if len(ranks) > 2 else {}
        if group == 1:
            return {1: {1: 0 if kind == "Conv" else 1, **bias}}
        is_depthwise = kind == "Conv" and group == graph.dims(node.input[0])[1] == graph.dims(node.output[0])[1]
        return {1: {0: 1, 1: 0, **bias}} if is_depthwise else {}
    if kind in _BY_CHANNEL and not (kind == "Resize" and len(ranks) > 3):
        return {1: {0: 1, **{i + 1: 0 for i in range(_BY_CHANNEL[kind])}}}
    if kind in ("Softmax", "LayerNormalization"):
        axis = int(given.get("axis", -1)) % rank
        return {k: {0: k} for k in range(rank) if (k != axis if kind == "Softmax" else k < axis)}
    if kind == "Transpose":
        return {k: {0: int(j)} for k, j in enumerate(given.get("perm", range(rank)[::-1]))}
    if kind.startswith("Reduce"):
        gone = _reduced_axes(node, given, graph)
        if given.get("keepdims", 1):
            return {k: {0: k} for k in range(rank) if k not in gone}
        return {k: {0: j} for k, j in enumerate(j for j in range(ranks[0]) if j not in gone)}
    if kind == "Concat":
        return {k: dict.fromkeys(range(len(ranks)), k) for k in range(rank)}
    if kind == "Slice" and len(ranks) > 3 and node.input[3] in graph.stored:
        cut = [int(axis) % rank for axis in numpy_helper.to_array(graph.stored[node.input[3]]).reshape(-1)]
        return {k: {0: k} for k in range(rank) if k not in cut}
    if kind == "Gather":
        axis = int(given.get("axis", 0)) % ranks[0]
        inside = range(axis, axis + ranks[1])
        return {k: {1: k - axis} if k in inside else {0: k if k < axis else k - ranks[1] + 1} for k in range(rank)}
    if kind == "GridSample":
        return {1: {0: 1}, **{k: {1: k - 1} for k in range(2, rank)}}
    return {}
