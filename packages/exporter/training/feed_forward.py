"""Trains a feed-forward generator: python feed_forward.py OUT VIEWS [VIEWS ...] [--unseen VIEWS]

Each VIEWS is one scene: pictures (.npz), all of one size (multiples of 4), or a .ply that is drawn from all round.
`--count` is how many pictures go in: 1 or 2. A step takes neighbouring views, makes Gaussians of one (or two), and
draws them for others. Every eighth view is never drawn while training; scenes given as `--unseen` are only measured.
OUT is the folder that `gaussian-export feed-forward` reads.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from common import HELD_OUT_EVERY, Pace, Record, Views, add_pace, decayed, device, load_views, seed, split
from losses import loss_of, psnr
from make_views import drawn, scene_of
from rasterizer import Camera, Splats, covariances, pictures
from show import sheet

REDUCTION = 4
HEAD = (1, 1, 3, 4, 3)
REFINEMENT = 0.2
SMALLEST, LARGEST = 0.2, 4.2
NEAREST = 1e-3
# Where opacity and size begin, before their sigmoids.
OPAQUE, SLIM = 1.0, -1.5
# Share of the training during which rates rise.
WARM_UP = 0.03
# How much opacities count besides the pictures.
COVERAGE_WEIGHT = 0.1
NEIGHBOURS = 5
# How many pictures are drawn from what one step made.
TARGETS = 3
# How a scene is looked at: from so many sides, in pictures of this size.
ORBIT, ORBIT_SIZE = 96, 256


@dataclass
class Shape:
    """What config.json holds."""

    width: int
    height: int
    views: int
    near: float
    far: float
    depths: int = 32


class Generator(nn.Module):
    """The network of gaussian_exporter.families.feed_forward, with the same names."""

    def __init__(self, shape: Shape, fine: int = 32, coarse: int = 64):
        """`fine` and `coarse`: channels of features, multiples of 4."""
        super().__init__()
        self.shape = shape
        sweep = coarse + (shape.depths if shape.views == 2 else 0)
        sizes = [(3, fine), (fine, coarse), (coarse, coarse), (coarse, coarse)]
        strides = (1, 2, 2, 1)
        self.encoder = nn.ModuleList(nn.Conv2d(i, o, 3, s, 1) for (i, o), s in zip(sizes, strides, strict=True))
        self.depth = nn.ModuleList([nn.Conv2d(sweep, coarse, 3, 1, 1), nn.Conv2d(coarse, shape.depths, 3, 1, 1)])
        sizes = [(coarse + fine + 4, fine), (fine, fine), (fine, sum(HEAD))]
        self.head = nn.ModuleList(nn.Conv2d(i, o, 3, 1, 1) for i, o in sizes)
        # To begin with nearly opaque and a pixel wide: what starts out transparent learns to stay so.
        with torch.no_grad():
            self.head[-1].bias[1] = OPAQUE
            self.head[-1].bias[2:5] = SLIM
        self.register_buffer("candidates", torch.linspace(1 / shape.near, 1 / shape.far, shape.depths))

    def encode(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Fine and coarse features of a picture (1,3,H,W)."""
        x, fine = image * 2 - 1, None
        for layer in self.encoder:
            x = F.relu(layer(x))
            fine = x if fine is None else fine
        return (x if fine is None else fine), x

    def rays(self, k: Tensor, width: int, height: int) -> Tensor:
        """Directions with z = 1 through pixel centres (H*W,3); k: fx, fy, cx, cy as shares of width and height."""
        v, u = torch.meshgrid(
            (torch.arange(height, device=k.device) + 0.5) / height,
            (torch.arange(width, device=k.device) + 0.5) / width,
            indexing="ij",
        )
        x, y = (u.flatten() - k[2]) / k[0], (v.flatten() - k[3]) / k[1]
        return torch.stack([x, y, torch.ones_like(x)], 1)

    def sweep(self, own: Tensor, other: Tensor, k: Tensor, pose: Tensor) -> Tensor:
        """(1,D,h,w): how alike features are at each candidate depth. pose (4,4): own camera to the other."""
        channels, height, width = own.shape[1:]
        points = (self.rays(k, width, height) @ pose[:3, :3].T)[None] / self.candidates[:, None, None] + pose[:3, 3]
        z = points[..., 2].clamp(min=NEAREST)
        x, y = points[..., 0] / z * k[0] + k[2], points[..., 1] / z * k[1] + k[3]
        grid = (torch.stack([x, y], -1) * 2 - 1).reshape(1, -1, width, 2)
        seen = F.grid_sample(other, grid, align_corners=False, padding_mode="zeros")
        alike = (seen.reshape(channels, len(self.candidates), -1) * own.reshape(channels, 1, -1)).sum(0)
        return (alike / channels**0.5).reshape(1, -1, height, width)

    def place(self, image: Tensor, encoded: tuple[Tensor, Tensor], cost: Tensor | None, k: Tensor) -> Splats:
        """One picture's Gaussians in its own camera's frame."""
        fine, coarse = encoded
        x = coarse if cost is None else torch.cat([cost, coarse], 1)
        logits = self.depth[1](F.relu(self.depth[0](x))) + (0 if cost is None else cost)
        guess = torch.einsum("bdhw,d->bhw", logits.softmax(1), self.candidates)[:, None]

        def enlarged(values: Tensor) -> Tensor:
            return F.interpolate(values, scale_factor=REDUCTION, mode="bilinear", align_corners=False)

        guess = enlarged(guess)
        x = torch.cat([enlarged(coarse), fine, image, guess], 1)
        for index, layer in enumerate(self.head):
            x = layer(F.relu(x) if index else x)
        nearer, opacity, size, turn, tint = x[0].flatten(1).T.split(HEAD, 1)
        inverse = guess.flatten()[:, None] * torch.exp(REFINEMENT * torch.tanh(nearer))
        depth = 1 / inverse.clamp(1 / self.shape.far, 1 / self.shape.near)
        scales = (torch.sigmoid(size) * (LARGEST - SMALLEST) + SMALLEST) * depth / (k[0] * self.shape.width)
        upright = turn + torch.tensor([1.0, 0, 0, 0], device=turn.device)
        colors = (image[0].flatten(1).T + 0.5 * torch.tanh(tint)).clamp(0, 1)
        positions = self.rays(k, self.shape.width, self.shape.height) * depth
        return Splats(positions, covariances(scales, upright), colors, torch.sigmoid(opacity[:, 0]))

    def forward(self, images: list[Tensor], k: Tensor, pose: Tensor | None) -> Splats:
        """Gaussians of all pictures in the first camera's frame; pose (4,4): first camera to the second."""
        encoded = [self.encode(image) for image in images]
        if len(images) == 1 or pose is None:
            return self.place(images[0], encoded[0], None, k)
        back = torch.linalg.inv(pose)
        costs = [self.sweep(encoded[i][1], encoded[1 - i][1], k, p) for i, p in enumerate((pose, back))]
        first, second = (self.place(images[i], encoded[i], costs[i], k) for i in range(2))
        turn = back[:3, :3]
        return Splats(
            torch.cat([first.positions, second.positions @ turn.T + back[:3, 3]]),
            torch.cat([first.covariances, turn @ second.covariances @ turn.T]),
            torch.cat([first.colors, second.colors]),
            torch.cat([first.opacities, second.opacities]),
        )

    def save(self, folder: Path) -> None:
        """config.json and model.pth."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "config.json").write_text(json.dumps(vars(self.shape)))
        state = {name: value.cpu() for name, value in self.state_dict().items() if name != "candidates"}
        torch.save(state, folder / "model.pth")


def load_scene(path: Path) -> Views:
    """Pictures as they are, or of a scene's file."""
    if path.suffix != ".ply":
        return load_views(path, device())
    return drawn(scene_of(path, device()), ORBIT, ORBIT_SIZE, "orbit")


