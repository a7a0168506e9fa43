"""Comparisons of images: PSNR, structural similarity, and photographs with unknown parts."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional as F  # noqa: N812

SSIM_WEIGHT = 0.2
# Weight of coverage in unknown pixels: small enough that any view that shows them decides.
DOUBT_WEIGHT = 0.1


def psnr(found: Tensor, wanted: Tensor) -> float:
    """PSNR of images in 0..1."""
    return float(-10 * torch.log10((found.clamp(0, 1) - wanted).square().mean() + 1e-12))


def gaussian_window(width: int, device: torch.device, sigma: float = 1.5) -> Tensor:
    """(3,1,width,width), sums to 1."""
    line = torch.exp(-((torch.arange(width, device=device) - width // 2) ** 2) / (2 * sigma**2))
    line = line / line.sum()
    return (line[:, None] * line[None]).expand(3, 1, width, width).contiguous()


def ssim(a: Tensor, b: Tensor, width: int = 11) -> Tensor:
    """Structural similarity of images (3,H,W) in 0..1 (Wang et al. 2004, an 11x11 window of sigma 1.5)."""
    stack = torch.stack([a, b, a * a, b * b, a * b])
    window = gaussian_window(width, a.device)
    mean_a, mean_b, aa, bb, ab = F.conv2d(stack, window, padding=width // 2, groups=3)
    both, c1, c2 = mean_a * mean_b, 0.01**2, 0.03**2
    above = (2 * both + c1) * (2 * (ab - both) + c2)
    below = (mean_a**2 + mean_b**2 + c1) * (aa - mean_a**2 + bb - mean_b**2 + c2)
    return (above / below).mean()


def difference(found: Tensor, wanted: Tensor) -> Tensor:
    """Loss of the training: L1 and a fifth of structural similarity."""
    return (1 - SSIM_WEIGHT) * (found - wanted).abs().mean() + SSIM_WEIGHT * (1 - ssim(found, wanted))


def loss_of(found: Tensor, wanted: Tensor) -> Tensor:
    """Images (4,H,W), premultiplied, over a random background, so that wrong coverage is visible."""
    background = torch.rand(3, 1, 1, device=found.device)
    return difference(
        found[:3] + background * (1 - found[3:]),
        wanted[:3] + background * (1 - wanted[3:]),
    )


@dataclass
class Photograph:
    """`picture` (4,H,W): colors of the object and, for dark pixels of object or room (doubtful), those of the
    photograph; coverage. valid (1,H,W): 0 for occluded pixels. doubtful (1,H,W).
    """

    picture: Tensor
    valid: Tensor
    doubtful: Tensor

    def loss(self, found: Tensor) -> Tensor:
        """As `loss_of`. Where the photograph is in doubt, anything that is no brighter than it over black is right."""
        background = torch.rand(3, 1, 1, device=found.device) * (1 - self.doubtful)
        got = found[:3] + background * (1 - found[3:])
        wanted = self.picture[:3] + background * (1 - self.picture[3:])
        wanted = torch.where(self.doubtful > 0, torch.minimum(wanted, got.detach()), wanted)
        got = got * self.valid + wanted * (1 - self.valid)
        return difference(got, wanted) + DOUBT_WEIGHT * (found[3:] * self.doubtful * self.valid).mean()

    def psnr(self, found: Tensor) -> float:
        """Decibels inside the outline after the best gain for each channel: a photograph's exposure is not the
        scene's."""
        inside = ((self.picture[3:] > 0.99) & (self.valid > 0) & (self.doubtful == 0))[0]
        got, wanted = found[:3, inside], self.picture[:3, inside]
        gain = (got * wanted).sum(1, keepdim=True) / (got * got).sum(1, keepdim=True).clamp(min=1e-9)
        return psnr(got * gain, wanted)
