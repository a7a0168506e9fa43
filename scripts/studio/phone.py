"""A phone in a hand: where it looks from, and what its camera makes of the light."""

import io

import numpy as np
from PIL import Image

from render import display


def walk(stage, random, count: int, doors=0.15, heights=(1.2, 1.65)):
    """(eye, target) of `count` images of rooms: free places, looking across the room they are in."""
    places = []
    while len(places) < count:
        areas = np.array([(f[1] - f[0]) * (f[3] - f[2]) for f in stage.floors])
        room = stage.floors[random.choice(len(areas), p=areas / areas.sum())]
        x, z = random.uniform(room[0], room[1]), random.uniform(room[2], room[3])
        if not stage.free(x, z, 0.22):
            continue
        goal = stage.floors[random.integers(len(stage.floors))] if random.random() < doors else room
        for _ in range(20):
            target = np.array(
                [random.uniform(goal[0], goal[1]), random.uniform(0.1, 1.9), random.uniform(goal[2], goal[3])]
            )
            if np.hypot(target[0] - x, target[2] - z) > 1.3:
                break
        high = random.uniform(*heights) if random.random() < 0.7 else random.uniform(0.7, 2.0)
        places.append((np.array([x, high, z]), target))
    return tour(places)


def orbit(center, radii, heights, random, count: int, turns: float = 4, arc=(0.0, 2 * np.pi), spread=0.1):
    """(eye, target) of `count` images about a center: a few turns from the first to the last height."""
    views = []
    for k in range(count):
        part = k / max(count - 1, 1)
        along = (part * turns) % 1
        if int(part * turns) % 2 and arc[1] - arc[0] < 6:
            along = 1 - along
        angle = arc[0] + (arc[1] - arc[0]) * along + 0.03 * random.normal()
        radius = random.uniform(*radii)
        height = heights[0] + (heights[1] - heights[0]) * part + 0.05 * random.normal()
        eye = np.asarray(center) * [1, 0, 1] + [radius * np.cos(angle), height, radius * np.sin(angle)]
        views.append((eye, np.asarray(center) + spread * random.normal(size=3)))
    return views


def tour(views):
    """Orders images as one walks: always to the nearest that is left."""
    left, order = list(range(1, len(views))), [0]
    while left:
        here = views[order[-1]][0]
        order.append(min(left, key=lambda k: np.linalg.norm(views[k][0] - here)))
        left.remove(order[-1])
    return [views[k] for k in order]


def between(views, random, count: int, wander: float = 0.1):
    """Held-out cameras: between two that follow one another, and beside the way."""
    found = []
    for k in np.linspace(0, len(views) - 2, count).astype(int):
        (a, s), (b, t) = views[k], views[k + 1]
        part = random.uniform(0.3, 0.7) if np.linalg.norm(a - b) < 1 else 0.1
        found.append(
            (a * (1 - part) + b * part + wander * random.normal(size=3) * [1, 0.6, 1], s * (1 - part) + t * part)
        )
    return found


def drift(count: int, random) -> np.ndarray:
    """Exposure of each image, about 1: slow waves of 12 % and jumps of 4 %."""
    at = np.arange(count)
    return np.exp(0.12 * np.sin(at / 11 + random.random() * 6) + 0.04 * random.normal(size=count))


def take(light, exposure: float, random, xp, draw):
    """A training image (H, W, 3) uint8 of linear light: blur of a hand, film curve, noise of a sensor, JPEG.

    `draw(shape)` gives normal numbers.
    """
    angle, length = random.random() * np.pi, random.exponential(0.5)
    light = spread(light * exposure, blur(angle, min(length, 2.5)), xp)
    image = display(light) if xp is np else shown(light, xp)
    image = image + draw(image.shape) * (0.006 + 0.008 * xp.sqrt(image))
    pixels = np.asarray(
        xp.clip(image * 255 + 0.5, 0, 255) if xp is np else (image * 255 + 0.5).clamp(0, 255).cpu().numpy()
    ).astype(np.uint8)
    return np.asarray(Image.open(io.BytesIO(coded(pixels, "JPEG", 91))).convert("RGB"))


def shown(light, xp):
    """`render.display` for tensors."""
    light = light.clamp(min=0)
    film = (light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)).clamp(0, 1)
    return xp.where(film <= 0.0031308, 12.92 * film, 1.055 * film.clamp(min=1e-8) ** (1 / 2.4) - 0.055)


def spread(light, weights: dict, xp):
    """Light, blurred by weights of shifts."""
    return sum(weight * xp.roll(light, (int(y), int(x)), (0, 1)) for (y, x), weight in weights.items())


def blur(angle: float, length: float) -> dict:
    """Weights of shifts: a lens of 0.45 pixels and a stroke of `length` pixels."""
    weights: dict = {}
    for part in np.linspace(-0.5, 0.5, 7):
        y, x = part * length * np.sin(angle), part * length * np.cos(angle)
        for i in range(-3, 4):
            for j in range(-3, 4):
                weight = np.exp(-((i - y) ** 2 + (j - x) ** 2) / (2 * 0.45**2))
                if weight > 0.01:
                    weights[i, j] = weights.get((i, j), 0) + weight
    total = sum(weights.values())
    return {shift: weight / total for shift, weight in weights.items()}


def coded(pixels: np.ndarray, kind: str, quality: int) -> bytes:
    """A compressed image."""
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, kind, quality=quality, **({"method": 6} if kind == "WEBP" else {}))
    return out.getvalue()
