"""What is left out of the finished scene, and how bright it is."""

import numpy as np
import torch
from scipy.spatial import cKDTree

from bounds import Bounds
from dataset import Picture
from gaussians import SH_C0, Gaussians
from model import Parameters, weights

# A Gaussian that makes up less than this many pixels of every single photograph is never missed.
LEAST_PIXELS = 0.1
# Neighbours and distance, in units of the typical distance, beyond which a Gaussian counts as floating alone.
NEIGHBOURS = 8
LONELY = 6.0
# How bright the scene is: as the photographs at this percentile of all exposures.
EXPOSURE_PERCENTILE = 85


def visible(parameters: Parameters, pictures: list[Picture]) -> torch.Tensor:
    """Which Gaussians make up LEAST_PIXELS of some photograph, (N,) booleans."""
    most = torch.zeros(len(parameters["means"]), device="cuda")
    for picture in pictures:
        most = torch.maximum(most, weights(parameters, picture.view_matrix, picture.intrinsics, picture.size))
    return most > LEAST_PIXELS


def lonely(means: np.ndarray) -> np.ndarray:
    """Which means (N,3) have no close neighbours, (N,) booleans."""
    distance = cKDTree(means).query(means, NEIGHBOURS + 1)[0][:, 1:].mean(1)
    return distance > LONELY * np.median(distance)


def cleaned(parameters: Parameters, bounds: Bounds, pictures: list[Picture]) -> Parameters:
    """The Gaussians that are inside the bounds, seen by somebody and not alone."""
    kept = visible(parameters, pictures)
    unseen = int((~kept).sum())
    outside = bounds.outside(parameters["means"]) | (bounds.overhang(parameters) > 0.01)
    strayed = int((kept & outside).sum())
    kept &= ~outside
    index = torch.nonzero(kept)[:, 0]
    alone = torch.tensor(lonely(parameters["means"][index].detach().cpu().numpy()), device=index.device)
    index = index[~alone]
    print(f"cleaned: {unseen} unseen, {strayed} outside the bounds, {int(alone.sum())} alone, {len(index)} left")
    return {key: torch.nn.Parameter(value.detach()[index]) for key, value in parameters.items()}


def brightened(gaussians: Gaussians, gains: np.ndarray) -> Gaussians:
    """Colours multiplied by the gain (per channel) of a well-lit photograph; exact, as harmonics are linear."""
    gain = np.percentile(gains, EXPOSURE_PERCENTILE, axis=0).mean().astype(np.float32)
    print(f"exposure: colours times {gain:.3f}")
    sh = gaussians.sh * gain
    sh[:, 0] += 0.5 * (gain - 1) / SH_C0
    return Gaussians(gaussians.positions, gaussians.log_scales, gaussians.rotations, gaussians.opacity_logits, sh)
