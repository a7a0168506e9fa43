"""Trains a feed-forward generator: python feed_forward.py OUT SCENE.ply [SCENE.ply ...] [--unseen SCENE.ply]

Scenes are drawn from all directions (shots.py). `--count` is the number of input images: 1 or 2. A step takes some
shots, makes Gaussians from the given images of each, and draws them for other cameras. The test set has other shots
of the same scenes and of one that is not in the training (`--unseen`). OUT is the input of `gaussian-export
feed-forward`.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from common import Record, Schedule, Views, add_schedule, device, seed
from losses import loss_of, psnr
from make_views import scene_of
from rasterizer import Splats, covariances, pictures
from shots import FAR, NEAR, Shot, draw_shots
from show import sheet

REDUCTION = 4
HEAD = (1, 1, 3, 4, 3)
REFINEMENT = 0.2
SMALLEST, LARGEST = 0.2, 4.2
NEAREST = 1e-3
EPSILON = 1e-5
# Initial opacity and size, before their sigmoids: nearly opaque, and a pixel wide.
OPAQUE, SLIM = 1.0, -1.5
RATE, LAST_RATE = 1e-3, 0.02
# Fractions of the training: warm-up of the rates; depths and opacities are learned before anything is drawn.
WARM_UP, BEFORE_DRAWING = 0.02, 0.12
# Weights of depths and opacities relative to the images, at the beginning and at the end.
DEPTH_WEIGHT, COVERAGE_WEIGHT = (2.0, 0.2), (0.5, 0.02)
# A pixel has a depth where this much of it is covered.
SOLID = 0.6
# Number of images drawn of every shot besides the given ones; number of test shots of each scene.
TARGETS, HELD_OUT = 3, 12


@dataclass
class Shape:
    """Content of config.json."""

    width: int
    height: int
    views: int
    near: float
    far: float
    depths: int = 32


@dataclass
class Made:
    """Output of the network for V images: Gaussians in the axes of the first camera (V*H*W); opacities before the
    sigmoid and inverse depths of the pixels (V,1,H,W); those before refinement (V,1,h,w).
    """

    splats: Splats
    logits: Tensor
    inverse: Tensor
    coarse_inverse: Tensor


def layers(*channels: int, kernels: Sequence[int] = ()) -> nn.ModuleList:
    """Convolutions from each number of channels to the next, 3 by 3 unless `kernels` says otherwise, begun so that the
    size of what goes through stays the same."""
    stack = nn.ModuleList()
    for index, (i, o) in enumerate(pairwise(channels)):
        kernel = kernels[index] if index < len(kernels) else 3
        layer = nn.Conv2d(i, o, kernel, 1, kernel // 2)
        nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
        nn.init.zeros_(layer.bias)
        stack.append(layer)
    return stack


class Generator(nn.Module):
    """The network of gaussian_exporter.families.feed_forward, with the same names."""

    def __init__(self, shape: Shape, fine: int = 32, coarse: int = 64):
        """`fine` and `coarse`: channels of features, multiples of 4."""
        super().__init__()
        self.shape = shape
        sweep = coarse + (shape.depths if shape.views == 2 else 0)
        self.encoder = layers(3, fine, coarse, coarse, coarse, coarse)
        for layer in self.encoder[1:3]:
            layer.stride = (2, 2)
        self.depth = layers(sweep, coarse, coarse, coarse, coarse, shape.depths)
        self.head = layers(coarse + fine + 4, fine, fine, sum(HEAD), kernels=(1,))
        with torch.no_grad():
            # The plane sweep determines the initial depths, and all Gaussians start with equal values.
            self.depth[-1].weight.mul_(0.1)
            self.head[-1].weight.mul_(0.1)
            self.head[-1].bias[1] = OPAQUE
            self.head[-1].bias[2:5] = SLIM
        self.register_buffer("candidates", torch.linspace(1 / shape.near, 1 / shape.far, shape.depths))

    def encode(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Fine and coarse features of images (V,3,H,W)."""
        x, fine = images * 2 - 1, None
        for layer in self.encoder:
            x = F.relu(layer(x))
            fine = x if fine is None else fine
        return (x if fine is None else fine), x

    def rays(self, k: Tensor, width: int, height: int) -> Tensor:
        """Directions with z = 1 through pixel centers (H*W,3); k: fx, fy, cx, cy as fractions of width and height."""
        v, u = torch.meshgrid(
            (torch.arange(height, device=k.device) + 0.5) / height,
            (torch.arange(width, device=k.device) + 0.5) / width,
            indexing="ij",
        )
        x, y = (u.flatten() - k[2]) / k[0], (v.flatten() - k[3]) / k[1]
        return torch.stack([x, y, torch.ones_like(x)], 1)

    def sweep(self, own: Tensor, other: Tensor, k: Tensor, pose: Tensor) -> Tensor:
        """(1,D,h,w): how alike features (1,C,h,w) are at each candidate depth. pose (4,4): own camera to the other."""
        channels, height, width = own.shape[1:]
        points = (self.rays(k, width, height) @ pose[:3, :3].T)[None] / self.candidates[:, None, None] + pose[:3, 3]
        z = points[..., 2].clamp(min=NEAREST)
        x, y = points[..., 0] / z * k[0] + k[2], points[..., 1] / z * k[1] + k[3]
        grid = (torch.stack([x, y], -1) * 2 - 1).reshape(1, -1, width, 2)
        seen = F.grid_sample(other, grid, align_corners=False, padding_mode="zeros")
        alike = (seen.reshape(channels, len(self.candidates), -1) * own.reshape(channels, 1, -1)).sum(0)
        return (alike / channels**0.5).reshape(1, -1, height, width)

    def costs(self, coarse: Tensor, k: Tensor, pose: Tensor) -> Tensor:
        """(2,D,h,w): the sweep of each image against the other."""
        centerd = coarse - coarse.mean(1, keepdim=True)
        even = centerd / (centerd.square().mean(1, keepdim=True) + EPSILON).sqrt()
        poses = (pose, torch.linalg.inv(pose))
        return torch.cat([self.sweep(even[i : i + 1], even[1 - i :][:1], k, poses[i]) for i in range(2)])

    def forward(self, images: Tensor, k: Tensor, pose: Tensor | None) -> Made:
        """images (V,3,H,W); pose (4,4): first camera to the second, None with one image."""
        fine, coarse = self.encode(images)
        cost = None if pose is None else self.costs(coarse, k, pose)
        x = coarse if cost is None else torch.cat([cost, coarse], 1)
        for index, layer in enumerate(self.depth):
            x = layer(F.relu(x) if index else x)
        logits = x if cost is None else x + cost
        guess = torch.einsum("bdhw,d->bhw", logits.softmax(1), self.candidates)[:, None]
        large, small = (F.interpolate(v, scale_factor=REDUCTION, mode="bilinear") for v in (guess, coarse))
        x = torch.cat([small, fine, images, large], 1)
        for index, layer in enumerate(self.head):
            x = layer(F.relu(x) if index else x)
        inverse = (large * torch.exp(REFINEMENT * torch.tanh(x[:, :1]))).clamp(1 / self.shape.far, 1 / self.shape.near)
        placed = [self.place(images[i], x[i], inverse[i], k) for i in range(len(images))]
        return Made(placed[0] if pose is None else joined(*placed, pose), x[:, 1:2], inverse, guess)

    def place(self, image: Tensor, x: Tensor, inverse: Tensor, k: Tensor) -> Splats:
        """One image's Gaussians in the axes of its own camera."""
        _, opacity, size, turn, tint = x.flatten(1).T.split(HEAD, 1)
        depth = 1 / inverse.flatten()[:, None]
        scales = (torch.sigmoid(size) * (LARGEST - SMALLEST) + SMALLEST) * depth / (k[0] * self.shape.width)
        upright = turn + torch.tensor([1.0, 0, 0, 0], device=turn.device)
        colors = (image.flatten(1).T + 0.5 * torch.tanh(tint)).clamp(0, 1)
        positions = self.rays(k, self.shape.width, self.shape.height) * depth
        return Splats(positions, covariances(scales, upright), colors, torch.sigmoid(opacity[:, 0]))

    def save(self, folder: Path) -> None:
        """config.json and model.pth."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "config.json").write_text(json.dumps(vars(self.shape)))
        state = {name: value.cpu() for name, value in self.state_dict().items() if name != "candidates"}
        torch.save(state, folder / "model.pth")


def joined(first: Splats, second: Splats, pose: Tensor) -> Splats:
    """Both images' Gaussians in the axes of the first camera."""
    back = torch.linalg.inv(pose)
    turn = back[:3, :3]
    return Splats(
        torch.cat([first.positions, second.positions @ turn.T + back[:3, 3]]),
        torch.cat([first.covariances, turn @ second.covariances @ turn.T]),
        torch.cat([first.colors, second.colors]),
        torch.cat([first.opacities, second.opacities]),
    )


