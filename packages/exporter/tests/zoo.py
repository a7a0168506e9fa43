"""One small file of each family, with something to feed it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import onnx

from gaussian_exporter.arrays import AnyArray
from gaussian_exporter.checkpoints.moving import gaussian4d_of
from gaussian_exporter.families.avatar import export_avatar
from gaussian_exporter.families.classic import export_classic
from gaussian_exporter.families.deformable import export_deformable
from gaussian_exporter.families.feed_forward import export_feed_forward
from gaussian_exporter.families.gaussian4d import export_gaussian4d
from gaussian_exporter.families.hexplane import export_hexplane
from gaussian_exporter.families.image_filter import export_image_filter
from gaussian_exporter.families.scaffold import export_scaffold
from gaussian_exporter.families.spacetime import export_spacetime
from gaussian_exporter.outputs import Options

from . import test_avatar, test_classic, test_hexplane, test_moving, test_networks, test_scaffold
from .running import FACTS

Case = tuple[onnx.ModelProto, dict[str, AnyArray]]


@cache
def every_family() -> dict[str, Case]:
    rng = np.random.default_rng(5)
    camera: dict[str, AnyArray] = {"camera_position": np.array([0.4, -0.3, -3.0], np.float32)}
    level = {"resolution_scale": np.ones(1, np.float32)}
    bank = test_scaffold.scaffold(
        distance=("opacity",), feature_bank=test_scaffold.layers(rng, 4, 8, 3), appearance=np.ones(6, np.float32)
    )
    moving = test_hexplane.deformation(
        mask=test_hexplane.layers(rng, 12, 12, 1), opacity=test_hexplane.layers(rng, 12, 12, 1)
    )
    body = test_avatar.feeds(camera_position=np.array([0.5, 1.0, -4.0]))
    cases: dict[str, Case] = {
        "classic": (export_classic(test_classic.cloud(), FACTS), {}),
        "classic-view": (export_classic(test_classic.cloud(), FACTS, colors="view"), camera),
        "scaffold": (export_scaffold(bank, FACTS), camera),
        "hexplane": (export_hexplane(test_hexplane.small(), moving, FACTS), {"time": np.array([0.3], np.float32)}),
        "avatar": (export_avatar(test_avatar.avatar(degree=1), FACTS), body),
    }
    for name, one, feeds in (
        ("avatar", export_avatar(test_avatar.avatar(degree=1), FACTS, Options(instances=8)), body),
        (
            "hexplane",
            export_hexplane(test_hexplane.small(), moving, FACTS, Options(instances=8)),
            {"time": np.array([0.3])},
        ),
    ):
        both = {key: np.stack([value, 0.8 * value]).astype(np.float32) for key, value in feeds.items()}
        cases[f"{name}-instances"] = (one, both)
    four = gaussian4d_of(Path("x"), test_moving.captured(), {"time_duration": [0.0, 10.0]})
    for name, moved in (
        ("spacetime", export_spacetime(test_moving.spacetime(), FACTS)),
        ("deformable", export_deformable(test_classic.cloud(test_moving.COUNT, 3), test_moving.deform(), FACTS)),
        ("4dgs", export_gaussian4d(four, FACTS)),
    ):
        cases[name] = (moved, {"time": np.array([0.3], np.float32)})
    picture = test_networks.given()["image"]
    for kind, norm in (("style", True), ("noise", False)):
        model = test_networks.image_filter("picture" if kind == "style" else "noise", norm)
        exported = export_image_filter(model, test_networks.WIDTH, test_networks.HEIGHT, FACTS)
        cases[kind] = (exported, {"image": picture, "strength": np.ones(1, np.float32)})
    for views in (1, 2):
        network = test_networks.feed_forward(views)
        cases[f"feed-forward-{views}"] = (export_feed_forward(network, FACTS), test_networks.given(views))
    for rule in ("round", "progressive", "ceil"):
        octree = test_scaffold.scaffold(levels=test_scaffold.levels(60, rule))
        cases[f"octree-{rule}"] = (export_scaffold(octree, FACTS), {**camera, **level})
    return cases


def halves() -> dict[str, onnx.ModelProto]:
    """The families once more, writing float16: for GPUs that have it."""
    half = Options(dtype="float16")
    octree = test_scaffold.scaffold(levels=test_scaffold.levels(60, "round"))
    return {
        "classic": export_classic(test_classic.cloud(), FACTS, half),
        "classic-view": export_classic(test_classic.cloud(), FACTS, half, colors="view"),
        "scaffold": export_scaffold(test_scaffold.scaffold(), FACTS, half),
        "octree-round": export_scaffold(octree, FACTS, half),
        "hexplane": export_hexplane(test_hexplane.small(), test_hexplane.deformation(), FACTS, half),
        "avatar": export_avatar(test_avatar.avatar(degree=1), FACTS, half),
        "feed-forward-1": export_feed_forward(test_networks.feed_forward(1), FACTS, half),
    }
