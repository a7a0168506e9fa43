"""An apartment of three rooms: living room with a kitchen, bedroom, study; windows over a street with trees."""

import itertools

import numpy as np

import materials as m
import phone
import plants
import rooms
import textures as t
from stage import Stage

HEIGHT = 2.6
DOOR = 2.05


def build() -> Stage:
    """Living room x 0..5.4, z 0..4.2; bedroom x 5.55..9, z 0..4.2; study x 5.55..9, z -3.15..-0.15."""
    random = np.random.default_rng(71)
    stage = Stage("apartment", field_of_view=76.0, exposure=4.2)
    surfaces(stage)
    shell(stage)
    rooms.living(stage, random)
    rooms.bedroom(stage, random)
    rooms.study(stage, random)
    outside(stage, random)
    stage.lights["sky"] = {
        "type": "sunsky",
        "sun_direction": [-0.75, 0.5, 0.35],
        "turbidity": 3.0,
        "sky_scale": 6,
        "sun_scale": 3,
        "to_world": m.y_up(),
    }
    stage.floors = [
        [0, 5.4, 0, 4.2, 0],
        [5.55, 9, 0, 4.2, 0],
        [5.55, 9, -3.15, -0.15, 0],
        [5.4, 5.55, 2.6, 3.5, 0],
        [7.7, 8.6, -0.15, 0, 0],
    ]
    return stage


def cameras(stage: Stage, random, count: int):
    """A walk through all rooms."""
    return phone.walk(stage, random, count)


def surfaces(stage: Stage) -> None:
    """Everything that covers something here."""
    stage.materials |= {
        "wall": m.matt(t.plaster([0.80, 0.76, 0.69], 1), 2.5),
        "blue wall": m.matt(t.plaster([0.45, 0.55, 0.60], 2), 2.5),
        "green wall": m.matt(t.plaster([0.52, 0.58, 0.45], 3), 2.5),
        "ceiling": m.matt(t.plaster([0.88, 0.87, 0.84], 4, 0.06), 2.5),
        "parquet": m.glossy(t.wood([0.26, 0.15, 0.07], [0.56, 0.37, 0.20], 3, 8), 1.2, 0.32, 0.4),
        "white": m.glossy([0.82, 0.81, 0.78], 1, 0.35, 0.3),
        "oak": m.glossy(t.wood([0.42, 0.27, 0.14], [0.66, 0.47, 0.28], 7), 0.9, 0.35, 0.3),
        "walnut": m.glossy(t.wood([0.13, 0.07, 0.04], [0.30, 0.18, 0.10], 8), 0.9, 0.3, 0.4),
        "counter": m.glossy(t.marble([0.16, 0.16, 0.17], [0.36, 0.36, 0.37], 9), 1.0, 0.2, 0.5),
        "kitchen": m.glossy([0.24, 0.34, 0.33], 1, 0.3, 0.4),
        "tile": m.glossy(t.tiles([[0.83, 0.81, 0.76], [0.62, 0.72, 0.70]], [0.55, 0.55, 0.53], 10), 0.6, 0.15, 0.5),
        "sofa": m.matt(t.weave([0.10, 0.20, 0.30], [0.22, 0.38, 0.50], 11), 0.25),
        "mustard": m.matt(t.weave([0.55, 0.36, 0.06], [0.75, 0.52, 0.14], 12), 0.2),
        "linen": m.matt(t.weave([0.70, 0.66, 0.60], [0.88, 0.85, 0.80], 13), 0.3),
        "blanket": m.matt(t.weave([0.40, 0.12, 0.10], [0.62, 0.25, 0.18], 14, 48, [1, 0.75, 1.15, 0.9, 0.6, 1.1]), 1.0),
        "rug": m.matt(
            t.weave([0.30, 0.09, 0.08], [0.62, 0.40, 0.28], 15, 96, [1, 0.5, 1.2, 1.2, 0.5, 1, 0.35, 0.8]), 1.4
        ),
        "curtain": m.matt(t.weave([0.62, 0.58, 0.48], [0.78, 0.74, 0.64], 16), 0.4),
        "leather": m.glossy(t.plaster([0.20, 0.09, 0.05], 17, 0.5), 0.6, 0.4, 0.4),
        "steel": m.metal([0.62, 0.63, 0.65], 0.25),
        "black": m.glossy([0.03, 0.03, 0.035], 1, 0.2, 0.5),
        "ceramic": m.glossy([0.75, 0.72, 0.66], 1, 0.12, 0.5),
        "pot": m.matt(t.plaster([0.55, 0.27, 0.16], 18, 0.3), 0.4),
        "apple": m.glossy(t.plaster([0.62, 0.10, 0.06], 19, 0.5), 0.2, 0.2, 0.5),
        "orange": m.glossy([0.80, 0.38, 0.05], 1, 0.4, 0.4),
        "leaf": m.leaf(t.plaster([0.16, 0.34, 0.08], 20, 0.5)),
        "bark": m.matt(t.wood([0.10, 0.07, 0.05], [0.28, 0.22, 0.17], 21), 0.5),
        "grass": m.matt(t.ground([[0.10, 0.20, 0.05], [0.22, 0.34, 0.10], [0.36, 0.34, 0.18]], 22), 3.0),
        "road": m.matt(t.ground([[0.16, 0.16, 0.17], [0.26, 0.26, 0.26], [0.32, 0.31, 0.30]], 23), 3.0),
        "brick": m.matt(t.bricks([0.48, 0.20, 0.13], [0.58, 0.55, 0.50], 24), 1.5),
        "render": m.matt(t.plaster([0.72, 0.62, 0.44], 25, 0.25), 4.0),
        "pane": m.glossy([0.08, 0.10, 0.13], 1, 0.08, 0.8),
        "shade": m.shining([5.0, 4.1, 3.0]),
        "panel": m.shining([6.5, 6.2, 5.6]),
        "screen": m.shining([0.5, 0.8, 1.2]),
    }
    for k in range(6):
        stage.materials[f"painting {k}"] = m.matt(t.painting(40 + k), 1.0)
    for k, color in enumerate(
        [
            [0.5, 0.1, 0.08],
            [0.1, 0.2, 0.42],
            [0.75, 0.7, 0.55],
            [0.1, 0.32, 0.2],
            [0.6, 0.42, 0.1],
            [0.08, 0.08, 0.09],
            [0.35, 0.2, 0.3],
        ]
    ):
        stage.materials[f"book {k}"] = m.matt(t.plaster(color, 50 + k, 0.35), 0.3)


