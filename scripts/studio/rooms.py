"""Furniture of the apartment, room by room."""

import numpy as np

import plants
import shapes
from stage import Stage


def legs(stage, thing, material, low, high, top, thick=0.05):
    """Four legs below the rectangle."""
    for x in (low[0], high[0] - thick):
        for z in (low[1], high[1] - thick):
            stage.box(thing, material, [x, 0, z], [x + thick, top, z + thick])


def chair(stage, name, x, z, turn, material="oak"):
    """A chair whose back is at -z before it is turned."""
    parts = [shapes.box([-0.21, 0.43, -0.2], [0.21, 0.47, 0.22]), shapes.box([-0.2, 0.68, -0.21], [0.2, 0.88, -0.18])]
    for a in (-0.2, 0.16):
        parts += [shapes.box([a, 0, -0.21], [a + 0.04, 0.9, -0.17]), shapes.box([a, 0, 0.17], [a + 0.04, 0.43, 0.21])]
    stage.add(name, material, *[shapes.moved(p, (x, 0, z), turn) for p in parts])
    stage.taken.append([x - 0.22, x + 0.22, z - 0.22, z + 0.22])


def books(stage, x0, x1, y, z0, z1, random, axis=0):
    """A row of books along x or z."""
    at = x0 if axis == 0 else z0
    end = x1 if axis == 0 else z1
    while at < end - 0.05:
        thick, tall = 0.018 + 0.03 * random.random(), 0.18 + 0.09 * random.random()
        deep = 0.7 + 0.25 * random.random()
        if random.random() < 0.9:
            low = [at, y, z0] if axis == 0 else [x0, y, at]
            high = (
                [at + thick, y + tall, z0 + (z1 - z0) * deep]
                if axis == 0
                else [x0 + (x1 - x0) * deep, y + tall, at + thick]
            )
            stage.box("books", f"book {random.integers(7)}", low, high)
        at += thick + 0.002


