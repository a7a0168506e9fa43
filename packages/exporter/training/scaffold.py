"""Trains a Scaffold-GS: python scaffold.py VIEWS.npz POINTS.npy OUT [--steps 15000] [--count 16000]

POINTS (N,3) lie on or near the surface; anchors are the voxels that contain them. In the first half of the
training, invisible anchors are dropped and new ones are added at Gaussians with large gradients, up to `count`. OUT
is the input of `gaussian-export scaffold`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from anchors import Watch, free_cells, replace_rows
from common import Optimizers, Record, Schedule, Views, device, fit, held_out_psnr, load_views, options, seed, split
from photographs import Exposures, photograph, photograph_psnr
from ply import write_ply
from rasterizer import Splats, covariances, picture
from show import held_out_sheet

FEATURES = 32
OFFSETS = 5
ROWS = ["anchors", "features", "offsets", "log_scales"]
# Growth: between these fractions of the training, once in this number of steps.
GROW_FROM, GROW_UNTIL, GROW_EVERY = 0.03, 0.5, 100
MIN_OPACITY = 0.005
VOLUME_WEIGHT = 0.01


class Scaffold(nn.Module):
    """Anchors, and the three networks that turn them into Gaussians for a camera."""

    def __init__(self, anchors: Tensor, voxel: float, features: int = FEATURES, offsets: int = OFFSETS):
        """anchors (M,3), `voxel` apart."""
        super().__init__()
        count = len(anchors)
        self.anchors = nn.Parameter(anchors)
        self.features = nn.Parameter(torch.zeros(count, features))
        self.offsets = nn.Parameter(torch.randn(count, offsets, 3) * 0.5)
        self.log_scales = nn.Parameter(torch.full((count, 6), float(np.log(voxel))))
        self.opacity_mlp = self.network(features, offsets, nn.Tanh())
        self.cov_mlp = self.network(features, 7 * offsets, nn.Identity())
        self.color_mlp = self.network(features, 3 * offsets, nn.Sigmoid())

    @staticmethod
    def network(features: int, outputs: int, last: nn.Module) -> nn.Sequential:
        """Two layers over the feature and the direction."""
        return nn.Sequential(nn.Linear(features + 3, features), nn.ReLU(), nn.Linear(features, outputs), last)

    def forward(self, eye: Tensor) -> Splats:
        """All Gaussians, seen from `eye` (3); dead ones have opacity 0."""
        x = torch.cat([self.features, nn.functional.normalize(self.anchors - eye, dim=1)], 1)
        count, k = self.offsets.shape[:2]
        scales = torch.exp(self.log_scales)[:, None]
        shape = self.cov_mlp(x).reshape(count, k, 7)
        positions = self.anchors[:, None] + self.offsets * scales[..., :3]
        full = covariances(torch.sigmoid(shape[..., :3]) * scales[..., 3:], shape[..., 3:])
        return Splats(
            positions.reshape(-1, 3),
            full.reshape(-1, 3, 3),
            self.color_mlp(x).reshape(-1, 3),
            torch.relu(self.opacity_mlp(x)).reshape(-1),
        )

    def save(self, folder: Path) -> None:
        """In the layout of Scaffold-GS."""
        inner = folder / "point_cloud" / "iteration_1"
        groups = {
            "x,y,z": self.anchors,
            "f_offset_": self.offsets.transpose(1, 2).flatten(1),
            "f_anchor_feat_": self.features,
            "opacity": torch.zeros(len(self.anchors), 1),
            "scale_": self.log_scales,
        }
        write_ply(inner / "point_cloud.ply", groups)
        networks = {name: getattr(self, name).cpu().state_dict() for name in ("opacity_mlp", "cov_mlp", "color_mlp")}
        torch.save(networks, inner / "checkpoints.pth")
        k, features = self.offsets.shape[1], self.features.shape[1]
        (folder / "cfg_args").write_text(f"Namespace(feat_dim={features}, n_offsets={k}, appearance_dim=0)")


def voxels(points: np.ndarray, count: int) -> tuple[Tensor, float]:
    """Centers of occupied voxels (M,3), M at most count, and how wide the voxels are."""
    width = float(np.ptp(points, 0).max()) / 512
    while len(cells := np.unique(np.round(points / width), axis=0)) > count:
        width *= 1.1
    return torch.tensor(cells * width, dtype=torch.float32), width


def optimizers_of(model: Scaffold, exposures: Exposures) -> list[torch.optim.Optimizer]:
    """Adam, with rates of the paper's kind; all decay."""
    groups = [
        {"params": [model.anchors], "lr": 1e-5},
        {"params": [model.offsets], "lr": 1e-2, "decay": 0.01},
        {"params": [model.features], "lr": 7.5e-3, "decay": 0.2},
        {"params": [model.log_scales], "lr": 7e-3, "decay": 0.2},
        {"params": list(model.opacity_mlp.parameters()), "lr": 2e-3, "decay": 0.01},
        {"params": list(model.cov_mlp.parameters()), "lr": 4e-3, "decay": 0.1},
        {"params": list(model.color_mlp.parameters()), "lr": 8e-3, "decay": 0.01},
    ]
    return [torch.optim.Adam(groups, eps=1e-15), torch.optim.Adam(exposures.parameters(), lr=2e-3)]


