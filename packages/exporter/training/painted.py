"""Images of a mesh with procedural clothes and light: the training set of the avatar, because there are no photographs
of it. Millions of colored points on the surface are projected to pixels; the nearest one is kept.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from makehuman import PARTS, Body
from rasterizer import NEAR, Camera

LIGHT = np.array([-0.4, -0.75, -0.55])
SUPERSAMPLING = 2
SKIN, SHIRT, STRIPE = (0.80, 0.61, 0.51), (0.16, 0.36, 0.47), (0.86, 0.84, 0.78)
TROUSERS, SHOES, HAIR = (0.24, 0.25, 0.31), (0.45, 0.20, 0.14), (0.20, 0.13, 0.09)
# Which bones carry which garment, by the beginning of their names.
DRESSED = {
    "shirt": ("spine", "clavicle", "upperarm"),
    "trousers": ("pelvis", "thigh", "calf"),
    "shoes": ("foot", "ball"),
}


def surface_points(
    body: Body, count: int, rng: np.random.Generator, favour: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Random points on the surface: their triangles (N) and barycentric coordinates (N,3). Triangles are drawn by area
    times favour (T)."""
    corners = body.vertices[body.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) * favour
    chosen = rng.choice(len(area), count, p=area / area.sum())
    a, b = rng.random(count), rng.random(count)
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    return chosen, np.stack([1 - a - b, a, b], 1)


