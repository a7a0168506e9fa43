"""Convolutions and related layers, on images (1,C,H,W)."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..graph import Tensor, wrong_shape


@dataclass(frozen=True)
class Convolution:
    """weight (out, in, k, k) with odd k, bias (out), as PyTorch stores them. norm: scale and shift (out) of an
    instance normalization after it, if there is one.
    """

    weight: Floats
    bias: Floats
    norm: tuple[Floats, Floats] | None = None


# PyTorch's default.
_NORM_EPSILON = 1e-5


def is_wrong_on_webgpu(inputs: int, outputs: int, size: int) -> bool:
    """Whether the WebGPU provider computes other numbers than the CPU for a convolution of these channels and kernel.
    Measured with onnxruntime-webgpu 1.27.0: wrong for 6, 9 and 18 input channels with 4, 8 or 12 output channels,
    right for every other pair tried, for 3 input channels, and for kernels of one pixel.
    """
    return inputs % 4 != 0 and inputs % 3 == 0 and inputs > 3 and outputs % 4 == 0 and size > 1


def convolve(x: Tensor, layer: Convolution, name: str, stride: int = 1) -> Tensor:
    """Zero-padded by half the kernel, so that stride 1 keeps the size and stride 2 halves it, rounded up."""
    graph = x.graph
    outputs, inputs, size, _ = layer.weight.shape
    if x.shape[1] != inputs:
        raise wrong_shape(f"Conv of {name}", f"{x.shape[1]} channels going in", str(layer.weight.shape))
    shape = (1, outputs, *(-(-side // stride) for side in x.shape[2:]))
    weight = layer.weight
    if is_wrong_on_webgpu(inputs, outputs, size):
        # Channels of zeros up to the next multiple of 4.
        more = -inputs % 4
        x = graph.concat([x, graph.constant(np.zeros((1, more, *x.shape[2:])), "padding")], 1)
        weight = np.pad(weight, ((0, 0), (0, more), (0, 0), (0, 0)))
    constants = [graph.constant(weight, f"{name}_weight"), graph.constant(layer.bias, f"{name}_bias")]
    pads = [size // 2] * 4
    result = graph.node("Conv", [x, *constants], shape, strides=[stride] * 2, pads=pads, kernel_shape=[size] * 2)
    if layer.norm is None:
        return result
    scale, shift = (graph.constant(part, f"{name}_norm") for part in layer.norm)
    return graph.node("InstanceNormalization", [result, scale, shift], shape, epsilon=_NORM_EPSILON)


def enlarge(x: Tensor, factor: int, smooth: bool) -> Tensor:
    """Each pixel `factor` times as wide and high; with `smooth`, bilinear between pixel centers."""
    graph = x.graph
    shape = (*x.shape[:2], x.shape[2] * factor, x.shape[3] * factor)
    scales = graph.constant(np.array([1, 1, factor, factor]), "scales")
    # Resize's second input, a region of interest, is omitted; ONNX writes that as an empty name.
    nothing = Tensor(graph, "", ())
    if smooth:
        how = {"mode": "linear", "coordinate_transformation_mode": "half_pixel"}
    else:
        how = {"mode": "nearest", "coordinate_transformation_mode": "asymmetric", "nearest_mode": "floor"}
    return graph.node("Resize", [x, nothing, scales], shape, **how)


def rows_of(x: Tensor) -> Tensor:
    """(1,C,H,W) as pixels (H*W,C)."""
    channels, height, width = x.shape[1:]
    return x.reshape(channels, height * width).transpose(1, 0)