def wall(stage, material, axis: int, at, spans, holes=()):
    """A wall across `axis` (0 or 2) from `at[0]` to `at[1]`, along `spans`; holes are (from, to, bottom, top)."""
    edges = sorted({spans[0], spans[1], *[h[0] for h in holes], *[h[1] for h in holes]})
    for a, b in itertools.pairwise(edges):
        hole = next((h for h in holes if h[0] <= a and b <= h[1]), None)
        for low, high in [(0, HEIGHT)] if hole is None else [(0, hole[2]), (hole[3], HEIGHT)]:
            if high > low:
                first, last = [0, low, 0], [0, high, 0]
                first[axis], last[axis], first[2 - axis], last[2 - axis] = at[0], at[1], a, b
                stage.box("walls", material, first, last)


def window(stage, axis: int, at, span, low: float, high: float, name: str):
    """A white frame with a mullion, a sill and the lengths of its opening."""

    def bar(thing, a, b, c, d, out=0.0):
        first, last = [0, c, 0], [0, d, 0]
        first[axis], last[axis], first[2 - axis], last[2 - axis] = at - 0.03 - out, at + 0.03 + out, a, b
        stage.box(thing, "white", first, last)

    middle = (span[0] + span[1]) / 2
    for a, b in ((span[0], span[0] + 0.06), (middle - 0.03, middle + 0.03), (span[1] - 0.06, span[1])):
        bar("window frames", a, b, low, high)
    for c, d in ((low, low + 0.06), (high - 0.06, high)):
        bar("window frames", span[0], span[1], c, d)
    bar("sills", span[0] - 0.05, span[1] + 0.05, low - 0.04, low, 0.1)
    inner = [[0, 0, 0], [0, 0, 0], [0, 0, 0]]
    for point, along, up in zip(
        inner, (span[0] + 0.06, span[1] - 0.06, span[0] + 0.06), (low + 0.06, low + 0.06, high - 0.06), strict=False
    ):
        point[axis], point[1], point[2 - axis] = at, up, along
    stage.length(f"{name}, inner width", inner[0], inner[1])
    stage.length(f"{name}, inner height", inner[0], inner[2])