def interpolated(body: Body, values: np.ndarray, chosen: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Values of vertices (V,...) at points of the surface (N,...)."""
    picked = values[body.triangles[chosen]]
    return np.einsum("nk,nk...->n...", share, picked)


def normals_of(body: Body) -> np.ndarray:
    """Unit normals of vertices (V,3), outwards."""
    corners = body.vertices[body.triangles]
    each = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(body.vertices)
    for corner in range(3):
        np.add.at(total, body.triangles[:, corner], each)
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    # The files wind their triangles one way; which way is out shows on the body as a whole.
    skin = body.parts == list(PARTS).index("skin")
    outwards = ((body.vertices - body.vertices[skin].mean(0)) * total)[skin].sum() > 0
    return total if outwards else -total


def ripple(at: np.ndarray, waves: float, rng: np.random.Generator) -> np.ndarray:
    """Smooth noise (N), about -1 to 1, with the given number of waves per meter."""
    directions = rng.normal(size=(6, 3)) * waves * 2 * np.pi
    return np.sin(at @ directions.T + rng.uniform(0, 2 * np.pi, 6)).mean(1) * 1.6


def colored(body: Body, at: np.ndarray, weights: np.ndarray, part: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Colors (N,3) before light of points at rest (N,3), by the bones that carry them (N,J) and their part (N)."""
    names = list(PARTS)
    share = [weights[:, [n.startswith(begin) for n in body.names]].sum(1) for begin in DRESSED.values()]
    garment = np.where(np.max(share, 0) > 0.5, np.argmax(share, 0), -1)
    # A neck and hands stay bare, and a belt's height parts shirt from trousers.
    grain = ripple(at, 60, rng)[:, None]
    result = np.array(SKIN) * (1 + 0.04 * ripple(at, 9, rng)[:, None] + 0.015 * grain)
    stripes = (np.sin(at[:, 1:2] * 2 * np.pi / 0.07) > 0.55).astype(float)
    shirt = np.array(SHIRT) * (1 - stripes) + np.array(STRIPE) * stripes
    result = np.where(garment[:, None] == 0, shirt * (1 + 0.06 * grain), result)
    denim = np.array(TROUSERS) * (1 + 0.12 * ripple(at, 25, rng)[:, None] + 0.08 * grain)
    result = np.where(garment[:, None] == 1, denim, result)
    result = np.where(garment[:, None] == 2, np.array(SHOES) * (1 + 0.05 * grain), result)
    head = weights[:, [n == "head" for n in body.names]].sum(1) > 0.5
    eye = part == names.index("eye")
    if head.any() and eye.any():
        result[head] = headed(at[head], at[eye], result[head], rng)
    return np.where(eye[:, None], eyes(at, eye), result)


def headed(at: np.ndarray, eye: np.ndarray, skin: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Colors (N,3) of points of the head: short hair, brows and lips, measured in meters from the eyes."""
    x, y, z = (at - [0, eye[:, 1].mean(), eye[:, 2].min()]).T
    x = np.abs(x)
    wave = 0.006 * ripple(at, 40, rng)
    hair = (y < -0.062 + wave) | ((z > 0.085 + wave) & (y < 0.075 + wave))
    brow = (np.abs(y + 0.022 + 0.15 * np.abs(x - 0.035)) < 0.0045) & (x > 0.012) & (x < 0.055) & (z < 0.04)
    lips = (np.abs(y - 0.071) < 0.010 * np.sqrt(np.clip(1 - (x / 0.026) ** 2, 0, 1))) & (z < 0.03)
    strands = np.array(HAIR) * (1 + 0.3 * np.sin(at[:, :1] * 700 + 8 * ripple(at, 20, rng)[:, None]))
    result = np.where(lips[:, None], skin * [0.86, 0.58, 0.58], skin)
    return np.where((hair | brow)[:, None], strands, result)


def eyes(at: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """White, iris and pupil (N,3) of points, `eye` of which lie on an eyeball. The body looks towards -z."""
    color = np.ones((len(at), 3)) * 0.93
    for side in (-1, 1):
        mine = eye & (np.sign(at[:, 0]) == side)
        if mine.any():
            middle = (at[mine].min(0) + at[mine].max(0)) / 2
            away = at - middle
            ahead = -away[:, 2] / np.maximum(np.linalg.norm(away, axis=1), 1e-9)
            color[mine & (ahead > np.cos(0.50))] = (0.25, 0.38, 0.42)
            color[mine & (ahead > np.cos(0.22))] = 0.03
    return color


class Painted(nn.Module):
    """The dressed surface."""

    def __init__(self, body: Body, samples: int, rng: np.random.Generator):
        """`samples`: number of points; an image of the whole body at 1024 pixels needs some millions."""
        super().__init__()
        chosen, share = surface_points(body, samples, rng, np.ones(len(body.triangles)))
        at = interpolated(body, body.vertices, chosen, share)
        normals = interpolated(body, normals_of(body), chosen, share)
        weights = interpolated(body, body.weights, chosen, share)
        color = colored(body, at, weights, body.parts[body.triangles[chosen, 0]], rng)
        facing = normals @ (LIGHT / np.linalg.norm(LIGHT))
        light = 0.55 + 0.50 * np.clip(facing, 0, 1) + 0.10 * np.clip(-facing, 0, 1)
        self.register_buffer("corners", torch.tensor(body.triangles[chosen]))
        self.register_buffer("share", torch.tensor(share, dtype=torch.float32))
        self.register_buffer("color", torch.tensor(np.clip(color * light[:, None], 0, 1), dtype=torch.float32))

    @torch.no_grad()
    def forward(self, vertices: Tensor, camera: Camera) -> Tensor:
        """Premultiplied color and alpha (4,H,W) of the body with its vertices (V,3) where they are now."""
        points = sum(self.share[:, [k]] * vertices[self.corners[:, k]] for k in range(3))
        at = points @ camera.view[:3, :3].T + camera.view[:3, 3]
        flat = at @ camera.intrinsics.T
        width, height = camera.width * SUPERSAMPLING, camera.height * SUPERSAMPLING
        column, row = (flat[:, :2] / flat[:, 2:] * SUPERSAMPLING).floor().long().unbind(1)
        seen = (at[:, 2] > NEAR) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        number = torch.nonzero(seen)[:, 0]
        # The bits of a positive float sort like the float: depth first, then the point's number.
        key = (at[number, 2].contiguous().view(torch.int32).long() << 32) | number
        nearest = torch.full((height * width,), torch.iinfo(torch.int64).max, device=key.device)
        nearest.scatter_reduce_(0, row[number] * width + column[number], key, "amin")
        covered = nearest < torch.iinfo(torch.int64).max
        full = torch.zeros(height * width, 4, device=key.device)
        full[covered] = torch.cat([self.color, torch.ones_like(self.color[:, :1])], 1)[nearest[covered] & 0xFFFFFFFF]
        return nn.functional.avg_pool2d(full.T.reshape(1, 4, height, width), SUPERSAMPLING)[0]
