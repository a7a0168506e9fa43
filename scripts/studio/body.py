"""A person from MakeHuman's CC0 body: a rig that turns joints, a stride, and a dress of several materials."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "packages/exporter/training"))
sys.path.insert(0, str(Path(__file__).resolve().parent))
import makehuman

# First and one past the last vertex of each part of the files' mesh.
PARTS = {"skin": [(0, 13380)], "eye": [(14598, 14742)], "cloth": [(15328, 18002)], "hair": [(18722, 19150)]}


def turn(axis, angle: float) -> np.ndarray:
    """Rotation by radians about x, y or z."""
    c, s = np.cos(angle), np.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


class Person:
    """Posed meshes by material; feet stand on y = 0 in rest, facing +z, y up, meters."""

    def __init__(self, folder: Path):
        """Reads the files of the body in `folder`."""
        self.body = makehuman.read_body(folder, parts=PARTS)
        flip = np.array([1, -1, -1])
        self.rest, self.joints = self.body.vertices * flip, self.body.joints * flip
        floor = self.rest[self.body.parts == 0][:, 1].min()
        self.rest, self.joints = self.rest - [0, floor, 0], self.joints - [0, floor, 0]
        self.pieces = self._pieces()

    def _pieces(self) -> dict:
        """Triangles of skin, eyes, hair, shirt, trousers and shoes."""
        kind = self.body.parts[self.body.triangles[:, 0]]
        middle = self.rest[self.body.triangles].mean(1)
        waist = self._joint("pelvis")[1] + 0.02
        side, ankle = np.abs(middle[:, 0]), self._joint("foot_l")[1] + 0.02
        wrist = self._joint("hand_l")[0] - 0.03
        neck = self._joint("neck_01")[1] + 0.03
        bare = (middle[:, 1] > neck) | (side > wrist)
        top = self.rest[:, 1].max()
        face = (middle[:, 2] > self._joint("head")[2] + 0.045) & (middle[:, 1] < top - 0.05)
        return {
            "skin": self.body.triangles[(kind == 0) & bare],
            "eyes": self.body.triangles[kind == 1],
            "hair": self.body.triangles[(kind == 3) & ~face],
            "shirt": self.body.triangles[(kind == 2) & (middle[:, 1] > waist) & ~bare],
            "trousers": self.body.triangles[(kind == 2) & (middle[:, 1] <= waist) & (middle[:, 1] > ankle - 0.05)],
            "shoes": self.body.triangles[(kind == 0) & (middle[:, 1] < ankle)],
        }

    def _joint(self, name: str) -> np.ndarray:
        return self.joints[self.body.names.index(name)]

    def posed(self, turns: dict, place=(0, 0, 0), heading: float = 0.0) -> dict:
        """A mesh of each piece; `turns` are rotations by joint about the axes of the world, in the rest pose."""
        moves = []
        for k, name in enumerate(self.body.names):
            above = moves[self.body.parents[k]] if self.body.parents[k] >= 0 else (np.eye(3), np.zeros(3))
            rotation = above[0] @ turns.get(name, np.eye(3))
            origin = above[0] @ self.joints[k] + above[1]
            moves.append((rotation, origin - rotation @ self.joints[k]))
        rotations, offsets = np.stack([m[0] for m in moves]), np.stack([m[1] for m in moves])
        points = (
            np.einsum("vj,jab,vb->va", self.body.weights, rotations, self.rest, optimize=True)
            + self.body.weights @ offsets
        )
        points = points @ turn("y", heading).T
        points[:, 1] -= min(points[self.pieces["shoes"].ravel(), 1].min(), 0.2)
        points = points + place
        return {name: self._mesh(points, triangles) for name, triangles in self.pieces.items()}

    def _mesh(self, points, triangles):
        used, index = np.unique(triangles.ravel(), return_inverse=True)
        triangles, p = index.reshape(-1, 3), points[used]
        faces = np.cross(p[triangles[:, 1]] - p[triangles[:, 0]], p[triangles[:, 2]] - p[triangles[:, 0]])
        normals = np.zeros_like(p)
        for k in range(3):
            np.add.at(normals, triangles[:, k], faces)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        rest = self.rest[used]
        return p, triangles, np.stack([rest[:, 0] + 0.7 * rest[:, 2], rest[:, 1]], 1), normals


def stride(phase: float) -> dict:
    """Joint rotations of a walk; two steps are phase 0 to 1. Positive turns about x swing a leg back."""
    swing = 2 * np.pi * phase
    pose = {}
    for side, sign in (("l", 1), ("r", -1)):
        leg = sign * np.sin(swing)
        bend = 0.12 + 0.75 * max(0.0, np.sin(swing + (0.5 * np.pi if sign > 0 else 1.5 * np.pi) + 0.6)) ** 2
        pose[f"thigh_{side}"] = turn("x", -0.45 * leg - 0.08) @ turn("z", -sign * 0.1)
        pose[f"calf_{side}"] = turn("x", bend)
        pose[f"foot_{side}"] = turn("x", 0.15 * leg - 0.1)
        pose[f"upperarm_{side}"] = turn("x", 0.5 * leg) @ turn("z", -sign * 0.55)
        pose[f"lowerarm_{side}"] = turn("x", -0.35 - 0.2 * leg)
    pose["spine_02"] = turn("y", 0.12 * np.sin(swing))
    pose["pelvis"] = turn("y", -0.08 * np.sin(swing))
    return pose


def statue() -> dict:
    """Weight on one leg, an arm raised, the head turned."""
    return {
        "pelvis": turn("z", 0.05),
        "spine_01": turn("z", -0.08),
        "spine_02": turn("y", 0.2) @ turn("z", -0.04),
        "thigh_l": turn("x", -0.25) @ turn("z", 0.08),
        "calf_l": turn("x", 0.4),
        "foot_l": turn("x", 0.1),
        "upperarm_l": turn("z", 0.75) @ turn("y", -0.35),
        "lowerarm_l": turn("z", 0.9),
        "upperarm_r": turn("z", 0.62) @ turn("x", -0.1),
        "lowerarm_r": turn("x", -0.5),
        "neck_01": turn("y", 0.3),
        "head": turn("y", 0.25) @ turn("z", 0.06),
    }