def living(stage: Stage, random) -> None:
    """Sofa, rug, low table, dining table with chairs, kitchen, shelf, lamp, paintings, plants."""
    s = stage
    s.box("rug", "rug", [0.7, 0, 1.2], [2.9, 0.012, 3.0])
    s.box("sofa base", "sofa", [0.75, 0.08, 3.25], [2.85, 0.42, 4.12], measure=True, stands=True)
    s.add("sofa back", "sofa", shapes.cushion([1.8, 0.62, 4.02], [2.1, 0.5, 0.24], 0.35))
    for x in (0.83, 2.77):
        s.add("sofa arms", "sofa", shapes.cushion([x, 0.42, 3.68], [0.2, 0.42, 0.9], 0.35))
    for x in (1.32, 2.28):
        s.add("sofa seats", "sofa", shapes.cushion([x, 0.47, 3.58], [0.92, 0.18, 0.72], 0.3))
    s.add("cushions", "mustard", shapes.cushion([1.1, 0.68, 3.82], [0.44, 0.42, 0.16], 0.5, 0.25))
    s.add("cushions", "linen", shapes.cushion([2.45, 0.68, 3.8], [0.44, 0.42, 0.16], 0.5, -0.3))
    s.box("low table", "walnut", [1.25, 0.36, 1.8], [2.35, 0.4, 2.4], measure=True, stands=True)
    legs(s, "low table", "walnut", [1.25, 1.8], [2.35, 2.4], 0.36)
    s.add(
        "bowl",
        "ceramic",
        shapes.lathe([(0, 0), (0.06, 0), (0.15, 0.08), (0.145, 0.085), (0.05, 0.012), (0, 0.012)], (1.6, 0.4, 2.1)),
    )
    for k, (x, z) in enumerate(((1.57, 2.08), (1.63, 2.13), (1.62, 2.05))):
        s.add("fruit", "apple" if k else "orange", shapes.ball([x, 0.455 + 0.005 * k, z], 0.037))
    for k in range(3):
        s.box(
            "magazines",
            f"book {k}",
            [2.0, 0.4 + 0.012 * k, 1.95 + 0.01 * k],
            [2.21 + 0.01 * k, 0.412 + 0.012 * k, 2.23],
        )
    s.box("dining table", "oak", [3.4, 0.71, 1.5], [4.9, 0.75, 2.4], measure=True, stands=True)
    legs(s, "dining table", "oak", [3.4, 1.5], [4.9, 2.4], 0.71, 0.06)
    for x in (3.8, 4.5):
        chair(s, f"chair {x} a", x, 1.3, 0.1)
        chair(s, f"chair {x} b", x, 2.62, np.pi - 0.15)
    s.add(
        "vase",
        "ceramic",
        shapes.lathe(
            [(0, 0), (0.05, 0), (0.08, 0.1), (0.035, 0.2), (0.045, 0.23), (0.04, 0.23), (0.03, 0.2), (0, 0.05)],
            (4.2, 0.75, 1.95),
        ),
    )
    away = shapes.sphere_points(40, random) * [0.6, 0.3, 0.6] + [0, 0.7, 0]
    s.add(
        "leaves vase",
        "leaf",
        shapes.leaves(
            np.tile([4.2, 0.96, 1.95], (40, 1)) + 0.1 * away * random.random((40, 1)), away, 0.16, 0.15, random
        ),
    )
    for x in (3.75, 4.6):
        s.add(
            "plates",
            "ceramic",
            shapes.lathe([(0, 0), (0.08, 0), (0.12, 0.015), (0.118, 0.02), (0.08, 0.006), (0, 0.006)], (x, 0.75, 1.75)),
        )
    s.box("kitchen base", "kitchen", [1.0, 0.1, 0], [3.6, 0.87, 0.6], measure=True, stands=True)
    s.box("counter", "counter", [0.98, 0.87, 0], [3.62, 0.91, 0.63])
    for x in np.arange(1.0, 3.6, 0.52):
        s.box("kitchen seams", "black", [x - 0.003, 0.1, 0.598], [x + 0.003, 0.87, 0.603])
        s.box("handles", "steel", [x + 0.14, 0.78, 0.61], [x + 0.38, 0.795, 0.63])
    s.box("kitchen tiles", "tile", [1.0, 0.91, 0], [3.6, 1.45, 0.012])
    s.box("wall cupboards", "kitchen", [1.0, 1.45, 0], [2.8, 2.15, 0.34], measure=True)
    s.box("fridge", "steel", [3.7, 0, 0], [4.32, 1.85, 0.65], measure=True, stands=True)
    s.box("fridge handle", "black", [3.76, 1.0, 0.66], [3.78, 1.5, 0.69])
    s.box("hob", "black", [2.05, 0.91, 0.08], [2.6, 0.916, 0.55])
    s.add(
        "pan",
        "steel",
        shapes.lathe([(0, 0), (0.1, 0), (0.12, 0.1), (0.115, 0.1), (0.095, 0.01), (0, 0.01)], (2.2, 0.917, 0.25)),
    )
    s.box("sink", "steel", [1.25, 0.905, 0.12], [1.75, 0.914, 0.52])
    s.add(
        "tap",
        "steel",
        shapes.tube(
            [[1.5, 0.91, 0.08], [1.5, 1.12, 0.08], [1.5, 1.18, 0.12], [1.5, 1.17, 0.22], [1.5, 1.12, 0.25]], 0.012
        ),
    )
    s.box("jars", "pot", [3.1, 0.91, 0.1], [3.2, 1.07, 0.2])
    s.add(
        "jars",
        "ceramic",
        shapes.lathe([(0, 0), (0.05, 0), (0.055, 0.14), (0.03, 0.16), (0, 0.165)], (3.35, 0.91, 0.16)),
    )
    s.box("shelf", "oak", [5.1, 0, 0.3], [5.38, 0.03, 2.2], stands=True)
    for y in (0.42, 0.8, 1.18, 1.56, 1.94):
        s.box("shelf", "oak", [5.1, y, 0.3], [5.38, y + 0.025, 2.2])
    for z in (0.3, 0.92, 1.55, 2.175):
        s.box("shelf", "oak", [5.1, 0, z], [5.38, 1.965, z + 0.025])
    s.length("shelf, height", [5.1, 0, 2.2], [5.1, 1.965, 2.2])
    s.length("shelf, length", [5.1, 1.965, 0.3], [5.1, 1.965, 2.2])
    for y in (0.03, 0.445, 0.825, 1.205, 1.585):
        for z in (0.33, 0.95, 1.58):
            if random.random() < 0.8:
                books(s, 5.13, 5.36, y, z, z + (0.25 + 0.33 * random.random()), random, 2)
    s.add(
        "painting left",
        "painting 0",
        shapes.quad([5.39, 1.2, 3.62], [5.39, 1.2, 4.12], [5.39, 1.8, 4.12], [5.39, 1.8, 3.62], True),
    )
    s.add(
        "painting kitchen",
        "painting 1",
        shapes.quad([0.1, 1.3, 0.01], [0.8, 1.3, 0.01], [0.8, 2.0, 0.01], [0.1, 2.0, 0.01], True),
    )
    s.add(
        "painting sofa",
        "painting 2",
        shapes.quad([4.5, 1.15, 4.19], [3.6, 1.15, 4.19], [3.6, 1.85, 4.19], [4.5, 1.85, 4.19], True),
    )
    s.length("painting over the chest, width", [4.5, 1.15, 4.19], [3.6, 1.15, 4.19])
    s.box("chest", "white", [3.5, 0, 3.8], [4.8, 0.7, 4.19], measure=True, stands=True)
    for x in (3.93, 4.36):
        s.box("chest seams", "black", [x - 0.004, 0.03, 3.796], [x + 0.004, 0.67, 3.8])
    s.add(
        "lamp foot",
        "steel",
        shapes.tube([[0.4, 0, 3.7], [0.4, 0.7, 3.7], [0.4, 1.45, 3.7]], 0.014),
        shapes.lathe([(0, 0), (0.15, 0), (0.15, 0.02), (0, 0.025)], (0.4, 0, 3.7)),
    )
    s.add("lamp shade", "shade", shapes.lathe([(0.2, 0), (0.14, 0.3)], (0.4, 1.4, 3.7)))
    s.taken.append([0.22, 0.58, 3.52, 3.88])
    plants.pot_plant(s, "by the window", [0.4, 0, 0.42], 1.25, random)
    s.taken.append([0.2, 0.6, 0.22, 0.62])
    plants.pot_plant(s, "on the chest", [4.5, 0.7, 4.0], 0.5, random)
    curtain(s, 0.08, (0.45, 0.95), random)
    curtain(s, 0.08, (3.15, 3.5), random)


