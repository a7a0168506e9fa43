"""Trains a post-processor: python style.py OUT VIEWS.npz [VIEWS.npz ...] [--kind oil|denoise]

`oil` imitates a Kuwahara filter, which takes hundreds of reads for each pixel, with a small network; `denoise`
removes added noise. `--count` is the number of channels, a multiple of 4. No third-party weights are needed. OUT is
the input of `gaussian-export image-filter`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from common import Record, Schedule, add_schedule, decayed, device, load_views, seed, split
from losses import psnr
from show import sheet

RADIUS = 6
NOISE = 0.08
CROP, BATCH = 128, 8


class Filter(nn.Module):
    """The network of gaussian_exporter.families.image_filter, with the same names."""

    def __init__(self, output: str, channels: int, halvings: int = 1, blocks: int = 3):
        """output: `picture` or `noise`."""
        super().__init__()
        self.output = output
        self.stem = nn.Conv2d(3, channels, 5, 1, 2)
        self.down = nn.ModuleList(nn.Conv2d(channels, channels, 3, 2, 1) for _ in range(halvings))
        self.blocks = nn.ModuleList(
            nn.ModuleList(nn.Conv2d(channels, channels, 3, 1, 1) for _ in range(2)) for _ in range(blocks)
        )
        self.up = nn.ModuleList(nn.Conv2d(channels, channels, 3, 1, 1) for _ in range(halvings))
        self.out = nn.Conv2d(channels, 3, 5, 1, 2)

    def forward(self, image: Tensor) -> Tensor:
        """(B,3,H,W) to the same, 0..1."""
        x = F.relu(self.stem(image))
        for layer in self.down:
            x = F.relu(layer(x))
        for first, second in self.blocks:
            x = x + second(F.relu(first(x)))
        for layer in self.up:
            x = F.relu(layer(F.interpolate(x, scale_factor=2, mode="nearest")))
        last = self.out(x)
        return torch.sigmoid(last) if self.output == "picture" else image - last

    def save(self, folder: Path, width: int, height: int) -> None:
        """config.json and model.pth."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "config.json").write_text(json.dumps({"output": self.output, "width": width, "height": height}))
        torch.save({name: value.cpu() for name, value in self.state_dict().items()}, folder / "model.pth")


def kuwahara(image: Tensor, radius: int) -> Tensor:
    """Each pixel becomes the mean of that one of its four square corners which varies least."""
    size = radius + 1
    padded = F.pad(image, [radius] * 4, mode="replicate")
    mean = F.avg_pool2d(padded, size, 1)
    gray = padded.mean(1, keepdim=True)
    varying = F.avg_pool2d(gray * gray, size, 1) - F.avg_pool2d(gray, size, 1) ** 2
    height, width = image.shape[2:]
    corners = [(y, x) for y in (0, radius) for x in (0, radius)]
    means = torch.stack([mean[:, :, y : y + height, x : x + width] for y, x in corners])
    spread = torch.stack([varying[:, :, y : y + height, x : x + width] for y, x in corners])
    minimum = spread.argmin(0, keepdim=True).expand(1, *image.shape)
    return means.gather(0, minimum)[0]


def pair(kind: str, image: Tensor) -> tuple[Tensor, Tensor]:
    """Input and expected output."""
    if kind == "oil":
        return image, kuwahara(image, RADIUS)
    return (image + NOISE * torch.randn_like(image)).clamp(0, 1), image


def backed(pictures: Tensor, backgrounds: Tensor) -> Tensor:
    """Premultiplied images (B,4,H,W) over plain backgrounds (B,3), because black backgrounds teach little."""
    return pictures[:, :3] + (1 - pictures[:, 3:]) * backgrounds[:, :, None, None]


def train(
    scenes: list[Tensor], kind: str, schedule: Schedule, channels: int, number: int, halvings: int = 1
) -> tuple[Filter, dict[str, float]]:
    """The network for images (V,4,H,W), a tensor for each size; its PSNR on held-out ones, and the PSNR of the
    unchanged images.
    """
    rng = seed(number)
    where = scenes[0].device
    # Both kinds learn the difference from the image, because a sigmoid never reaches white.
    model = Filter("noise", channels, halvings).to(where)
    optimizer = torch.optim.Adam(model.parameters(), lr=2e-3)
    for step, progress in enumerate(schedule):
        pictures = scenes[int(rng.integers(len(scenes)))]
        trained, _ = split(len(pictures))
        rows, columns = (side // 2 * 2 for side in pictures.shape[2:])
        height, width = min(CROP, rows), min(CROP, columns)
        top, left = int(rng.integers(0, rows - height + 1)), int(rng.integers(0, columns - width + 1))
        index = rng.choice(trained, min(BATCH, len(trained)))
        image = pictures[index, :, top : top + height, left : left + width]
        given, wanted = pair(kind, backed(image, torch.rand(len(index), 3, device=where)))
        loss = (model(given) - wanted).abs().mean()
        optimizer.zero_grad(set_to_none=True)
        decayed([optimizer], progress, 0.01)
        loss.backward()
        optimizer.step()
        if step % 1000 == 0:
            print(f"step {step}, {progress:.0%}: loss {loss.item():.4f}", flush=True)
    return model, measured(model, kind, scenes)


@torch.no_grad()
def measured(model: Filter, kind: str, scenes: list[Tensor]) -> dict[str, float]:
    """PSNR of held-out images over white, filtered and unchanged."""
    found, untouched = [], []
    for pictures in scenes:
        rows, columns = (side // 2 * 2 for side in pictures.shape[2:])
        for i in split(len(pictures))[1]:
            whole = backed(pictures[i : i + 1, :, :rows, :columns], torch.ones(1, 3, device=pictures.device))
            given, wanted = pair(kind, whole)
            found.append(psnr(model(given), wanted))
            untouched.append(psnr(given, wanted))
    return {"held_out_psnr": float(np.mean(found)), "untouched_psnr": float(np.mean(untouched))}


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("views", type=Path, nargs="+")
    parser.add_argument("--kind", choices=("oil", "denoise"), default="oil")
    parser.add_argument("--count", type=int, default=16)
    parser.add_argument("--halvings", type=int, default=1, help="0 keeps every pixel, at four times the work")
    add_schedule(parser, 8_000)
    given = parser.parse_args(argv)
    record, schedule = Record(given), Schedule(given.steps, given.seconds)
    scenes = [load_views(path, device()).pictures for path in given.views]
    model, scores = train(scenes, given.kind, schedule, given.count, given.seed, given.halvings)
    height, width = scenes[0].shape[2:]
    model.save(given.out, width // 4 * 4, height // 4 * 4)
    record.write(**scores, steps=schedule.done)
    with torch.no_grad():
        held = [backed(s[4:5], torch.ones(1, 3, device=s.device)) for s in scenes if s.shape == scenes[0].shape]
        pairs = [pair(given.kind, picture) for picture in held]
        shown = [model(noisy)[0] for noisy, _ in pairs]
    sheet(given.out / "held-out.png", [wanted[0] for _, wanted in pairs], shown)


if __name__ == "__main__":
    main()
