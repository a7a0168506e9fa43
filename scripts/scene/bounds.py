"""Bounds of the Gaussians: inside the visual hull, above the cut."""

import numpy as np
import torch
from scipy.ndimage import binary_dilation

from masks import VOXEL
from model import Parameters

# Gaussians may lie this many voxels outside the hull; the hull's own outline is not exact.
HULL_SLACK = 3
# Standard deviations of a Gaussian that must stay above the cut, so that the cut looks like one.
CUT_SIGMAS = 2.0
# Widest standard deviation that surface detail needs, in world units (the object is about one unit long).
WIDEST = 0.03


def matrices(quaternions: torch.Tensor) -> torch.Tensor:
    """Rotation matrices (N,3,3) of quaternions w x y z (N,4)."""
    w, x, y, z = torch.nn.functional.normalize(quaternions, dim=1).unbind(1)
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return torch.stack(rows, 1).reshape(-1, 3, 3)


class Bounds:
    """The hull as a grid of booleans on the GPU, and the height of the cut (y grows downwards)."""

    def __init__(self, hull: np.ndarray, cut_height: float, device: str = "cuda"):
        self.low = hull.min(0) - (HULL_SLACK + 1) * VOXEL
        index = np.round((hull - self.low) / VOXEL).astype(int)
        grid = np.zeros(index.max(0) + HULL_SLACK + 2, bool)
        grid[tuple(index.T)] = True
        self.grid = torch.tensor(binary_dilation(grid, iterations=HULL_SLACK), device=device)
        self.origin = torch.tensor(self.low, dtype=torch.float32, device=device)
        self.cut_height = cut_height

    def outside(self, means: torch.Tensor) -> torch.Tensor:
        """Which of the means (N,3) lie outside the hull or below the cut."""
        index = torch.round((means - self.origin) / VOXEL).long()
        limit = torch.tensor(self.grid.shape, device=means.device)
        within = ((index >= 0) & (index < limit)).all(1)
        x, y, z = torch.minimum(index.clamp(min=0), limit - 1).unbind(1)
        return ~(within & self.grid[x, y, z]) | (means[:, 1] > self.cut_height)

    def overhang(self, parameters: Parameters) -> torch.Tensor:
        """How far each Gaussian reaches below the cut, world units, 0 if it does not. Differentiable."""
        down = matrices(parameters["quats"])[:, 1] * torch.exp(parameters["scales"])
        return torch.relu(parameters["means"][:, 1] + CUT_SIGMAS * down.norm(dim=1) - self.cut_height)

    def excess_width(self, parameters: Parameters) -> torch.Tensor:
        """The excess of each axis over the width that surface detail needs."""
        return torch.relu(torch.exp(parameters["scales"]) - WIDEST)
