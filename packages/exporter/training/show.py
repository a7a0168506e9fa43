"""Comparison images of a training: references above, drawn images below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from common import Draw, Views, split

MAX_IMAGES = 6


@torch.no_grad()
def held_out_sheet(path: Path, views: Views, draw: Draw) -> None:
    """Some held-out images: PATH.png to view, PATH.npz with their cameras."""
    _, held = split(len(views.pictures))
    chosen = held[:: max(len(held) // MAX_IMAGES, 1)][:MAX_IMAGES]
    sheet(path.with_suffix(".png"), [views.pictures[i] for i in chosen], [draw(i) for i in chosen])
    extra = {name: value[chosen] for name, value in views.extra.items()}
    Views(views.pictures[chosen], views.views[chosen], views.intrinsics[chosen], extra).save(path.with_suffix(".npz"))


def sheet(path: Path, wanted: Sequence[Tensor], found: Sequence[Tensor], background: float = 1.0) -> None:
    """Writes a PNG of two rows; images (4,H,W), premultiplied, or (3,H,W). Without OpenCV it prints a message."""
    try:
        import cv2
    except ImportError:
        print(f"{path}: not written, OpenCV is not installed", flush=True)
        return

    def row(pictures: Sequence[Tensor]) -> np.ndarray:
        over = [p[:3] + (background * (1 - p[3:]) if len(p) == 4 else 0) for p in pictures]
        return torch.cat([p.detach().clamp(0, 1) for p in over], 2).permute(1, 2, 0).cpu().numpy()

    table = (np.concatenate([row(wanted), row(found)]) * 255).round().astype(np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), table[:, :, ::-1])