def shares(intrinsics: Tensor, width: int, height: int) -> Tensor:
    """fx, fy, cx, cy as shares of width and height."""
    k = intrinsics
    return torch.stack([k[0, 0] / width, k[1, 1] / height, k[0, 2] / width, k[1, 2] / height])


@dataclass
class Attempt:
    """Targets (T,4,H,W) as drawn and as they are; opacities (N) and how covered the pixel of each Gaussian is (N)."""

    found: Tensor
    wanted: Tensor
    opacities: Tensor
    coverage: Tensor

    def loss(self) -> Tensor:
        """Of the pictures, and of opacities that are not what their own pixel is: a sigmoid that has come to its end
        passes no other gradient on."""
        drawn = torch.stack([loss_of(*both) for both in zip(self.found, self.wanted, strict=True)]).mean()
        opacities = self.opacities.clamp(1e-6, 1 - 1e-6)
        return drawn + COVERAGE_WEIGHT * F.binary_cross_entropy(opacities, self.coverage)


FIELDS = ("pictures", "views", "intrinsics")
Recolour = Callable[[Tensor], Tensor]


def untouched(pictures: Tensor) -> Tensor:
    """Pictures as they are."""
    return pictures


def attempt(
    model: Generator, views: Views, given: list[int], targets: list[int], recolour: Recolour = untouched
) -> Attempt:
    """The targets as drawn from the given views, and as they are; both recoloured."""
    _, _, height, width = views.pictures.shape
    images = [recolour(views.pictures[i : i + 1])[:, :3] for i in given]
    world = torch.linalg.inv(views.views[given[0]])
    pose = views.views[given[1]] @ world if len(given) == 2 else None
    splats = model(images, shares(views.intrinsics[given[0]], width, height), pose)
    cameras = [Camera(views.views[t] @ world, views.intrinsics[t], width, height) for t in targets]
    coverage = views.pictures[given, 3].flatten()
    return Attempt(pictures(splats, cameras), recolour(views.pictures[targets]), splats.opacities, coverage)


