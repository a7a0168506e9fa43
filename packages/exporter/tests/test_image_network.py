"""A network of the kind of Splatter Image (Szymanowicz et al. 2024): a U-Net writes one Gaussian for each pixel of one
image. The paper's idea in an architecture of our own, small, with random weights: it shows that modules of this kind
export, and says nothing of the published class."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

import gaussian_exporter as gs

from .running import run

torch: Any = pytest.importorskip("torch")
pytest.importorskip("onnxscript")

SIDE = 32
NEAR, FAR = 0.5, 2.5
HALF = 0.5**0.5


class Block(torch.nn.Module):  # type: ignore[misc]
    """A residual block of two convolutions, with attention among all pixels if they are few."""

    def __init__(self, inputs: int, outputs: int, attends: bool = False) -> None:
        super().__init__()
        self.norms = torch.nn.ModuleList([torch.nn.GroupNorm(4, inputs), torch.nn.GroupNorm(4, outputs)])
        self.convs = torch.nn.ModuleList(
            [torch.nn.Conv2d(inputs, outputs, 3, padding=1), torch.nn.Conv2d(outputs, outputs, 3, padding=1)]
        )
        self.skip = torch.nn.Conv2d(inputs, outputs, 1)
        self.attention = torch.nn.Conv2d(outputs, 3 * outputs, 1) if attends else None

    def forward(self, x: Any) -> Any:
        y = x
        for norm, conv in zip(self.norms, self.convs, strict=True):
            y = conv(torch.nn.functional.silu(norm(y)))
        y = (self.skip(x) + y) * HALF
        if self.attention is None:
            return y
        query, key, value = self.attention(y).flatten(2).transpose(1, 2).chunk(3, dim=2)
        weights = torch.softmax(query @ key.transpose(1, 2) / query.shape[2] ** 0.5, dim=2)
        return (y + (weights @ value).transpose(1, 2).reshape(y.shape)) * HALF


def product(a: Any, b: Any) -> Any:
    """Product of quaternions, real part first."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a.unbind(-1), b.unbind(-1)
    return torch.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        -1,
    )


class PixelSplats(torch.nn.Module):  # type: ignore[misc]
    """Gaussians along the rays of the pixels, in the axes of the world."""

    def __init__(self) -> None:
        super().__init__()
        self.enter = torch.nn.Conv2d(3, 16, 3, padding=1)
        self.down = torch.nn.ModuleList([Block(16, 16), Block(16, 32), Block(32, 32, attends=True)])
        self.up = torch.nn.ModuleList([Block(32 + 32, 32), Block(32 + 16, 16)])
        self.shrink = torch.nn.ModuleList(
            [torch.nn.Conv2d(16, 16, 3, stride=2, padding=1), torch.nn.Conv2d(32, 32, 3, stride=2, padding=1)]
        )
        # Depth, offset, opacity, scales, rotation and color of each pixel.
        self.leave = torch.nn.Conv2d(16, 1 + 3 + 1 + 3 + 4 + 3, 1)
        at = (torch.arange(SIDE) + 0.5) / SIDE * 2 - 1
        y, x = torch.meshgrid(at, at, indexing="ij")
        self.register_buffer("rays", torch.stack([0.5 * x, 0.5 * y, torch.ones_like(x)], -1).reshape(-1, 3))
        # The camera turns by 40 degrees about y.
        self.register_buffer("turn", torch.tensor([np.cos(np.pi / 9), 0.0, np.sin(np.pi / 9), 0.0]).float())
        cos, sin = np.cos(2 * np.pi / 9), np.sin(2 * np.pi / 9)
        self.register_buffer("matrix", torch.tensor([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]).float())
        self.register_buffer("eye", torch.tensor([0.1, -0.2, -1.5]))

    def forward(self, photo: Any) -> Any:
        x = self.enter(photo * 2 - 1)
        kept = []
        for level, block in enumerate(self.down):
            x = block(x)
            if level < len(self.shrink):
                kept.append(x)
                x = self.shrink[level](x)
        for block in self.up:
            larger = torch.nn.functional.interpolate(x, scale_factor=2.0, mode="nearest")
            x = block(torch.cat([larger, kept.pop()], 1))
        rows = self.leave(torch.nn.functional.silu(x))[0].flatten(1).transpose(0, 1)
        depth, offset, opacity, scale, rotation, color = rows.split([1, 3, 1, 3, 4, 3], 1)
        local = self.rays * (NEAR + (FAR - NEAR) * torch.sigmoid(depth)) + 0.1 * torch.tanh(offset)
        identity = torch.tensor([1.0, 0.0, 0.0, 0.0])
        turned = product(self.turn, torch.nn.functional.normalize(rotation + identity, dim=1))
        return (
            local @ self.matrix.T + self.eye,
            torch.exp(scale.clamp(-4, 1) - 4),
            turned,
            torch.sigmoid(color),
            torch.sigmoid(opacity),
        )


def test_a_network_that_writes_a_gaussian_for_each_pixel(tmp_path: Path) -> None:
    torch.manual_seed(3)
    module, layout = PixelSplats().eval(), gs.split()
    report = gs.export_module(module, {"photo": gs.image(SIDE, SIDE)}, layout, out=tmp_path / "x.onnx", quiet=True)
    assert max(report.errors.values()) < 1e-4
    # Every node has a kernel. GroupNorm becomes InstanceNormalization, which the runtime computes inexactly.
    assert [str(found) for found in report.findings if found.kind != "inexact"] == []
    model = onnx.load(report.path)
    outputs = []
    for seed in (5, 6):
        photo = np.random.default_rng(seed).random((1, 3, SIDE, SIDE)).astype(np.float32)
        with torch.no_grad():
            wanted = dict(zip(layout.outputs, module(torch.tensor(photo)), strict=True))
        outputs.append(run(model, {"photo": photo}))
        for name, values in outputs[-1].items():
            reference = wanted[name].numpy()
            assert values.shape[0] == SIDE * SIDE
            assert np.abs(values - reference).max() < 1e-4 * np.abs(reference).max(), name
    # The photo decides, and rotations are of length 1: random weights do not make the test one of constants.
    names = list(layout.outputs)
    for name in names:
        assert np.abs(outputs[0][name] - outputs[1][name]).max() > 1e-3 * np.abs(outputs[0][name]).max(), name
    assert np.abs(np.linalg.norm(outputs[0][names[2]], axis=1) - 1).max() < 1e-5
