"""Vessels of Gaussians by our own formula: what diffusion.py learns from. Needs numpy alone.

A vessel is a grid of ROWS x COLUMNS Gaussians, from the middle of its bottom to its rim, and around its axis. Twelve
numbers make a Gaussian: its position, the symmetric root of its covariance (upper triangle), its color.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float32]]

ROWS, COLUMNS = 48, 64
CHANNELS = 12
# Vessels that are made at once.
CHUNK = 256
# Rows of the flat bottom.
BOTTOM = 7
# Factors that bring all numbers to a deviation of about a half: positions, roots of covariances, colors.
POSITION, ROOT, COLOR = 1.3, 28.0, 2.8
# Smallest deviation of a Gaussian, and its deviation across the surface, world units.
THIN = 0.006
LIGHT = np.array([0.45, -0.75, -0.48]) / np.linalg.norm([0.45, 0.75, 0.48])


def hues(rng: np.random.Generator, count: int) -> Array:
    """Colors (count,3), 0..1: any hue, muted or strong."""
    hue, strength, value = rng.random((count, 1)), rng.uniform(0.2, 0.85, (count, 1)), rng.uniform(0.45, 1, (count, 1))
    wheel = np.clip(np.abs((hue * 6 + np.array([0, 4, 2])) % 6 - 3) - 1, 0, 1)
    return value * (1 - strength * (1 - wheel))


def vessels(rng: np.random.Generator, count: int) -> Array:
    """Random vessels (count,12,ROWS,COLUMNS), float32."""

    def of(low: float, high: float) -> Any:
        return rng.uniform(low, high, (count, 1, 1))

    angle = (np.arange(COLUMNS) / COLUMNS * 2 * np.pi)[None, None, :]
    height = np.clip((np.arange(ROWS) - BOTTOM + 1) / (ROWS - BOTTOM), 0, 1)[None, :, None]
    inner = np.clip((np.arange(ROWS) + 0.5) / BOTTOM, 0, 1)[None, :, None]
    waves = sum(rng.normal(0, 0.17 / k, (count, 1, 1)) * np.cos(np.pi * k * height + of(0, 6.3)) for k in (1, 2, 3))
    radius = np.maximum(of(0.3, 0.6) + waves, 0.1)
    lobes, twist = rng.choice([0, 3, 4, 5, 6, 8], (count, 1, 1)), of(-3, 3)
    ribs = np.where(lobes > 0, of(0, 0.22), 0) * np.cos(lobes * angle + twist * height)
    around = radius * (1 + ribs * np.sqrt(height)) * inner
    tall, lean = of(0.8, 1.7), of(-0.3, 0.3) * height**2
    # -y is up.
    x, y, z = around * np.cos(angle) * of(0.8, 1.2) + lean, tall * (0.5 - height), around * np.sin(angle)
    places = np.stack(np.broadcast_arrays(x, y, z), -1)

    across = (np.roll(places, -1, 2) - np.roll(places, 1, 2)) / 2
    along = np.gradient(places, axis=1)
    # The middle of the bottom has a direction around, too.
    across = across + 1e-4 * np.stack(np.broadcast_arrays(-np.sin(angle), 0 * height, np.cos(angle)), -1)
    first = across / np.linalg.norm(across, axis=-1, keepdims=True)
    normal = np.cross(first, along)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    second = np.cross(normal, first)
    sizes = [np.maximum(0.6 * np.linalg.norm(each, axis=-1), THIN) for each in (across, along)]
    axes = zip((first, second, normal), (*sizes, np.full_like(sizes[0], THIN)), strict=True)
    root = sum(size[..., None, None] * axis[..., :, None] * axis[..., None, :] for axis, size in axes)
    rows, columns = np.triu_indices(3)

    stripes, rings = rng.integers(0, 9, (count, 1, 1)), of(0, 5)
    pattern = 0.5 + 0.5 * np.tanh(of(1, 4) * np.sin(stripes * angle + 2 * np.pi * rings * height + of(0, 6.3)))
    band = 1 / (1 + np.exp(-40 * (height - of(0.75, 1.1))))
    three = [hues(rng, count)[:, None, None, :] for _ in range(3)]
    painted = three[0] + (three[1] - three[0]) * pattern[..., None]
    painted = painted + (three[2] - painted) * band[..., None]
    outward = np.sign((normal * (places * [1, 0.3, 1])).sum(-1, keepdims=True))
    lit = 0.5 + 0.5 * np.clip((normal * outward * LIGHT).sum(-1, keepdims=True), -0.3, 1)
    roots = root[..., rows, columns] * ROOT - 0.5 * (rows == columns)
    numbers = [places * POSITION, roots, (painted * lit - 0.4) * COLOR]
    return np.concatenate(numbers, -1).transpose(0, 3, 1, 2).astype(np.float32)


def chunk(number: int) -> Array:
    """CHUNK vessels; each number has its own."""
    return vessels(np.random.default_rng([7, number]), CHUNK)


def held_out(count: int) -> Array:
    """Vessels that no training has seen: of chunk 0."""
    return chunk(0)[:count]
