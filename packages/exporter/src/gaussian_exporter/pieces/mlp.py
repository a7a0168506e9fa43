"""Small networks of linear layers."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

from ..arrays import Floats
from ..graph import Tensor


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


def linear(x: Tensor, layer: Linear, name: str) -> Tensor:
    """One layer on rows (..., in)."""
    graph = x.graph
    weight = graph.constant(layer.weight.T, f"{name}_weight")
    bias = graph.constant(layer.bias, f"{name}_bias")
    if x.shape[-1] != layer.inputs:
        # The product raises the error that says so.
        return x @ weight
    rows = x.reshape(prod(x.shape[:-1]), layer.inputs)
    result = graph.node("Gemm", [rows, weight, bias], (rows.shape[0], layer.outputs))
    return result.reshape(*x.shape[:-1], layer.outputs)


def mlp(x: Tensor, layers: Sequence[Linear], name: str, last: str | None = None) -> Tensor:
    """Layers with ReLU between them and, after the last, the ONNX operator `last`."""
    for index, layer in enumerate(layers):
        if index > 0:
            x = x.unary("Relu")
        x = linear(x, layer, f"{name}_{index}")
    return x.unary(last) if last else x
