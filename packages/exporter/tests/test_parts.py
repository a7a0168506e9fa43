"""Graphs in parts give the numbers of the whole graphs, and no tensor of them exceeds the limit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from gaussian_exporter.cli import main
from gaussian_exporter.errors import ExportError
from gaussian_exporter.parts import in_parts, large_tensors

from .running import run
from .zoo import every_family

RNG = np.random.default_rng(3)


def chain(x: list[int], y: list[int], *nodes: onnx.NodeProto, **weights: list[int]) -> onnx.ModelProto:
    stored = [
        numpy_helper.from_array(RNG.normal(0, 0.3, each).astype(np.float32), name) for name, each in weights.items()
    ]
    values = [helper.make_tensor_value_info(name, TensorProto.FLOAT, dims) for name, dims in (("x", x), ("y", y))]
    stored.append(numpy_helper.from_array(np.array([1, 40, 8, 8], np.int64), "shape"))
    stored.append(numpy_helper.from_array(np.array([1, 1, 2, 2], np.float32), "twice"))
    graph = helper.make_graph(nodes, "g", values[:1], values[1:], stored)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    return model


def node(operator: str, *inputs: str, to: str = "y", **attributes: object) -> onnx.NodeProto:
    return helper.make_node(operator, inputs, [to], **attributes)  # type: ignore[arg-type]


# From x to y, with a result or a weight above 4,000 bytes.
CHAINS: dict[str, Callable[[], onnx.ModelProto]] = {
    "rows of a network": lambda: chain(
        [200, 4],
        [200, 3],
        node("MatMul", "x", "a", to="1"),
        node("Add", "1", "b", to="2"),
        node("Relu", "2", to="3"),
        node("Gemm", "3", "c", "d", transB=1),
        a=[4, 64],
        b=[64],
        c=[3, 64],
        d=[3],
    ),
    "columns of a weight, and the sum over them": lambda: chain(
        [2, 30],
        [2, 30],
        node("Gemm", "x", "a", "b", to="1"),
        node("Tanh", "1", to="2"),
        node("MatMul", "2", "c"),
        a=[30, 900],
        b=[900],
        c=[900, 30],
    ),
    "a weight of few columns": lambda: chain([1, 900], [1, 2], node("MatMul", "x", "a"), a=[900, 2]),
    "images": lambda: chain(
        [1, 3, 8, 8],
        [1, 3, 8, 8],
        node("Conv", "x", "a", "b", to="1", kernel_shape=[3, 3], pads=[1] * 4),
        node("InstanceNormalization", "1", "b", "b", to="2"),
        node("Resize", "2", "", "twice", to="3", mode="nearest"),
        node("MaxPool", "3", to="4", kernel_shape=[2, 2], strides=[2, 2]),
        node("Conv", "4", "d", "b", to="5", kernel_shape=[3, 3], pads=[1] * 4, group=40),
        node("Concat", "5", "2", to="6", axis=1),
        node("Conv", "6", "c", "e", kernel_shape=[1, 1]),
        a=[40, 3, 3, 3],
        b=[40],
        c=[3, 80, 1, 1],
        d=[40, 1, 3, 3],
        e=[3],
    ),
    "attention, reshaped and turned": lambda: chain(
        [40, 8],
        [1, 40],
        node("MatMul", "x", "b", to="0"),
        node("Reshape", "0", "shape", to="1"),
        node("MatMul", "1", "a", to="2"),
        node("Softmax", "2", to="3", axis=-1),
        node("Transpose", "3", to="4", perm=[0, 1, 3, 2]),
        node("ReduceMean", "4", to="5", axes=[2, 3], keepdims=0),
        node("ReduceMax", "3", to="6", axes=[2, 3], keepdims=0),
        node("Add", "6", "5"),
        a=[8, 16],
        b=[8, 64],
    ),
}


@pytest.mark.parametrize("name", CHAINS)
def test_the_parts_are_the_whole(name: str) -> None:
    model, limit = CHAINS[name](), 4000
    assert large_tensors(model, limit)
    parts = in_parts(model, limit)
    assert large_tensors(parts, limit) == {}
    x = RNG.normal(0, 1, [d.dim_value for d in model.graph.input[0].type.tensor_type.shape.dim]).astype(np.float32)
    whole = run(model, {"x": x})["y"]
    assert np.abs(run(parts, {"x": x})["y"] - whole).max() < 1e-6 * np.abs(whole).max()
    assert in_parts(model, 1 << 20).graph.node == model.graph.node


@pytest.mark.parametrize("name", ["classic-view", "deformable", "avatar", "feed-forward-1", "feed-forward-2", "style"])
def test_families_in_parts(name: str) -> None:
    model, feeds = every_family()[name]
    sizes = large_tensors(model, 0)
    widest = max(sizes.get(value.name, 0) for value in [*model.graph.input, *model.graph.output])
    limit = max(widest, max(sizes.values()) // 3)
    assert large_tensors(model, limit)
    found, whole = run(in_parts(model, limit), feeds), run(model, feeds)
    assert all(np.abs(found[key] - whole[key]).max() < 1e-6 * np.abs(whole[key]).max() for key in whole)


def test_what_cannot_be_split_is_named() -> None:
    with pytest.raises(ExportError, match=r"tensor [xy]: expected at most 100 bytes.*\[graph/parts\]"):
        in_parts(CHAINS["images"](), 100)
    odd = chain([4, 4], [4, 4], node("MatMul", "x", "a", to="1"), node("CumSum", "1", "b", to="2"), a=[4, 400])
    odd.graph.node.append(node("MatMul", "2", "c"))
    for name, array in (("b", np.array(1, np.int64)), ("c", np.ones((400, 4), np.float32))):
        odd.graph.initializer.append(numpy_helper.from_array(array, name))
    with pytest.raises(ExportError, match="CumSum with"):
        in_parts(odd, 4000)
    branch = helper.make_graph([node("Identity", "1", to="b")], "b", [], [])
    branch.output.append(helper.make_tensor_value_info("b", TensorProto.FLOAT, [4, 400]))
    looked = chain([4, 4], [4, 4], node("MatMul", "x", "a", to="1"), node("MatMul", "1", "c"), a=[4, 400], c=[400, 4])
    looked.graph.initializer.append(numpy_helper.from_array(np.array(True), "yes"))
    looked.graph.node.insert(1, node("If", "yes", to="2", then_branch=branch, else_branch=branch))
    with pytest.raises(ExportError, match=r"\[graph/parts\]"):
        in_parts(looked, 4000)


def test_the_command_proves_what_it_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, _ = every_family()["feed-forward-1"]
    onnx.save(model, tmp_path / "a.onnx")
    limit = ["--limit", "7000"]
    assert main(["check", str(tmp_path / "a.onnx"), *limit]) == 0
    assert "gaussian-export parts" in capsys.readouterr().out
    assert main(["parts", str(tmp_path / "a.onnx"), str(tmp_path / "b.onnx"), *limit]) == 0
    assert "largest difference" in capsys.readouterr().out
    assert large_tensors(onnx.load(tmp_path / "b.onnx"), 7000) == {}
    assert main(["check", str(tmp_path / "b.onnx"), *limit]) == 0
    assert "gaussian-export parts" not in capsys.readouterr().out
    assert main(["parts", str(tmp_path / "b.onnx"), str(tmp_path / "c.onnx"), "--limit", "10"]) == 1
    assert "[graph/parts]" in capsys.readouterr().err and not (tmp_path / "c.onnx").exists()
