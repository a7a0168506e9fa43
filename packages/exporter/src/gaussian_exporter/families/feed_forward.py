"""Single-shot generators: from one or two images, one Gaussian per pixel in the coordinates of the first camera.

The method is that of pixelSplat and MVSplat, with a network small enough for a page. With two images, a plane sweep
finds the depth of each pixel: it samples features of the other image at candidate depths and compares them. With one
image, the network predicts the depth. In both cases the depth is an average of inverse depths, weighted by a softmax.
A head adds opacity, scale, rotation and color.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
import onnx

from ..arrays import Doubles
from ..contract import Facts, Input, control, image
from ..errors import ExportError
from ..graph import Graph, Tensor
from ..outputs import Gaussians, Options, finish
from ..pieces.convolution import Convolution, convolve, enlarge, rows_of
from ..pieces.covariance import covariance_of_half, rotation_matrix

# The encoder's first strides; all others are 1. Features have a quarter of the image's width and height.
STRIDES = (1, 2, 2)
REDUCTION = 4
# The head's channels: inverse depth, opacity, scales, quaternion, color.
HEAD = (1, 1, 3, 4, 3)
# Limits of the head: change of an inverse depth (as a power of e), and range of a Gaussian's size in pixels.
REFINEMENT = 0.2
SMALLEST, LARGEST = 0.2, 4.2
# The heat equation, backwards: half of the variance times the colors' second derivative.
SHARPENING = 0.5
# Variance that renderers add on the screen, in squared pixels.
DILATION = 0.3
# Added to the variance of a pixel's features before it is divided out.
EPSILON = 1e-5
# A second camera within this distance of a point, in world units, does not see it.
NEAREST = 1e-3


@dataclass(frozen=True)
class FeedForward:
    """A trained network for `views` (1 or 2) images of one size, multiples of 4. encoder: three layers or more;
    depth: the last with a channel for each of `depths` candidates, spaced evenly in inverse depth from near to far
    (world units); head: ending in 12 channels.

    widened: variance added to every Gaussian, in squared pixels of the input images. A network is trained at the size
    of its images, at which the renderer's own 0.3 closes the gaps between pixels; a larger frame shows the gaps.
    Opacities decrease as areas grow, and colors are sharpened to compensate for the blur.
    """

    width: int
    height: int
    views: int
    near: float
    far: float
    depths: int
    encoder: Sequence[Convolution]
    depth: Sequence[Convolution]
    head: Sequence[Convolution]
    widened: float = 0.0

    def inverse_depths(self) -> Doubles:
        """The candidates (D), near first."""
        result: Doubles = np.linspace(1 / self.near, 1 / self.far, self.depths)
        return result


@dataclass(frozen=True)
class Camera:
    """Intrinsics as tensors (1), in fractions of the image's width and height."""

    fx: Tensor
    fy: Tensor
    cx: Tensor
    cy: Tensor


@dataclass(frozen=True)
class Pose:
    """From one camera to another: x -> turn x + shift. turn (3,3), shift (1,3)."""

    turn: Tensor
    shift: Tensor

    def inverse(self) -> Pose:
        """The inverse."""
        return Pose(self.turn.transpose(1, 0), (self.shift @ self.turn) * -1.0)


def export_feed_forward(model: FeedForward, facts: Facts, options: Options | None = None) -> onnx.ModelProto:
    """A generator of views * height * width Gaussians, row by row of the first image, then of the second.

    Inputs: `image` (and `image_2`), `focal_length` and `principal_point` ([2] each, as fractions of width and
    height; the same for every image), and with two images `relative_pose`, the 4x4 matrix from the first camera to
    the second (OpenCV axes).
    """
    check(model)
    options = options or Options()
    graph = Graph("feed_forward", options.weights)
    pictures = [graph.input(name, 1, 3, model.height, model.width) for name in ("image", "image_2")[: model.views]]
    focal, principal = graph.input("focal_length", 2), graph.input("principal_point", 2)
    camera = Camera(focal.part(0, 1), focal.part(1, 2), principal.part(0, 1), principal.part(1, 2))
    inputs: list[Input] = [image(name) for name in ("image", "image_2")[: model.views]]
    inputs.append(control("focal_length", [1.0, model.width / model.height], 0.1, 20.0))
    inputs.append(control("principal_point", 0.5, -1.0, 2.0))
    found = gaussians(model, graph, pictures, camera, inputs)
    return finish(graph, found, inputs, reach(model), facts, options)