def shell(stage: Stage) -> None:
    """Floors, ceilings, walls, doors, windows, skirting."""
    stage.box("floor", "parquet", [-0.2, -0.2, -3.3], [9.2, 0, 4.4])
    stage.box("ceiling", "ceiling", [-0.2, HEIGHT, -3.3], [9.2, HEIGHT + 0.1, 4.4])
    wall(stage, "wall", 0, (-0.2, 0), (-0.2, 4.4), [(0.8, 3.3, 0.75, 2.25)])
    wall(stage, "wall", 2, (-0.2, 0), (-0.2, 5.475))
    wall(stage, "wall", 2, (4.2, 4.4), (-0.2, 5.475), [(1.1, 3.3, 0.9, 2.25)])
    wall(stage, "wall", 0, (5.4, 5.475), (0, 4.2), [(2.6, 3.5, 0, DOOR)])
    wall(stage, "blue wall", 0, (5.475, 5.55), (0, 4.2), [(2.6, 3.5, 0, DOOR)])
    wall(stage, "blue wall", 2, (4.2, 4.4), (5.475, 9.2))
    wall(stage, "blue wall", 2, (-0.075, 0), (5.475, 9.2), [(7.7, 8.6, 0, DOOR)])
    wall(stage, "green wall", 2, (-0.15, -0.075), (5.475, 9.2), [(7.7, 8.6, 0, DOOR)])
    wall(stage, "blue wall", 0, (9, 9.2), (0, 4.4), [(1.2, 3.0, 0.9, 2.2)])
    wall(stage, "green wall", 0, (9, 9.2), (-3.3, 0), [(-2.5, -1.0, 0.9, 2.2)])
    wall(stage, "green wall", 0, (5.35, 5.55), (-3.3, -0.075))
    wall(stage, "green wall", 2, (-3.3, -3.15), (5.35, 9.2))
    window(stage, 0, -0.1, (0.8, 3.3), 0.75, 2.25, "living room window")
    window(stage, 2, 4.3, (1.1, 3.3), 0.9, 2.25, "back window")
    window(stage, 0, 9.1, (1.2, 3.0), 0.9, 2.2, "bedroom window")
    window(stage, 0, 9.1, (-2.5, -1.0), 0.9, 2.2, "study window")
    for x0, x1, z0, z1 in ((5.38, 5.57, 2.54, 2.6), (5.38, 5.57, 3.5, 3.56)):
        stage.box("door frames", "white", [x0, 0, z0], [x1, DOOR + 0.06, z1])
    stage.box("door frames", "white", [5.38, DOOR, 2.54], [5.57, DOOR + 0.06, 3.56])
    for x0, x1 in ((7.64, 7.7), (8.6, 8.66)):
        stage.box("door frames", "white", [x0, 0, -0.17], [x1, DOOR + 0.06, 0.02])
    stage.box("door frames", "white", [7.64, DOOR, -0.17], [8.66, DOOR + 0.06, 0.02])
    stage.length("living room door, height", [5.38, 0, 2.6], [5.38, DOOR, 2.6])
    stage.length("living room door, width", [5.38, DOOR, 2.6], [5.38, DOOR, 3.5])
    stage.length("study door, height", [7.7, 0, 0.02], [7.7, DOOR, 0.02])
    for low, high in (
        ([0, 0, 0], [5.4, 0.08, 0.015]),
        ([0, 0, 4.185], [5.4, 0.08, 4.2]),
        ([0, 0, 0], [0.015, 0.08, 4.2]),
        ([5.385, 0, 0], [5.4, 0.08, 2.54]),
        ([5.55, 0, 4.185], [9, 0.08, 4.2]),
        ([8.985, 0, 0], [9, 0.08, 4.2]),
        ([5.55, 0, -3.15], [9, 0.08, -3.135]),
        ([5.55, 0, -3.15], [5.565, 0.08, -0.15]),
    ):
        stage.box("skirting", "white", low, high)
    for x, z in ((2.2, 2.1), (7.3, 2.2), (7.2, -1.6)):
        stage.box("ceiling lamps", "panel", [x - 0.3, HEIGHT - 0.03, z - 0.3], [x + 0.3, HEIGHT - 0.005, z + 0.3])


def outside(stage: Stage, random) -> None:
    """Lawns, a street, trees, houses over the way."""
    s = stage
    s.box("lawn", "grass", [-60, -1.2, -60], [60, -1.0, 60])
    s.box("street", "road", [-14, -1.0, -60], [-8, -0.98, 60])
    for k, (x, z) in enumerate(
        ((-6.2, 0.5), (-6.5, 5.5), (-6, -6), (3.5, 9), (-1, 11), (14, 4.5), (14.5, -3), (13, 0.8), (6, 10))
    ):
        plants.tree(s, f"outside {k}", [x, -1, z], 5 + 2.5 * random.random(), random, count=3500)
    for x0, z0, x1, z1, high, skin in (
        (-24, -12, -17, -3, 8, "brick"),
        (-24, -2, -17, 7, 9.5, "render"),
        (-24, 8, -17, 18, 8.5, "brick"),
        (18, -10, 25, 12, 8, "render"),
        (-6, 20, 14, 27, 7, "brick"),
    ):
        s.box("houses", skin, [x0, -1, z0], [x1, high - 1, z1])
        for y in np.arange(0.8, high - 2, 2.8):
            for z in np.arange(z0 + 1.2, z1 - 1.5, 2.4):
                for x in (x0, x1):
                    s.box("house windows", "pane", [x - 0.03, y, z], [x + 0.03, y + 1.5, z + 1.1])
            for x in np.arange(x0 + 1.2, x1 - 1.5, 2.4):
                s.box("house windows", "pane", [x, y, z0 - 0.03], [x + 1.1, y + 1.5, z0 + 0.03])
