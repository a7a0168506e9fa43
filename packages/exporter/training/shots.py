"""Small sets of images of captured scenes, with depth: the training set of a feed-forward generator. A shot is two
cameras 7 to 24 degrees apart that see a scene, and further ones between and beside them. Scenes are drawn once,
before the training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from make_views import FOCAL
from rasterizer import Camera, Splats, pictures_with_depth

# How far away cameras stand, in world units, and how far above and below the scene, in radians.
NEAREST_EYE, FARTHEST_EYE = 2.8, 3.7
LOWEST, HIGHEST = -0.25, 0.7
# Angles between the two given cameras, in radians.
APART = 0.12, 0.42
# How far cameras look past the middle (world units) and lean (radians).
ASIDE, LEAN = 0.12, 0.1
# Minimum and maximum depth of content: scenes reach at most 2 around the origin.
NEAR, FAR = 1.6, 6.4


@dataclass
class Shot:
    """`pictures` (T,4,H,W) premultiplied, 0..1; depths (G,1,H,W) of the given ones, world units, 0 in empty pixels;
    views (T,4,4) world to camera; intrinsics (3,3) of all. The first G images are given to the network.
    """

    pictures: Tensor
    depths: Tensor
    views: Tensor
    intrinsics: Tensor

    def packed(self) -> Shot:
        """Small enough to keep thousands: bytes, and float16."""
        return replace(self, pictures=(self.pictures.clamp(0, 1) * 255).round().byte(), depths=self.depths.half())

    def unpacked(self) -> Shot:
        """As it was, rounded."""
        return replace(self, pictures=self.pictures.float() / 255, depths=self.depths.float())

    def camera(self, index: int) -> Camera:
        """The world has the axes of the first image's camera."""
        height, width = self.pictures.shape[2:]
        return Camera(self.views[index] @ torch.linalg.inv(self.views[0]), self.intrinsics, width, height)


def looking(eye: np.ndarray, at: np.ndarray, lean: float) -> np.ndarray:
    """World to camera (4,4), OpenCV axes; -y is up."""
    forward = (at - eye) / np.linalg.norm(at - eye)
    right = np.cross(forward, [np.sin(lean), -np.cos(lean), 0])
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    view[:3, 3] = -view[:3, :3] @ eye
    return view


def direction(azimuth: float, rise: float) -> np.ndarray:
    """Unit vector to an eye."""
    return np.array([np.sin(azimuth) * np.cos(rise), -np.sin(rise), -np.cos(azimuth) * np.cos(rise)])


def random_views(rng: np.random.Generator, targets: int) -> np.ndarray:
    """(2+targets,4,4): the given two; one between them; others between and a little outside."""
    azimuth, rise = rng.uniform(0, 2 * np.pi), rng.uniform(LOWEST, HIGHEST)
    apart, slope = rng.uniform(*APART) * rng.choice([-1, 1]), rng.uniform(-0.6, 0.6)
    distance, lean = rng.uniform(NEAREST_EYE, FARTHEST_EYE), rng.uniform(-LEAN, LEAN)
    at = rng.uniform(-ASIDE, ASIDE, 3)
    shares = [0.0, 1.0, *([0.5] if targets else []), *rng.uniform(-0.3, 1.3, max(targets - 1, 0))]
    return np.stack(
        [
            looking(at + distance * direction(azimuth + share * apart, rise + share * apart * slope), at, lean)
            for share in shares
        ]
    )


@torch.no_grad()
def draw_shot(scene: Splats, size: int, given: int, targets: int, rng: np.random.Generator) -> Shot:
    """Images of `size` by `size` pixels."""
    where = scene.positions.device
    views = torch.tensor(random_views(rng, targets)).float().to(where)
    if given == 1:
        views = views[[0, *range(2, len(views))]]
    k = torch.tensor([[FOCAL * size, 0, size / 2], [0, FOCAL * size, size / 2], [0, 0, 1.0]]).to(where)
    drawn, depths = pictures_with_depth(scene, [Camera(view, k, size, size) for view in views])
    return Shot(drawn, depths[:given], views, k)


def draw_shots(
    scenes: Sequence[Splats], count: int, size: int, given: int, targets: int, rng: np.random.Generator
) -> list[Shot]:
    """`count` shots, of each scene in turn."""
    return [draw_shot(scenes[i % len(scenes)], size, given, targets, rng).packed() for i in range(count)]
