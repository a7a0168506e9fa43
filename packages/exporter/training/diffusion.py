"""A diffusion model that makes Gaussians: python diffusion.py train OUT, then package OUT MODEL.onnx

It learns from vessels.py, by the preconditioning and the loss of Karras et al., "Elucidating the Design Space of
Diffusion-Based Generative Models" (2022). In the page noise becomes a vessel in steps, a few of them in each run.
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812

from common import Record, Schedule, add_schedule, device, seed
from vessels import CHANNELS, CHUNK, COLOR, COLUMNS, POSITION, ROOT, ROWS, chunk, held_out

# Standard deviation of the data, and of the noise of a training: exp(N(-0.8, 1.4)).
DEVIATION, NOISE_MEAN, NOISE_SPREAD = 0.5, -0.8, 1.4
WIDTHS = (32, 48, 64, 96)
# Noise at the beginning and at the end of a generation, its seconds, and its steps in each run.
START, END, SECONDS, STEPS = 20.0, 0.01, 3.0, 2
# Shares along the rows and waves around the axis that a generation keeps of clean positions, roots of covariances and
# colors. Positions of vessels have no others.
SMOOTH = ((slice(0, 3), 8, 10), (slice(3, 9), 10, 12), (slice(9, 12), 20, 20))
# Levels of the uniform numbers that become noise: products with seeds up to 8191 are exact in float32.
LEVELS = 2048


def around(x: Tensor) -> Tensor:
    """One more column at each side: that of the other side."""
    return torch.cat([x[..., -1:], x, x[..., :1]], -1)


def even(x: Tensor) -> Tensor:
    """Channels (B,C,H,W) of the length 1 in each cell."""
    return x * torch.rsqrt((x * x).mean(1, keepdim=True) + 1e-4)


class Block(nn.Module):
    """Two convolutions beside the input; the noise scales and shifts what is between them."""

    def __init__(self, width: int):
        """A block of `width` channels."""
        super().__init__()
        self.first, self.second = (nn.Conv2d(width, width, 3, padding=(1, 0)) for _ in range(2))
        self.noise = nn.Linear(64, 2 * width)
        nn.init.zeros_(self.second.weight)

    def forward(self, x: Tensor, noise: Tensor) -> Tensor:
        """(B,C,H,W) and (B,64) to (B,C,H,W)."""
        scale, shift = self.noise(noise)[:, :, None, None].chunk(2, 1)
        inner = self.first(around(F.silu(even(x)))) * (1 + scale) + shift
        return x + self.second(around(F.silu(even(inner))))


class Denoiser(nn.Module):
    """A U-Net of four sizes, whose columns go around."""

    def __init__(self) -> None:
        """Untrained: it returns what it is given, less noise."""
        super().__init__()
        self.noise = nn.Sequential(nn.Linear(8, 64), nn.SiLU(), nn.Linear(64, 64), nn.SiLU())
        self.into = nn.Conv2d(CHANNELS + 4, WIDTHS[0], 3, padding=(1, 0))
        self.down = nn.ModuleList(Block(width) for width in WIDTHS[:-1])
        self.shrink = nn.ModuleList(nn.Conv2d(a, b, 2, 2) for a, b in pairwise(WIDTHS))
        self.middle = nn.ModuleList(Block(WIDTHS[-1]) for _ in range(2))
        self.narrow = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in pairwise(WIDTHS))
        self.up = nn.ModuleList(nn.ModuleList(Block(width) for _ in range(2)) for width in WIDTHS[:-1])
        self.out = nn.Conv2d(WIDTHS[0], CHANNELS, 3, padding=(1, 0))
        nn.init.zeros_(self.out.weight)
        # The place of each row between bottom and rim, -1..1.
        line = torch.linspace(-1, 1, ROWS)[:, None].expand(ROWS, COLUMNS)
        place = torch.stack([line, line**2, line**3, torch.ones_like(line)])[None]
        self.register_buffer("place", place, persistent=False)

    def forward(self, noisy: Tensor, sigma: Tensor) -> Tensor:
        """The clean numbers (B,12,H,W) of noisy ones, whose noise has the deviation sigma (B,)."""
        s = sigma[:, None, None, None]
        total = s * s + DEVIATION**2
        level = sigma.log()[:, None] / 4
        waves = level * (torch.pi / 2 * torch.tensor([1.0, 2, 4], device=level.device))
        noise = self.noise(torch.cat([level, level**2, waves.sin(), waves.cos()], 1))
        place = self.place.expand(len(noisy), -1, -1, -1)
        x = self.into(around(torch.cat([noisy * torch.rsqrt(total), place], 1)))
        kept = []
        for block, shrink in zip(self.down, self.shrink, strict=True):
            x = block(x, noise)
            kept.append(x)
            x = shrink(x)
        for block in self.middle:
            x = block(x, noise)
        for blocks, narrow in zip(reversed(self.up), reversed(self.narrow), strict=True):
            x = kept.pop() + F.interpolate(narrow(x), scale_factor=2.0, mode="nearest")
            for block in blocks:
                x = block(x, noise)
        change = self.out(around(F.silu(even(x))))
        return noisy * (DEVIATION**2 / total) + change * (s * DEVIATION * torch.rsqrt(total))


class Smooth(nn.Module):
    """Projects numbers (12,H,W) onto what vessels have in common: errors of a small network are rough."""

    def __init__(self) -> None:
        """The projections of SMOOTH, of vessels of the training."""
        super().__init__()
        known = torch.tensor(chunk(1)).double()
        for number, (channels, shares, waves) in enumerate(SMOOTH):
            lines = known[:, channels].transpose(2, 3).reshape(-1, ROWS)
            basis = torch.linalg.eigh(lines.T @ lines)[1][:, -shares:]
            spectrum = torch.fft.rfft(torch.eye(COLUMNS).double())
            spectrum[:, waves + 1 :] = 0
            self.register_buffer(f"rows{number}", (basis @ basis.T).float())
            self.register_buffer(f"columns{number}", torch.fft.irfft(spectrum, COLUMNS).float())

    def forward(self, x: Tensor) -> Tensor:
        """(12,H,W) to (12,H,W). Tables come first in each product, because 8 bits are for second ones."""
        parts = []
        for number, (channels, _, _) in enumerate(SMOOTH):
            rows, columns = getattr(self, f"rows{number}"), getattr(self, f"columns{number}")
            parts.append((columns @ (rows @ x[channels]).transpose(1, 2)).transpose(1, 2))
        return torch.cat(parts)


class Generator(nn.Module):
    """The generator of a page: noise of a seed, a few steps in each run, and Gaussians of what is reached."""

    def __init__(self, denoiser: Denoiser):
        """The generator of a denoiser, with the noise of all seeds."""
        super().__init__()
        self.denoiser, self.smooth = denoiser, Smooth()
        # Pairs of uniform numbers for the normal ones. The table turned around says how far a seed shifts each.
        table = np.random.default_rng(1).integers(0, LEVELS, (CHANNELS, ROWS, COLUMNS))
        self.register_buffer("table", torch.tensor(table).float())

    def noise(self, number: Tensor) -> Tensor:
        """Normal numbers (12,H,W)."""
        uniform = (torch.remainder(self.table + number.float() * self.table.flip(0, 1, 2), LEVELS) + 0.5) / LEVELS
        radius, angle = torch.sqrt(-2 * uniform[:6].log()), 2 * torch.pi * uniform[6:]
        return torch.cat([radius * angle.cos(), radius * angle.sin()])

    def forward(self, t: Tensor, number: Tensor, previous: Tensor) -> tuple[Tensor, ...]:
        """`previous` (13,H,W): noisy numbers of the run before, and the deviation of their noise; at first 0."""
        left = previous[CHANNELS:, :1, :1].abs()
        is_new = left < END / 2
        x = torch.where(is_new, START * self.noise(number), previous[:CHANNELS])
        left = torch.where(is_new, torch.full_like(left, START), left)
        sigma = START * (END / START) ** (t / SECONDS).clamp(0, 1)
        # A time that goes back does not add noise.
        ratio = (sigma / left).clamp(max=1) ** (1 / STEPS)
        clean = x
        for _ in range(STEPS):
            clean = self.smooth(self.denoiser(x[None], left.reshape(1))[0])
            x = clean + ratio * (x - clean)
            left = left * ratio
        kept = torch.cat([x, left.expand(1, ROWS, COLUMNS)])
        # Noise is shown as large as the data, and none of it at the end.
        shown = clean + (x - clean) * (1 - END / left)
        shown = (shown * torch.rsqrt(1 + (left / DEVIATION) ** 2)).flatten(1).T
        root = shown[:, 3:9] / ROOT + torch.tensor([1.0, 0, 0, 1, 0, 1], device=x.device) * (0.5 / ROOT)
        a, b, c, d, e, f = root.split(1, 1)
        products = [a * a + b * b + c * c, a * b + b * d + c * e, a * c + b * e + c * f, b * b + d * d + e * e]
        covariances = torch.cat([*products, b * c + d * e + e * f, c * c + e * e + f * f], 1)
        colors = (shown[:, 9:] / COLOR + 0.4).clamp(0, 1)
        return shown[:, :3] / POSITION, covariances, colors, torch.full_like(shown[:, :1], 0.92), kept


def examples(first: int, chunks: int) -> Tensor:
    """Vessels of the chunks `first`, `first + 1`, ..., of CHUNK each, float16."""
    with ProcessPoolExecutor() as pool:
        made = pool.map(_half, range(first, first + chunks))
        return torch.cat([torch.tensor(each) for each in made])


def _half(number: int) -> np.ndarray:
    return chunk(number).astype(np.float16)


def decibels(model: nn.Module, clean: Tensor, sigma: float, number: int = 0) -> float:
    """Gain of one step over noisy vessels, dB."""
    random = torch.Generator().manual_seed(number)
    noise = torch.randn(clean.shape, generator=random).to(clean.device) * sigma
    with torch.no_grad():
        found = model(clean + noise, torch.full((len(clean),), sigma, device=clean.device))
    return float(10 * torch.log10(noise.square().mean() / (found - clean).square().mean()))


def train(clean: Tensor, schedule: Schedule, batch: int, number: int) -> Denoiser:
    """The denoiser for vessels (V,12,H,W); an average over the steps."""
    seed(number)
    where = clean.device
    torch.backends.cudnn.benchmark = True
    model = Denoiser().to(where, memory_format=torch.channels_last)
    average = copy.deepcopy(model)
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-3, betas=(0.9, 0.99))
    for step, progress in enumerate(schedule):
        rate = 1.5e-3 * min(1, (step + 1) / 200) * (0.5 + 0.5 * np.cos(np.pi * progress))
        for group in optimizer.param_groups:
            group["lr"] = rate
        x = clean[torch.randint(len(clean), (batch,), device=where)].float()
        x = x.contiguous(memory_format=torch.channels_last)
        sigma = (torch.randn(batch, device=where) * NOISE_SPREAD + NOISE_MEAN).exp()
        s = sigma[:, None, None, None]
        with torch.autocast(where.type, torch.bfloat16, enabled=where.type == "cuda"):
            found = model(x + torch.randn_like(x) * s, sigma)
        weight = (s * s + DEVIATION**2) / (s * DEVIATION) ** 2
        loss = (weight * (found.float() - x).square()).mean()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
        with torch.no_grad():
            share = min(0.999, (step + 1) / (step + 10))
            torch._foreach_lerp_(list(average.parameters()), list(model.parameters()), 1 - share)
        if step % 100 == 0:
            print(f"step {step}, {progress:.0%}: loss {loss.item():.4f}", flush=True)
    return average


def package(checkpoint: Path, out: Path) -> None:
    """Writes the generator of a checkpoint with its contract."""
    from gaussian_exporter import module as gs

    model = Denoiser()
    model.load_state_dict(torch.load(checkpoint / "model.pth", map_location="cpu", weights_only=True))
    previous = gs.state([CHANNELS + 1, ROWS, COLUMNS])
    inputs = {"t": gs.time(duration=SECONDS + 2), "seed": gs.seed(), "previous": previous}
    layout = gs.split("positions", "covariances", "colors", "opacities", state="previous")
    facts = {"name": "Vessels, diffusion", "license": "MIT", "attribution": "Trained on shapes of our own formula"}
    gs.export_module(Generator(model.eval()), inputs, layout, out=out, weights="int8", **facts)


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("command", choices=("train", "package"))
    parser.add_argument("out", type=Path, help="folder of the checkpoint")
    parser.add_argument("model", type=Path, nargs="?", help="file of the generator")
    parser.add_argument("--vessels", type=int, default=30_000)
    parser.add_argument("--batch", type=int, default=128)
    add_schedule(parser, 20_000)
    given = parser.parse_args(argv)
    if given.command == "package":
        return package(given.out, given.model)
    where = torch.device(device())
    clean = examples(1, -(-given.vessels // CHUNK)).to(where)
    held = torch.tensor(held_out(64)).to(where)
    record, schedule = Record(given), Schedule(given.steps, given.seconds)
    model = train(clean, schedule, given.batch, given.seed)
    scores = {f"held_out_gain_db_at_{sigma}": round(decibels(model, held, sigma), 2) for sigma in (0.1, 0.5, 2.0)}
    size = sum(each.numel() for each in model.parameters())
    record.write(**scores, parameters=size, steps=schedule.done)
    torch.save({name: value.cpu() for name, value in model.state_dict().items()}, given.out / "model.pth")


if __name__ == "__main__":
    main()