def shares(intrinsics: Tensor, width: int, height: int) -> Tensor:
    """fx, fy, cx, cy as fractions of width and height."""
    k = intrinsics
    return torch.stack([k[0, 0] / width, k[1, 1] / height, k[0, 2] / width, k[1, 2] / height])


def make(model: Generator, shot: Shot) -> Made:
    """Gaussians of a shot's given images."""
    height, width = shot.pictures.shape[2:]
    count = model.shape.views
    pose = shot.camera(1).view if count == 2 else None
    return model(shot.pictures[:count, :3], shares(shot.intrinsics, width, height), pose)


def known_loss(model: Generator, made: Made, shot: Shot) -> tuple[Tensor, Tensor]:
    """How far depths are from the scene's, and opacities from the coverage of their own pixel. Logits, not opacities: a
    sigmoid that has come to its end passes nothing on."""
    coverage = shot.pictures[: model.shape.views, 3:]
    solid = (coverage > SOLID).float()
    wanted = solid / shot.depths.clamp(min=NEAR)
    span = 1 / model.shape.near - 1 / model.shape.far

    def far_off(found: Tensor, true: Tensor, there: Tensor) -> Tensor:
        return ((found - true).abs() * there).sum() / there.sum().clamp(min=1) / span

    small = F.avg_pool2d(solid, REDUCTION)
    whole = (small > 0.99).float()
    coarse = far_off(made.coarse_inverse, F.avg_pool2d(wanted, REDUCTION), whole)
    depth = coarse + far_off(made.inverse, wanted, solid)
    return depth, F.binary_cross_entropy_with_logits(made.logits, coverage)


