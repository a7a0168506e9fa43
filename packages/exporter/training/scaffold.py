"""Trains a Scaffold-GS: python scaffold.py VIEWS.npz POINTS.npy OUT [--steps 15000] [--count 20000]

POINTS (N,3) lie on or near the surface; anchors are the voxels they fall into, `count` of them at most. Anchors are
neither grown nor pruned. OUT is the folder that `gaussian-export scaffold` reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from common import Record, Views, device, fit, held_out_psnr, load_views, options, seed
from ply import write_ply
from rasterizer import Splats, covariances

FEATURES = 32
OFFSETS = 5


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
        networks = {name: getattr(self, name).state_dict() for name in ("opacity_mlp", "cov_mlp", "color_mlp")}
        torch.save(networks, inner / "checkpoints.pth")
        k, features = self.offsets.shape[1], self.features.shape[1]
        (folder / "cfg_args").write_text(f"Namespace(feat_dim={features}, n_offsets={k}, appearance_dim=0)")


def voxels(points: np.ndarray, count: int) -> tuple[Tensor, float]:
    """Centres of occupied voxels (M,3), M at most count, and how wide the voxels are."""
    width = float(np.ptp(points, 0).max()) / 512
    while len(cells := np.unique(np.round(points / width), axis=0)) > count:
        width *= 1.1
    return torch.tensor(cells * width, dtype=torch.float32), width


def train(views: Views, points: np.ndarray, steps: int, count: int, number: int) -> tuple[Scaffold, float]:
    """The model, and its PSNR on held-out views."""
    rng = seed(number)
    model = Scaffold(*voxels(points, count)).to(views.pictures.device)
    eyes = [views.camera(i).position for i in range(len(views.pictures))]
    slow = [{"params": [model.anchors], "lr": 1e-5}, {"params": [model.offsets], "lr": 5e-3}]
    networks = [p for name in ("opacity_mlp", "cov_mlp", "color_mlp") for p in getattr(model, name).parameters()]
    fast = [{"params": [model.features, model.log_scales], "lr": 7e-3}, {"params": networks, "lr": 4e-3}]
    fit(views, lambda i: model(eyes[i]), torch.optim.Adam([*slow, *fast]), steps, rng)
    return model, held_out_psnr(views, lambda i: model(eyes[i]))


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    given = options(__doc__ or "", 15_000, argv, "views", "points")
    record = Record(given)
    views, points = load_views(given.views, device()), np.load(given.points)
    model, score = train(views, points, given.steps, given.count or 20_000, given.seed)
    model.save(given.out)
    record.write(held_out_psnr=score, anchors=len(model.anchors), gaussians=len(model.anchors) * OFFSETS)


if __name__ == "__main__":
    main()
