"""A brick house with its front garden, trees, a fence and the sky."""

import itertools

import numpy as np

import materials as m
import phone
import plants
import shapes
import textures as t
from stage import Stage


def build() -> Stage:
    """The front is the plane z = 0, the garden lies before it to z = 9; the door is in the middle."""
    random = np.random.default_rng(73)
    s = Stage("garden", field_of_view=66.0, exposure=4.0, depth=5)
    s.materials |= {
        "brick": m.matt(t.bricks([0.46, 0.20, 0.13], [0.60, 0.57, 0.52], 24, 14, 7), 1.5),
        "stone": m.matt(t.plaster([0.62, 0.58, 0.50], 2, 0.3), 0.8),
        "roof": m.matt(t.bricks([0.22, 0.11, 0.09], [0.07, 0.05, 0.05], 25, 8, 8), 2.0),
        "white": m.glossy([0.80, 0.80, 0.77], 1, 0.35, 0.3),
        "door": m.glossy(t.wood([0.05, 0.14, 0.12], [0.09, 0.22, 0.19], 6), 0.8, 0.25, 0.5),
        "pane": m.glossy([0.04, 0.05, 0.06], 1, 0.04, 0.8),
        "paving": m.matt(t.tiles([[0.52, 0.50, 0.46], [0.44, 0.42, 0.39]], [0.20, 0.20, 0.16], 7, 4, 0.025), 1.6),
        "lawn": m.matt(t.ground([[0.08, 0.17, 0.03], [0.18, 0.30, 0.07], [0.30, 0.30, 0.12]], 22), 2.0),
        "meadow": m.matt(t.ground([[0.12, 0.20, 0.05], [0.26, 0.34, 0.10], [0.40, 0.36, 0.18]], 23), 6.0),
        "soil": m.matt(t.ground([[0.10, 0.06, 0.04], [0.20, 0.14, 0.09], [0.05, 0.03, 0.02]], 26), 0.8),
        "road": m.matt(t.ground([[0.15, 0.15, 0.16], [0.24, 0.24, 0.24], [0.3, 0.3, 0.29]], 27), 2.0),
        "blade": m.leaf(t.plaster([0.22, 0.40, 0.08], 28, 0.5)),
        "leaf": m.leaf(t.plaster([0.15, 0.32, 0.07], 29, 0.5)),
        "autumn": m.leaf(t.plaster([0.50, 0.27, 0.05], 30, 0.5)),
        "box tree": m.leaf(t.plaster([0.08, 0.22, 0.06], 31, 0.5)),
        "rose": m.leaf(t.plaster([0.65, 0.08, 0.14], 32, 0.4)),
        "lavender": m.leaf(t.plaster([0.35, 0.22, 0.60], 33, 0.4)),
        "bark": m.matt(t.wood([0.10, 0.07, 0.05], [0.30, 0.24, 0.18], 34), 0.5),
        "oak": m.matt(t.wood([0.30, 0.20, 0.12], [0.52, 0.38, 0.25], 35), 0.6),
        "pot": m.matt(t.plaster([0.55, 0.27, 0.16], 36, 0.3), 0.4),
        "iron": m.metal([0.10, 0.10, 0.11], 0.4),
        "render": m.matt(t.plaster([0.70, 0.64, 0.52], 37, 0.2), 3.0),
    }
    house(s)
    ground(s, random)
    planting(s, random)
    around(s, random)
    s.lights["sky"] = {"type": "sunsky", "sun_direction": [0.55, 0.55, 0.63], "turbidity": 3.5, "to_world": m.y_up()}
    s.floors = [[-6.0, 6.0, 0.6, 8.6, 0.0]]
    return s


def cameras(stage: Stage, random, count: int):
    """Along the front, far and near, and round the bench and the roses."""
    views = []
    for _ in range(count):
        while True:
            x, z = random.uniform(-5.4, 5.4), random.uniform(1.8, 8.4)
            if stage.free(x, z, 0.3):
                break
        far = random.random() < 0.72
        target = (
            [random.uniform(-5, 5), random.uniform(0.2, 3.6), random.uniform(-0.5, 1.5)]
            if far
            else [random.uniform(-7, 7), random.uniform(0, 1.6), random.uniform(1, 9)]
        )
        if not far and np.hypot(target[0] - x, target[2] - z) < 1.5:
            target = [x * 0.3, 1.0, 0.5]
        views.append(
            (
                np.array([x, random.uniform(1.3, 1.75) if random.random() < 0.75 else random.uniform(0.6, 2.1), z]),
                np.array(target),
            )
        )
    return phone.tour(views)


