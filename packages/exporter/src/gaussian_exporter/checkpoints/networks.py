"""Convolutional networks as a folder of config.json and model.pth (a state_dict), or model.npz."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from ..errors import ExportError
from ..families.feed_forward import FeedForward
from ..families.image_filter import ImageFilter, Output
from ..pieces.convolution import Convolution
from .avatar_file import read_npz
from .files import existing
from .torch_file import Weights, read_weights
from .untrusted import read_json


def read_feed_forward(folder: Path, ignored: Sequence[str] = ()) -> FeedForward:
    """config.json: width, height, views, near, far, depths; layers encoder.i, depth.i and head.i."""
    config, weights = read_network(folder, "feed-forward", ("width", "height", "views", "near", "far", "depths"))

    def stack(name: str) -> list[Convolution]:
        # Without any layers, the first is requested, so that the error names it.
        return [convolution(weights.under(f"{name}.{index}")) for index in numbers(weights, name) or [0]]

    model = FeedForward(
        width=int(config["width"]),
        height=int(config["height"]),
        views=int(config["views"]),
        near=float(config["near"]),
        far=float(config["far"]),
        depths=int(config["depths"]),
        encoder=stack("encoder"),
        depth=stack("depth"),
        head=stack("head"),
    )
    weights.refuse_unread(ignored)
    return model


def read_image_filter(folder: Path, ignored: Sequence[str] = ()) -> tuple[ImageFilter, dict[str, Any]]:
    """config.json: output, width, height; layers stem, down.i, blocks.i.0-1, up.i, out. Returns the config, too."""
    config, weights = read_network(folder, "image filter", ("output", "width", "height"))

    model = ImageFilter(
        stem=convolution(weights.under("stem")),
        down=[convolution(weights.under(f"down.{i}")) for i in numbers(weights, "down")],
        blocks=[
            (convolution(weights.under(f"blocks.{i}.0")), convolution(weights.under(f"blocks.{i}.1")))
            for i in numbers(weights, "blocks")
        ],
        up=[convolution(weights.under(f"up.{i}")) for i in numbers(weights, "up")],
        out=convolution(weights.under("out")),
        output=cast(Output, config["output"]),
    )
    weights.refuse_unread(ignored)
    return model, config


def numbers(weights: Weights, name: str) -> list[int]:
    """The indices of the layers NAME.0, NAME.1, ... in the file, ascending."""
    return sorted({int(key.split(".")[1]) for key in weights.tensors if key.startswith(f"{name}.")})


def convolution(weights: Weights) -> Convolution:
    """Reads weight, bias and, if the file has them, norm.weight and norm.bias."""
    norm = (weights.get("norm.weight"), weights.get("norm.bias")) if "norm.weight" in weights else None
    return Convolution(weights.get("weight"), weights.get("bias"), norm)


def read_network(folder: Path, kind: str, keys: tuple[str, ...]) -> tuple[dict[str, Any], Weights]:
    """The two files of a network."""
    path = existing(folder / "config.json", f"the config.json of a {kind} network")
    try:
        config = read_json(path)
    except ValueError as error:
        raise _broken(path, "JSON", str(error)) from error
    missing = [key for key in keys if key not in config] if isinstance(config, dict) else list(keys)
    if missing:
        raise _broken(path, f"the keys {', '.join(keys)}", f"none of the name {missing[0]}")
    arrays = folder / "model.npz"
    return config, Weights(read_npz(arrays), str(arrays)) if arrays.exists() else read_weights(folder / "model.pth")


def _broken(path: Path, expected: str, found: str) -> ExportError:
    return ExportError(
        "checkpoint/unreadable",
        where=str(path),
        expected=expected,
        found=found,
        remedy="give the folder that packages/exporter/training wrote",
    )
