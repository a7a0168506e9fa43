"""A network of published code that turns images into Gaussians, small and with random weights: TokenGS as the package
ffgs has it. Its C3G cannot be traced: the length of a table is the largest number in a tensor."""

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
tokengs: Any = pytest.importorskip("ffgs.models.tokengs.modeling")

HEIGHT, WIDTH = 28, 42


class Views(torch.nn.Module):  # type: ignore[misc]
    """Two images in 0..1, normalized as both networks expect them."""

    def __init__(self, network: Any, std: float) -> None:
        super().__init__()
        self.network = network
        for parameter in network.parameters():
            if parameter.dim() > 1 and parameter.is_floating_point():
                torch.nn.init.normal_(parameter, std=std)
        self.register_buffer("mean", torch.tensor([0.485, 0.456, 0.406]).view(1, 1, 3, 1, 1))
        self.register_buffer("deviation", torch.tensor([0.229, 0.224, 0.225]).view(1, 1, 3, 1, 1))

    def normalized(self, images: Any) -> Any:
        return (images[None] - self.mean) / self.deviation


class OfTokens(Views):
    def __init__(self) -> None:
        sizes = {"enc_depth": 1, "dec_depth": 2, "enc_embed_dim": 32, "enc_num_heads": 4, "token_dim": 32}
        super().__init__(tokengs.TokenGS(**sizes, patch_size=14, num_gs_tokens=16, dec_patch_size=4), 0.1)
        origins = torch.randn(1, 2, 3, HEIGHT, WIDTH)
        directions = torch.nn.functional.normalize(torch.randn(1, 2, 3, HEIGHT, WIDTH), dim=2)
        self.register_buffer("rays", torch.cat([torch.cross(origins, directions, dim=2), directions], 2))

    def forward(self, images: Any) -> Any:
        rows = self.network({"images": self.normalized(images), "plucker": self.rays})[0]
        return rows[:, :3], rows[:, 4:7], rows[:, 7:11], rows[:, 11:14].clamp(0, 1), rows[:, 3:4]


def test_tokengs(tmp_path: Path) -> None:
    torch.manual_seed(0)
    module, layout = OfTokens().eval(), gs.split()
    inputs = {"images": gs.image(WIDTH, HEIGHT, views=2)}
    report = gs.export_module(module, inputs, layout, out=tmp_path / "x.onnx", quiet=True)
    assert max(report.errors.values()) < 1e-4
    assert [str(found) for found in report.findings if found.kind != "inexact"] == []
    images = np.random.default_rng(5).random((2, 3, HEIGHT, WIDTH)).astype(np.float32)
    with torch.no_grad():
        wanted = dict(zip(layout.outputs, module(torch.tensor(images)), strict=True))
    for name, values in run(onnx.load(report.path), {"images": images}).items():
        assert np.abs(values - wanted[name].numpy()).max() < 1e-4 * np.abs(wanted[name].numpy()).max(), name
