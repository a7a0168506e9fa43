"""Writes a file for each rule of the GPU, and one beside it that only just keeps it:

python -m tests.write_rules ../../tests/fixtures/rules

Both checkers find in them what tests/fixtures/gpu-findings.json says (test_placement.py,
tests/onnx/webgpu-rules.test.ts).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

Shape = Sequence[int | str]
F, I64 = TensorProto.FLOAT, TensorProto.INT64


def model(
    nodes: Sequence[onnx.NodeProto],
    x: Shape = (4, 4),
    y: Shape = (4, 4),
    opset: int = 17,
    constants: dict[str, np.ndarray] | None = None,
    kinds: tuple[int, int] = (F, F),
    domain: str = "",
) -> onnx.ModelProto:
    """From x to y."""
    graph = helper.make_graph(
        nodes,
        "rule",
        [helper.make_tensor_value_info("x", kinds[0], x)],
        [helper.make_tensor_value_info("y", kinds[1], y)],
        [numpy_helper.from_array(value, name) for name, value in (constants or {}).items()],
    )
    imports = [helper.make_opsetid("", opset), *([helper.make_opsetid(domain, 1)] if domain else [])]
    made = helper.make_model(graph, opset_imports=imports)
    made.ir_version = 8
    return made


def node(operator: str, *inputs: str, to: str = "y", domain: str = "", **attributes: Any) -> onnx.NodeProto:
    """An operator of one output."""
    return helper.make_node(operator, inputs, [to], domain=domain, **attributes)


def ints(*values: int) -> np.ndarray:
    return np.array(values, np.int64)


def convolution(channels: int, outputs: int, kernel: int, stride: int = 1, group: int = 1) -> onnx.ModelProto:
    size = (6 - kernel) // stride + 1
    weights = np.ones((outputs, channels // group, kernel, kernel), np.float32)
    return model(
        [node("Conv", "x", "w", strides=[stride, stride], group=group)],
        (1, channels, 6, 6),
        (1, outputs, size, size),
        constants={"w": weights},
    )


def split(count: int) -> onnx.ModelProto:
    parts = [f"p{i}" for i in range(count)]
    nodes = [helper.make_node("Split", ["x", "sizes"], parts, axis=0), node("Relu", "p0")]
    return model(nodes, (count, 4), (1, 4), constants={"sizes": np.ones(count, np.int64)})


def grid_sample(opset: int) -> onnx.ModelProto:
    mode = "linear" if opset >= 20 else "bilinear"
    return model(
        [node("GridSample", "x", "grid", mode=mode)],
        (1, 1, 4, 4),
        (1, 1, 4, 4),
        opset,
        {"grid": np.zeros((1, 4, 4, 2), np.float32)},
    )


def cumulative(length: int) -> onnx.ModelProto:
    return model([node("CumSum", "x", "axis")], (length,), (length,), constants={"axis": np.array(0, np.int64)})


def loop() -> onnx.ModelProto:
    then = helper.make_graph([node("Relu", "x", to="a")], "then", [], [helper.make_tensor_value_info("a", F, (4, 4))])
    other = helper.make_graph([node("Abs", "x", to="b")], "else", [], [helper.make_tensor_value_info("b", F, (4, 4))])
    nodes = [
        node("ReduceSum", "x", to="s", keepdims=0),
        node("Greater", "s", "zero", to="c"),
        node("If", "c", then_branch=then, else_branch=other),
    ]
    return model(nodes, constants={"zero": np.zeros((), np.float32)})


def dequantized(size: Sequence[int], scales: Sequence[int], axis: int) -> onnx.ModelProto:
    rng = np.random.default_rng(0)
    table = rng.integers(-128, 128, size).astype(np.int8)
    block = int(size[axis]) // int(scales[axis])
    nodes = [node("DequantizeLinear", "w", "s", to="d", axis=axis, block_size=block), node("Add", "d", "x")]
    return model(nodes, size, size, 21, {"w": table, "s": rng.random(scales).astype(np.float32)})


def microsoft(operator: str, x: Sequence[int] = (4, 4), y: Shape = (4, 4), **attributes: Any) -> onnx.ModelProto:
    rng = np.random.default_rng(0)
    constants: dict[str, np.ndarray] = {}
    if operator == "MatMulNBits":
        constants = {"w": rng.integers(0, 256, (8, 1, 16)).astype(np.uint8), "s": rng.random(8).astype(np.float32)}
    elif operator in ("BiasGelu", "FusedMatMul"):
        constants = {"w": rng.random(x[1:] if operator == "BiasGelu" else x).astype(np.float32)}
    nodes = [node(operator, "x", *constants, domain="com.microsoft", **attributes)]
    return model(nodes, x, y, constants=constants, domain="com.microsoft")


def rules() -> dict[str, onnx.ModelProto]:
    """Names describe the fault, or are `kept-` and a valid value at its limit."""
    shape = {"shape": ints(16)}
    eye = {"v": np.ones(4, np.float32), "m": np.ones((4, 1), np.float32)}
    return {
        "compress": model(
            [node("Compress", "x", "c", axis=0)], y=(2, 4), constants={"c": np.array([1, 0, 1, 0], bool)}
        ),
        "round": model([node("Round", "x")]),
        "foreign-domain": model([node("Sparkle", "x", domain="ai.example")], domain="ai.example"),
        "if": loop(),
        "grid-sample-20": grid_sample(20),
        "kept-grid-sample-16": grid_sample(16),
        "int64": model([node("Add", "x", "x")], kinds=(I64, I64)),
        "kept-int64-indices": model(
            [helper.make_node("Cast", ["x"], ["i"], to=I64), node("Gather", "t", "i")],
            (4,),
            (4,),
            constants={"t": np.ones(4, np.float32)},
        ),
        "double": model([node("Add", "x", "x")], kinds=(TensorProto.DOUBLE, TensorProto.DOUBLE)),
        "half": model([node("Add", "x", "x")], kinds=(TensorProto.FLOAT16, TensorProto.FLOAT16)),
        "symbolic": model([node("Relu", "x")], ("N", 4), ("N", 4)),
        "copied": model([node("Relu", "x", to="r"), node("Reshape", "r", "shape")], y=(16,), constants=shape),
        "kept-reshaped-inside": model(
            [node("Reshape", "x", "shape", to="r"), node("Relu", "r")], y=(16,), constants=shape
        ),
        "kept-constant-output": model([node("Abs", "t")], y=(4,), constants={"t": np.ones(4, np.float32)}),
        "split-10": split(10),
        "kept-split-9": split(9),
        "cumsum-5000": cumulative(5000),
        "kept-cumsum-4096": cumulative(4096),
        "turned-times-vector": model(
            [node("Transpose", "x", to="t", perm=[1, 0]), node("MatMul", "t", "v")], y=(4,), constants=eye
        ),
        "kept-turned-times-column": model(
            [node("Transpose", "x", to="t", perm=[1, 0]), node("MatMul", "t", "m")], y=(4, 1), constants=eye
        ),
        "conv-6-8": convolution(6, 8, 3),
        "conv-6-8-strided-1": convolution(6, 8, 1, 2),
        "conv-15-4": convolution(15, 4, 3),
        "kept-conv-6-8-pointwise": convolution(6, 8, 1),
        "kept-conv-6-7": convolution(6, 7, 3),
        "kept-conv-12-8": convolution(12, 8, 3),
        "kept-conv-3-8": convolution(3, 8, 3),
        "kept-conv-grouped": convolution(12, 8, 3, group=2),
        "dequantize-blocks-of-a-vector": dequantized((32,), (4,), 0),
        "kept-dequantize-blocks-of-a-row": dequantized((1, 32), (1, 4), 1),
        "kept-dequantize-blocks": dequantized((32, 8), (4, 8), 0),
        "kept-max": model([node("Sin", "x", to="s"), node("Max", "x", "s")]),
        "kept-prelu": model([node("PRelu", "x", "s")], constants={"s": np.linspace(0, 1, 4, dtype=np.float32)}),
        "sign": model([node("Sign", "x")]),
        "sum": model([node("Sum", "x", "x")]),
        "fused-product": microsoft("FusedMatMul", transB=1),
        "kept-fast-gelu": microsoft("FastGelu"),
        "kept-quick-gelu": microsoft("QuickGelu"),
        "kept-bias-gelu": microsoft("BiasGelu"),
        "kept-product-of-4-bits": microsoft("MatMulNBits", (4, 32), (4, 8), K=32, N=8, bits=4, block_size=32),
        "opset-27": model([node("Relu", "x")], opset=27),
    }


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, made in rules().items():
        (folder / f"{name}.onnx").write_bytes(made.SerializeToString(deterministic=True))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
