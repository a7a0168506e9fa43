"""A scene being built: materials, meshes by object, lights, where people may stand, what is known about it.

World of a stage: meters, x right, y up, z towards the viewer. Scenes are trained and written in the frame of trainers,
half a turn about x from it.
"""

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import shapes

TRAINER = np.array([1.0, -1.0, -1.0])  # world of a stage -> frame of the trained scene (x right, y down, z forward)


@dataclass
class Stage:
    """Parts of a scene, and the facts about it."""

    name: str
    field_of_view: float = 70.0  # degrees, horizontal
    exposure: float = 1.0  # factor of linear light
    depth: int = 7  # longest light path
    materials: dict = field(default_factory=dict)
    parts: dict = field(default_factory=dict)  # (object, material) -> meshes
    lights: dict = field(default_factory=dict)
    floors: list = field(default_factory=list)  # [x0, x1, z0, z1, height]: where people may walk
    taken: list = field(default_factory=list)  # [x0, x1, z0, z1]: furniture that stands there
    lengths: list = field(default_factory=list)  # (name, point, point)
    credits: list = field(default_factory=list)
    targets: list = field(default_factory=list)  # points worth looking at

    def add(self, thing: str, material: str, *meshes) -> None:
        """Adds meshes of one material to an object."""
        if material not in self.materials:
            raise KeyError(f'expected a material of the stage, found "{material}"')
        self.parts.setdefault((thing, material), []).extend(meshes)

    def box(self, thing: str, material: str, low, high, measure: bool = False, stands: bool = False) -> None:
        """A box; `measure` adds its upper edges and its height to the known lengths, `stands` takes its floor."""
        low, high = np.asarray(low, float), np.asarray(high, float)
        self.add(thing, material, shapes.box(low, high))
        if measure:
            a = np.array([low[0], high[1], high[2]])
            self.length(f"{thing}, width", a, [high[0], high[1], high[2]])
            self.length(f"{thing}, depth", [high[0], high[1], low[2]], [high[0], high[1], high[2]])
            if low[1] < high[1] - 0.2:
                self.length(f"{thing}, height", [high[0], low[1], high[2]], [high[0], high[1], high[2]])
        if stands:
            self.taken.append([low[0], high[0], low[2], high[2]])

    def length(self, name: str, a, b) -> None:
        """A known length between two visible corners."""
        self.lengths.append((name, [float(x) for x in a], [float(x) for x in b]))

    @property
    def objects(self) -> list:
        """Names of all objects; their places are their ids."""
        return list(dict.fromkeys(thing for thing, _ in self.parts))

    def write(self, folder: Path) -> dict:
        """Writes the meshes into `folder`; returns the dictionary that Mitsuba loads."""
        folder.mkdir(parents=True, exist_ok=True)
        scene = {"type": "scene", **self.lights}
        for number, ((_, material), meshes) in enumerate(self.parts.items()):
            path = folder / f"{number:03}.ply"
            write_ply(path, shapes.joined(meshes))
            emitter = {"emitter": self.materials[material]["emits"]} if "emits" in self.materials[material] else {}
            bsdf = self.materials[material].get("bsdf", {"type": "diffuse"})
            scene[f"part{number:03}"] = {"type": "ply", "filename": str(path), "bsdf": bsdf, **emitter}
        return scene

    def ids(self) -> np.ndarray:
        """Object id of each part, in the order of `write`."""
        names = self.objects
        return np.array([names.index(thing) for thing, _ in self.parts])

    def free(self, x: float, z: float, margin: float = 0.0) -> bool:
        """Whether a person may stand there, `margin` from furniture and edges."""
        floor = any(a + margin < x < b - margin and c + margin < z < d - margin for a, b, c, d, _ in self.floors)
        return floor and not any(
            a - margin < x < b + margin and c - margin < z < d + margin for a, b, c, d in self.taken
        )

    def area(self) -> float:
        """Free floor in square meters, counted in cells of 2 cm."""
        total, cell = 0, 0.02
        low_x, high_x = min(f[0] for f in self.floors), max(f[1] for f in self.floors)
        low_z, high_z = min(f[2] for f in self.floors), max(f[3] for f in self.floors)
        x, z = np.meshgrid(np.arange(low_x, high_x, cell) + cell / 2, np.arange(low_z, high_z, cell) + cell / 2)
        inside, taken = np.zeros(x.shape, bool), np.zeros(x.shape, bool)
        for a, b, c, d, _ in self.floors:
            inside |= (x > a) & (x < b) & (z > c) & (z < d)
        for a, b, c, d in self.taken:
            taken |= (x > a) & (x < b) & (z > c) & (z < d)
        total = (inside & ~taken).sum()
        return float(total * cell * cell)

    def truth(self) -> dict:
        """All that is known, in the frame of the trained scene."""
        flip = lambda p: [round(float(v), 4) for v in np.asarray(p) * TRAINER]  # noqa: E731
        rectangle = lambda r: [round(float(v), 3) for v in (r[0], r[1], -r[3], -r[2])]  # noqa: E731
        return {
            "name": self.name,
            "unit": "meter",
            "up": [0, -1, 0],
            "floors": [{"x0x1z0z1": rectangle(f), "y": round(-float(f[4]), 4)} for f in self.floors],
            "taken": [rectangle(f) for f in self.taken],
            "freeFloor": round(self.area(), 2),
            "lengths": [
                {
                    "name": n,
                    "from": flip(a),
                    "to": flip(b),
                    "meters": round(float(np.linalg.norm(np.subtract(a, b))), 4),
                }
                for n, a, b in self.lengths
            ],
            "objects": self.objects,
            "credits": self.credits,
        }

    def mesh(self) -> tuple:
        """Geometry without leaves in the frame of the trained scene.

        Points (V, 3) float32, triangles (T, 3) uint32, object ids (T) uint8.
        """
        solid = [
            (thing, shapes.joined(meshes))
            for (thing, _), meshes in self.parts.items()
            if not thing.startswith("leaves")
        ]
        names = self.objects
        points = np.concatenate([m[0] for _, m in solid]) * TRAINER
        starts = np.cumsum([0] + [len(m[0]) for _, m in solid])
        triangles = np.concatenate([m[1] + s for (_, m), s in zip(solid, starts, strict=False)])
        ids = np.concatenate([np.full(len(m[1]), names.index(thing)) for thing, m in solid])
        return points.astype("<f4"), triangles.astype("<u4"), ids.astype(np.uint8)