def curtain(stage, x, span, random):
    """A hanging curtain along z."""
    phase = random.random() * 6

    def surface(u, v):
        return (
            x + 0.035 * np.sin(u * 34 + phase) * (0.5 + 0.5 * v),
            2.4 - 2.3 * v,
            span[0] + (span[1] - span[0]) * u,
        )

    stage.add("curtains", "curtain", shapes.grid(surface, 8, 90, (1.0, 2.3)))


def bedroom(stage: Stage, random) -> None:
    """Bed, night tables, wardrobe, mirror chest, rug, painting, chair."""
    s = stage
    s.box("bed base", "oak", [6.6, 0.05, 2.0], [8.55, 0.3, 3.7], measure=True, stands=True)
    s.add("mattress", "linen", shapes.cushion([7.57, 0.42, 2.85], [1.9, 0.26, 1.66], 0.22))

    def ripple(u, v):
        return (
            6.62 + 1.28 * u,
            0.585 + 0.02 * np.sin(9 * u + 5 * v) * np.sin(7 * v) - 0.3 * np.clip(np.abs(v - 0.5) * 2 - 0.93, 0, 1) * 4,
            1.96 + 1.78 * v,
        )

    s.add("blanket", "blanket", shapes.grid(ripple, 40, 40, (1.3, 1.8)))
    for z in (2.42, 3.28):
        s.add("pillows", "linen", shapes.cushion([8.2, 0.62, z], [0.5, 0.18, 0.72], 0.45))
    s.add("pillows", "mustard", shapes.cushion([7.95, 0.66, 2.85], [0.2, 0.36, 0.4], 0.5))
    s.box("bed head", "walnut", [8.6, 0, 1.9], [8.68, 1.05, 3.8], measure=True)
    for z in (1.35, 3.85):
        s.box("night table", "walnut", [8.5, 0, z], [8.95, 0.45, min(z + 0.42, 4.18)], stands=True)
    s.add("night lamp", "shade", shapes.lathe([(0.11, 0), (0.07, 0.16)], (8.72, 0.62, 1.56)))
    s.add(
        "night lamp foot",
        "ceramic",
        shapes.lathe([(0, 0), (0.06, 0), (0.02, 0.06), (0.015, 0.2), (0, 0.2)], (8.72, 0.45, 1.56)),
    )
    s.box("wardrobe", "white", [5.56, 0, 0.02], [7.3, 2.2, 0.6], measure=True, stands=True)
    for x in (6.14, 6.72):
        s.box("wardrobe seams", "black", [x - 0.004, 0.05, 0.598], [x + 0.004, 2.15, 0.604])
    s.box("handles", "steel", [6.08, 1.0, 0.61], [6.095, 1.25, 0.63])
    s.box("desk chest", "oak", [5.56, 0, 3.7], [6.4, 0.8, 4.18], measure=True, stands=True)
    s.add(
        "painting bed",
        "painting 3",
        shapes.quad([7.8, 1.25, 4.19], [6.9, 1.25, 4.19], [6.9, 1.95, 4.19], [7.8, 1.95, 4.19], True),
    )
    s.add(
        "painting door",
        "painting 4",
        shapes.quad([5.56, 1.2, 2.1], [5.56, 1.2, 1.4], [5.56, 1.9, 1.4], [5.56, 1.9, 2.1], True),
    )
    s.add("bedroom rug", "rug", shapes.box([6.3, 0, 0.95], [7.9, 0.01, 1.85]))
    plants.pot_plant(s, "in the bedroom", [5.9, 0.8, 3.95], 0.55, random)


