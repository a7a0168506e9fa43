"""Pictures of Gaussians that can be differentiated: gsplat where there is a CUDA device, a plain sum elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

# As in gsplat's classic mode: variance added to every ellipse (pixels squared), and alpha's limits.
DILATION = 0.3
LEAST_ALPHA, MOST_ALPHA = 1 / 255, 0.999
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
    """view (4,4) world to camera, OpenCV axes; intrinsics (3,3) in pixels; size of the picture in pixels."""

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
    """Premultiplied colour and alpha (4,H,W)."""
    return pictures(splats, [camera])[0]


def pictures(splats: Splats, cameras: Sequence[Camera]) -> Tensor:
    """The same Gaussians for cameras of one size (C,4,H,W)."""
    if splats.positions.is_cuda:
        return with_gsplat(splats, cameras)
    return torch.stack([summed(splats, camera) for camera in cameras])


def with_gsplat(splats: Splats, cameras: Sequence[Camera]) -> Tensor:
    """By gsplat's CUDA rasterizer."""
    from gsplat import rasterization

    colour, alpha, _ = rasterization(
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
    )
    return torch.cat([colour, alpha], -1).permute(0, 3, 1, 2)


def summed(splats: Splats, camera: Camera) -> Tensor:
    """Every Gaussian at every pixel: for a few hundred of them and pictures of a few thousand pixels."""
    turn, shift = camera.view[:3, :3], camera.view[:3, 3]
    at = splats.positions @ turn.T + shift
    order = torch.argsort(at[:, 2].detach())
    order = order[at[order, 2] > NEAR]
    x, y, z = at[order].unbind(1)
    fx, fy = camera.intrinsics[0, 0], camera.intrinsics[1, 1]
    zero = torch.zeros_like(z)
    jacobian = torch.stack([fx / z, zero, -fx * x / z**2, zero, fy / z, -fy * y / z**2], 1).reshape(-1, 2, 3) @ turn
    flat = jacobian @ splats.covariances[order] @ jacobian.transpose(1, 2) + DILATION * torch.eye(2)
    inverse = torch.linalg.inv(flat)
    centre = torch.stack([fx * x / z + camera.intrinsics[0, 2], fy * y / z + camera.intrinsics[1, 2]], 1)
    rows, columns = torch.arange(camera.height) + 0.5, torch.arange(camera.width) + 0.5
    pixels = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), -1).reshape(-1, 2)
    offset = pixels[None] - centre[:, None]
    falloff = torch.exp(-0.5 * torch.einsum("npa,nab,npb->np", offset, inverse, offset))
    alpha = (splats.opacities[order, None] * falloff).clamp(max=MOST_ALPHA)
    alpha = torch.where(alpha < LEAST_ALPHA, torch.zeros_like(alpha), alpha)
    through = torch.cumprod(torch.cat([torch.ones_like(alpha[:1]), 1 - alpha]), 0)
    weights = alpha * through[:-1]
    colour = weights.T @ splats.colors[order]
    full = torch.cat([colour, 1 - through[-1:].T], 1)
    return full.T.reshape(4, camera.height, camera.width)