def front_window(s: Stage, name: str, x0: float, x1: float, y0: float, y1: float) -> None:
    """A window in the front: reveal, frame, glazing bars, pane, sill, lintel."""
    s.box("panes", "pane", [x0, y0, -0.16], [x1, y1, -0.14])
    for x in (x0, (x0 + x1) / 2 - 0.025, x1 - 0.05):
        s.box("window frames", "white", [x, y0, -0.14], [x + 0.05, y1, -0.08])
    for y in (y0, (y0 + y1) / 2 - 0.02, y1 - 0.05):
        s.box("window frames", "white", [x0, y, -0.14], [x1, y + 0.05, -0.085])
    s.box("sills", "stone", [x0 - 0.12, y0 - 0.1, -0.16], [x1 + 0.12, y0, 0.1])
    s.box("lintels", "stone", [x0 - 0.15, y1, -0.1], [x1 + 0.15, y1 + 0.22, 0.03])
    s.length(f"{name}, width", [x0, y1, 0], [x1, y1, 0])
    s.length(f"{name}, height", [x0, y0, 0], [x0, y1, 0])


def house(s: Stage) -> None:
    """Two floors of brick with five openings each, a gable roof, a porch."""
    openings = [
        (-4.2, -2.8, 0.9, 2.3),
        (-2.3, -1.1, 0.9, 2.3),
        (-0.55, 0.55, 0, 2.2),
        (1.1, 2.3, 0.9, 2.3),
        (2.8, 4.2, 0.9, 2.3),
    ]
    upper = [
        (-4.2, -2.8, 3.5, 4.8),
        (-2.1, -1.2, 3.5, 4.8),
        (-0.45, 0.45, 3.5, 4.8),
        (1.2, 2.1, 3.5, 4.8),
        (2.8, 4.2, 3.5, 4.8),
    ]
    xs = sorted({-5.2, 5.2, *[v for o in openings + upper for v in o[:2]]})
    for a, b in itertools.pairwise(xs):
        holes = sorted([o[2:] for o in openings + upper if o[0] <= a and b <= o[1]])
        low = 0.0
        for bottom, top in [*holes, (5.6, 5.6)]:
            if bottom > low:
                s.box("front", "brick", [a, low, -0.3], [b, bottom, 0])
            low = top
    s.box("house body", "brick", [-5.2, 0, -7], [5.2, 5.6, -0.3])
    for k, o in enumerate(openings[:2] + openings[3:] + upper):
        front_window(s, f"window {k}", *o)
    s.box("plinth", "stone", [-5.25, 0, -7.05], [-0.6, 0.3, 0.06])
    s.box("plinth", "stone", [0.6, 0, -7.05], [5.25, 0.3, 0.06])
    s.box("cornice", "stone", [-5.35, 5.45, -7.1], [5.35, 5.7, 0.2])
    for a, b, _c in (([-5.6, 5.65, 0.35], [5.6, 5.65, 0.35], 1), ([5.6, 5.65, -7.3], [-5.6, 5.65, -7.3], -1)):
        ridge = [[b[0], 8.4, -3.5], [a[0], 8.4, -3.5]]
        s.add("roof", "roof", shapes.quad(a, b, *ridge))
    for x in (-5.2, 5.2):
        s.add(
            "gables",
            "brick",
            (
                np.array([[x, 5.6, 0], [x, 5.6, -7], [x, 8.35, -3.5]]),
                np.array([[0, 1, 2]]),
                np.array([[0, 0], [7, 0], [3.5, 2.75]]),
                None,
            ),
        )
    s.box("chimney", "brick", [2.6, 7, -3.2], [3.4, 9.2, -2.4])
    s.box("door", "door", [-0.5, 0.3, -0.2], [0.5, 2.2, -0.14], measure=False)
    for x0, x1, y0, y1 in (
        (-0.38, -0.06, 0.5, 1.1),
        (0.06, 0.38, 0.5, 1.1),
        (-0.38, -0.06, 1.25, 2.0),
        (0.06, 0.38, 1.25, 2.0),
    ):
        s.box("door panels", "door", [x0, y0, -0.15], [x1, y1, -0.11])
    s.add("knob", "iron", shapes.ball([0.42, 1.2, -0.1], 0.035))
    for x0, x1 in ((-0.62, -0.5), (0.5, 0.62)):
        s.box("door frame", "white", [x0, 0, -0.2], [x1, 2.3, 0.05])
    s.box("door frame", "white", [-0.62, 2.2, -0.2], [0.62, 2.4, 0.1])
    s.length("door frame, width", [-0.5, 2.2, 0.05], [0.5, 2.2, 0.05])
    s.length("door frame, height", [-0.62, 0, 0.05], [-0.62, 2.4, 0.05])
    s.box("step", "stone", [-0.9, 0, 0], [0.9, 0.15, 0.8], measure=True, stands=True)
    s.box("upper step", "stone", [-0.75, 0.15, 0], [0.75, 0.3, 0.45])
    for x in (-4.7, 4.6):
        s.add("pipes", "iron", shapes.tube([[x, 0, 0.08], [x, 3, 0.08], [x, 5.5, 0.08]], 0.045))
    s.box("lamp", "iron", [0.8, 1.75, 0.02], [0.92, 2.05, 0.16])