def write_ply(path: Path, mesh) -> None:
    """A binary PLY that Mitsuba reads, with uv and, where the surface is smooth, normals."""
    positions, triangles, uv, normals = mesh
    names = ["x", "y", "z"] + (["nx", "ny", "nz"] if normals is not None else []) + ["u", "v"]
    vertices = np.concatenate([positions] + ([normals] if normals is not None else []) + [uv], 1).astype("<f4")
    faces = np.zeros(len(triangles), [("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, triangles
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
    head += "".join(f"property float {n}\n" for n in names)
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_bytes(head.encode() + vertices.tobytes() + faces.tobytes())


def read_glb(path: Path) -> list:
    """Meshes of a glTF binary without textures: (material name, base color, mesh), placed as its nodes say."""
    data = path.read_bytes()
    size = struct.unpack("<I", data[12:16])[0]
    tree, binary = json.loads(data[20 : 20 + size]), data[28 + size :]

    def values(index):
        accessor = tree["accessors"][index]
        view = tree["bufferViews"][accessor["bufferView"]]
        kind = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        start, step = view.get("byteOffset", 0) + accessor.get("byteOffset", 0), view.get("byteStride", 0)
        item = np.dtype(kind).itemsize * width
        rows = np.ndarray((accessor["count"], item), "u1", binary, start, (step or item, 1))
        return np.ascontiguousarray(rows).view(kind).reshape(accessor["count"], width)

    def matrix(node):
        if "matrix" in node:
            return np.array(node["matrix"]).reshape(4, 4).T
        result = np.eye(4)
        x, y, z, w = node.get("rotation", [0, 0, 0, 1])
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        result[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]))
        result[:3, 3] = node.get("translation", [0, 0, 0])
        return result

    found = []

    def visit(index, above):
        node = tree["nodes"][index]
        here = above @ matrix(node)
        for primitive in tree["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            at = primitive["attributes"]
            points = values(at["POSITION"]).astype(float) @ here[:3, :3].T + here[:3, 3]
            normals = values(at["NORMAL"]).astype(float) @ np.linalg.inv(here[:3, :3]) if "NORMAL" in at else None
            if normals is not None:
                normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
            triangles = values(primitive["indices"]).reshape(-1, 3).astype(np.int64)
            uv = values(at["TEXCOORD_0"]).astype(float) if "TEXCOORD_0" in at else points[:, :2]
            material = tree["materials"][primitive["material"]] if "material" in primitive else {}
            color = material.get("pbrMetallicRoughness", {}).get("baseColorFactor", [0.7, 0.7, 0.7, 1])[:3]
            found.append((material.get("name", ""), color, (points, triangles, uv, normals)))
        for child in node.get("children", []):
            visit(child, here)

    for root in tree["scenes"][tree.get("scene", 0)]["nodes"]:
        visit(root, np.eye(4))
    return found
