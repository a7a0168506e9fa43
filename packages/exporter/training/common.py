"""Common code of all trainers: images with their cameras, held-out views, the loop, the record of a training."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from losses import psnr
from rasterizer import Camera

HELD_OUT_EVERY = 8


@dataclass
class Views:
    """Images (V,4,H,W), premultiplied, 0..1, with cameras: view matrices (V,4,4), intrinsics (V,3,3) in pixels. Other
    properties of the images are in `extra`, by name: times (V), poses (V,J,3), shapes (V,B); for photographs also
    valid and doubtful (V,1,H,W), see `losses.Photograph`.
    """

    pictures: Tensor
    views: Tensor
    intrinsics: Tensor
    extra: dict[str, Tensor]

    def camera(self, index: int) -> Camera:
        """The camera of one image."""
        height, width = self.pictures.shape[2:]
        return Camera(self.views[index], self.intrinsics[index], width, height)

    def save(self, path: Path) -> None:
        """Saves as .npz, images as bytes."""
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


class Schedule:
    """How far a training has come, from 0 to 1: by its steps, or by the clock where that runs out first, so that a
    rented machine is given back with a finished model. `done` counts the steps that were taken."""

    def __init__(self, steps: int, seconds: float | None = None):
        """`seconds` begin with the first step."""
        self.steps, self.seconds, self.done = steps, seconds, 0

    def __iter__(self) -> Iterator[float]:
        """The progress at the beginning of each step."""
        started = time.time()
        while True:
            late = 0.0 if self.seconds is None else (time.time() - started) / self.seconds
            progress = max(self.done / self.steps, late)
            if progress >= 1:
                return
            yield progress
            self.done += 1

    def part(self, share: float) -> Schedule:
        """Learning rate at this fraction of the training."""
        return Schedule(max(int(self.steps * share), 1), None if self.seconds is None else self.seconds * share)


Optimizers = Sequence[torch.optim.Optimizer]


def decayed(optimizers: Optimizers, progress: float, decay: float) -> None:
    """Multiplies each group's initial rate by a factor: at the end its own `decay`, or this one."""
    for optimizer in optimizers:
        for group in optimizer.param_groups:
            first = group.setdefault("first_lr", group["lr"])
            group["lr"] = first * group.get("decay", decay) ** progress


def fit(
    trained: Sequence[int],
    loss_at: Callable[[int, float], Tensor],
    optimizers: Optimizers,
    schedule: Schedule,
    rng: np.random.Generator,
    decay: float = 0.05,
    after: Callable[[int, float], None] | None = None,
) -> None:
    """Trains on images in random order, each once per epoch. `loss_at` gets an image's index and the progress; `after`
    gets the step and the progress, and is called before gradients are cleared.
    """
    order: list[int] = []
    for step, progress in enumerate(schedule):
        order = order or rng.permutation(np.asarray(trained)).tolist()
        loss = loss_at(order.pop(), progress)
        decayed(optimizers, progress, decay)
        loss.backward()
        for optimizer in optimizers:
            optimizer.step()
        if after is not None:
            after(step, progress)
        for optimizer in optimizers:
            optimizer.zero_grad(set_to_none=True)
        if step % 1000 == 0:
            print(f"step {step}, {progress:.0%}: loss {loss.item():.4f}", flush=True)


Draw = Callable[[int], Tensor]


@torch.no_grad()
def held_out_psnr(views: Views, draw: Draw) -> float:
    """Mean over held-out images, on black; `draw` returns one as (4,H,W)."""
    _, held = split(len(views.pictures))
    return float(np.mean([psnr(draw(i)[:3], views.pictures[i, :3]) for i in held]))


@torch.no_grad()
def outline_psnr(views: Views, draw: Draw) -> float:
    """As held_out_psnr, inside the scene's outline only: black around it is no merit."""
    _, held = split(len(views.pictures))
    inside = [views.pictures[i, 3] > 0.5 for i in held]
    scores = [psnr(draw(i)[:3, m], views.pictures[i, :3, m]) for i, m in zip(held, inside, strict=True) if m.any()]
    return float(np.mean(scores))


def options(description: str, steps: int, argv: Sequence[str] | None, *positional: str) -> argparse.Namespace:
    """Command line of a trainer: its positional paths, the output folder, steps, seed."""
    parser = argparse.ArgumentParser(description=description)
    for name in positional:
        parser.add_argument(name, type=Path)
    parser.add_argument("out", type=Path, help="folder for the checkpoint and record.json")
    parser.add_argument("--count", type=int, help="how many anchors, Gaussians or channels; each trainer has its own")
    add_schedule(parser, steps)
    return parser.parse_args(argv)


def add_schedule(parser: argparse.ArgumentParser, steps: int) -> None:
    """Options that say how long to train."""
    parser.add_argument("--steps", type=int, default=steps)
    parser.add_argument("--seconds", type=float, help="end after these, with all rates brought down, steps or no steps")
    parser.add_argument("--seed", type=int, default=0)


def plain(value: object) -> object:
    """An option as the record keeps it: of paths the last part only."""
    if isinstance(value, list):
        return [plain(each) for each in value]
    return value.name if isinstance(value, Path) else value


class Record:
    """Settings and results of a training, written as record.json."""

    def __init__(self, given: argparse.Namespace):
        """Starts the clock."""
        self._facts: dict[str, object] = {
            "trainer": Path(sys.modules["__main__"].__file__ or "").name,
            "options": {key: plain(value) for key, value in vars(given).items()},
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
