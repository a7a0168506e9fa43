"""A small rasterizer for the CPU: who covers which pixel, and how much. The image formation of gsplat's antialiased
mode without colours. Slow (a second for 90,000 Gaussians), but trimming needs no GPU this way."""

from dataclasses import dataclass

import numba
import numpy as np

from gaussians import Gaussians

# Both as in gsplat: variance added to every screen ellipse, pixels squared; opacity under which nothing is drawn.
DILATION = 0.3
MIN_ALPHA = 1 / 255
MAX_ALPHA = 0.999
OPAQUE = 1e-4
# Standard deviations past which even an opaque Gaussian is below LEAST_ALPHA.
REACH = 3.34


@dataclass(frozen=True)
class Ellipses:
    """Gaussians on the screen, nearest first. `index` says which Gaussian each one is."""

    index: np.ndarray
    centers: np.ndarray
    conics: np.ndarray
    opacities: np.ndarray
    reaches: np.ndarray


def rotation_matrices(wxyz: np.ndarray) -> np.ndarray:
    """Rotation matrices (N,3,3) of unit quaternions (N,4)."""
    w, x, y, z = wxyz.T
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return np.stack(rows, 1).reshape(-1, 3, 3)


def axes(gaussians: Gaussians) -> np.ndarray:
    """The three half axes of one standard deviation as columns, (N,3,3)."""
    return rotation_matrices(gaussians.rotations) * np.exp(gaussians.log_scales)[:, None]


def project_ellipses(gaussians: Gaussians, matrix: np.ndarray, focal: float, size: tuple[int, int]) -> Ellipses:
    """EWA splatting (Zwicker et al. 2002). `matrix`: world to camera (4,4). Every Gaussian must lie in front of it."""
    camera = gaussians.positions @ matrix[:3, :3].T + matrix[:3, 3]
    x, y, depth = camera.T
    zero = np.zeros_like(depth)
    jacobian = np.stack([focal / depth, zero, -focal * x / depth**2, zero, focal / depth, -focal * y / depth**2], 1)
    half = jacobian.reshape(-1, 2, 3) @ matrix[:3, :3] @ axes(gaussians)
    covariance = half @ half.transpose(0, 2, 1)
    a, b, c = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    before = a * c - b * b
    a, c = a + DILATION, c + DILATION
    after = a * c - b * b
    # A Gaussian thinner than a pixel is drawn wider and, for that, fainter.
    opacity = np.sqrt(np.maximum(before / after, 0)) / (1 + np.exp(-gaussians.opacity_logits))
    centers = np.stack([focal * x / depth + size[0] / 2, focal * y / depth + size[1] / 2], 1)
    order = np.argsort(depth, kind="stable")
    conics = np.stack([c / after, -b / after, a / after], 1)
    reaches = REACH * np.sqrt(np.maximum(a, c))
    return Ellipses(order, centers[order], conics[order], opacity[order], reaches[order])


@numba.njit(cache=False)
def _blend(centers, conics, opacities, reaches, final, max_thin, thin, solid, transmittance):
    """Front to back. With a final coverage given, sorts each Gaussian's weights into thin and solid pixels."""
    height, width = transmittance.shape
    for i in range(len(centers)):
        left, right = max(int(centers[i, 0] - reaches[i]), 0), min(int(centers[i, 0] + reaches[i]) + 2, width)
        top, bottom = max(int(centers[i, 1] - reaches[i]), 0), min(int(centers[i, 1] + reaches[i]) + 2, height)
        for row in range(top, bottom):
            for column in range(left, right):
                if transmittance[row, column] < OPAQUE:
                    continue
                dx, dy = column + 0.5 - centers[i, 0], row + 0.5 - centers[i, 1]
                power = 0.5 * (conics[i, 0] * dx * dx + conics[i, 2] * dy * dy) + conics[i, 1] * dx * dy
                alpha = min(MAX_ALPHA, opacities[i] * np.exp(-power))
                if alpha < MIN_ALPHA:
                    continue
                weight = alpha * transmittance[row, column]
                transmittance[row, column] -= weight
                if final[row, column] < max_thin:
                    thin[i] += weight
                else:
                    solid[i] += weight


def thin_and_solid(ellipses: Ellipses, size: tuple[int, int], max_thin: float) -> tuple[np.ndarray, np.ndarray]:
    """Each Gaussian's blending weights summed over the pixels whose coverage stays below `most_thin`, and over the
    others; (N,) each, in the order of the Gaussians."""
    count, shape = len(ellipses.index), (size[1], size[0])
    rest = np.ones(shape)
    drawn = (ellipses.centers, ellipses.conics, ellipses.opacities, ellipses.reaches)
    _blend(*drawn, np.zeros(shape), 0.0, np.zeros(count), np.zeros(count), rest)
    thin, solid = np.zeros(count), np.zeros(count)
    _blend(*drawn, 1 - rest, max_thin, thin, solid, np.ones(shape))
    back = np.argsort(ellipses.index)
    return thin[back], solid[back]
