"""Photographs as a trainer sees them: an exposure for each, unknown parts left out, PSNR against held-out ones."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from common import Draw, Views, split
from losses import Photograph


class Exposures(nn.Module):
    """A gain for each image and channel: the flash was nearer to the object in some photographs than in others."""

    def __init__(self, count: int):
        """All gains 1."""
        super().__init__()
        self.log_gains = nn.Parameter(torch.zeros(count, 3))

    def exposed(self, picture: Tensor, index: int) -> Tensor:
        """The image (4,H,W) with the brightness of the photograph. Gains and colors could trade a common factor, so
        the mean gain is 1.
        """
        gain = torch.exp(self.log_gains[index] - self.log_gains.mean(0))
        return torch.cat([picture[:3] * gain[:, None, None], picture[3:]])


def photograph(views: Views, index: int) -> Photograph:
    """One photograph; images without masks are valid everywhere."""
    picture = views.pictures[index]
    whole, none = torch.ones_like(picture[3:]), torch.zeros_like(picture[3:])
    extra = views.extra
    valid = extra["valid"][index] if "valid" in extra else whole
    return Photograph(picture, valid, extra["doubtful"][index] if "doubtful" in extra else none)


@torch.no_grad()
def photograph_psnr(views: Views, draw: Draw) -> float:
    """Mean over held-out photographs, inside the outline, gain fitted."""
    _, held = split(len(views.pictures))
    return float(np.mean([photograph(views, i).psnr(draw(i)) for i in held]))
