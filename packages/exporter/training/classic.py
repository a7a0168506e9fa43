"""Trains a plain 3DGS: python classic.py VIEWS.npz POINTS.npy OUT [--steps 15000] [--count 80000] [--degree 2]

This is the baseline for the other models: same images, same loss, same steps. With CUDA the strategy is gsplat's
MCMC, which grows to `count` Gaussians; without CUDA the number of points stays fixed. OUT is the input of
`gaussian-export classic`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from common import Record, Schedule, Views, add_schedule, device, fit, held_out_psnr, load_views, seed, split
from photographs import Exposures, photograph, photograph_psnr
from ply import write_ply
from rasterizer import NEAR, Camera, Splats, covariances, picture
from show import held_out_sheet

RATES = {"means": 1.6e-4, "scales": 5e-3, "quats": 1e-3, "opacities": 5e-2, "sh0": 2.5e-3, "shN": 1.25e-4}
OPACITY_WEIGHT, SCALE_WEIGHT = 0.01, 0.01
# The flash moved with the camera: harmonics pay for what they add.
SH_WEIGHT = 2e-3
SH_C0 = 0.28209479177387814
REFINE_UNTIL = 0.75


class Classic:
    """Gaussians with harmonics, as gsplat's strategies want them: a dictionary of parameters."""

    def __init__(self, points: Tensor, degree: int):
        """points (N,3)."""
        third = torch.cdist(points, points).kthvalue(min(3, len(points)), dim=1).values
        size = third.clamp(1e-4, (points.amax(0) - points.amin(0)).max().item() / 30)
        rest = (degree + 1) ** 2 - 1
        values = {
            "means": points,
            "scales": torch.log(size)[:, None].repeat(1, 3),
            "quats": torch.randn(len(points), 4, device=points.device),
            "opacities": torch.zeros(len(points), device=points.device),
            "sh0": torch.zeros(len(points), 1, 3, device=points.device),
            "shN": torch.zeros(len(points), rest, 3, device=points.device),
        }
        self.parameters: dict[str, nn.Parameter] = {name: nn.Parameter(value) for name, value in values.items()}
        self.info: dict[str, Any] = {}

    def draw(self, camera: Camera, degree: int) -> Tensor:
        """Premultiplied color and alpha (4,H,W), with harmonics up to a degree."""
        p = self.parameters
        if not p["means"].is_cuda:
            full = covariances(torch.exp(p["scales"]), p["quats"])
            colors = torch.relu(p["sh0"][:, 0] * SH_C0 + 0.5)
            return picture(Splats(p["means"], full, colors, torch.sigmoid(p["opacities"])), camera)
        from gsplat import rasterization

        color, alpha, self.info = rasterization(
            means=p["means"],
            quats=p["quats"],
            scales=torch.exp(p["scales"]),
            opacities=torch.sigmoid(p["opacities"]),
            colors=torch.cat([p["sh0"], p["shN"]], 1),
            viewmats=camera.view[None],
            Ks=camera.intrinsics[None],
            width=camera.width,
            height=camera.height,
            sh_degree=degree,
            near_plane=NEAR,
            packed=False,
        )
        return torch.cat([color[0], alpha[0]], -1).permute(2, 0, 1)

    def save(self, folder: Path) -> None:
        """INRIA's PLY."""
        p = self.parameters
        groups = {
            "x,y,z": p["means"],
            "f_dc_": p["sh0"][:, 0],
            "f_rest_": p["shN"].transpose(1, 2).flatten(1),
            "opacity": p["opacities"][:, None],
            "scale_": p["scales"],
            "rot_": p["quats"],
        }
        kept = {name: table for name, table in groups.items() if table.shape[1] > 0}
        write_ply(folder / "point_cloud" / "iteration_1" / "point_cloud.ply", kept)


class Refinement:
    """gsplat's MCMC strategy, where there is a CUDA device."""

    def __init__(self, model: Classic, optimizers: dict[str, torch.optim.Optimizer], schedule: Schedule, count: int):
        """`count`: the most Gaussians."""
        from gsplat.strategy import MCMCStrategy

        self.model, self.optimizers = model, optimizers
        self.strategy = MCMCStrategy(cap_max=count, refine_start_iter=500, refine_stop_iter=10**9)
        self.state = self.strategy.initialize_state()

    def after(self, step: int, progress: float) -> None:
        """After each step."""
        if progress < REFINE_UNTIL:
            rate = self.optimizers["means"].param_groups[0]["lr"]
            self.strategy.step_post_backward(
                self.model.parameters, self.optimizers, self.state, step, self.model.info, lr=rate
            )


def train(
    views: Views, points: np.ndarray, schedule: Schedule, count: int, degree: int, number: int
) -> tuple[Classic, dict[str, float]]:
    """The model, and its PSNR on held-out views."""
    rng = seed(number)
    chosen = points[rng.permutation(len(points))[: max(count // 2, 1)]]
    model = Classic(torch.tensor(chosen, dtype=torch.float32, device=views.pictures.device), degree)
    exposures = Exposures(len(views.pictures)).to(views.pictures.device)
    optimizers: dict[str, torch.optim.Optimizer] = {
        name: torch.optim.Adam(
            [{"params": [value], "lr": RATES[name], "decay": 0.01 if name == "means" else 1.0}], eps=1e-15
        )
        for name, value in model.parameters.items()
    }
    refinement = Refinement(model, optimizers, schedule, count) if views.pictures.is_cuda else None

    def loss_at(index: int, progress: float) -> Tensor:
        p = model.parameters
        drawn = model.draw(views.camera(index), min(degree, int(progress * 15)))
        loss = photograph(views, index).loss(exposures.exposed(drawn, index))
        if degree > 0:
            loss = loss + SH_WEIGHT * p["shN"].square().mean()
        if progress < REFINE_UNTIL:
            loss = loss + OPACITY_WEIGHT * torch.sigmoid(p["opacities"]).mean()
            loss = loss + SCALE_WEIGHT * torch.exp(p["scales"]).mean()
        return loss

    def draw(index: int) -> Tensor:
        return model.draw(views.camera(index), degree)

    trained, _ = split(len(views.pictures))
    gains = torch.optim.Adam(exposures.parameters(), lr=2e-3)
    after = None if refinement is None else refinement.after
    fit(trained, loss_at, [*optimizers.values(), gains], schedule, rng, after=after)
    return model, {"held_out_psnr": photograph_psnr(views, draw), "whole_picture_psnr": held_out_psnr(views, draw)}


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("views", "points", "out"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--count", type=int, default=80_000)
    parser.add_argument("--degree", type=int, default=2, choices=(0, 1, 2, 3))
    add_schedule(parser, 15_000)
    given = parser.parse_args(argv)
    record = Record(given)
    schedule = Schedule(given.steps, given.seconds)
    views, points = load_views(given.views, device()), np.load(given.points)
    model, scores = train(views, points, schedule, given.count, given.degree, given.seed)
    model.save(given.out)
    record.write(**scores, steps=schedule.done, gaussians=len(model.parameters["means"]))
    held_out_sheet(given.out / "held-out", views, lambda i: model.draw(views.camera(i), given.degree))


if __name__ == "__main__":
    main()
