"""Trains the scene: python train.py VIEWS SPARSE OUT [--degree 2] [--cap 90000] [--steps 15000] [--hold-out]

VIEWS is what masks.py made, SPARSE the COLMAP text model. Writes OUT.ply and OUT.spz, before trimming. With
--hold-out every eighth view is kept from training, to measure.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from gsplat.strategy import MCMCStrategy

from bounds import Bounds
from capture import read_colmap, to_upright
from clean import brightened, cleaned
from dataset import Picture, load_pictures
from gaussians import write_ply
from model import Parameters, initial_parameters, render, to_gaussians
from spz import write_spz

RATES = {"means": 1.6e-4, "scales": 5e-3, "quats": 1e-3, "opacities": 5e-2, "sh0": 2.5e-3, "shN": 2.5e-3 / 20}
HELD_OUT_EVERY = 8
# Flash and camera moved together: apparent gloss may be the lamp. Harmonics pay for what they add.
SH_WEIGHT = 2e-3
OPACITY_WEIGHT = 0.01
SCALE_WEIGHT = 0.01
# Sums over Gaussians, not means: a Gaussian under the cut pays the same however many others there are.
CUT_WEIGHT = 2e-3
WIDTH_WEIGHT = 1e-2
SSIM_WEIGHT = 0.2
# Weight of coverage on doubtful pixels: small enough that other views override it.
DOUBT_WEIGHT = 0.1
# Steps after which the scene is good enough to correct the cameras by.
POSES_FROM = 1000


def gaussian_window(width: int = 11, sigma: float = 1.5) -> torch.Tensor:
    offset = torch.arange(width, dtype=torch.float32, device="cuda") - width // 2
    line = torch.exp(-(offset**2) / (2 * sigma**2))
    line /= line.sum()
    return (line[:, None] * line[None]).expand(3, 1, width, width).contiguous()


def ssim(a: torch.Tensor, b: torch.Tensor, window: torch.Tensor) -> torch.Tensor:
    """Structural similarity of two images (3,H,W) in 0..1 (Wang et al. 2004, an 11x11 window of sigma 1.5)."""
    stack = torch.stack([a, b, a * a, b * b, a * b])
    mean_a, mean_b, aa, bb, ab = F.conv2d(stack, window, padding=window.shape[-1] // 2, groups=3)
    both, c1, c2 = mean_a * mean_b, 0.01**2, 0.03**2
    above = (2 * both + c1) * (2 * (ab - both) + c2)
    below = (mean_a**2 + mean_b**2 + c1) * (aa - mean_a**2 + bb - mean_b**2 + c2)
    return (above / below).mean()


class Exposures:
    """A gain for each image and channel: the flash was nearer to the object in some photographs than in others."""

    def __init__(self, count: int):
        self.log_gain = torch.nn.Parameter(torch.zeros(count, 3, device="cuda"))
        self.optimizer = torch.optim.Adam([self.log_gain], lr=2e-3)

    def gain(self, index: int) -> torch.Tensor:
        # Gains and the model's colours could trade a common factor; the mean gain is 1 by definition.
        return torch.exp(self.log_gain[index] - self.log_gain.mean(0))[:, None, None]


class Poses:
    """A small motion of each camera, learned with the scene: a rotation vector and a shift in the camera's frame."""

    def __init__(self, count: int, steps: int):
        self.motion = torch.nn.Parameter(torch.zeros(count, 6, device="cuda"))
        self.optimizer = torch.optim.Adam([self.motion], lr=5e-5)
        self.decay = torch.optim.lr_scheduler.ExponentialLR(self.optimizer, 0.05 ** (1 / steps))

    def moved(self, picture: Picture, index: int) -> torch.Tensor:
        # All cameras together could carry the scene away; their mean motion is none.
        x, y, z, *shift = (self.motion[index] - self.motion.mean(0)).unbind()
        zero = torch.zeros_like(x)
        turn = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3)
        delta = torch.eye(4, device="cuda")
        delta[:3, :3] = torch.linalg.matrix_exp(turn)
        delta[:3, 3] = torch.stack(shift)
        return delta @ picture.view_matrix


def photometric_loss(picture: Picture, color: torch.Tensor, alpha: torch.Tensor, window: torch.Tensor) -> torch.Tensor:
    """Over a random background, new each time: only coverage that is right looks right over all of them. If the photograph is dark and the mask in doubt, the background is black, and anything that is no brighter is right."""
    background = torch.rand(3, 1, 1, device="cuda") * (1 - picture.doubtful)
    got = color + background * (1 - alpha)
    wanted = picture.rgb * picture.alpha + background * (1 - picture.alpha)
    wanted = torch.where(picture.doubtful > 0, torch.minimum(picture.rgb, got.detach()), wanted)
    got = got * picture.valid + wanted * (1 - picture.valid)
    doubt = DOUBT_WEIGHT * (alpha * picture.doubtful * picture.valid).mean()
    return (1 - SSIM_WEIGHT) * (got - wanted).abs().mean() + SSIM_WEIGHT * (1 - ssim(got, wanted, window)) + doubt


