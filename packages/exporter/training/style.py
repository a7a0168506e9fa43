"""Trains a post-processor: python style.py VIEWS.npz OUT [--kind oil|denoise] [--steps 8000] [--count 16]

`oil` imitates a Kuwahara filter, which takes hundreds of reads for each pixel, with a small network; `denoise` takes
added noise off. `--count` is the number of channels, a multiple of 4. No weights of anybody else are needed. OUT is the
folder that `gaussian-export image-filter` reads.
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

from common import Record, device, load_views, psnr, seed, split

RADIUS = 6
NOISE = 0.08
CROP = 256


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
    grey = padded.mean(1, keepdim=True)
    varying = F.avg_pool2d(grey * grey, size, 1) - F.avg_pool2d(grey, size, 1) ** 2
    height, width = image.shape[2:]
    corners = [(y, x) for y in (0, radius) for x in (0, radius)]
    means = torch.stack([mean[:, :, y : y + height, x : x + width] for y, x in corners])
    spread = torch.stack([varying[:, :, y : y + height, x : x + width] for y, x in corners])
    least = spread.argmin(0, keepdim=True).expand(1, *image.shape)
    return means.gather(0, least)[0]


def pair(kind: str, image: Tensor) -> tuple[Tensor, Tensor]:
    """What goes in and what should come out."""
    if kind == "oil":
        return image, kuwahara(image, RADIUS)
    return (image + NOISE * torch.randn_like(image)).clamp(0, 1), image


def train(pictures: Tensor, kind: str, steps: int, channels: int, number: int) -> tuple[Filter, dict[str, float]]:
    """The network; its PSNR on held-out pictures, and what leaving them as they are would score."""
    rng = seed(number)
    model = Filter("picture" if kind == "oil" else "noise", channels).to(pictures.device)
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    trained, held = split(len(pictures))
    rows, columns = (side // 2 * 2 for side in pictures.shape[2:])
    height, width = min(CROP, rows), min(CROP, columns)
    for step in range(steps):
        top, left = int(rng.integers(0, rows - height + 1)), int(rng.integers(0, columns - width + 1))
        index = rng.choice(trained, min(4, len(trained)))
        image = pictures[index, :, top : top + height, left : left + width]
        given, wanted = pair(kind, image)
        loss = (model(given) - wanted).abs().mean()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        schedule.step()
        if step % 500 == 0 or step == steps - 1:
            print(f"step {step}: loss {loss.item():.4f}", flush=True)
    with torch.no_grad():
        pairs = [pair(kind, pictures[i : i + 1, :, :rows, :columns]) for i in held]
        score = float(np.mean([psnr(model(given), wanted) for given, wanted in pairs]))
        untouched = float(np.mean([psnr(given, wanted) for given, wanted in pairs]))
    return model, {"held_out_psnr": score, "untouched_psnr": untouched}


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("views", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--kind", choices=("oil", "denoise"), default="oil")
    parser.add_argument("--steps", type=int, default=8_000)
    parser.add_argument("--count", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    record = Record(given)
    views = load_views(given.views, device())
    model, scores = train(views.pictures[:, :3], given.kind, given.steps, given.count, given.seed)
    height, width = views.pictures.shape[2:]
    model.save(given.out, width // 4 * 4, height // 4 * 4)
    record.write(**scores)


if __name__ == "__main__":
    main()
