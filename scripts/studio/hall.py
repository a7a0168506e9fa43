"""A museum's hall: two rows of columns, a coffered ceiling with skylights, a marble statue, a bronze cat."""

from pathlib import Path

import numpy as np

import body
import materials as m
import phone
import shapes
import textures as t
from product import placed
from stage import Stage, read_glb

LONG, WIDE, HIGH = 9.0, 6.0, 6.5  # half of the length (x), half of the width (z), height


def build(data: Path) -> Stage:
    """The hall's middle is the origin; the statue stands there."""
    s = Stage("hall", field_of_view=74.0, exposure=1.0, depth=6)
    s.materials |= {
        "wall": m.matt(t.plaster([0.62, 0.22, 0.18], 1, 0.2), 3.0),
        "upper wall": m.matt(t.plaster([0.80, 0.76, 0.68], 2, 0.12), 3.0),
        "ceiling": m.matt(t.plaster([0.84, 0.82, 0.76], 3, 0.08), 3.0),
        "floor": m.glossy(
            t.tiles([[0.70, 0.66, 0.58], [0.13, 0.12, 0.12]], [0.30, 0.28, 0.26], 4, 4, 0.012), 2.4, 0.22, 0.5
        ),
        "stone": m.matt(t.marble([0.55, 0.50, 0.42], [0.80, 0.76, 0.68], 5), 1.2),
        "marble": m.glossy(t.marble([0.55, 0.54, 0.53], [0.86, 0.85, 0.82], 6), 0.8, 0.3, 0.4),
        "dark stone": m.glossy(t.marble([0.06, 0.07, 0.06], [0.22, 0.23, 0.20], 7), 0.8, 0.2, 0.5),
        "bronze": m.metal([0.45, 0.28, 0.14], 0.32),
        "gold": m.metal([0.75, 0.55, 0.22], 0.3),
        "oak": m.glossy(t.wood([0.18, 0.10, 0.05], [0.38, 0.24, 0.13], 8), 0.8, 0.3, 0.4),
        "leather": m.glossy(t.plaster([0.25, 0.06, 0.05], 9, 0.4), 0.5, 0.4, 0.4),
        "black": m.glossy([0.03, 0.03, 0.03], 1, 0.3, 0.4),
        "skylight": m.shining([3.4, 3.7, 4.2]),
        "lamp": m.shining([6, 5, 3.6]),
    }
    for k in range(8):
        s.materials[f"painting {k}"] = m.matt(t.painting(60 + k), 1.0)
    shell(s)
    columns(s)
    paintings(s)
    statues(s, data)
    s.floors = [[-LONG, LONG, -WIDE, WIDE, 0]]
    return s


