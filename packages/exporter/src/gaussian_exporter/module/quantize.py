"""Weights of networks in 8 bits: a quarter of the file; the runtime dequantizes them on the GPU."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from ..arrays import AnyArray

# Operators whose second input holds weights, and the axis of its output channels.
_AXES = {"Conv": 0, "ConvTranspose": 1, "MatMul": -1, "Gemm": -1}
# Tables with fewer numbers stay as they are: they save nothing.
_FEWEST = 1024


def quantize_weights(model: onnx.ModelProto) -> int:
    """Replaces float32 weights by int8, symmetric, with a scale for each output channel, in place. Returns the number
    of tables. Tables that another operator reads, too, stay as they are.
    """
    graph = model.graph
    readers: dict[str, list[onnx.NodeProto]] = {}
    for node in graph.node:
        for name in node.input:
            readers.setdefault(name, []).append(node)
    stored = {tensor.name: tensor for tensor in graph.initializer}
    nodes: list[onnx.NodeProto] = []
    for name, tensor in stored.items():
        axis = _axis(name, readers.get(name, []), len(tensor.dims))
        if axis is None or tensor.data_type != TensorProto.FLOAT or np.prod(tensor.dims) < _FEWEST:
            continue
        table, scales = _rounded(numpy_helper.to_array(tensor), axis)
        tensor.CopyFrom(numpy_helper.from_array(table, f"{name}_int8"))
        graph.initializer.append(numpy_helper.from_array(scales, f"{name}_scales"))
        given = [f"{name}_int8", f"{name}_scales"]
        nodes.append(helper.make_node("DequantizeLinear", given, [name], name=f"{name}_float32", axis=axis))
    rest = list(graph.node)
    del graph.node[:]
    graph.node.extend([*nodes, *rest])
    return len(nodes)


def _axis(name: str, readers: list[onnx.NodeProto], rank: int) -> int | None:
    """The axis of the output channels; None for a table that is not only the weights of one kind of operator."""
    kinds = {(node.op_type, _is_transposed(node)) for node in readers}
    if len(kinds) != 1 or rank < 2 or any(list(node.input).index(name) != 1 for node in readers):
        return None
    ((operator, is_transposed),) = kinds
    axis = 0 if is_transposed else _AXES.get(operator)
    return None if axis is None else axis % rank


def _is_transposed(node: onnx.NodeProto) -> bool:
    return any(attribute.name == "transB" and attribute.i == 1 for attribute in node.attribute)


def _rounded(table: AnyArray, axis: int) -> tuple[AnyArray, AnyArray]:
    others = tuple(i for i in range(table.ndim) if i != axis)
    scales = np.abs(table).max(others, keepdims=True) / 127
    scales[scales == 0] = 1
    return np.round(table / scales).astype(np.int8), scales.reshape(-1).astype(np.float32)


def decibels(found: AnyArray, wanted: AnyArray) -> float:
    """Peak signal-to-noise ratio of an output; the peak is its largest number."""
    noise = float(np.sqrt(np.mean((np.float64(found) - np.float64(wanted)) ** 2)))
    peak = float(np.abs(wanted).max(initial=0)) or 1.0
    return float("inf") if noise == 0 else float(20 * np.log10(peak / noise))
