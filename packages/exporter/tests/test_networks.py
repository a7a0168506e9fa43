"""Feed-forward generators and post-processors against plain numpy in float64."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gaussian_exporter.arrays import AnyArray, Doubles
from gaussian_exporter.checkpoints.networks import read_feed_forward, read_image_filter
from gaussian_exporter.cli import main
from gaussian_exporter.conformance import default_feeds
from gaussian_exporter.contract import of_metadata
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.feed_forward import (
    SHARPENING,
    STRIDES,
    Camera,
    FeedForward,
    Pose,
    export_feed_forward,
    sweep,
)
from gaussian_exporter.families.image_filter import ImageFilter, export_image_filter
from gaussian_exporter.graph import Graph
from gaussian_exporter.pieces.convolution import Convolution

from .picture_reference import convolved, doubled, looked_up, relu, sigmoid, smoothly_enlarged
from .running import FACTS, covariance, error, parts, rows, run

WIDTH, HEIGHT = 16, 12


def layer(rng: np.random.Generator, inputs: int, outputs: int, size: int = 3, norm: bool = False) -> Convolution:
    weight = rng.normal(size=(outputs, inputs, size, size)) / np.sqrt(inputs * size * size)
    both = (rng.normal(1, 0.2, outputs), rng.normal(0, 0.2, outputs)) if norm else None
    return Convolution(
        weight.astype(np.float32),
        (rng.normal(size=outputs) * 0.1).astype(np.float32),
        None if both is None else (both[0].astype(np.float32), both[1].astype(np.float32)),
    )


def image_filter(output: Any = "picture", norm: bool = False) -> ImageFilter:
    rng = np.random.default_rng(3)
    return ImageFilter(
        stem=layer(rng, 3, 6, 5, norm),
        down=[layer(rng, 6, 8, 3, norm), layer(rng, 8, 8, 3, norm)],
        blocks=[(layer(rng, 8, 8, 3, norm), layer(rng, 8, 8, 3, norm)) for _ in range(2)],
        up=[layer(rng, 8, 8, 3, norm), layer(rng, 8, 6, 3, norm)],
        out=layer(rng, 6, 3, 5),
        output=output,
    )


def filtered(model: ImageFilter, picture: Doubles, strength: float) -> Doubles:
    x = relu(convolved(picture, model.stem))
    for each in model.down:
        x = relu(convolved(x, each, 2))
    for first, second in model.blocks:
        x = x + convolved(relu(convolved(x, first)), second)
    for each in model.up:
        x = relu(convolved(doubled(x), each))
    last = convolved(x, model.out)
    full = sigmoid(last) if model.output == "picture" else picture - last
    return np.clip(picture + (full - picture) * strength, 0, 1)


@pytest.mark.parametrize("norm", [False, True])
@pytest.mark.parametrize("output", ["picture", "noise"])
def test_image_filters(output: str, norm: bool) -> None:
    picture = np.random.default_rng(0).random((3, HEIGHT, WIDTH)).astype(np.float32)
    model = image_filter(output, norm)
    exported = export_image_filter(model, WIDTH, HEIGHT, FACTS)
    for strength in (1.0, 0.4, 0.0):
        found = run(exported, {"image": picture[None], "strength": np.array([strength])})["processed"]
        expected = filtered(model, picture.astype(np.float64), strength)
        assert error(found.reshape(-1, 1), expected.reshape(-1, 1)) < 1e-5


def test_options_of_generators_are_refused_for_image_filters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = [str(tmp_path), str(tmp_path / "a.onnx"), "--license", "MIT", "--attribution", "me"]
    for option in (["--weights", "compact"], ["--dtype", "float16"], ["--layout", "packed"], ["--instances", "3"]):
        assert main(["image-filter", *place, *option]) == 1
        assert option[0] in capsys.readouterr().err


def test_a_filter_of_any_size_is_checked_with_an_image_that_it_can_halve() -> None:
    model = export_image_filter(image_filter(), WIDTH, HEIGHT, FACTS)
    for value in (*model.graph.input, *model.graph.output):
        dims = value.type.tensor_type.shape.dim
        if len(dims) == 4:
            dims[2].dim_param, dims[3].dim_param = "H", "W"
    [image] = [value.name for value in model.graph.input if len(value.type.tensor_type.shape.dim) == 4]
    contract = of_metadata({prop.key: prop.value for prop in model.metadata_props}, "a")
    assert default_feeds(model, contract)[image].shape == (1, 3, 64, 64)


def test_sizes_that_cannot_be_halved_are_refused() -> None:
    with pytest.raises(ExportError, match=r"multiples of 4.*found 18x12.*\[argument/value\]"):
        export_image_filter(image_filter(), 18, 12, FACTS)


def feed_forward(views: int = 2) -> FeedForward:
    rng = np.random.default_rng(6)
    sweep = 10 + (7 if views == 2 else 0)
    return FeedForward(
        width=WIDTH,
        height=HEIGHT,
        views=views,
        near=1.0,
        far=8.0,
        depths=7,
        encoder=[layer(rng, 3, 6), layer(rng, 6, 8), layer(rng, 8, 10), layer(rng, 10, 10)],
        depth=[layer(rng, sweep, 9), layer(rng, 9, 9), layer(rng, 9, 7)],
        head=[layer(rng, 10 + 6 + 3 + 1, 9, 1), layer(rng, 9, 9), layer(rng, 9, 12)],
    )


def given(views: int = 2) -> dict[str, AnyArray]:
    rng = np.random.default_rng(1)
    feeds: dict[str, AnyArray] = {"focal_length": np.array([1.1, 1.4]), "principal_point": np.array([0.48, 0.53])}
    for name in ("image", "image_2")[:views]:
        feeds[name] = rng.random((1, 3, HEIGHT, WIDTH))
    if views == 2:
        angle = 0.1
        pose = np.eye(4)
        pose[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        pose[:3, 3] = [-0.5, 0.1, 0.05]
        feeds["relative_pose"] = pose
    return {name: np.asarray(value, np.float32) for name, value in feeds.items()}


def ray(column: float, row: float, width: int, height: int, k: Doubles) -> Doubles:
    return np.array([(column / width - k[2]) / k[0], (row / height - k[3]) / k[1], 1.0])


def swept(model: FeedForward, own: Doubles, other: Doubles, k: Doubles, pose: Doubles) -> Doubles:
    _, height, width = own.shape
    cost: Doubles = np.zeros((model.depths, height, width))
    for d, inverse in enumerate(np.linspace(1 / model.near, 1 / model.far, model.depths)):
        for row in range(height):
            for column in range(width):
                point = ray(column + 0.5, row + 0.5, width, height, k) / inverse
                x, y, z = pose[:3, :3] @ point + pose[:3, 3]
                if z <= 0:
                    continue
                at = (x / z * k[0] + k[2]) * width, (y / z * k[1] + k[3]) * height
                cost[d, row, column] = looked_up(other, *at) @ own[:, row, column] / np.sqrt(len(own))
    return cost


def reference(model: FeedForward, feeds: dict[str, AnyArray]) -> dict[str, Doubles]:
    k = np.concatenate([feeds["focal_length"], feeds["principal_point"]]).astype(np.float64)
    pictures = [feeds[name][0].astype(np.float64) for name in ("image", "image_2")[: model.views]]
    encoded = []
    for picture in pictures:
        stages = [picture * 2 - 1]
        for index, each in enumerate(model.encoder):
            stages.append(relu(convolved(stages[-1], each, STRIDES[index] if index < 3 else 1)))
        encoded.append((stages[1], stages[-1]))
    there = feeds["relative_pose"].astype(np.float64) if model.views == 2 else np.eye(4)
    back: Doubles = np.linalg.inv(there).astype(np.float64)
    poses = [there, back]
    columns: dict[str, list[Doubles]] = {"positions": [], "covariances": [], "color": [], "opacities": []}
    for view, picture in enumerate(pictures):
        fine, coarse = encoded[view]
        even = [(each - each.mean(0)) / np.sqrt(each.var(0) + 1e-5) for _, each in encoded]
        cost = swept(model, even[view], even[1 - view], k, poses[view]) if model.views == 2 else None
        x = coarse if cost is None else np.concatenate([cost, coarse])
        for index, each in enumerate(model.depth):
            x = convolved(relu(x) if index else x, each)
        logits = x + (0 if cost is None else cost)
        weights = np.exp(logits - logits.max(0))
        candidates = np.linspace(1 / model.near, 1 / model.far, model.depths)
        guess = np.einsum("dhw,d->hw", weights / weights.sum(0), candidates)[None]
        guess = smoothly_enlarged(guess, 4)
        x = np.concatenate([smoothly_enlarged(coarse, 4), fine, picture, guess])
        for index, each in enumerate(model.head):
            x = convolved(relu(x) if index else x, each)
        depth = 1 / np.clip(guess[0] * np.exp(0.2 * np.tanh(x[0])), 1 / model.far, 1 / model.near)
        colors = np.clip(picture + 0.5 * np.tanh(x[9:]), 0, 1)
        wide = np.pad(colors, ((0, 0), (1, 1), (1, 1)), "edge")
        bend = wide[:, :-2, 1:-1] + wide[:, 2:, 1:-1] + wide[:, 1:-1, :-2] + wide[:, 1:-1, 2:] - 4 * colors
        colors = np.clip(colors - SHARPENING * model.widened * bend, 0, 1)
        for row in range(HEIGHT):
            for column in range(WIDTH):
                z, pixel = depth[row, column], x[:, row, column]
                point = ray(column + 0.5, row + 0.5, WIDTH, HEIGHT, k) * z
                scales = np.sqrt((0.2 + 4 * sigmoid(pixel[2:5])) ** 2 + model.widened) * z / (k[0] * WIDTH)
                turn = np.eye(4) if view == 0 else np.linalg.inv(there)
                upper = covariance(scales[None], (pixel[5:9] + np.eye(4)[0])[None])[0]
                full = turn[:3, :3] @ upper[[0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(3, 3) @ turn[:3, :3].T
                columns["positions"].append(turn[:3, :3] @ point + turn[:3, 3])
                columns["covariances"].append(full[np.triu_indices(3)])
                columns["color"].append(colors[:, row, column])
                drawn = ((0.2 + 4 * sigmoid(pixel[2:5])) ** 2).mean() + 0.3
                columns["opacities"].append(sigmoid(pixel[1:2]) * drawn / (drawn + model.widened))
    return {name: np.stack(values) for name, values in columns.items()}


@pytest.mark.parametrize(("views", "widened"), [(1, 0.0), (2, 0.0), (1, 0.1)])
def test_pixel_aligned_gaussians(views: int, widened: float) -> None:
    model, feeds = replace(feed_forward(views), widened=widened), given(views)
    found = parts(run(export_feed_forward(model, FACTS), feeds))
    assert len(found["positions"]) == views * WIDTH * HEIGHT
    for name, values in reference(model, feeds).items():
        assert error(found[name], values) < 1e-5, name


def test_the_plane_sweep_sees_the_right_depth() -> None:
    """Two cameras in front of one textured plane: if the features are the image itself, the depth of the plane has the
    lowest cost.
    """
    model = feed_forward()
    rng = np.random.default_rng(0)
    texture = rng.normal(size=(3, 60, 60))
    k, depth = np.array([1.0, WIDTH / HEIGHT, 0.5, 0.5]), 1 / np.linspace(1, 1 / 8, 7)[4]
    pose = np.eye(4)
    pose[0, 3] = -depth / 4
    views = []
    for shift in (0.0, pose[0, 3]):
        at = [[ray(c + 0.5, r + 0.5, WIDTH, HEIGHT, k) * depth for c in range(WIDTH)] for r in range(HEIGHT)]
        views.append(
            np.array([[looked_up(texture, (p[0] - shift) * 4 + 30, p[1] * 4 + 30) for p in row] for row in at])
        )
    own, other = (np.transpose(view, (2, 0, 1)) for view in views)
    graph = Graph("sweep")
    given = graph.input("own", 1, 3, HEIGHT, WIDTH), graph.input("other", 1, 3, HEIGHT, WIDTH)
    numbers = graph.constant(k, "k")
    camera = Camera(*(numbers.part(i, i + 1) for i in range(4)))
    between = Pose(graph.constant(pose[:3, :3], "turn"), graph.constant(pose[None, :3, 3], "shift"))
    graph.output("cost", sweep(model, *given, camera, between))
    cost = run(graph.model({}), {"own": own[None], "other": other[None]})["cost"][0]
    exact = (own**2).sum(0) / np.sqrt(3)
    inner = np.s_[:, 4:]
    assert np.abs(cost[4] - exact)[inner].max() < 1e-4
    assert np.abs(cost[1] - exact)[inner].mean() > 0.1


def test_parts_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ExportError, match=r"depth's end: expected 7, found 9"):
        export_feed_forward(replace(feed_forward(), depth=[feed_forward().depth[0]] * 2), FACTS)


def arrays(prefix: str, each: Convolution) -> dict[str, AnyArray]:
    named: dict[str, AnyArray] = {f"{prefix}.weight": each.weight, f"{prefix}.bias": each.bias}
    if each.norm is not None:
        named |= {f"{prefix}.norm.weight": each.norm[0], f"{prefix}.norm.bias": each.norm[1]}
    return named


def write_network(folder: Path, config: dict[str, Any], tensors: dict[str, Any]) -> None:
    folder.mkdir(exist_ok=True)
    (folder / "config.json").write_text(json.dumps(config))
    np.savez(folder / "model.npz", **tensors)


def test_folders_are_read_back(tmp_path: Path) -> None:
    model = feed_forward()
    stacks = {"encoder": model.encoder, "depth": model.depth, "head": model.head}
    tensors = {
        k: v for name, stack in stacks.items() for i, e in enumerate(stack) for k, v in arrays(f"{name}.{i}", e).items()
    }
    config = {name: getattr(model, name) for name in ("width", "height", "views", "near", "far", "depths")}
    write_network(tmp_path / "ff", config, tensors)
    both = [rows(run(export_feed_forward(m, FACTS), given())) for m in (model, read_feed_forward(tmp_path / "ff"))]
    assert np.array_equal(both[0], both[1])

    style = image_filter(norm=True)
    tensors = arrays("stem", style.stem) | arrays("out", style.out)
    for name, stack in (("down", style.down), ("up", style.up)):
        for i, each in enumerate(stack):
            tensors |= arrays(f"{name}.{i}", each)
    for i, pair in enumerate(style.blocks):
        tensors |= arrays(f"blocks.{i}.0", pair[0]) | arrays(f"blocks.{i}.1", pair[1])
    write_network(tmp_path / "style", {"output": "picture", "width": WIDTH, "height": HEIGHT}, tensors)
    again, _ = read_image_filter(tmp_path / "style")
    feeds = {"image": given()["image"], "strength": np.ones(1)}
    pictures = [run(export_image_filter(m, WIDTH, HEIGHT, FACTS), feeds)["processed"] for m in (style, again)]
    assert np.array_equal(pictures[0], pictures[1])
    (tmp_path / "style" / "config.json").write_text("{}")
    with pytest.raises(ExportError, match=r"found none of the name output.*\[checkpoint/unreadable\]"):
        read_image_filter(tmp_path / "style")
