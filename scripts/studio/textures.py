"""Tileable textures from noise. Every image is float32, rows x columns x 3, linear reflectance in 0 to 1."""

import functools

import numpy as np

SIZE = 512


@functools.cache
def noise(seed: int, first: int = 4, octaves: int = 6, stretch: int = 1, size: int = SIZE) -> np.ndarray:
    """Smooth value noise in 0 to 1; `first` cells in the first octave, `stretch` times as many along rows."""
    random = np.random.default_rng(seed)
    total = np.zeros((size, size))
    for octave in range(octaves):
        rows, columns = first << octave, (first * stretch) << octave
        if max(rows, columns) > size:
            break
        grid = random.random((rows, columns))
        total += _smooth(_smooth(grid, size).T, size).T / 2**octave
    total -= total.min()
    return total / total.max()


def _smooth(grid: np.ndarray, size: int) -> np.ndarray:
    at = np.linspace(0, len(grid), size, endpoint=False)
    cell, part = at.astype(int), (at % 1)[:, None]
    part = part * part * (3 - 2 * part)
    return grid[cell] * (1 - part) + grid[(cell + 1) % len(grid)] * part


def blend(low, high, amount: np.ndarray) -> np.ndarray:
    """A image between two colors."""
    amount = amount[..., None]
    return np.clip(np.asarray(low) * (1 - amount) + np.asarray(high) * amount, 0, 1).astype(np.float32)


def plaster(color, seed: int, depth: float = 0.12) -> np.ndarray:
    """Painted wall: broad stains and a fine grain."""
    grain = 0.6 * noise(seed, 4, 4) + 0.4 * noise(seed + 900, 64, 3)
    return blend(np.asarray(color) * (1 - depth), np.asarray(color), grain)


def wood(low, high, seed: int, planks: int = 0) -> np.ndarray:
    """Grain along columns; with `planks`, boards side by side whose ends are staggered."""
    grain = noise(seed, 2, 6, 16)
    rings = 0.5 + 0.5 * np.sin(40 * noise(seed + 1, 2, 3, 4) + 3 * grain)
    image = blend(low, high, 0.65 * grain + 0.35 * rings)
    if not planks:
        return image
    random = np.random.default_rng(seed)
    width = SIZE // planks
    for board in range(planks):
        columns = slice(board * width, (board + 1) * width)
        image[:, columns] = np.roll(image[:, columns], random.integers(SIZE), 0)
        cut = random.integers(SIZE)
        for part in (slice(0, cut), slice(cut, SIZE)):
            image[part, columns] *= 0.7 + 0.5 * random.random()
        image[cut : cut + 2, columns] *= 0.4
        image[:, board * width : board * width + 2] *= 0.4
    return np.clip(image, 0, 1)


def bricks(color, mortar, seed: int, rows: int = 12, columns: int = 6) -> np.ndarray:
    """Running bond; each brick has a tone of its own."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    row = (y * rows).astype(int)
    along = x * columns + 0.5 * (row % 2)
    tone = (0.65 + 0.5 * random.random((rows, columns)))[row, along.astype(int) % columns]
    edge_x, edge_y = np.abs((along % 1) - 0.5) * 2, np.abs((y * rows % 1) - 0.5) * 2
    joint = (np.maximum(1 - (1 - edge_x) * rows / columns * 0.5, edge_y) > 0.86) | (edge_y > 0.86)
    face = np.asarray(color) * tone[..., None] * (0.75 + 0.4 * noise(seed, 16, 5)[..., None])
    filled = np.asarray(mortar) * (0.8 + 0.3 * noise(seed + 1, 32, 4)[..., None])
    return np.clip(np.where(joint[..., None], filled, face), 0, 1).astype(np.float32)


def tiles(colors, joint, seed: int, count: int = 4, gap: float = 0.03) -> np.ndarray:
    """Square tiles; `colors` alternate as on a chess board."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE * count
    pick = (x.astype(int) + y.astype(int)) % len(colors)
    tone = 0.85 + 0.3 * np.random.default_rng(seed).random((count, count))[y.astype(int), x.astype(int)]
    face = np.asarray(colors)[pick] * tone[..., None] * (0.8 + 0.3 * noise(seed, 6, 6)[..., None])
    edge = np.minimum(np.minimum(x % 1, 1 - x % 1), np.minimum(y % 1, 1 - y % 1)) < gap
    return np.clip(np.where(edge[..., None], np.asarray(joint), face), 0, 1).astype(np.float32)


def weave(low, high, seed: int, threads: int = 64, stripes=None) -> np.ndarray:
    """Cloth: threads over and under, worn places, wide stripes if asked for."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE * threads * np.pi
    thread = 0.5 + 0.5 * np.sin(x) * np.sin(y)
    image = blend(low, high, 0.5 * thread + 0.5 * noise(seed, 4, 6))
    if stripes is not None:
        band = (np.arange(SIZE) * len(stripes) // SIZE) % len(stripes)
        image *= np.asarray(stripes, np.float32)[band][None, :, None]
    return np.clip(image, 0, 1)


def marble(low, high, seed: int) -> np.ndarray:
    """Stone with veins."""
    veins = np.abs(np.sin(3 * np.pi * noise(seed, 2, 3) + 1.6 * np.pi * noise(seed + 1, 4, 6)))
    return blend(low, high, np.clip(veins**0.5 * 0.8 + 0.2 * noise(seed + 2, 32, 4), 0, 1))


def painting(seed: int) -> np.ndarray:
    """An abstract image of discs, bars and brush strokes."""
    random = np.random.default_rng(seed)
    image = blend(random.random(3) * 0.8, random.random(3) * 0.8, noise(seed, 3, 6))
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    for _ in range(14):
        center, radius, color = random.random(2), 0.05 + 0.18 * random.random(), random.random(3) ** 1.5
        if random.random() < 0.5:
            inside = np.hypot(x - center[0], y - center[1]) < radius
        else:
            turn = random.random() * np.pi
            along = (x - center[0]) * np.cos(turn) + (y - center[1]) * np.sin(turn)
            across = -(x - center[0]) * np.sin(turn) + (y - center[1]) * np.cos(turn)
            inside = (np.abs(along) < 2 * radius) & (np.abs(across) < radius / 4)
        image[inside] = image[inside] * 0.15 + 0.85 * color * (0.8 + 0.2 * noise(seed + 5, 16, 4)[inside][:, None])
    return np.clip(image, 0, 1).astype(np.float32)


def ground(colors, seed: int) -> np.ndarray:
    """Grass, soil or gravel: several colors mixed at several sizes."""
    image = blend(colors[0], colors[1], noise(seed, 4, 7))
    for step, color in enumerate(colors[2:]):
        speck = np.clip((noise(seed + 7 + step, 48, 3) - 0.55) * 5, 0, 1)[..., None]
        image = image * (1 - speck) + np.asarray(color) * speck
    return np.clip(image, 0, 1).astype(np.float32)
