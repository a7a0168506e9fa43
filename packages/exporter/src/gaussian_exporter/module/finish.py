"""Finishes the graph of a PyTorch exporter: names, shapes, and outputs that a kernel writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from ..arrays import AnyArray
from ..graph import ALIASES
from ..placement import RULES, gpu_findings
from .kernels import pad_channels, use_kernels
from .layouts import Layout
from .roles import Role


def finish_graph(
    model: onnx.ModelProto,
    layout: Layout,
    inputs: Mapping[str, Role],
    expected: Sequence[Sequence[AnyArray]],
    n_max: int | None,
) -> None:
    """Changes the model in place."""
    model.ir_version = min(model.ir_version, RULES["newestIr"], 10)
    graph = model.graph
    _forget_source(graph)
    _narrow(graph)
    for value, wanted in zip(graph.output, layout.outputs, strict=True):
        if value.name != wanted:
            _name_output(graph, value, wanted)
    for index, value in enumerate(graph.output):
        _declare(value, [tensors[index] for tensors in expected], layout)
    use_kernels(model)
    pad_channels(model)
    _turn_vectors(model)
    _write_by_kernels(model, inputs)
    onnx.checker.check_model(model)


def _forget_source(graph: onnx.GraphProto) -> None:
    """Removes what PyTorch notes of the code: its author's paths and lines, a kilobyte for each node."""
    for part in (graph, *graph.node, *graph.initializer, *graph.input, *graph.value_info, *graph.output):
        part.ClearField("metadata_props")
        part.ClearField("doc_string")
    for attribute in (attribute for node in graph.node for attribute in node.attribute):
        if attribute.HasField("g"):
            _forget_source(attribute.g)


def _narrow(graph: onnx.GraphProto) -> None:
    """Converts float64 to float32, the widest type in pages: constants, casts, and declarations."""
    for tensor in graph.initializer:
        _narrow_tensor(tensor)
    for value in [*graph.input, *graph.value_info, *graph.output]:
        if value.type.tensor_type.elem_type == TensorProto.DOUBLE:
            value.type.tensor_type.elem_type = TensorProto.FLOAT
    for attribute in (attribute for node in graph.node for attribute in node.attribute):
        if attribute.name in ("to", "dtype") and attribute.i == TensorProto.DOUBLE:
            attribute.i = TensorProto.FLOAT
        if attribute.HasField("t"):
            _narrow_tensor(attribute.t)
        if attribute.HasField("g"):
            _narrow(attribute.g)


def _narrow_tensor(tensor: onnx.TensorProto) -> None:
    if tensor.data_type == TensorProto.DOUBLE:
        with np.errstate(over="ignore"):
            tensor.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float32), tensor.name))


def _name_output(graph: onnx.GraphProto, value: onnx.ValueInfoProto, wanted: str) -> None:
    """TorchScript's exporter drops the name of a constant; a copy of it has the right one."""
    graph.node.append(helper.make_node("Identity", [value.name], [wanted], name=f"named_{wanted}"))
    value.name = wanted


def _declare(value: onnx.ValueInfoProto, seen: Sequence[AnyArray], layout: Layout) -> None:
    """The shape of the output in PyTorch; N for the number of rows if it differs, or is symbolic in the file."""
    shape = value.type.tensor_type.shape
    dims: list[int | str] = [*seen[0].shape]
    # A state and a count have no rows; a state may be a single number.
    has_rows = not (layout.state is not None and value.name == layout.outputs[-1]) and value.name != "count"
    is_open = len({tensor.shape[:1] for tensor in seen}) > 1 or (
        len(shape.dim) > 0 and not shape.dim[0].HasField("dim_value") and layout.kind != "image"
    )
    if has_rows and is_open:
        dims[0] = "N"
    kind = value.type.tensor_type.elem_type or helper.np_dtype_to_tensor_dtype(seen[0].dtype)
    value.CopyFrom(helper.make_tensor_value_info(value.name, kind, dims))


def _turn_vectors(model: onnx.ModelProto) -> None:
    """Replaces a transposed matrix times a vector by a product with a matrix of one column: ONNX Runtime's optimizer
    loses the transposition of the first form, and with it camera positions.
    """
    found = {f.tensor for f in gpu_findings(model) if f.operator == "MatMul" and f.kind == "slow"}
    nodes = []
    for node in model.graph.node:
        if node.op_type != "MatMul" or node.output[0] not in found:
            nodes.append(node)
            continue
        name = node.output[0]
        nodes.append(helper.make_node("Unsqueeze", [node.input[1], "last_axis"], [f"{name}_column"]))
        nodes.append(helper.make_node("MatMul", [node.input[0], f"{name}_column"], [f"{name}_product"]))
        nodes.append(helper.make_node("Squeeze", [f"{name}_product", "last_axis"], [name]))
    if found:
        model.graph.initializer.append(numpy_helper.from_array(np.array([-1], np.int64), "last_axis"))
        del model.graph.node[:]
        model.graph.node.extend(nodes)


def _write_by_kernels(model: onnx.ModelProto, inputs: Mapping[str, Role]) -> None:
    """Adds a zero that comes from an input to outputs that are reshaped results: recorded commands would write them
    once and never again.
    """
    graph = model.graph
    copied = [f.tensor for f in gpu_findings(model) if f.kind == "slow" and f.operator in ALIASES]
    floats = [v for v in graph.input if v.type.tensor_type.elem_type == TensorProto.FLOAT]
    if not copied or not floats:
        return
    minimum = min(floats, key=lambda value: int(np.prod([d.dim_value for d in value.type.tensor_type.shape.dim])))
    size = int(np.prod([d.dim_value for d in minimum.type.tensor_type.shape.dim]))
    for name, array in (
        ("zero_row", np.array([1, size], np.int64)),
        ("zero_weights", np.zeros((size, 1), np.float32)),
        ("zero_shape", np.array([1], np.int64)),
    ):
        graph.initializer.append(numpy_helper.from_array(array, name))
    nodes = [
        helper.make_node("Reshape", [minimum.name, "zero_row"], ["zero_input"], name="zero_input"),
        helper.make_node("MatMul", ["zero_input", "zero_weights"], ["zero_product"], name="zero_product"),
        helper.make_node("Reshape", ["zero_product", "zero_shape"], ["zero"], name="zero"),
    ]
    kinds = {value.name: value.type.tensor_type.elem_type for value in graph.output}
    for name in copied:
        if kinds[name] != TensorProto.FLOAT:
            continue
        for node in graph.node:
            node.output[:] = [f"{name}_shaped" if each == name else each for each in node.output]
            node.input[:] = [f"{name}_shaped" if each == name else each for each in node.input]
        nodes.append(helper.make_node("Add", [f"{name}_shaped", "zero"], [name], name=f"written_{name}"))
    graph.node.extend(nodes)