class Growth:
    """Drops anchors that are not seen, makes new ones where Gaussians are pulled most."""

    def __init__(self, model: Scaffold, optimizers: Optimizers, voxel: float, maximum: int):
        """`voxel`: no two new anchors share a voxel this wide."""
        self.model, self.optimizers, self.voxel, self.maximum = model, optimizers, voxel, maximum
        self.watch, self.last = self.fresh(), 0.0

    def fresh(self) -> Watch:
        """Resets the statistics."""
        return Watch(*self.model.offsets.shape[:2], self.model.anchors.device)

    def after(self, splats: Splats, step: int, progress: float) -> None:
        """After each step."""
        if progress > GROW_UNTIL or splats.positions.grad is None:
            return
        self.watch.note(splats.positions.grad, splats.opacities)
        if step % GROW_EVERY == GROW_EVERY - 1 and progress > GROW_FROM:
            self.change(splats, progress)
            self.watch = self.fresh()

    @torch.no_grad()
    def change(self, splats: Splats, progress: float) -> None:
        """One round; the count grows evenly until GROW_UNTIL."""
        model = self.model
        kept = torch.nonzero(self.watch.alive(MIN_OPACITY))[:, 0]
        room = self.maximum - len(kept)
        since, self.last = progress - self.last, progress
        share = since / max(GROW_UNTIL - progress, since)
        wanted = self.watch.wanted()[: 8 * room]
        # Voxels shrink during the training: coarse structure first.
        width = self.voxel * (4 if progress < GROW_UNTIL / 3 else 2 if progress < GROW_UNTIL * 2 / 3 else 1)
        chosen = free_cells(splats.positions.detach()[wanted], model.anchors[kept], width, max(room, 0))
        parents = wanted[chosen[: int(np.ceil(room * share))]]
        owner = torch.div(parents, model.offsets.shape[1], rounding_mode="floor")
        size = torch.full((len(parents), 6), float(np.log(width)), device=parents.device)
        added = {
            "anchors": splats.positions.detach()[parents],
            "features": model.features[owner],
            "offsets": torch.randn(len(parents), *model.offsets.shape[1:], device=parents.device) * 0.3,
            "log_scales": torch.minimum(model.log_scales[owner], size),
        }
        replace_rows(model, ROWS, kept, added, self.optimizers)


def train(
    views: Views, points: np.ndarray, schedule: Schedule, count: int, number: int
) -> tuple[Scaffold, dict[str, float]]:
    """The model, and its PSNR on held-out views."""
    rng = seed(number)
    anchors, width = voxels(points, max(count // 2, 1))
    model = Scaffold(anchors, width).to(views.pictures.device)
    exposures = Exposures(len(views.pictures)).to(views.pictures.device)
    optimizers = optimizers_of(model, exposures)
    growth = Growth(model, optimizers, width / 4, count)
    eyes = [views.camera(i).position for i in range(len(views.pictures))]
    latest: list[Splats] = []

    def loss_at(index: int, progress: float) -> Tensor:
        splats = model(eyes[index])
        splats.positions.retain_grad()
        latest[:] = [splats]
        drawn = exposures.exposed(picture(splats, views.camera(index)), index)
        volume = torch.exp(model.log_scales[:, 3:]).prod(1).mean()
        return photograph(views, index).loss(drawn) + VOLUME_WEIGHT * volume

    def draw(index: int) -> Tensor:
        return picture(model(eyes[index]), views.camera(index))

    trained, _ = split(len(views.pictures))
    fit(
        trained,
        loss_at,
        optimizers,
        schedule,
        rng,
        after=lambda step, progress: growth.after(latest[0], step, progress),
    )
    alive = torch.stack([model(eye).opacities > 1 / 255 for eye in eyes[:8]]).any(0).float().mean().item()
    scores = {"held_out_psnr": photograph_psnr(views, draw), "whole_picture_psnr": held_out_psnr(views, draw)}
    return model, {**scores, "share_ever_visible": round(alive, 3)}


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    given = options(__doc__ or "", 15_000, argv, "views", "points")
    record = Record(given)
    views, points = load_views(given.views, device()), np.load(given.points)
    schedule = Schedule(given.steps, given.seconds)
    model, scores = train(views, points, schedule, given.count or 16_000, given.seed)
    record.write(**scores, steps=schedule.done, anchors=len(model.anchors), gaussians=len(model.anchors) * OFFSETS)
    cameras = [views.camera(i) for i in range(len(views.pictures))]
    held_out_sheet(given.out / "held-out", views, lambda i: picture(model(cameras[i].position), cameras[i]))
    model.save(given.out)


if __name__ == "__main__":
    main()
