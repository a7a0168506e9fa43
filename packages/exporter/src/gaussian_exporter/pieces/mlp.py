"""Small networks of linear layers."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from ..arrays import Floats
from ..graph import Tensor, wrong_shape


@dataclass(frozen=True)
class Linear:
    """y = x W^T + b, as PyTorch stores it: weight (out, in), bias (out)."""

    weight: Floats
    bias: Floats

    @property
    def inputs(self) -> int:
        """Numbers going in."""
        return int(self.weight.shape[1])

    @property
    def outputs(self) -> int:
        """Numbers coming out."""
        return int(self.weight.shape[0])


def linear(x: Tensor, layer: Linear, name: str, plus: Tensor | None = None, are_columns: bool = False) -> Tensor:
    """One layer on rows (..., in), or with `are_columns` on columns (in, rows), which saves turning them; gives rows.
    `plus` (rows, out), constant or not, takes the place of the bias."""
    graph = x.graph
    if x.shape[0 if are_columns else -1] != layer.inputs:
        raise wrong_shape("Gemm", f"{layer.inputs} columns", str(x.shape))
    # As PyTorch stores it: the provider then reads four numbers at once whatever the number of outputs.
    weight = graph.constant(layer.weight, f"{name}_weight")
    added = graph.constant(layer.bias, f"{name}_bias") if plus is None else plus
    if are_columns:
        return graph.node("Gemm", [x, weight, added], (x.shape[1], layer.outputs), transA=1, transB=1)
    rows = x.reshape(prod(x.shape[:-1]), layer.inputs)
    result = graph.node("Gemm", [rows, weight, added], (rows.shape[0], layer.outputs), transB=1)
    return result.reshape(*x.shape[:-1], layer.outputs)


def mlp(x: Tensor, layers: Sequence[Linear], name: str, last: str | None = None) -> Tensor:
    """Layers with ReLU between them and, after the last, the ONNX operator `last`."""
    for index, layer in enumerate(layers):
        if index > 0:
            x = x.unary("Relu")
        x = linear(x, layer, f"{name}_{index}")
    return x.unary(last) if last else x


def stacked(layers: Sequence[Linear]) -> Linear:
    """Layers of the same input as one, outputs one after the other."""
    return Linear(np.concatenate([layer.weight for layer in layers]), np.concatenate([layer.bias for layer in layers]))


def beside(layers: Sequence[Linear]) -> Linear:
    """Layers as one, each on a part of the input of its own: a matrix with blocks along its diagonal."""
    weight = np.zeros((sum(layer.outputs for layer in layers), sum(layer.inputs for layer in layers)), np.float32)
    row = column = 0
    for layer in layers:
        weight[row : row + layer.outputs, column : column + layer.inputs] = layer.weight
        row, column = row + layer.outputs, column + layer.inputs
    return Linear(weight, np.concatenate([layer.bias for layer in layers]))