def neighbours(views: Views, target: int) -> list[int]:
    """The nearest other views by the cameras' places, nearest first."""
    eyes = torch.stack([views.camera(i).position for i in range(len(views.pictures))])
    order = torch.argsort((eyes - eyes[target]).norm(dim=1)).tolist()
    return [i for i in order if i != target][:NEIGHBOURS]


def pair_around(views: Views, target: int, count: int) -> list[int]:
    """The views that a target is measured from: the nearest, and the near one most nearly on its other side."""
    near = neighbours(views, target)
    eyes = torch.stack([views.camera(i).position for i in [target, *near]])
    away = torch.nn.functional.normalize(eyes[1:] - eyes[0], dim=1)
    opposite = int((away[1:] @ away[0]).argmin()) + 1
    return [near[0], near[opposite]][:count]


def depth_range(scenes: list[Views]) -> tuple[float, float]:
    """Near and far: cameras look at something around the origin."""
    distances = torch.cat(
        [torch.stack([s.camera(i).position for i in range(len(s.pictures))]).norm(dim=1) for s in scenes]
    )
    return float(distances.min()) * 0.62, float(distances.max()) * 1.5


def train(
    scenes: list[Views], pace: Pace, views: int, number: int, jitter: bool = True, **sizes: int
) -> tuple[Generator, float]:
    """The network, and its PSNR on targets it never drew. `jitter`: turn channels about and change brightness, so that
    few scenes stand for more."""
    rng = seed(number)
    height, width = scenes[0].pictures.shape[2:]
    depths = {"depths": sizes.pop("depths")} if "depths" in sizes else {}
    model = Generator(Shape(width, height, views, *depth_range(scenes), **depths), **sizes)
    model = model.to(scenes[0].pictures.device)
    optimizer = torch.optim.Adam(model.parameters(), lr=6e-4)
    near = [[neighbours(scene, i) for i in range(len(scene.pictures))] for scene in scenes]
    for step, progress in enumerate(pace):
        which = int(rng.integers(len(scenes)))
        scene = scenes[which]
        trained, held = split(len(scene.pictures))
        target = int(rng.choice(trained))
        given = rng.permutation(near[which][target])[:views].tolist()
        # A given view among the targets: Gaussians of its own pixels are right there at any depth, so colours and
        # opacities are learned at once, and depths from the others.
        others = [given[0], *[i for i in near[which][target] if i not in given and i not in held]]
        recolour = random_tint(rng) if jitter else untouched
        loss = attempt(model, scene, given, [target, *others][:TARGETS], recolour).loss()
        optimizer.zero_grad(set_to_none=True)
        decayed([optimizer], progress, 0.03)
        optimizer.param_groups[0]["lr"] *= min(1.0, (progress + 1e-3) / WARM_UP)
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
        if step % 1000 == 0:
            print(f"step {step}, {progress:.0%}: loss {loss.item():.4f}", flush=True)
    return model, float(np.mean([held_out(model, scene) for scene in scenes]))


