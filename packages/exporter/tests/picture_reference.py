"""Convolution, enlarging and looking up between pixels, on (C,H,W) in float64, by their definitions."""

from __future__ import annotations

import numpy as np

from gaussian_exporter.arrays import AnyArray, Doubles
from gaussian_exporter.pieces.convolution import Convolution


def convolved(x: Doubles, layer: Convolution, stride: int = 1) -> Doubles:
    size = layer.weight.shape[2]
    padded = np.pad(x, ((0, 0), (size // 2,) * 2, (size // 2,) * 2))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (size, size), (1, 2))[:, ::stride, ::stride]
    result: Doubles = np.einsum("ihwab,oiab->ohw", windows, layer.weight.astype(np.float64))
    result = result + layer.bias[:, None, None]
    if layer.norm is None:
        return result
    centerd = result - result.mean((1, 2), keepdims=True)
    deviation = np.sqrt((centerd**2).mean((1, 2), keepdims=True) + 1e-5)
    normal: Doubles = centerd / deviation * layer.norm[0][:, None, None] + layer.norm[1][:, None, None]
    return normal


def relu(x: Doubles) -> Doubles:
    return np.maximum(x, 0)


def sigmoid(x: AnyArray) -> Doubles:
    result: Doubles = 1 / (1 + np.exp(-np.asarray(x, np.float64)))
    return result


def doubled(x: Doubles) -> Doubles:
    return np.repeat(np.repeat(x, 2, 1), 2, 2)


def smoothly_enlarged(x: Doubles, factor: int) -> Doubles:
    """Bilinear between pixel centers: a product with one matrix of hats for rows and one for columns."""

    def hats(size: int) -> Doubles:
        at = np.clip((np.arange(size * factor) + 0.5) / factor - 0.5, 0, size - 1)
        near: Doubles = np.maximum(0, 1 - np.abs(at[:, None] - np.arange(size)[None]))
        return near

    result: Doubles = np.einsum("ay,cyx,bx->cab", hats(x.shape[1]), x, hats(x.shape[2]))
    return result


def looked_up(x: Doubles, column: float, row: float) -> Doubles:
    """At a place in pixels, whose centers lie at half integers; 0 outside."""
    _, height, width = x.shape
    across = np.maximum(0, 1 - np.abs(np.arange(width) + 0.5 - column))
    down = np.maximum(0, 1 - np.abs(np.arange(height) + 0.5 - row))
    result: Doubles = np.einsum("cyx,y,x->c", x, down, across)
    return result
