"""The parameters that are trained, and the image they give."""

import numpy as np
import torch
from gsplat import rasterization
from scipy.spatial import cKDTree

from gaussians import SH_C0, Gaussians

# Trained with the antialiasing compensation of Mip-Splatting, so shown with it: the file carries the flag.
RASTERIZE_MODE = "antialiased"
NEAR_PLANE = 0.2

Parameters = dict[str, torch.nn.Parameter]


def as_parameters(values: dict[str, np.ndarray], device: str) -> Parameters:
    return {
        key: torch.nn.Parameter(torch.tensor(value, dtype=torch.float32, device=device))
        for key, value in values.items()
    }


def initial_parameters(points: np.ndarray, colors: np.ndarray, sh_degree: int, device: str = "cuda") -> Parameters:
    """Round Gaussians at `points` (N,3), as wide as the distance to their neighbours; colours (N,3) in 0..1."""
    distance = cKDTree(points).query(points, 4)[0][:, 1:].mean(1)
    values = {
        "means": points,
        "scales": np.log(np.clip(distance, 1e-4, 0.03))[:, None].repeat(3, 1),
        "quats": np.random.default_rng(0).normal(size=(len(points), 4)),
        "opacities": np.full(len(points), 0.0),
        "sh0": ((colors - 0.5) / SH_C0)[:, None],
        "shN": np.zeros((len(points), (sh_degree + 1) ** 2 - 1, 3)),
    }
    return as_parameters(values, device)


def render(
    parameters: Parameters, view_matrix: torch.Tensor, intrinsics: torch.Tensor, size: tuple[int, int], sh_degree: int
) -> tuple[torch.Tensor, torch.Tensor, dict]:
    """Premultiplied colour (3,H,W), alpha (1,H,W) and the inputs of the strategy. size is (width, height)."""
    color, alpha, info = rasterization(
        means=parameters["means"],
        quats=parameters["quats"],
        scales=torch.exp(parameters["scales"]),
        opacities=torch.sigmoid(parameters["opacities"]),
        colors=torch.cat([parameters["sh0"], parameters["shN"]], 1),
        viewmats=view_matrix[None],
        Ks=intrinsics[None],
        width=size[0],
        height=size[1],
        sh_degree=sh_degree,
        near_plane=NEAR_PLANE,
        packed=False,
        rasterize_mode=RASTERIZE_MODE,
    )
    return color[0].permute(2, 0, 1), alpha[0].permute(2, 0, 1), info


def weights(
    parameters: Parameters,
    view_matrix: torch.Tensor,
    intrinsics: torch.Tensor,
    size: tuple[int, int],
    regions: list[torch.Tensor],
) -> list[torch.Tensor]:
    """How many pixels of each region (1,H,W) each Gaussian makes up: its blending weights summed, (N,) each."""
    # The derivative of the summed image by a Gaussian's grey value is that sum; no second rasterizer needed.
    gray = torch.ones(len(parameters["means"]), 1, device=view_matrix.device, requires_grad=True)
    picture, _, _ = rasterization(
        means=parameters["means"].detach(),
        quats=parameters["quats"].detach(),
        scales=torch.exp(parameters["scales"].detach()),
        opacities=torch.sigmoid(parameters["opacities"].detach()),
        colors=gray,
        viewmats=view_matrix[None],
        Ks=intrinsics[None],
        width=size[0],
        height=size[1],
        near_plane=NEAR_PLANE,
        packed=False,
        rasterize_mode=RASTERIZE_MODE,
    )
    sums = [(picture[0, ..., 0] * region[0]).sum() for region in regions]
    return [torch.autograd.grad(total, gray, retain_graph=True)[0][:, 0] for total in sums]


def to_gaussians(parameters: Parameters) -> Gaussians:
    arrays = {key: value.detach().cpu().numpy() for key, value in parameters.items()}
    rotations = arrays["quats"] / np.linalg.norm(arrays["quats"], axis=1, keepdims=True)
    sh = np.concatenate([arrays["sh0"], arrays["shN"]], 1)
    return Gaussians(arrays["means"], arrays["scales"], rotations, arrays["opacities"], sh)


def from_gaussians(gaussians: Gaussians, device: str = "cuda") -> Parameters:
    values = {
        "means": gaussians.positions,
        "scales": gaussians.log_scales,
        "quats": gaussians.rotations,
        "opacities": gaussians.opacity_logits,
        "sh0": gaussians.sh[:, :1],
        "shN": gaussians.sh[:, 1:],
    }
    return as_parameters(values, device)