def check(model: FeedForward) -> None:
    """Raises checkpoint/mismatch if the layers do not form this network."""
    features = model.encoder[-1].weight.shape[0]
    sweep = features + (model.depths if model.views == 2 else 0)
    head = features + model.encoder[0].weight.shape[0] + 3 + 1
    wanted = {
        "views": (model.views in (1, 2), "1 or 2", str(model.views)),
        "size": (not model.width % REDUCTION and not model.height % REDUCTION, f"multiples of {REDUCTION}", ""),
        "near and far": (0 < model.near < model.far, "0 < near < far", f"{model.near}, {model.far}"),
        "encoder": (len(model.encoder) >= len(STRIDES), f"{len(STRIDES)} layers or more", str(len(model.encoder))),
        "depth": (model.depth[0].weight.shape[1] == sweep, f"{sweep} channels in", str(model.depth[0].weight.shape)),
        "depth's end": (len(model.depth[-1].bias) == model.depths, str(model.depths), str(len(model.depth[-1].bias))),
        "head": (model.head[0].weight.shape[1] == head, f"{head} channels in", str(model.head[0].weight.shape)),
        "head's end": (len(model.head[-1].bias) == sum(HEAD), str(sum(HEAD)), str(len(model.head[-1].bias))),
    }
    for where, (holds, expected, found) in wanted.items():
        if not holds:
            raise ExportError(
                "checkpoint/mismatch",
                where=f"feed-forward network: {where}",
                expected=expected,
                found=found or f"{model.width}x{model.height}",
                remedy="config.json and model.pth must be of one training",
            )


def gaussians(
    model: FeedForward, graph: Graph, pictures: list[Tensor], camera: Camera, inputs: list[Input]
) -> Gaussians:
    """The Gaussians of all images, in their order."""
    encoded = [encode(model, picture) for picture in pictures]
    if model.views == 1:
        return placed(model, pictures[0], encoded[0], None, camera, None)
    matrix = graph.input("relative_pose", 4, 4)
    rest = np.eye(4)
    rest[0, 3] = -0.1
    inputs.append(control("relative_pose", [float(x) for x in rest.ravel()], -100.0, 100.0))
    upper = matrix.part(0, 3, 0)
    pose = Pose(upper.part(0, 3, 1), upper.part(3, 4, 1).reshape(1, 3))
    features = [evened(coarse) for _, coarse in encoded]
    first = placed(model, pictures[0], encoded[0], sweep(model, features[0], features[1], camera, pose), camera, None)
    back = pose.inverse()
    cost = sweep(model, features[1], features[0], camera, back)
    return joined(graph, first, placed(model, pictures[1], encoded[1], cost, camera, back))


def joined(graph: Graph, first: Gaussians, second: Gaussians) -> Gaussians:
    """Concatenates two lists."""
    if first.colors is None or second.colors is None:
        raise ValueError("pixel-aligned Gaussians have plain colors")
    return Gaussians(
        positions=graph.concat([first.positions, second.positions], 0),
        covariances=graph.concat([first.covariance(), second.covariance()], 0),
        colors=graph.concat([first.colors, second.colors], 0),
        opacities=graph.concat([first.opacity(), second.opacity()], 0),
    )


def encode(model: FeedForward, picture: Tensor) -> tuple[Tensor, Tensor]:
    """Fine features (1,C,H,W) and coarse ones (1,F,H/4,W/4)."""
    x = picture * 2.0 - 1.0
    fine = None
    for index, layer in enumerate(model.encoder):
        stride = STRIDES[index] if index < len(STRIDES) else 1
        x = convolve(x, layer, f"encoder_{index}", stride).unary("Relu")
        fine = x if fine is None else fine
    return (x if fine is None else fine), x


def rays(graph: Graph, width: int, height: int, camera: Camera) -> Tensor:
    """Directions with z = 1 through all pixel centers (height*width,3), row by row."""
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    x = (graph.constant(u.reshape(-1, 1), "u") - camera.cx) / camera.fx
    y = (graph.constant(v.reshape(-1, 1), "v") - camera.cy) / camera.fy
    return graph.concat([x, y, graph.constant(np.ones((width * height, 1)), "ones")], 1)


def evened(features: Tensor) -> Tensor:
    """Features of every pixel with mean 0 and variance 1, so that a sweep measures their correlation."""
    centerd = features - features.mean([1], keep=True)
    return centerd / ((centerd * centerd).mean([1], keep=True) + EPSILON).unary("Sqrt")


def sweep(model: FeedForward, own: Tensor, other: Tensor, camera: Camera, pose: Pose) -> Tensor:
    """Similarity (1,D,h,w) of own features (1,F,h,w) and those of the other image, at each candidate depth."""
    graph = own.graph
    channels, height, width = own.shape[1:]
    count, pixels = model.depths, height * width
    depths = graph.constant((1 / model.inverse_depths()).reshape(count, 1, 1), "depths")
    turned = rays(graph, width, height, camera) @ pose.turn.transpose(1, 0)
    points = depths * turned.reshape(1, pixels, 3) + pose.shift.reshape(1, 1, 3)
    z = points.part(2, 3, 2).clip(NEAREST, 1e6)
    x = points.part(0, 1, 2) / z * camera.fx + camera.cx
    y = points.part(1, 2, 2) / z * camera.fy + camera.cy
    grid = (graph.concat([x, y], 2) * 2.0 - 1.0).reshape(1, count * height, width, 2)
    shape = (1, channels, count * height, width)
    seen = graph.node("GridSample", [other, grid], shape, mode="bilinear", padding_mode="zeros", align_corners=0)
    alike = (seen.reshape(channels, count, pixels) * own.reshape(channels, 1, pixels)).sum(0)
    return (alike * (1 / sqrt(channels))).reshape(1, count, height, width)


