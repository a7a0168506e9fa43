"""Replaces operators without a kernel on the GPU by others that have one."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from ..placement import gpu_findings


def use_kernels(model: onnx.ModelProto) -> None:
    """Rewrites Sign of floats in place."""
    floats = _floats(model)
    nodes: list[onnx.NodeProto] = []
    for node in model.graph.node:
        is_sign = node.op_type == "Sign" and node.output[0] in floats
        nodes += _sign(model.graph, node) if is_sign else [node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)


def pad_channels(model: onnx.ModelProto) -> None:
    """Adds channels of zeros to what goes into a convolution that WebGPU would compute wrongly, and to its weights."""
    wrong = {found.tensor for found in gpu_findings(model) if found.kind == "wrong" and found.operator == "Conv"}
    graph, nodes = model.graph, []
    weights = {tensor.name: tensor for tensor in graph.initializer}
    for node in graph.node:
        if node.output[0] in wrong and node.input[1] in weights:
            table = numpy_helper.to_array(weights[node.input[1]])
            more, name = -table.shape[1] % 4, node.output[0]
            sides = [0, 0] * table.ndim
            sides[table.ndim + 1] = more
            wide = np.pad(table, [(0, more if axis == 1 else 0) for axis in range(table.ndim)])
            graph.initializer.append(numpy_helper.from_array(np.array(sides, np.int64), f"{name}_sides"))
            graph.initializer.append(numpy_helper.from_array(wide, f"{name}_weight"))
            nodes.append(helper.make_node("Pad", [node.input[0], f"{name}_sides"], [f"{name}_padded"]))
            node.input[0], node.input[1] = f"{name}_padded", f"{name}_weight"
        nodes.append(node)
    if wrong:
        del graph.node[:]
        graph.node.extend(nodes)
        used = _used(graph) | {value.name for value in graph.output}
        kept = [tensor for tensor in graph.initializer if tensor.name in used]
        del graph.initializer[:]
        graph.initializer.extend(kept)


def _used(graph: onnx.GraphProto) -> set[str]:
    """Names of all inputs of nodes, those of subgraphs included."""
    names = {name for node in graph.node for name in node.input}
    inner = [each for node in graph.node for each in node.attribute]
    parts = [graph for each in inner for graph in ([each.g] if each.HasField("g") else []) + list(each.graphs)]
    return names.union(*(_used(part) for part in parts))


def _floats(model: onnx.ModelProto) -> set[str]:
    """Names of all tensors of float32 that the graph computes."""
    graph = onnx.shape_inference.infer_shapes(model).graph
    values = [*graph.value_info, *graph.output]
    return {value.name for value in values if value.type.tensor_type.elem_type == TensorProto.FLOAT}


def _sign(graph: onnx.GraphProto, node: onnx.NodeProto) -> list[onnx.NodeProto]:
    (x,), name = node.input, node.output[0]
    one, zero, minus = (_constant(graph, f"{name}_{i}", i) for i in (1, 0, -1))
    return [
        helper.make_node("Less", [x, zero], [f"{name}_below"]),
        helper.make_node("Where", [f"{name}_below", minus, zero], [f"{name}_low"]),
        helper.make_node("Greater", [x, zero], [f"{name}_above"]),
        helper.make_node("Where", [f"{name}_above", one, f"{name}_low"], [name]),
    ]


def _constant(graph: onnx.GraphProto, name: str, value: float) -> str:
    graph.initializer.append(numpy_helper.from_array(np.array(value, np.float32), name))
    return name
