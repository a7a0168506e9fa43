"""What every trainer does alike: pictures with their cameras, held-out views, the record of a training."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from rasterizer import Camera, Splats, picture

HELD_OUT_EVERY = 8


@dataclass
class Views:
    """Pictures (V,4,H,W), premultiplied, 0..1, with cameras: view matrices (V,4,4), intrinsics (V,3,3) in pixels. What
    else changes from one picture to the next lies in `extra`, by name: times (V), poses (V,J,3), shapes (V,B)."""

    pictures: Tensor
    views: Tensor
    intrinsics: Tensor
    extra: dict[str, Tensor]

    def camera(self, index: int) -> Camera:
        """The camera of one picture."""
        height, width = self.pictures.shape[2:]
        return Camera(self.views[index], self.intrinsics[index], width, height)

    def save(self, path: Path) -> None:
        """As .npz, pictures as bytes."""
        arrays = {name: value.cpu().numpy() for name, value in self.extra.items()}
        bytes_ = (self.pictures.clamp(0, 1) * 255).round().byte().cpu().numpy()
        views, intrinsics = self.views.cpu().numpy(), self.intrinsics.cpu().numpy()
        np.savez_compressed(path, pictures=bytes_, views=views, intrinsics=intrinsics, **arrays)


def load_views(path: Path, device: str) -> Views:
    """Reads what `Views.save` wrote."""
    with np.load(path) as archive:
        arrays = {name: torch.tensor(archive[name]).to(device).float() for name in archive.files}
    return Views(arrays.pop("pictures") / 255, arrays.pop("views"), arrays.pop("intrinsics"), arrays)


def split(count: int) -> tuple[list[int], list[int]]:
    """Indices to train on, and every eighth to measure on."""
    held = [i for i in range(count) if i % HELD_OUT_EVERY == HELD_OUT_EVERY // 2]
    return [i for i in range(count) if i not in held], held


def device() -> str:
    """The CUDA device if there is one."""
    return "cuda" if torch.cuda.is_available() else "cpu"


def seed(number: int) -> np.random.Generator:
    """Seeds PyTorch and returns a generator of numpy's."""
    torch.manual_seed(number)
    return np.random.default_rng(number)


def psnr(found: Tensor, wanted: Tensor) -> float:
    """Decibels between pictures in 0..1."""
    return float(-10 * torch.log10((found.clamp(0, 1) - wanted).square().mean() + 1e-12))


def loss_of(found: Tensor, wanted: Tensor) -> Tensor:
    """L1 over a random background, so that only coverage that is right looks right."""
    background = torch.rand(3, 1, 1, device=found.device)
    difference = found[:3] + background * (1 - found[3:]) - wanted[:3] - background * (1 - wanted[3:])
    return difference.abs().mean()


Show = Callable[[int], Splats]


def fit(
    views: Views,
    show: Show,
    optimizer: torch.optim.Optimizer,
    steps: int,
    rng: np.random.Generator,
    decay: float = 0.05,
) -> None:
    """Trains on all pictures that are not held out, in random order; learning rates end at `decay` of their start."""
    trained, _ = split(len(views.pictures))
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, decay ** (1 / steps))
    for step in range(steps):
        index = int(rng.choice(trained))
        loss = loss_of(picture(show(index), views.camera(index)), views.pictures[index])
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        schedule.step()
        if step % 1000 == 0 or step == steps - 1:
            print(f"step {step}: loss {loss.item():.4f}", flush=True)


@torch.no_grad()
def held_out_psnr(views: Views, show: Show) -> float:
    """Mean over held-out pictures, on black."""
    _, held = split(len(views.pictures))
    scores = [psnr(picture(show(i), views.camera(i))[:3], views.pictures[i, :3]) for i in held]
    return float(np.mean(scores))


def options(description: str, steps: int, argv: Sequence[str] | None, *positional: str) -> argparse.Namespace:
    """Command line of a trainer: its positional paths, the output folder, steps, seed."""
    parser = argparse.ArgumentParser(description=description)
    for name in positional:
        parser.add_argument(name, type=Path)
    parser.add_argument("out", type=Path, help="folder for the checkpoint and record.json")
    parser.add_argument("--steps", type=int, default=steps)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, help="how many anchors, Gaussians or channels; each trainer has its own")
    return parser.parse_args(argv)


class Record:
    """What a training was and how well it went, written as record.json."""

    def __init__(self, given: argparse.Namespace):
        """Starts the clock."""
        self._facts: dict[str, object] = {
            "trainer": Path(sys.modules["__main__"].__file__ or "").name,
            "options": {key: str(value) if isinstance(value, Path) else value for key, value in vars(given).items()},
        }
        self._out: Path = given.out
        self._started = time.time()

    def write(self, **facts: object) -> None:
        """Adds results, and what it ran on."""
        where = torch.cuda.get_device_name() if torch.cuda.is_available() else "CPU"
        clock = {"seconds": round(time.time() - self._started, 1), "device": where, "torch": torch.__version__}
        self._out.mkdir(parents=True, exist_ok=True)
        (self._out / "record.json").write_text(json.dumps({**self._facts, **facts, **clock}, indent=2) + "\n")
        print(json.dumps(facts), flush=True)
