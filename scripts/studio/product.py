"""A product on a table: a small robot arm, sunglasses, a carafe and a glass, a metal lamp, a plant."""

from pathlib import Path

import numpy as np

import materials as m
import phone
import plants
import shapes
import textures as t
from stage import Stage, read_glb


def build(data: Path) -> Stage:
    """The table's top is at 0.75 m; `data` is the folder of shared data."""
    random = np.random.default_rng(72)
    s = Stage("product", field_of_view=60.0, exposure=0.75, depth=8)
    s.materials |= {
        "top": m.glossy(t.wood([0.30, 0.17, 0.08], [0.58, 0.38, 0.21], 3, 6), 0.9, 0.22, 0.5, 0.4),
        "wall": m.matt(t.plaster([0.50, 0.55, 0.56], 1), 2.0),
        "far wall": m.matt(t.plaster([0.72, 0.66, 0.56], 5), 2.0),
        "floor": m.matt(t.weave([0.20, 0.20, 0.22], [0.36, 0.35, 0.35], 2), 0.6),
        "glass": m.glass(),
        "steel": m.metal([0.66, 0.66, 0.68], 0.18),
        "brass": m.metal([0.80, 0.58, 0.25], 0.25),
        "rubber": m.glossy([0.03, 0.03, 0.035], 1, 0.45, 0.4),
        "lens": m.glossy([0.015, 0.02, 0.03], 1, 0.05, 0.8),
        "ceramic": m.glossy([0.22, 0.40, 0.48], 1, 0.1, 0.6, 0.6),
        "cloth": m.matt(t.weave([0.55, 0.52, 0.45], [0.78, 0.75, 0.68], 6, 48, [1, 1, 0.6, 1, 1, 0.8]), 0.25),
        "cork": m.matt(t.ground([[0.42, 0.28, 0.16], [0.60, 0.44, 0.28], [0.25, 0.15, 0.08]], 7), 0.1),
        "painting": m.matt(t.painting(33), 1.0),
        "poster": m.matt(t.painting(35), 1.0),
        "leaf": m.leaf(t.plaster([0.14, 0.32, 0.09], 20, 0.5)),
        "pot": m.glossy(t.plaster([0.75, 0.73, 0.70], 8, 0.1), 0.4, 0.3, 0.4),
        "soft box": m.shining([7.0, 6.8, 6.4]),
        "window": m.shining([3.2, 3.8, 4.6]),
        "ceiling": m.matt([0.8, 0.8, 0.78]),
    }
    for k, color in enumerate([[0.55, 0.10, 0.08], [0.10, 0.22, 0.42], [0.75, 0.70, 0.55]]):
        s.materials[f"book {k}"] = m.matt(t.plaster(color, 50 + k, 0.3), 0.3)
    room(s)
    things(s, random)
    robot(s, data / "meshes/robot-arm.glb")
    glasses(s, data / "meshes/sunglasses.glb")
    s.floors = [[-0.9, 0.9, -0.5, 0.5, 0.75]]
    s.taken += [
        [-0.42, -0.02, -0.16, 0.2],
        [0.24, 0.44, -0.32, -0.12],
        [-0.72, -0.5, -0.42, -0.2],
        [0.5, 0.78, -0.4, -0.1],
    ]
    return s


