"""Removes Gaussians from the finished scene, and sets its brightness."""

import numpy as np
import torch
from scipy.spatial import cKDTree

from bounds import Bounds
from dataset import Picture
from gaussians import SH_C0, Gaussians
from model import Parameters, weights

# A Gaussian that makes up less than this many pixels of every single photograph is never missed.
MIN_PIXELS = 0.1
# Fraction of a Gaussian's visible weight, over all photographs, that must fall on the object.
MIN_ON_OBJECT = 0.6
# Neighbours and distance, in units of the typical distance, beyond which a Gaussian counts as floating alone.
NEIGHBORS = 8
LONELY = 6.0
# How bright the scene is: as the photographs at this percentile of all exposures.
EXPOSURE_PERCENTILE = 85


def visible_and_proper(parameters: Parameters, pictures: list[Picture]) -> tuple[torch.Tensor, torch.Tensor]:
    """Which Gaussians make up LEAST_PIXELS of some photograph, and which of them are visible mostly on the object rather than on background or darkness; (N,) booleans each."""
    count = len(parameters["means"])
    maximum, on, off = (torch.zeros(count, device="cuda") for _ in range(3))
    for picture in pictures:
        known = picture.valid * (1 - picture.doubtful)
        regions = [known * picture.alpha, picture.valid * (1 - known * picture.alpha), torch.ones_like(known)]
        shown, spilled, whole = weights(parameters, picture.view_matrix, picture.intrinsics, picture.size, regions)
        maximum, on, off = torch.maximum(maximum, whole), on + shown, off + spilled
    return maximum > MIN_PIXELS, on >= MIN_ON_OBJECT * (on + off)


def lonely(means: np.ndarray) -> np.ndarray:
    """Which means (N,3) have no close neighbours, (N,) booleans."""
    distance = cKDTree(means).query(means, NEIGHBORS + 1)[0][:, 1:].mean(1)
    return distance > LONELY * np.median(distance)


def cleaned(parameters: Parameters, bounds: Bounds, pictures: list[Picture]) -> Parameters:
    """The Gaussians that are inside the bounds, visible on the object in a view, and not isolated."""
    kept, proper = visible_and_proper(parameters, pictures)
    unseen, spilled = int((~kept).sum()), int((kept & ~proper).sum())
    kept &= proper
    outside = bounds.outside(parameters["means"]) | (bounds.overhang(parameters) > 0.01)
    strayed = int((kept & outside).sum())
    kept &= ~outside
    index = torch.nonzero(kept)[:, 0]
    alone = torch.tensor(lonely(parameters["means"][index].detach().cpu().numpy()), device=index.device)
    index = index[~alone]
    gone = f"{unseen} unseen, {spilled} beside the object, {strayed} outside the bounds, {int(alone.sum())} alone"
    print(f"cleaned: {gone}, {len(index)} left")
    return {key: torch.nn.Parameter(value.detach()[index]) for key, value in parameters.items()}


def brightened(gaussians: Gaussians, gains: np.ndarray) -> Gaussians:
    """Colours multiplied by the gain (per channel) of a well-lit photograph; exact, as harmonics are linear."""
    gain = np.percentile(gains, EXPOSURE_PERCENTILE, axis=0).mean().astype(np.float32)
    print(f"exposure: colours times {gain:.3f}")
    sh = gaussians.sh * gain
    sh[:, 0] += 0.5 * (gain - 1) / SH_C0
    return Gaussians(gaussians.positions, gaussians.log_scales, gaussians.rotations, gaussians.opacity_logits, sh)
