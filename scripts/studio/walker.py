"""A person who walks a circle on a stage with a few things, filmed by cameras on stands all around."""

from pathlib import Path

import mitsuba as mi
import numpy as np

import body
import materials as m
import plants
import shapes
import textures as t
from stage import Stage

RATE = 24.0  # paintings a second of each camera
PACE, RADIUS = 1.25, 0.85  # meters a second along a circle
STRIDE = 1.3  # meters of two steps


def build(data: Path) -> Stage:
    """A photographer's room of 6 x 6 m."""
    random = np.random.default_rng(75)
    s = Stage("walker", field_of_view=62.0, exposure=1.0, depth=5)
    s.materials |= {
        "floor": m.matt(t.wood([0.32, 0.21, 0.12], [0.58, 0.42, 0.27], 3, 8), 1.4),
        "wall": m.matt(t.bricks([0.66, 0.62, 0.57], [0.50, 0.47, 0.43], 4, 14, 7), 1.6),
        "ceiling": m.matt([0.7, 0.7, 0.7]),
        "rug": m.matt(t.weave([0.14, 0.22, 0.34], [0.45, 0.55, 0.62], 5, 64, [1, 0.5, 1.2, 0.8, 0.4]), 1.2),
        "oak": m.matt(t.wood([0.42, 0.27, 0.14], [0.66, 0.47, 0.28], 7), 0.9),
        "cloth": m.matt(t.weave([0.50, 0.34, 0.08], [0.72, 0.52, 0.16], 8), 0.3),
        "steel": m.metal([0.3, 0.3, 0.31], 0.4),
        "leaf": m.leaf(t.plaster([0.14, 0.32, 0.09], 20, 0.5)),
        "pot": m.matt(t.plaster([0.55, 0.27, 0.16], 18, 0.3), 0.4),
        "skin": m.matt(t.plaster([0.62, 0.40, 0.30], 9, 0.12), 0.5),
        "eyes": m.glossy([0.12, 0.09, 0.08], 1, 0.1, 0.5),
        "hair": m.matt(t.wood([0.05, 0.03, 0.02], [0.20, 0.11, 0.06], 10), 0.2),
        "shirt": m.matt(t.weave([0.62, 0.10, 0.10], [0.85, 0.30, 0.22], 11, 48, [1, 0.35, 1, 1.1, 0.35, 1]), 0.5),
        "trousers": m.matt(t.weave([0.08, 0.13, 0.25], [0.20, 0.28, 0.44], 12), 0.2),
        "shoes": m.matt([0.06, 0.05, 0.05]),
        "soft box": m.shining([4.5, 4.4, 4.2]),
    }
    for k in range(3):
        s.materials[f"painting {k}"] = m.matt(t.painting(80 + k), 1.0)
    s.box("floor", "floor", [-3.2, -0.1, -3.2], [3.2, 0, 3.2])
    for low, high in (
        ([-3.3, 0, -3.3], [3.3, 3, -3.2]),
        ([-3.3, 0, 3.2], [3.3, 3, 3.3]),
        ([-3.3, 0, -3.2], [-3.2, 3, 3.2]),
        ([3.2, 0, -3.2], [3.3, 3, 3.2]),
    ):
        s.box("walls", "wall", low, high)
    s.box("ceiling", "ceiling", [-3.3, 3, -3.3], [3.3, 3.1, 3.3])
    for x in (-1.5, 1.5):
        for z in (-1.5, 1.5):
            s.box("soft boxes", "soft box", [x - 0.8, 2.95, z - 0.8], [x + 0.8, 2.98, z + 0.8])
    s.add("rug", "rug", shapes.lathe([(0.03, 0.008), (1.6, 0.008), (1.6, 0.001)], (0, 0, 0), 64))
    for k, (x, z) in enumerate(((-1.2, -3.19), (1.2, -3.19))):
        s.add(
            f"painting {k}",
            f"painting {k}",
            shapes.quad([x - 0.5, 1.2, z], [x + 0.5, 1.2, z], [x + 0.5, 2.0, z], [x - 0.5, 2.0, z], True),
        )
        s.length(f"painting {k}, width", [x - 0.5, 1.2, z], [x + 0.5, 1.2, z])
        s.length(f"painting {k}, height", [x + 0.5, 1.2, z], [x + 0.5, 2.0, z])
    for x, z, high in ((-2.5, -2.4, 0.45), (2.4, -2.5, 0.8), (2.5, 2.3, 0.5), (-2.4, 2.5, 0.65)):
        s.box(f"crate {x} {z}", "oak", [x - 0.3, 0, z - 0.3], [x + 0.3, high, z + 0.3], measure=True, stands=True)
    plants.pot_plant(s, "left", [-2.5, 0.45, -2.4], 0.8, random)
    plants.pot_plant(s, "right", [2.4, 0.8, -2.5], 0.6, random)
    s.add("cushion", "cloth", shapes.cushion([2.5, 0.6, 2.3], [0.5, 0.2, 0.5], 0.5))
    s.person = body.Person(data / "avatars/body-cc0")
    for name, mesh in pose(s, 0).items():
        s.add("person", name, mesh)
    s.credits.append(
        {"what": "person: MakeHuman's base mesh and rig", "licence": "CC0", "from": "http://www.makehumancommunity.org"}
    )
    s.floors = [[-3.2, 3.2, -3.2, 3.2, 0]]
    return s


def pose(stage: Stage, frame: int) -> dict:
    """Meshes of the person in a frame, by material."""
    way = PACE * frame / RATE
    angle = way / RADIUS
    place = np.array([RADIUS * np.sin(angle), 0, RADIUS * np.cos(angle)])
    return stage.person.posed(body.stride(way / STRIDE), place, angle + np.pi / 2)


def animate(stage: Stage, scene, frame: int) -> None:
    """Moves the person of a loaded scene."""
    values = mi.traverse(scene)
    meshes = pose(stage, frame)
    for number, (thing, material) in enumerate(stage.parts):
        if thing == "person":
            points, _, _, normals = meshes[material]
            values[f"part{number:03}.vertex_positions"] = mi.Float(points.astype(np.float32).ravel())
            values[f"part{number:03}.vertex_normals"] = mi.Float(normals.astype(np.float32).ravel())
    values.update()


def cameras(stage: Stage, random, count: int):
    """Cameras on stands in two rings, all towards the middle."""
    views = []
    for k in range(count):
        angle = 2 * np.pi * k / count + 0.05 * random.normal()
        height = (0.9, 1.55, 2.25)[k % 3] + 0.05 * random.normal()
        eye = np.array([2.75 * np.sin(angle), height, 2.75 * np.cos(angle)])
        views.append((eye, np.array([0, 0.85, 0]) + 0.12 * random.normal(size=3)))
    return views
