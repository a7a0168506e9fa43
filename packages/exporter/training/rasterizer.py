"""Differentiable rendering of Gaussians: gsplat on a CUDA device, a list of pairs elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

# As in gsplat's classic mode: variance added to every ellipse (pixels squared), and alpha's limits.
DILATION = 0.3
MIN_ALPHA, MAX_ALPHA = 1 / 255, 0.999
NEAR = 0.01


@dataclass
class Splats:
    """positions (N,3), covariances (N,3,3), colors (N,3), opacities (N)."""

    positions: Tensor
    covariances: Tensor
    colors: Tensor
    opacities: Tensor


@dataclass
class Camera:
    """view (4,4) world to camera, OpenCV axes; intrinsics (3,3) in pixels; size of the image in pixels."""

    view: Tensor
    intrinsics: Tensor
    width: int
    height: int

    @property
    def position(self) -> Tensor:
        """The eye (3)."""
        return -self.view[:3, :3].T @ self.view[:3, 3]


def rotation_matrices(quaternions: Tensor) -> Tensor:
    """(N,3,3) of quaternions w x y z (N,4) of any length."""
    w, x, y, z = torch.nn.functional.normalize(quaternions, dim=-1).unbind(-1)
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return torch.stack(rows, -1).reshape(*quaternions.shape[:-1], 3, 3)


def covariances(scales: Tensor, quaternions: Tensor) -> Tensor:
    """(N,3,3) of standard deviations (N,3) and quaternions (N,4)."""
    half = rotation_matrices(quaternions) * scales[..., None, :]
    return half @ half.transpose(-1, -2)


def picture(splats: Splats, camera: Camera) -> Tensor:
    """Premultiplied color and alpha (4,H,W)."""
    return pictures(splats, [camera])[0]


def pictures(splats: Splats, cameras: Sequence[Camera]) -> Tensor:
    """The same Gaussians for cameras of one size (C,4,H,W)."""
    if splats.positions.is_cuda:
        return with_gsplat(splats, cameras, "RGB")
    return torch.stack([listed(splats, camera, splats.colors) for camera in cameras])


def pictures_with_depth(splats: Splats, cameras: Sequence[Camera]) -> tuple[Tensor, Tensor]:
    """As `pictures`, and the depth of each pixel (C,1,H,W): the mean z in the camera's frame of what is seen there,
    world units; 0 where nothing is."""
    if splats.positions.is_cuda:
        both = with_gsplat(splats, cameras, "RGB+D")
    else:
        both = torch.stack([listed(splats, camera, with_z(splats, camera)) for camera in cameras])
    color, depth, alpha = both.split((3, 1, 1), 1)
    return torch.cat([color, alpha], 1), depth / alpha.clamp(min=MIN_ALPHA)


def with_z(splats: Splats, camera: Camera) -> Tensor:
    """Colors and the depth from a camera (N,4)."""
    z = splats.positions @ camera.view[2, :3] + camera.view[2, 3]
    return torch.cat([splats.colors, z[:, None]], 1)


def with_gsplat(splats: Splats, cameras: Sequence[Camera], mode: str) -> Tensor:
    """Draws with gsplat's CUDA rasterizer; alpha is the last channel."""
    from gsplat import rasterization

    color, alpha, _ = rasterization(
        means=splats.positions,
        quats=None,
        scales=None,
        covars=splats.covariances,
        opacities=splats.opacities,
        colors=splats.colors,
        viewmats=torch.stack([camera.view for camera in cameras]),
        Ks=torch.stack([camera.intrinsics for camera in cameras]),
        width=cameras[0].width,
        height=cameras[0].height,
        near_plane=NEAR,
        packed=False,
        render_mode=mode,
    )
    return torch.cat([color, alpha], -1).permute(0, 3, 1, 2)


@dataclass
class Ellipses:
    """Gaussians in the image, near to far: centers (N,2) in pixels, covariances (N,3) xx, xy, yy, opacities (N), and
    their indices among all Gaussians (N).
    """

    centers: Tensor
    covariances: Tensor
    opacities: Tensor
    numbers: Tensor