def loss_of_shot(model: Generator, shot: Shot, progress: float) -> Tensor:
    """Loss of images, and of known depths and opacities, whose weight decreases with time."""
    made = make(model, shot)
    depth, coverage = known_loss(model, made, shot)
    late = min(max((progress - BEFORE_DRAWING) / (1 - BEFORE_DRAWING), 0), 1)
    weights = [first * (last / first) ** late for first, last in (DEPTH_WEIGHT, COVERAGE_WEIGHT)]
    loss = weights[0] * depth + weights[1] * coverage
    if progress < BEFORE_DRAWING:
        return loss
    # A given image is drawn, too: in it every Gaussian is at its pixel for any depth.
    drawn = [0, *range(model.shape.views, len(shot.pictures))]
    found = pictures(made.splats, [shot.camera(i) for i in drawn])
    return loss + torch.stack([loss_of(f, shot.pictures[i]) for f, i in zip(found, drawn, strict=True)]).mean()


def train(
    shots: Sequence[Shot], schedule: Schedule, number: int, at_once: int = 1, jitter: bool = True, **sizes: int
) -> Generator:
    """The network. `at_once`: shots to a step. `jitter`: turn channels about and change brightness, so that few scenes
    stand for more."""
    rng = seed(number)
    height, width = shots[0].pictures.shape[2:]
    depths = {"depths": sizes.pop("depths")} if "depths" in sizes else {}
    model = Generator(Shape(width, height, len(shots[0].depths), NEAR, FAR, **depths), **sizes)
    model = model.to(shots[0].pictures.device)
    optimizer = torch.optim.Adam(model.parameters(), lr=RATE)
    for step, progress in enumerate(schedule):
        chosen = [shots[int(i)].unpacked() for i in rng.integers(len(shots), size=at_once)]
        chosen = [tinted(shot, rng) for shot in chosen] if jitter else chosen
        optimizer.zero_grad(set_to_none=True)
        optimizer.param_groups[0]["lr"] = rate_at(progress)
        total = 0.0
        for shot in chosen:
            loss = loss_of_shot(model, shot, progress) / at_once
            loss.backward()
            total += loss.detach()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
        if step % 250 == 0:
            print(f"step {step}, {progress:.0%}: loss {float(total):.4f}", flush=True)
    return model