def regularization(parameters: Parameters, bounds: Bounds, progress: float) -> torch.Tensor:
    """MCMC's push towards few, small Gaussians while they may still move, and what keeps them inside the bounds."""
    loss = SH_WEIGHT * parameters["shN"].square().mean()
    loss = loss + CUT_WEIGHT * bounds.overhang(parameters).sum() + WIDTH_WEIGHT * bounds.excess_width(parameters).sum()
    if progress < 0.75:
        loss = loss + OPACITY_WEIGHT * torch.sigmoid(parameters["opacities"]).mean()
        loss = loss + SCALE_WEIGHT * torch.exp(parameters["scales"]).mean()
    return loss


def start_points(capture, hull: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """COLMAP's points on the object; positions and colours in 0..1."""
    near = np.linalg.norm(capture.points, axis=1) < 1.2 * np.linalg.norm(hull, axis=1).max()
    kept = near & (capture.points[:, 1] < capture.cut_height)
    return capture.points[kept], capture.colors[kept] / 255


def train(pictures: list[Picture], parameters: Parameters, bounds: Bounds, options) -> tuple[Exposures, Poses]:
    optimizers = {
        key: torch.optim.Adam([{"params": value, "lr": RATES[key], "name": key}], eps=1e-15, fused=True)
        for key, value in parameters.items()
    }
    decay = torch.optim.lr_scheduler.ExponentialLR(optimizers["means"], 0.01 ** (1 / options.steps))
    strategy = MCMCStrategy(cap_max=options.cap, refine_start_iter=500, refine_stop_iter=int(0.75 * options.steps))
    strategy.check_sanity(parameters, optimizers)
    state, window = strategy.initialize_state(), gaussian_window()
    exposures, poses = Exposures(len(pictures)), Poses(len(pictures), options.steps)
    order, started = [], time.time()
    for step in range(options.steps):
        if not order:
            order = np.random.permutation(len(pictures)).tolist()
        index = order.pop()
        picture = pictures[index]
        degree = min(options.degree, step // 1000)
        refining = step >= POSES_FROM
        matrix = poses.moved(picture, index) if refining else picture.view_matrix
        color, alpha, info = render(parameters, matrix, picture.intrinsics, picture.size, degree)
        loss = photometric_loss(picture, color * exposures.gain(index), alpha, window)
        (loss + regularization(parameters, bounds, step / options.steps)).backward()
        for optimizer in [*optimizers.values(), exposures.optimizer, *([poses.optimizer] if refining else [])]:
            optimizer.step()
            optimizer.zero_grad(set_to_none=True)
        decay.step()
        if refining:
            poses.decay.step()
        if step % 100 == 0:
            # A Gaussian outside the hull counts as dead; the strategy puts it to better use on this very step.
            with torch.no_grad():
                parameters["opacities"][bounds.outside(parameters["means"])] = -8.0
        if step < strategy.refine_stop_iter:
            strategy.step_post_backward(parameters, optimizers, state, step, info, lr=decay.get_last_lr()[0])
        if step % 2000 == 0 or step == options.steps - 1:
            state_of_training = f"loss {loss.item():.4f}, {len(parameters['means'])} Gaussians"
            print(f"step {step}: {state_of_training}, {time.time() - started:.0f} s", flush=True)
    return exposures, poses


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("views", type=Path)
    parser.add_argument("sparse", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--degree", type=int, default=2)
    parser.add_argument("--cap", type=int, default=90_000)
    parser.add_argument("--steps", type=int, default=15_000)
    parser.add_argument("--hold-out", action="store_true")
    options = parser.parse_args()
    torch.manual_seed(0)
    np.random.seed(0)
    capture = to_upright(read_colmap(options.sparse))
    hull = np.load(options.views / "hull.npy")
    every = load_pictures(options.views, capture)
    pictures = [p for p in every if not (options.hold_out and int(p.name) % HELD_OUT_EVERY == 0)]
    bounds = Bounds(hull, capture.cut_height)
    parameters = initial_parameters(*start_points(capture, hull), options.degree)
    exposures, poses = train(pictures, parameters, bounds, options)
    gains = torch.stack([exposures.gain(i)[:, 0, 0] for i in range(len(pictures))]).detach().cpu().numpy()
    gaussians = brightened(to_gaussians(cleaned(parameters, bounds, every)), gains)
    motion = (poses.motion - poses.motion.mean(0)).detach().norm(dim=1)
    print(f"poses moved by {motion.mean():.5f} on average, {motion.max():.5f} at most")
    write_ply(Path(f"{options.out}.ply"), gaussians)
    size = write_spz(Path(f"{options.out}.spz"), gaussians, antialiased=True)
    print(f"{options.out}: {len(gaussians)} Gaussians, degree {gaussians.sh_degree}, {size} bytes of SPZ")


if __name__ == "__main__":
    main()
