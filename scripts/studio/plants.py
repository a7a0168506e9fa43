"""Plants: trees, hedges, grass and pots, as branches and bent leaves."""

import numpy as np

import shapes


def tree(
    stage,
    name: str,
    place,
    height: float,
    random,
    leaf: str = "leaf",
    bark: str = "bark",
    count: int = 5000,
    spread: float = 0.34,
):
    """A broad-leaved tree at `place`; its leaves hang in clumps about its boughs."""
    place = np.asarray(place, float)
    top = place + np.array([0.2 * random.normal(), 0.62 * height, 0.2 * random.normal()])
    trunk = np.linspace(place, top, 7) + np.r_[np.zeros((1, 3)), 0.03 * height * random.normal(size=(6, 3)) * [1, 0, 1]]
    wood, tips = [shapes.tube(trunk, np.linspace(0.032, 0.012, 7) * height)], []
    for _ in range(16):
        start = trunk[random.integers(3, 7)]
        reach = shapes.sphere_points(1, random)[0] * [1, 0.5, 1] + [0, 0.45, 0]
        bough = (
            start
            + np.linspace(0, 1, 5)[:, None] * reach * height * spread
            + 0.015 * height * random.normal(size=(5, 3))
        )
        wood.append(shapes.tube(bough, np.linspace(0.012, 0.004, 5) * height, 6))
        tips += [bough[2], bough[3], bough[4]]
    tips = np.array(tips)
    clump = tips[random.integers(len(tips), size=count)]
    away = shapes.sphere_points(count, random)
    centers = clump + away * (0.1 * height * random.random((count, 1)) ** 0.4)
    stage.add(f"tree {name}", bark, *wood)
    stage.add(f"leaves {name}", leaf, shapes.leaves(centers, away - np.array([0, 0.3, 0]), 0.028 * height, 0.3, random))


def hedge(stage, name: str, low, high, random, leaf: str = "leaf", density: float = 420):
    """A clipped hedge: a dark core and leaves over its faces."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    size = high - low
    stage.add(f"hedge {name}", "soil", shapes.box(low + 0.08, high - 0.08))
    areas = np.array([size[1] * size[2]] * 2 + [size[0] * size[2]] * 2 + [size[0] * size[1]] * 2)
    count = int(areas.sum() * density)
    face = random.choice(6, count, p=areas / areas.sum())
    centers = low + random.random((count, 3)) * size
    out = np.zeros((count, 3))
    for k in range(6):
        on = face == k
        centers[on, k // 2] = (low, high)[k % 2][k // 2] - (0.12 * random.random(on.sum()) * (1 if k % 2 else -1))
        out[on, k // 2] = 1 if k % 2 else -1
    stage.add(
        f"leaves {name}",
        leaf,
        shapes.leaves(centers, out + 0.8 * shapes.sphere_points(count, random), 0.07, 0.35, random),
    )


def grass(stage, name: str, spots, random, blade: str = "blade", length: float = 0.11):
    """Blades at `spots`, (N, 3)."""
    up = np.array([0, 1, 0]) + 0.45 * random.normal(size=(len(spots), 3)) * [1, 0, 1]
    stage.add(f"leaves {name}", blade, shapes.leaves(spots, up, length, 0.06, random, 0.5))


def pot_plant(stage, name: str, place, height: float, random, leaf: str = "leaf", pot: str = "pot", stems: int = 9):
    """A pot with stems and big leaves."""
    place = np.asarray(place, float)
    radius = 0.16 * height
    profile = [
        (0, 0),
        (radius * 0.75, 0),
        (radius, radius * 1.5),
        (radius * 1.06, radius * 1.5),
        (radius * 0.9, radius * 1.45),
        (0, radius * 1.35),
    ]
    stage.add(f"pot {name}", pot, shapes.lathe(profile, place, 32))
    tops, wood = [], []
    for k in range(stems):
        turn = 2 * np.pi * k / stems + random.random()
        t = np.linspace(0, 1, 6)[:, None]
        lean = 0.16 + 0.22 * random.random()
        path = place + [0, radius * 1.3, 0] + t * [0, height - radius * 1.3, 0] * (0.7 + 0.3 * random.random())
        path = path + t**1.7 * np.array([np.cos(turn), 0, np.sin(turn)]) * lean * height
        wood.append(shapes.tube(path, np.linspace(0.006, 0.003, 6) * max(height, 0.5), 6))
        tops += [path[3], path[4], path[5], path[5]]
    tops = np.array(tops)
    away = shapes.sphere_points(len(tops), random) * [1, 0.4, 1] + [0, 0.35, 0]
    stage.add(f"stems {name}", leaf, *wood)
    stage.add(f"leaves {name}", leaf, shapes.leaves(tops, away, 0.26 * height, 0.22, random))