def cameras(stage: Stage, random, count: int):
    """Half on a walk through the hall, half about the statue."""
    around = phone.orbit([0, 1.7, 0], (2.2, 3.4), (1.1, 2.2), random, count * 2 // 5, 4, spread=0.35)
    return phone.walk(stage, random, count - len(around), doors=0) + around


def shell(s: Stage) -> None:
    """Floor, walls with a dado and a cornice, ceiling with beams and skylights, two doors."""
    s.box("floor", "floor", [-LONG - 0.3, -0.2, -WIDE - 0.3], [LONG + 0.3, 0, WIDE + 0.3])
    for x0, x1, z0, z1 in (
        (-LONG - 0.3, LONG + 0.3, -WIDE - 0.3, -WIDE),
        (-LONG - 0.3, LONG + 0.3, WIDE, WIDE + 0.3),
        (-LONG - 0.3, -LONG, -WIDE, WIDE),
        (LONG, LONG + 0.3, -WIDE, WIDE),
    ):
        s.box("dado", "dark stone", [x0, 0, z0], [x1, 0.9, z1])
        s.box("walls", "wall", [x0, 0.9, z0], [x1, 4.2, z1])
        s.box("walls", "upper wall", [x0, 4.2, z0], [x1, HIGH, z1])
    for y, out in ((0.9, 0.05), (4.2, 0.12), (HIGH - 0.35, 0.25)):
        for side in (-1, 1):
            s.box(
                "mouldings",
                "stone",
                [-LONG, y, min(side * WIDE, side * (WIDE - out))],
                [LONG, y + 0.1, max(side * WIDE, side * (WIDE - out))],
            )
            s.box(
                "mouldings",
                "stone",
                [min(side * LONG, side * (LONG - out)), y, -WIDE],
                [max(side * LONG, side * (LONG - out)), y + 0.1, WIDE],
            )
    s.box("ceiling", "ceiling", [-LONG - 0.3, HIGH, -WIDE - 0.3], [LONG + 0.3, HIGH + 0.1, WIDE + 0.3])
    for x in np.arange(-7.5, 7.6, 3):
        s.box("beams", "ceiling", [x - 0.2, HIGH - 0.4, -WIDE], [x + 0.2, HIGH, WIDE])
    for z in (-3.4, 0, 3.4):
        s.box("beams", "ceiling", [-LONG, HIGH - 0.35, z - 0.2], [LONG, HIGH, z + 0.2])
    for x in np.arange(-6, 6.1, 3):
        for z in (-1.7, 1.7):
            s.box("skylights", "skylight", [x - 0.9, HIGH - 0.02, z - 0.9], [x + 0.9, HIGH - 0.005, z + 0.9])
    for side in (-1, 1):
        x = side * LONG
        s.box("doors", "oak", [min(x, x - side * 0.06), 0, -0.9], [max(x, x - side * 0.06), 2.8, 0.9])
        s.box("door seams", "black", [min(x, x - side * 0.07), 0, -0.01], [max(x, x - side * 0.07), 2.8, 0.01])
        for z in (-1.1, 0.9):
            s.box("door frames", "stone", [min(x, x - side * 0.15), 0, z], [max(x, x - side * 0.15), 3.0, z + 0.2])
        s.box("door frames", "stone", [min(x, x - side * 0.15), 2.8, -1.2], [max(x, x - side * 0.15), 3.1, 1.2])
        s.length(f"door {side}, width", [x - side * 0.15, 2.8, -0.9], [x - side * 0.15, 2.8, 0.9])
        s.length(f"door {side}, height", [x - side * 0.15, 0, -1.1], [x - side * 0.15, 3.1, -1.1])


def columns(s: Stage) -> None:
    """Ten columns on square bases; each casts what all others cast."""
    shaft = [
        (0.30, 0.3),
        (0.33, 0.34),
        (0.27, 0.42),
        (0.26, 0.5),
        (0.27, 1.8),
        (0.23, 4.6),
        (0.28, 4.68),
        (0.24, 4.74),
        (0.36, 4.95),
        (0.36, 5.0),
    ]
    for x in np.arange(-6, 6.1, 3):
        for z in (-3.4, 3.4):
            s.box("bases", "stone", [x - 0.38, 0, z - 0.38], [x + 0.38, 0.3, z + 0.38], stands=True)
            s.add("columns", "stone", shapes.lathe(shaft, (x, 0, z), 40))
            s.box("capitals", "stone", [x - 0.4, 5.0, z - 0.4], [x + 0.4, 5.18, z + 0.4])
    for z in (-3.4, 3.4):
        s.box("architraves", "stone", [-LONG, 5.18, z - 0.32], [LONG, HIGH - 0.35, z + 0.32])
    s.length("column base, width", [-0.38, 0.3, -3.02], [0.38, 0.3, -3.02])
    s.length("columns, from middle to middle", [-0.38, 0.3, -3.02], [2.62, 0.3, -3.02])
    s.length("bases, across the hall", [0.38, 0.3, -3.02], [0.38, 0.3, 3.02])


def paintings(s: Stage) -> None:
    """Framed paintings on all long walls, benches before some."""
    for k, x in enumerate((-7.2, -3, 0.0, 3, 7.2)):
        for side in (-1, 1):
            wide, high = 0.75 + 0.12 * (k % 3), 0.6 + 0.15 * ((k + side) % 3)
            z = side * (WIDE - 0.03)
            s.box(
                "frames",
                "gold",
                [x - wide - 0.09, 2.2 - high - 0.09, min(z, side * WIDE)],
                [x + wide + 0.09, 2.2 + high + 0.09, max(z, side * WIDE)],
            )
            zz = side * (WIDE - 0.035)
            s.add(
                f"painting {k} {side}",
                f"painting {(k + (3 if side > 0 else 0)) % 8}",
                shapes.quad(
                    [x - wide * side, 2.2 - high, zz],
                    [x + wide * side, 2.2 - high, zz],
                    [x + wide * side, 2.2 + high, zz],
                    [x - wide * side, 2.2 + high, zz],
                    True,
                ),
            )
            if k < 3:
                s.length(f"painting {k} {side}, width", [x - wide, 2.2 - high, zz], [x + wide, 2.2 - high, zz])
                s.length(f"painting {k} {side}, height", [x + wide, 2.2 - high, zz], [x + wide, 2.2 + high, zz])
    for x, z in ((-4.5, 0), (4.5, 0), (-1.5, 4.8), (1.5, -4.8)):
        s.box("benches", "leather", [x - 0.8, 0.36, z - 0.25], [x + 0.8, 0.46, z + 0.25], measure=True, stands=True)
        for a in (-0.7, 0.6):
            s.box("bench legs", "black", [x + a, 0, z - 0.22], [x + a + 0.1, 0.36, z + 0.22])


def statues(s: Stage, data: Path) -> None:
    """The marble figure on its pedestal, a cat of bronze, two vases."""
    s.box("pedestal", "dark stone", [-0.6, 0, -0.6], [0.6, 0.25, 0.6], measure=True, stands=True)
    s.box("pedestal", "stone", [-0.48, 0.25, -0.48], [0.48, 0.95, 0.48], measure=True)
    s.box("pedestal", "marble", [-0.52, 0.95, -0.52], [0.52, 1.05, 0.52])
    figure = body.Person(data / "avatars/body-cc0").posed(body.statue(), (0, 1.045, 0), 0.4)
    for name in ("skin", "hair", "shirt", "trousers", "shoes", "eyes"):
        s.add("statue", "marble", figure[name])
    s.credits.append(
        {"what": "statue: MakeHuman's base mesh", "licence": "CC0", "from": "http://www.makehumancommunity.org"}
    )
    s.credits.append(
        {
            "what": "cat: Egyptian Cat Statue by Ankledot, without its textures",
            "licence": "CC BY 4.0",
            "from": "https://sketchfab.com/3d-models/egyptian-cat-statue-02b0456362f9442da46d39fb34b3ee5b",
        }
    )
    s.box("plinth", "marble", [5.7, 0, 1.4], [6.3, 1.0, 2.0], measure=True, stands=True)
    for _, _, mesh in placed(read_glb(data / "meshes/cat.glb"), [6.0, 1.0, 1.7], height=0.62, turn=-0.9):
        s.add("cat", "bronze", mesh)
    vase = [
        (0, 0),
        (0.12, 0),
        (0.1, 0.05),
        (0.24, 0.35),
        (0.2, 0.6),
        (0.09, 0.72),
        (0.14, 0.82),
        (0.13, 0.82),
        (0.07, 0.72),
        (0, 0.7),
    ]
    for x, z, skin in ((-6.0, 1.7, "bronze"), (-6.0, -1.7, "dark stone")):
        s.box("plinth", "marble", [x - 0.3, 0, z - 0.3], [x + 0.3, 0.8, z + 0.3], stands=True)
        s.add("vases", skin, shapes.lathe(vase, (x, 0.8, z), 64))
    s.length("left plinth, height", [-5.7, 0, 2.0], [-5.7, 0.8, 2.0])
