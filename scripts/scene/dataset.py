"""The masked photographs as torch tensors: the references of the trainer's images."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch

from capture import Capture, View

# Room round the object in each crop, pixels: enough background to punish a Gaussian that strays out of the outline.
CROP_MARGIN = 40
# Pixels next to the outline mix object and background; their colour is taken from this far inside.
EDGE = 2


@dataclass(frozen=True)
class Picture:
    """One crop on the GPU: rgb (3,H,W) in 0..1, alpha, valid and doubtful (1,H,W), world to camera
    (4,4), intrinsics (3,3). masks.py defines valid and doubtful."""

    name: str
    rgb: torch.Tensor
    alpha: torch.Tensor
    valid: torch.Tensor
    doubtful: torch.Tensor
    view_matrix: torch.Tensor
    intrinsics: torch.Tensor

    @property
    def size(self) -> tuple[int, int]:
        return self.rgb.shape[2], self.rgb.shape[1]


def colors_without_fringe(photograph: np.ndarray, coverage: np.ndarray) -> np.ndarray:
    """Replaces each pixel that is not well inside the object by the nearest one that is."""
    inside = cv2.erode((coverage > 127).astype(np.uint8), np.ones((2 * EDGE + 1, 2 * EDGE + 1)))
    _, labels = cv2.distanceTransformWithLabels(1 - inside, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    row, column = np.nonzero(inside)
    of_label = np.zeros(labels.max() + 1, np.int64)
    of_label[labels[row, column]] = np.arange(len(row))
    nearest = of_label[labels]
    return photograph[row[nearest], column[nearest]]


def load_picture(folder: Path, view: View, capture: Capture, device: str) -> Picture:
    photograph = cv2.cvtColor(cv2.imread(str(folder / f"{view.name}.jpg")), cv2.COLOR_BGR2RGB)
    mask = cv2.imread(str(folder / f"{view.name}.png"))
    doubtful, valid, coverage = mask[..., 0] > 127, mask[..., 1] > 127, mask[..., 2]
    rows, columns = np.nonzero(coverage.any(1))[0], np.nonzero(coverage.any(0))[0]
    top, left = max(rows[0] - CROP_MARGIN, 0), max(columns[0] - CROP_MARGIN, 0)
    crop = np.s_[top : rows[-1] + CROP_MARGIN, left : columns[-1] + CROP_MARGIN]
    colors = np.where(doubtful[..., None], photograph, colors_without_fringe(photograph, coverage))
    rgb = colors[crop].astype(np.float32) / 255
    intrinsics = capture.intrinsics.matrix()
    intrinsics[:2, 2] -= [left, top]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = view.rotation, view.translation

    def tensor(array: np.ndarray) -> torch.Tensor:
        return torch.tensor(np.ascontiguousarray(array), dtype=torch.float32, device=device)

    return Picture(
        view.name,
        tensor(rgb.transpose(2, 0, 1)),
        tensor(coverage[crop][None] / 255),
        tensor(valid[crop][None]),
        tensor(doubtful[crop][None]),
        tensor(matrix),
        tensor(intrinsics),
    )


def load_pictures(folder: Path, capture: Capture, device: str = "cuda") -> list[Picture]:
    """All views with a mask of masks.py, in the order of their names."""
    return [
        load_picture(folder, view, capture, device) for view in capture.views if (folder / f"{view.name}.png").exists()
    ]