def study(stage: Stage, random) -> None:
    """Desk with a screen, shelves of books, armchair, lamp, globe."""
    s = stage
    s.box("desk", "walnut", [8.25, 0.71, -2.6], [8.95, 0.75, -0.95], measure=True, stands=True)
    legs(s, "desk", "steel", [8.25, -2.6], [8.95, -0.95], 0.71, 0.04)
    s.box("monitor", "black", [8.62, 0.95, -2.1], [8.65, 1.3, -1.5], measure=True)
    s.add(
        "screen",
        "screen",
        shapes.quad([8.615, 0.97, -1.52], [8.615, 0.97, -2.08], [8.615, 1.28, -2.08], [8.615, 1.28, -1.52]),
    )
    s.box("monitor foot", "black", [8.62, 0.75, -1.85], [8.66, 0.98, -1.75])
    s.box("keyboard", "black", [8.36, 0.75, -2.02], [8.5, 0.77, -1.58])
    s.add(
        "mug",
        "ceramic",
        shapes.lathe([(0, 0), (0.04, 0), (0.042, 0.1), (0.036, 0.1), (0.034, 0.01), (0, 0.01)], (8.45, 0.75, -1.25)),
    )
    chair(s, "desk chair", 7.95, -1.8, np.pi / 2 + np.pi, "leather")
    for y in (0, 0.4, 0.8, 1.2, 1.6, 2.0):
        s.box("bookcase", "walnut", [5.7, y, -3.13], [7.9, y + 0.03, -2.85])
    for x in (5.7, 6.42, 7.15, 7.87):
        s.box("bookcase", "walnut", [x, 0, -3.13], [x + 0.03, 2.03, -2.85])
    s.taken.append([5.7, 7.9, -3.13, -2.85])
    s.length("bookcase, height", [7.9, 0, -2.85], [7.9, 2.03, -2.85])
    s.length("bookcase, length", [5.7, 2.03, -2.85], [7.9, 2.03, -2.85])
    for y in (0.03, 0.43, 0.83, 1.23, 1.63):
        for x in (5.74, 6.46, 7.19):
            books(s, x, x + 0.3 + 0.35 * random.random(), y, -3.11, -2.88, random)
    s.add(
        "armchair",
        "leather",
        shapes.cushion([6.25, 0.3, -1.0], [0.75, 0.4, 0.75], 0.3, 0.5),
        shapes.cushion([6.02, 0.62, -0.86], [0.22, 0.8, 0.75], 0.35, 0.5),
    )
    s.taken.append([5.75, 6.7, -1.5, -0.5])
    s.add("cushions", "blanket", shapes.cushion([6.2, 0.6, -0.95], [0.18, 0.36, 0.4], 0.5, 0.5))
    s.add("study rug", "rug", shapes.box([6.7, 0, -2.4], [7.6, 0.01, -0.7]))
    s.add("globe", "painting 5", shapes.ball([8.6, 0.92, -2.42], 0.13))
    s.add(
        "globe foot",
        "steel",
        shapes.lathe([(0, 0), (0.08, 0), (0.02, 0.03), (0.015, 0.05), (0, 0.05)], (8.6, 0.75, -2.42)),
    )
    s.add(
        "painting study",
        "painting 1",
        shapes.quad([5.56, 1.3, -0.5], [5.56, 1.3, -1.3], [5.56, 2.0, -1.3], [5.56, 2.0, -0.5], True),
    )
