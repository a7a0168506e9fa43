"""Trains a 4DGS: python hexplane.py VIEWS.npz POINTS.npy OUT [--steps 15000] [--count 30000]

VIEWS hold `times` in 0..1. The first fifth of the steps finds the resting Gaussians, the rest their motion, too.
Gaussians are neither grown nor pruned. OUT is the folder that `gaussian-export hexplane` reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from common import Record, Schedule, Views, device, fit, held_out_psnr, load_views, options, outline_psnr, seed, split
from losses import loss_of
from ply import write_ply
from rasterizer import Splats, covariances, picture
from show import held_out_sheet

PLANES = list(combinations(range(4), 2))
SH_C0 = 0.28209479177387814
CHANNELS, WIDTH = 16, 64
RESOLUTIONS, TIMES = (32, 64), 25
# Planes are to be smooth, and those of time to change evenly.
SMOOTH_WEIGHT, EVEN_WEIGHT = 2e-4, 2e-3


class Moving(nn.Module):
    """Resting Gaussians, the planes and the heads that move them. Names of parameters are those of 4DGaussians."""

    def __init__(self, positions: Tensor, scale: float):
        """positions (N,3); `scale`: standard deviation to start with, in world units."""
        super().__init__()
        count = len(positions)
        self.positions = nn.Parameter(positions)
        self.log_scales = nn.Parameter(torch.full((count, 3), float(np.log(scale))))
        self.rotations = nn.Parameter(torch.randn(count, 4))
        self.opacity_logits = nn.Parameter(torch.zeros(count, 1))
        self.dc = nn.Parameter(torch.zeros(count, 3))
        reach = positions.abs().max().item() * 1.2
        self.register_buffer("aabb", torch.tensor([[reach] * 3, [-reach] * 3]))
        sizes = [[r, r, r, TIMES] for r in RESOLUTIONS]
        self.grids = nn.ModuleList(nn.ParameterList(self.plane(s[a], s[b], b) for a, b in PLANES) for s in sizes)
        self.feature_out = nn.Sequential(nn.Linear(CHANNELS * len(RESOLUTIONS), WIDTH))
        self.pos_deform, self.scales_deform, self.rotations_deform = (self.head(n) for n in (3, 3, 4))

    @staticmethod
    def plane(across: int, down: int, second: int) -> nn.Parameter:
        """(1,C,down,across): planes with time begin as ones, which change nothing."""
        shape = (1, CHANNELS, down, across)
        return nn.Parameter(torch.ones(shape) if second == 3 else torch.empty(shape).uniform_(0.1, 0.5))

    @staticmethod
    def head(outputs: int) -> nn.Sequential:
        """Begins by moving nothing."""
        last = nn.Linear(WIDTH, outputs)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        return nn.Sequential(nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU(), last)

    def hidden(self, time: Tensor) -> Tensor:
        """Features of the resting positions at a time (1), through the first layer (N,W)."""
        high, low = self.aabb
        at = (self.positions.detach() - high) * (2 / (low - high)) - 1
        at = torch.cat([at, time.expand(len(at), 1)], 1)
        levels = []
        for planes in self.grids:
            product: Tensor | float = 1.0
            for plane, axes in zip(planes, PLANES, strict=True):
                grid = at[:, list(axes)][None, None]
                sampled = nn.functional.grid_sample(plane, grid, align_corners=True, padding_mode="border")
                product = product * sampled[0, :, 0].T
            levels.append(product)
        return self.feature_out(torch.cat(levels, 1))

    def forward(self, time: Tensor | None) -> Splats:
        """The Gaussians at a time (1), or at rest."""
        hidden = None if time is None else self.hidden(time)

        def moved(rest: Tensor, head: nn.Module) -> Tensor:
            return rest if hidden is None else rest + head(hidden)

        full = covariances(
            torch.exp(moved(self.log_scales, self.scales_deform)), moved(self.rotations, self.rotations_deform)
        )
        colors = torch.relu(self.dc * SH_C0 + 0.5)
        opacities = torch.sigmoid(self.opacity_logits[:, 0])
        return Splats(moved(self.positions, self.pos_deform), full, colors, opacities)

    def roughness(self) -> Tensor:
        """Regularization of planes: steps between neighbors, and, along time, changes of steps."""
        total = torch.zeros((), device=self.positions.device)
        for planes in self.grids:
            for plane, (_, second) in zip(planes, PLANES, strict=True):
                across, down = plane.diff(dim=3), plane.diff(dim=2)
                total = total + SMOOTH_WEIGHT * across.square().mean()
                if second == 3:
                    total = total + EVEN_WEIGHT * down.diff(dim=2).square().mean()
                else:
                    total = total + SMOOTH_WEIGHT * down.square().mean()
        return total

    def save(self, folder: Path) -> None:
        """In the layout of 4DGaussians."""
        inner = folder / "point_cloud" / "iteration_1"
        groups = {
            "x,y,z": self.positions,
            "f_dc_": self.dc,
            "opacity": self.opacity_logits,
            "scale_": self.log_scales,
            "rot_": self.rotations,
        }
        write_ply(inner / "point_cloud.ply", groups)
        state = {"deformation_net.grid.aabb": self.aabb}
        for name, value in self.state_dict().items():
            if name.startswith("grids."):
                state[f"deformation_net.grid.{name}"] = value
            elif "deform" in name or name.startswith("feature_out"):
                state[f"deformation_net.{name}"] = value
        torch.save({name: value.cpu() for name, value in state.items()}, inner / "deformation.pth")
        (folder / "cfg_args").write_text("Namespace(no_do=True, no_dshs=True, sh_degree=0)")


def start_points(points: np.ndarray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """`count` places near the points, more than one at a point if there are too few, and how far apart they are."""
    few = points[rng.permutation(len(points))[:2000]]
    gaps = np.linalg.norm(few[:, None] - few[None], axis=2) + 1e9 * np.eye(len(few))
    spacing = float(np.median(gaps.min(1))) * (len(few) / max(len(points), 1)) ** 0.5
    chosen = points[rng.choice(len(points), count, replace=count > len(points))]
    return chosen + rng.normal(size=chosen.shape) * spacing * 0.3, spacing


def train(
    views: Views, points: np.ndarray, schedule: Schedule, count: int, number: int
) -> tuple[Moving, dict[str, float]]:
    """The model, and its PSNR on held-out views, each of which is also a time of its own."""
    rng = seed(number)
    start, spacing = start_points(points, count, rng)
    model = Moving(torch.tensor(start, dtype=torch.float32), spacing).to(views.pictures.device)
    resting = [
        {"params": [model.positions], "lr": 1.6e-4, "decay": 0.02},
        {"params": [model.log_scales], "lr": 5e-3, "decay": 0.2},
        {"params": [model.rotations], "lr": 2e-3, "decay": 0.2},
        {"params": [model.opacity_logits], "lr": 3e-2, "decay": 0.2},
        {"params": [model.dc], "lr": 1e-2, "decay": 0.1},
    ]
    heads = [p for name, p in model.named_parameters() if "deform" in name or name.startswith("feature_out")]
    moving = [
        {"params": list(model.grids.parameters()), "lr": 1e-2, "decay": 0.05},
        {"params": heads, "lr": 1e-3, "decay": 0.05},
    ]
    times = views.extra["times"][:, None]
    trained, _ = split(len(views.pictures))
    still = torch.optim.Adam(resting, eps=1e-15)
    optimizers = [still, torch.optim.Adam(moving, eps=1e-15)]

    def rest_loss(index: int, progress: float) -> Tensor:
        return loss_of(picture(model(None), views.camera(index)), views.pictures[index])

    def draw(index: int) -> Tensor:
        return picture(model(times[index]), views.camera(index))

    first = schedule.part(0.08)
    fit(trained, rest_loss, [still], first, rng, decay=1.0)
    rest = Schedule(max(schedule.steps - first.done, 1), None if schedule.seconds is None else schedule.seconds * 0.92)
    fit(trained, lambda i, _: loss_of(draw(i), views.pictures[i]) + model.roughness(), optimizers, rest, rng)
    schedule.done = first.done + rest.done
    return model, {"held_out_psnr": held_out_psnr(views, draw), "outline_psnr": outline_psnr(views, draw)}


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    given = options(__doc__ or "", 15_000, argv, "views", "points")
    record = Record(given)
    views, points = load_views(given.views, device()), np.load(given.points)
    schedule = Schedule(given.steps, given.seconds)
    model, scores = train(views, points, schedule, given.count or 30_000, given.seed)
    model.save(given.out)
    record.write(**scores, steps=schedule.done, gaussians=len(model.positions))
    times = views.extra["times"][:, None]
    held_out_sheet(given.out / "held-out", views, lambda i: picture(model(times[i]), views.camera(i)))


if __name__ == "__main__":
    main()