def inverse_depth(model: FeedForward, features: Tensor, cost: Tensor | None) -> Tensor:
    """(1,1,h,w), from coarse features and the plane sweep, if there was one."""
    graph = features.graph
    x = features if cost is None else graph.concat([cost, features], 1)
    for index, layer in enumerate(model.depth):
        x = convolve(x if index == 0 else x.unary("Relu"), layer, f"depth_{index}")
    logits = x if cost is None else x + cost
    rows = rows_of(logits)
    weights = graph.node("Softmax", [rows], rows.shape, axis=1)
    candidates = graph.constant(model.inverse_depths().reshape(-1, 1), "inverse_depths")
    return (weights @ candidates).reshape(1, 1, *features.shape[2:])


def placed(
    model: FeedForward,
    picture: Tensor,
    encoded: tuple[Tensor, Tensor],
    cost: Tensor | None,
    camera: Camera,
    pose: Pose | None,
) -> Gaussians:
    """The Gaussians of one image; `pose` maps from its camera to the first camera, None for the first."""
    graph, (fine, coarse) = picture.graph, encoded
    guess = enlarge(inverse_depth(model, coarse, cost), REDUCTION, smooth=True)
    x = graph.concat([enlarge(coarse, REDUCTION, smooth=True), fine, picture, guess], 1)
    for index, layer in enumerate(model.head):
        x = convolve(x if index == 0 else x.unary("Relu"), layer, f"head_{index}")
    ends = np.cumsum(HEAD)
    rows, tint = rows_of(x), x.part(int(ends[-2]), int(ends[-1]), 1).unary("Tanh")
    nearer, opacity, size, turn, _ = (rows.part(int(e - n), int(e)) for e, n in zip(ends, HEAD, strict=True))
    inverse = (rows_of(guess) * (nearer.unary("Tanh") * REFINEMENT).unary("Exp")).clip(1 / model.far, 1 / model.near)
    depth = inverse.unary("Reciprocal")
    pixels = size.unary("Sigmoid") * (LARGEST - SMALLEST) + SMALLEST
    solid = opacity.unary("Sigmoid")
    if model.widened > 0:
        variances = pixels * pixels
        # Keeps opacity times area at the size of the input images, although the area grows.
        drawn = variances.mean([1], keep=True) + DILATION
        solid = solid * (drawn / (drawn + model.widened))
        pixels = (variances + model.widened).unary("Sqrt")
    scales = pixels * depth / (camera.fx * float(model.width))
    quaternions = turn + graph.constant(np.array([[1, 0, 0, 0]]), "upright")
    half = rotation_matrix(quaternions) * scales.reshape(scales.shape[0], 1, 3)
    positions = rays(graph, model.width, model.height, camera) * depth
    if pose is not None:
        positions = positions @ pose.turn.transpose(1, 0) + pose.shift
        half = (pose.turn.reshape(1, 3, 3, 1) * half.reshape(half.shape[0], 1, 3, 3)).sum(2)
    return Gaussians(
        positions=positions,
        covariances=covariance_of_half(half),
        opacities=solid,
        colors=rows_of(sharpened((picture + tint * 0.5).clip(0, 1), model.widened)),
    )


def sharpened(colors: Tensor, widened: float) -> Tensor:
    """Sharpened colors (1,3,H,W): a blur of this variance, in squared pixels, approximately restores the given ones."""
    if widened == 0:
        return colors
    graph, (_, channels, height, width) = colors.graph, colors.shape
    around = np.array([[0, 1, 0], [1, -4, 1], [0, 1, 0]]) * SHARPENING * widened
    kernel = np.zeros((channels, channels, 3, 3), np.float32)
    for channel in range(channels):
        kernel[channel, channel] = -around
        kernel[channel, channel, 1, 1] += 1
    # Replicates the border pixels: subtracts the error of the convolution's zero padding.
    lines = []
    for size, shape in ((height, (1, 1, height, 1)), (width, (1, 1, 1, width))):
        line = np.zeros(size, np.float32)
        line[[0, -1]] = -SHARPENING * widened
        lines.append(graph.constant(line.reshape(shape), "border"))
    plain = convolve(colors, Convolution(kernel, np.zeros(channels, np.float32)), "sharpen")
    return (plain + colors * (lines[0] + lines[1])).clip(0, 1)


def reach(model: FeedForward) -> tuple[Doubles, Doubles]:
    """Corners of the first camera's view at its default intrinsics, from near to far."""
    half = np.array([0.5, 0.5 * model.height / model.width]) * model.far
    return np.array([-half[0], -half[1], model.near]), np.array([half[0], half[1], model.far])