def rate_at(progress: float) -> float:
    """Adam's rate: up, and down along a cosine."""
    wave = 0.5 + 0.5 * math.cos(math.pi * progress)
    return RATE * min(1.0, (progress + 1e-3) / WARM_UP) * (LAST_RATE + (1 - LAST_RATE) * wave)


def tinted(shot: Shot, rng: np.random.Generator) -> Shot:
    """Channels in another order, each a little brighter or darker."""
    order = [*rng.permutation(3).tolist(), 3]
    gains = torch.tensor([*rng.uniform(0.7, 1.2, 3), 1.0], dtype=torch.float32, device=shot.pictures.device)
    recolored = (shot.pictures[:, order] * gains[:, None, None]).clamp(max=1)
    return Shot(recolored, shot.depths, shot.views, shot.intrinsics)


@torch.no_grad()
def measure(model: Generator, shots: Sequence[Shot]) -> dict[str, float]:
    """Means over the middle views of shots. PSNR on black, inside the outline: of the drawn images, and of the nearest
    given image unchanged, which is the best without a generator; depth: the mean relative error.
    """
    rows = []
    for each in shots:
        shot, middle = each.unpacked(), model.shape.views
        made = make(model, shot)
        found, wanted = pictures(made.splats, [shot.camera(middle)])[0, :3], shot.pictures[middle, :3]
        inside = shot.pictures[middle, 3] > SOLID
        solid = shot.pictures[:middle, 3:] > SOLID
        off = (1 / made.inverse - shot.depths).abs() / shot.depths.clamp(min=NEAR)
        rows.append(
            {
                "psnr": psnr(found, wanted),
                "outline_psnr": psnr(found[:, inside], wanted[:, inside]),
                "given_picture_psnr": psnr(shot.pictures[0, :3], wanted),
                "depth_error": float(off[solid].mean()),
                "opacity": float(torch.sigmoid(made.logits)[solid].mean()),
            }
        )
    return {key: round(float(np.mean([row[key] for row in rows])), 4) for key in rows[0]}


@torch.no_grad()
def show(path: Path, model: Generator, shots: Sequence[Shot]) -> None:
    """Middle views as references and as drawn; with cameras, given images first, for example_view.py."""
    full = [shot.unpacked() for shot in shots]
    middle = model.shape.views
    drawn = [pictures(make(model, shot).splats, [shot.camera(middle)])[0] for shot in full]
    sheet(path.with_suffix(".png"), [shot.pictures[middle] for shot in full], drawn)
    rows = [(shot.pictures[i], shot.camera(i).view, shot.intrinsics) for shot in full for i in range(middle + 1)]
    Views(*(torch.stack(column) for column in zip(*rows, strict=True)), {}).save(path.with_suffix(".npz"))


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--unseen", type=Path, help="a scene to measure on, and not to train on")
    parser.add_argument("--count", type=int, default=2, choices=(1, 2), help="number of input images")
    parser.add_argument("--size", type=int, default=256, help="pixels of their sides, a multiple of 4")
    parser.add_argument("--shots", type=int, default=3000, help="how many are drawn to learn from")
    parser.add_argument("--at-once", type=int, default=4, help="shots to a step")
    add_schedule(parser, 20_000)
    given = parser.parse_args(argv)
    record, schedule = Record(given), Schedule(given.steps, given.seconds)
    rng = np.random.default_rng(given.seed)

    def drawn(paths: Sequence[Path], count: int, targets: int) -> list[Shot]:
        scenes = [scene_of(path, device()) for path in paths]
        return draw_shots(scenes, count, given.size, given.count, targets, rng)

    held = drawn(given.scenes, HELD_OUT * len(given.scenes), 1)
    unseen = drawn([given.unseen], HELD_OUT, 1) if given.unseen else []
    shots = drawn(given.scenes, given.shots, TARGETS)
    print(f"{len(shots)} shots of {len(shots[0].pictures)} images", flush=True)
    model = train(shots, schedule, given.seed, given.at_once)
    model.save(given.out)
    known, unknown = measure(model, held), measure(model, unseen) if unseen else {}
    record.write(
        held_out_psnr=known["psnr"], held_out=known, unseen=unknown, steps=schedule.done, shape=vars(model.shape)
    )
    show(given.out / "held-out", model, [*held[: len(given.scenes)], *unseen[:3]])


if __name__ == "__main__":
    main()