def random_tint(rng: np.random.Generator) -> Recolour:
    """Channels in another order, each a little brighter or darker."""
    order, gain = [*rng.permutation(3).tolist(), 3], [*rng.uniform(0.7, 1.2, 3).tolist(), 1.0]

    def recolour(pictures: Tensor) -> Tensor:
        gains = torch.tensor(gain, device=pictures.device)
        return (pictures[:, order] * gains[:, None, None]).clamp(max=1)

    return recolour


@torch.no_grad()
def held_out(model: Generator, scene: Views) -> float:
    """Mean PSNR of held-out targets, on black."""
    scores = []
    for target in split(len(scene.pictures))[1]:
        tried = attempt(model, scene, pair_around(scene, target, model.shape.views), [target])
        scores.append(psnr(tried.found[0, :3], tried.wanted[0, :3]))
    return float(np.mean(scores))


@torch.no_grad()
def show(path: Path, model: Generator, scenes: list[Views]) -> None:
    """A held-out target of each scene, and, with its pictures and cameras, the two views that it was drawn from."""
    target = HELD_OUT_EVERY // 2
    tried = [attempt(model, s, pair_around(s, target, model.shape.views), [target]) for s in scenes]
    sheet(path.with_suffix(".png"), [t.wanted[0] for t in tried], [t.found[0] for t in tried])
    rows = [[*pair_around(s, target, model.shape.views), target] for s in scenes]
    picked = [torch.cat([getattr(s, name)[r] for s, r in zip(scenes, rows, strict=True)]) for name in FIELDS]
    Views(*picked, {}).save(path.with_suffix(".npz"))


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("views", type=Path, nargs="+")
    parser.add_argument("--unseen", type=Path, help="a scene to measure on, and not to train on")
    parser.add_argument("--count", type=int, default=2, choices=(1, 2))
    add_pace(parser, 20_000)
    given = parser.parse_args(argv)
    record, pace = Record(given), Pace(given.steps, given.seconds)
    scenes = [load_scene(path) for path in given.views]
    print(f"{sum(len(scene.pictures) for scene in scenes)} pictures", flush=True)
    model, score = train(scenes, pace, given.count, given.seed)
    model.save(given.out)
    unseen = [load_scene(given.unseen)] if given.unseen else []
    unknown = [round(held_out(model, scene), 3) for scene in unseen]
    record.write(held_out_psnr=score, unseen_scene_psnr=unknown, steps=pace.done, shape=vars(model.shape))
    show(given.out / "held-out", model, [*scenes, *unseen])


if __name__ == "__main__":
    main()
