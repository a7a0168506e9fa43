"""Post-processors: a small network maps the rendered frame to another image, for style transfer or denoising.

The network has a stem, downsampling layers, residual blocks, as many upsampling layers, and a last convolution, as the
fast style networks of Johnson et al. It has few channels, because it runs in every frame after rendering.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import onnx

from ..contract import Facts, control, image, image_contract, metadata
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..pieces.convolution import Convolution, convolve, enlarge

Output = Literal["picture", "noise"]


@dataclass(frozen=True)
class ImageFilter:
    """Layers in order. Each of `down` halves the size, each of `up` doubles it; a block is two layers whose result is
    added to its input. output: `picture` through a sigmoid, or `noise` that is subtracted from the input.
    """

    stem: Convolution
    down: Sequence[Convolution]
    blocks: Sequence[tuple[Convolution, Convolution]]
    up: Sequence[Convolution]
    out: Convolution
    output: Output


def export_image_filter(model: ImageFilter, width: int, height: int, facts: Facts) -> onnx.ModelProto:
    """A post-processor for frames of one size: `image` [1,3,H,W] in 0..1 to `processed`, mixed by the control
    `strength`, 0 to 1."""
    step = 2 ** len(model.down)
    if len(model.up) != len(model.down) or width % step or height % step or min(width, height) < step:
        raise ExportError(
            "argument/value",
            where="--size",
            expected=f"a width and a height that are multiples of {step}, and as many doublings as halvings",
            found=f"{width}x{height}, {len(model.down)} halvings, {len(model.up)} doublings",
            remedy="give another --size WIDTHxHEIGHT",
        )
    graph = Graph("image_filter")
    picture = graph.input("image", 1, 3, height, width)
    strength = graph.input("strength", 1)
    processed = transform(model, picture)
    graph.output("processed", (picture + (processed - picture) * strength).clip(0, 1))
    inputs = [image(), control("strength", 1.0, 0.0, 1.0)]
    return graph.model(metadata(image_contract(facts, inputs)))


def transform(model: ImageFilter, picture: Tensor) -> Tensor:
    """The network's output [1,3,H,W] at full strength."""
    x = convolve(picture, model.stem, "stem").unary("Relu")
    for index, layer in enumerate(model.down):
        x = convolve(x, layer, f"down_{index}", stride=2).unary("Relu")
    for index, (first, second) in enumerate(model.blocks):
        x = x + convolve(convolve(x, first, f"block_{index}_0").unary("Relu"), second, f"block_{index}_1")
    for index, layer in enumerate(model.up):
        x = convolve(enlarge(x, 2, smooth=False), layer, f"up_{index}").unary("Relu")
    last = convolve(x, model.out, "out")
    return last.unary("Sigmoid") if model.output == "picture" else picture - last