def projected(splats: Splats, camera: Camera) -> Ellipses:
    """Selects Gaussians in front of the camera that are not transparent."""
    turn, shift = camera.view[:3, :3], camera.view[:3, 3]
    at = splats.positions @ turn.T + shift
    order = torch.argsort(at[:, 2].detach(), stable=True)
    order = order[(at[order, 2] > NEAR) & (splats.opacities[order] > MIN_ALPHA)]
    x, y, z = at[order].unbind(1)
    fx, fy = camera.intrinsics[0, 0], camera.intrinsics[1, 1]
    zero = torch.zeros_like(z)
    jacobian = torch.stack([fx / z, zero, -fx * x / z**2, zero, fy / z, -fy * y / z**2], 1).reshape(-1, 2, 3) @ turn
    flat = jacobian @ splats.covariances[order] @ jacobian.transpose(1, 2)
    entries = torch.stack([flat[:, 0, 0] + DILATION, flat[:, 0, 1], flat[:, 1, 1] + DILATION], 1)
    centers = torch.stack([fx * x / z + camera.intrinsics[0, 2], fy * y / z + camera.intrinsics[1, 2]], 1)
    return Ellipses(centers, entries, splats.opacities[order], order)


@torch.no_grad()
def touched(ellipses: Ellipses, width: int, height: int) -> tuple[Tensor, Tensor, Tensor]:
    """Which ellipse may reach which pixel: numbers of ellipses, columns and rows of pixels, a pair to an entry."""
    reach = (2 * torch.log(ellipses.opacities / MIN_ALPHA)).sqrt()[:, None] * ellipses.covariances[:, ::2].sqrt()
    maximum = torch.tensor([width, height])
    low = (ellipses.centers - reach - 0.5).ceil().long().clamp(min=0)
    size = ((ellipses.centers + reach - 0.5).floor().long() + 1).minimum(maximum).sub(low).clamp(min=0)
    counts = size[:, 0] * size[:, 1]
    which = torch.repeat_interleave(counts)
    at = torch.arange(len(which)) - (counts.cumsum(0) - counts)[which]
    wide = size[which, 0]
    return which, low[which, 0] + at % wide, low[which, 1] + at // wide


def listed(splats: Splats, camera: Camera, values: Tensor) -> Tensor:
    """Values (N,K) of the Gaussians, blended, and alpha (K+1,H,W): all pairs of Gaussian and pixel in one list."""
    ellipses = projected(splats, camera)
    which, column, row = touched(ellipses, camera.width, camera.height)
    dx, dy = (torch.stack([column, row], 1) + 0.5 - ellipses.centers[which]).unbind(1)
    xx, xy, yy = ellipses.covariances[which].unbind(1)
    falloff = torch.exp(-0.5 * (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy))
    alpha = (ellipses.opacities[which] * falloff).clamp(max=MAX_ALPHA)
    pixel = row * camera.width + column
    kept = torch.nonzero(alpha.detach() >= MIN_ALPHA)[:, 0]
    # Stable, so that each pixel's entries stay in the order of depth.
    kept = kept[torch.argsort(pixel[kept], stable=True)]
    alpha, pixel = alpha[kept], pixel[kept]
    weights = alpha * transmittance(alpha, pixel)
    full = torch.cat([values[ellipses.numbers[which[kept]]], torch.ones_like(alpha[:, None])], 1)
    count = camera.width * camera.height
    blended = torch.zeros(count, full.shape[1]).index_add(0, pixel, weights[:, None] * full)
    return blended.T.reshape(-1, camera.height, camera.width)


def transmittance(alpha: Tensor, pixel: Tensor) -> Tensor:
    """Transmittance before each entry. Entries are grouped by pixel, near to far."""
    # In double: one sum runs through all pixels.
    logs = torch.log1p(-alpha.double())
    before = logs.cumsum(0) - logs
    first = torch.ones_like(pixel, dtype=torch.bool)
    first[1:] = pixel[1:] != pixel[:-1]
    start = before[first][first.cumsum(0) - 1]
    return (before - start).exp().float()