def ground(s: Stage, random) -> None:
    """Paving to the door, lawns with blades, beds along the front, a fence, the road."""
    s.box("meadow", "meadow", [-70, -0.4, -70], [70, -0.05, 70])
    s.box("lawn", "lawn", [-7, -0.1, 0], [7, 0.0, 9])
    s.box("path", "paving", [-0.8, 0, 0.8], [0.8, 0.012, 9])
    s.box("path", "paving", [-6, 0, 3.2], [-0.8, 0.012, 4.4])
    s.box("road", "road", [-70, -0.06, 10.2], [70, -0.04, 15])
    s.box("pavement", "paving", [-70, -0.06, 9.1], [70, 0.0, 10.2])
    for x0, x1 in ((-5.1, -1.0), (1.0, 5.1)):
        s.box("beds", "soil", [x0, 0, 0.05], [x1, 0.05, 1.1], stands=True)
        s.box("bed edges", "stone", [x0, 0, 1.1], [x1, 0.1, 1.18], stands=True)
    spots = np.stack([random.uniform(-7, 7, 60000), np.zeros(60000), random.uniform(1.2, 9, 60000)], 1)
    off = (np.abs(spots[:, 0]) < 0.85) | (
        (spots[:, 0] < -0.7) & (spots[:, 0] > -6.1) & (spots[:, 2] > 3.15) & (spots[:, 2] < 4.45)
    )
    plants.grass(s, "of the lawn", spots[~off], random, length=0.055)
    for x in np.arange(-7, 7.01, 0.16):
        if abs(x) > 0.85:
            s.box("fence", "white", [x, 0, 9.0], [x + 0.09, 0.95, 9.03])
    for x0, x1 in ((-7, -0.85), (0.85, 7.1)):
        for y in (0.25, 0.75):
            s.box("fence", "white", [x0, y, 9.03], [x1, y + 0.07, 9.06])
    for x in (-0.95, 0.85):
        s.box("gate posts", "stone", [x, 0, 8.95], [x + 0.12, 1.2, 9.07])
    s.length("gate posts, height", [-0.95, 0, 9.07], [-0.95, 1.2, 9.07])