def cameras(stage: Stage, random, count: int):
    """Round the table, low and high, far and close."""
    far = phone.orbit([0, 0.92, 0], (0.95, 1.25), (1.0, 1.75), random, count * 6 // 10, 4, (0.15, np.pi - 0.15), 0.1)
    near = phone.orbit([-0.05, 0.9, 0], (0.6, 0.8), (0.95, 1.4), random, count - len(far), 3, (0.0, np.pi), 0.14)
    return far + near


def room(s: Stage) -> None:
    """Table, walls, a window and a soft box, a shelf behind."""
    s.box("table", "top", [-0.9, 0.715, -0.5], [0.9, 0.75, 0.5], measure=True)
    for x in (-0.86, 0.8):
        for z in (-0.46, 0.4):
            s.box("table legs", "steel", [x, 0, z], [x + 0.06, 0.715, z + 0.06])
    s.box("floor", "floor", [-3, -0.1, -1.2], [3, 0, 3])
    s.box("wall", "wall", [-3, 0, -1.3], [3, 2.6, -1.2])
    s.box("side walls", "far wall", [-3.1, 0, -1.3], [-3, 2.6, 3])
    s.box("side walls", "far wall", [3, 0, -1.3], [3.1, 2.6, 3])
    s.box("back wall", "far wall", [-3, 0, 3], [3, 2.6, 3.1])
    s.box("ceiling", "ceiling", [-3, 2.6, -1.3], [3, 2.7, 3])
    s.box("soft box", "soft box", [-0.7, 2.45, -0.2], [0.9, 2.5, 0.9])
    s.add("window", "window", shapes.quad([-2.99, 0.9, 2.2], [-2.99, 0.9, -0.4], [-2.99, 2.2, -0.4], [-2.99, 2.2, 2.2]))
    for z in (-0.45, 0.85, 2.15):
        s.box("window frame", "pot", [-3, 0.85, z], [-2.95, 2.25, z + 0.07])
    s.add(
        "painting",
        "painting",
        shapes.quad([-0.3, 1.2, -1.19], [0.5, 1.2, -1.19], [0.5, 1.85, -1.19], [-0.3, 1.85, -1.19], True),
    )
    s.length("painting, width", [-0.3, 1.2, -1.19], [0.5, 1.2, -1.19])
    s.length("painting, height", [0.5, 1.2, -1.19], [0.5, 1.85, -1.19])
    s.add(
        "poster",
        "poster",
        shapes.quad([1.0, 1.0, -1.19], [1.7, 1.0, -1.19], [1.7, 1.95, -1.19], [1.0, 1.95, -1.19], True),
    )
    s.length("poster, width", [1.0, 1.0, -1.19], [1.7, 1.0, -1.19])
    s.length("poster, height", [1.7, 1.0, -1.19], [1.7, 1.95, -1.19])
    s.box("sideboard", "top", [-2.2, 0, -1.19], [-0.9, 0.8, -0.8], measure=True)


def things(s: Stage, random) -> None:
    """Things on the table apart from the arm."""
    wall = [(0, 0), (0.045, 0), (0.055, 0.02), (0.06, 0.1), (0.035, 0.19), (0.032, 0.24), (0.042, 0.26)]
    inner = [(0.039, 0.26), (0.029, 0.24), (0.032, 0.19), (0.056, 0.1), (0.05, 0.022), (0, 0.008)]
    s.add("carafe", "glass", shapes.lathe(wall + inner, (0.34, 0.7501, -0.22), 72))
    cup = [(0, 0), (0.03, 0), (0.036, 0.11), (0.034, 0.11), (0.028, 0.01), (0, 0.01)]
    s.add("drinking glass", "glass", shapes.lathe(cup, (0.22, 0.7501, 0.1), 64))
    s.add("coaster", "cork", shapes.lathe([(0, 0), (0.05, 0), (0.05, 0.005), (0, 0.005)], (0.4, 0.75, 0.2)))
    s.add(
        "mug",
        "ceramic",
        shapes.lathe(
            [(0, 0), (0.038, 0), (0.042, 0.01), (0.042, 0.095), (0.037, 0.095), (0.036, 0.01), (0, 0.01)],
            (0.4, 0.755, 0.2),
            64,
        ),
    )
    t0 = np.linspace(-1.25, 1.25, 12)
    s.add(
        "mug handle",
        "ceramic",
        shapes.tube(np.stack([0.44 + 0.028 * np.cos(t0), 0.803 + 0.03 * np.sin(t0), 0.2 + 0 * t0], 1), 0.006),
    )
    s.box("books", "book 0", [0.5, 0.75, -0.38], [0.76, 0.785, -0.18], measure=True)
    s.box("second book", "book 1", [0.52, 0.785, -0.37], [0.75, 0.812, -0.2], measure=True)
    s.box("third book", "book 2", [0.51, 0.812, -0.375], [0.73, 0.83, -0.19], measure=True)
    ripple = lambda u, v: (-0.82 + 0.3 * u, 0.7515 + 0.004 * np.sin(11 * u + 3 * v) ** 2, 0.1 + 0.32 * v)  # noqa: E731
    s.add("cloth", "cloth", shapes.grid(ripple, 30, 30, (0.3, 0.32)))
    spring = np.linspace(0, 9 * 2 * np.pi, 260)
    coil = np.stack([0.62 + 0.03 * np.cos(spring), 0.762 + 0.0011 * spring * 2, 0.22 + 0.03 * np.sin(spring)], 1)
    s.add("spring", "brass", shapes.tube(coil, 0.0028, 8))
    s.add(
        "lamp", "brass", shapes.lathe([(0, 0), (0.07, 0), (0.07, 0.012), (0.01, 0.02), (0, 0.02)], (0.72, 0.75, -0.02))
    )
    s.add(
        "lamp",
        "brass",
        shapes.tube([[0.72, 0.76, -0.02], [0.72, 1.0, -0.02], [0.7, 1.12, -0.02], [0.6, 1.2, -0.02]], 0.005),
    )
    s.add(
        "lamp",
        "brass",
        shapes.moved(shapes.lathe([(0.02, 0.06), (0.035, 0.05), (0.075, -0.03)], (0, 0, 0), 48), (0.57, 1.18, -0.02)),
    )
    plants.pot_plant(s, "table", [-0.62, 0.75, -0.32], 0.34, random, stems=12)
    s.box("box", "cork", [-0.85, 0.75, -0.15], [-0.65, 0.83, -0.02], measure=True)


def placed(parts, place, height=None, width=None, turn=0.0):
    """Meshes of a model scaled to a height or a width and put on a place."""
    points = np.concatenate([mesh[0] for _, _, mesh in parts])
    low, high = points.min(0), points.max(0)
    scale = height / (high[1] - low[1]) if height else width / max(high[0] - low[0], high[2] - low[2])
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    c, n = np.cos(turn), np.sin(turn)
    offset = np.asarray(place) - scale * np.array([c * foot[0] + n * foot[2], foot[1], -n * foot[0] + c * foot[2]])
    return [(name, color, shapes.moved(mesh, offset, turn, scale)) for name, color, mesh in parts]


def robot(s: Stage, path: Path) -> None:
    """The arm: lacquer, castings, steel, rubber, a small light."""
    s.credits.append(
        {
            "what": "robot arm",
            "licence": "CC BY 4.0",
            "from": "https://sketchfab.com/3d-models/black-honey-robotic-arm-c50671f2a8e74de2a2e687103fdc93ab",
        }
    )
    for name, color, mesh in placed(read_glb(path), [-0.22, 0.75, 0.02], height=0.46, turn=0.6):
        if f"arm {name}" not in s.materials:
            rough, metallic = (
                (0.15, False) if "shell" in name or "warning" in name else (0.3, "steel" in name or "casting" in name)
            )
            s.materials[f"arm {name}"] = (
                m.metal(color, rough) if metallic else m.glossy(color, 1, rough, 0.5, 0.8 if "shell" in name else 0)
            )
        s.add(f"arm {name}", f"arm {name}", mesh)


def glasses(s: Stage, path: Path) -> None:
    """The sunglasses: thin temples, dark lenses."""
    s.credits.append(
        {
            "what": "sunglasses, by Eric Chadwick of Darmstadt Graphics Group GmbH",
            "licence": "CC BY 4.0",
            "from": "https://github.com/KhronosGroup/glTF-Sample-Assets/tree/main/Models/SunglassesKhronos",
        }
    )
    for name, _, mesh in placed(read_glb(path), [0.06, 0.7502, 0.28], width=0.15, turn=-0.5):
        s.add(
            "sunglasses lenses" if "lens" in name else "sunglasses",
            "lens" if "lens" in name else "brass" if "temples" in name else "rubber",
            mesh,
        )