def planting(s: Stage, random) -> None:
    """Roses, lavender, box balls, two hedges, a bench, pots, a tree on the lawn."""
    for x in (*np.arange(-4.8, -1.1, 0.62), *np.arange(1.3, 5, 0.62)):
        place = np.array([x, 0.05, 0.5 + 0.15 * random.normal()])
        away = shapes.sphere_points(240, random)
        away[:, 1] = np.abs(away[:, 1])
        centers = place + away * [0.26, 0.55, 0.26] * random.random((240, 1)) ** 0.5
        kind = "rose" if int(x * 10) % 2 else "lavender"
        s.add("leaves bed", "leaf", shapes.leaves(centers, away + np.array([0, 0.6, 0]), 0.11, 0.25, random))
        blossoms = place + away[:60] * [0.27, 0.62, 0.27] * (0.85 + 0.15 * random.random((60, 1)))
        s.add(f"leaves {kind}", kind, shapes.leaves(blossoms, shapes.sphere_points(60, random), 0.07, 0.5, random))
    for x, z in ((-1.5, 1.7), (1.5, 1.7)):
        away = shapes.sphere_points(5000, random)
        s.add(
            "leaves ball",
            "box tree",
            shapes.leaves(
                np.array([x, 0.45, z]) + 0.4 * away, away + 0.6 * shapes.sphere_points(5000, random), 0.05, 0.35, random
            ),
        )
        s.add("ball core", "soil", shapes.ball([x, 0.45, z], 0.37))
        s.taken.append([x - 0.42, x + 0.42, z - 0.42, z + 0.42])
    plants.hedge(s, "left", [-7.2, 0, 0.4], [-6.5, 1.7, 8.9], random, "box tree")
    plants.hedge(s, "right", [6.5, 0, 0.4], [7.2, 1.7, 8.9], random, "box tree")
    plants.tree(s, "on the lawn", [3.9, 0, 5.2], 4.6, random, "autumn", count=7000)
    s.taken.append([3.7, 4.1, 5.0, 5.4])
    s.box("bench", "oak", [-4.6, 0.42, 2.3], [-3.0, 0.46, 2.75], measure=True, stands=True)
    for y in (0.6, 0.75, 0.88):
        s.box("bench back", "oak", [-4.6, y, 2.3], [-3.0, y + 0.09, 2.33])
    for x in (-4.5, -3.15):
        s.box("bench legs", "iron", [x, 0, 2.3], [x + 0.05, 0.95, 2.34])
        s.box("bench legs", "iron", [x, 0, 2.68], [x + 0.05, 0.42, 2.72])
    for x in (-1.15, 1.15):
        plants.pot_plant(s, f"at the door {x}", [x, 0, 1.35 - 0.2], 0.85, random, stems=14)
        s.taken.append([x - 0.18, x + 0.18, 0.97, 1.33])


def around(s: Stage, random) -> None:
    """Trees and houses of the neighbors."""
    for k, (x, z, high) in enumerate(
        (
            (-10, 3, 7),
            (-11, -4, 9),
            (10.5, 2, 8),
            (11, -5, 9),
            (-6, 18, 7),
            (3, 19, 8),
            (10, 17, 7),
            (-14, 12, 8),
            (-8.5, -9, 10),
            (9, -11, 10),
        )
    ):
        plants.tree(s, f"around {k}", [x, 0, z], high, random, "leaf" if k % 3 else "autumn", count=4500)
    for x0, z0, x1, z1, high in ((-26, -6, -15, 4, 6), (15, -8, 26, 3, 6.5), (-20, 22, -6, 30, 6), (-2, 23, 14, 31, 7)):
        s.box("neighbors", "render" if x0 > 0 else "brick", [x0, 0, z0], [x1, high, z1])
        middle = (z0 + z1) / 2
        s.add(
            "roof",
            "roof",
            shapes.quad(
                [x0 - 0.3, high, z1 + 0.3],
                [x1 + 0.3, high, z1 + 0.3],
                [x1 + 0.3, high + 2.5, middle],
                [x0 - 0.3, high + 2.5, middle],
            ),
        )
        s.add(
            "roof",
            "roof",
            shapes.quad(
                [x1 + 0.3, high, z0 - 0.3],
                [x0 - 0.3, high, z0 - 0.3],
                [x0 - 0.3, high + 2.5, middle],
                [x1 + 0.3, high + 2.5, middle],
            ),
        )
        for x in np.arange(x0 + 1, x1 - 1.2, 2.2):
            for y in (1.0, 3.6):
                for z in (z0, z1):
                    s.box("neighbor windows", "pane", [x, y, z - 0.04], [x + 1.1, y + 1.4, z + 0.04])
