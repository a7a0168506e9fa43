"""MakeHuman's body, its rig and its targets, read from the CC0 files into arrays that know nothing of MakeHuman."""

from __future__ import annotations

import gzip
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

# Vertices of the body itself and of the eyeballs, first and one past the last; the rest are helpers for hair, clothes
# and joints.
PARTS = {"skin": [(0, 13380)], "eye": [(14598, 14670), (14670, 14742)]}
# Units of the files are decimeters, y up; the trainers' frame is meters, y down, facing -z (OpenCV's camera at -z).
TO_METERS = np.array([0.1, -0.1, -0.1])


@dataclass
class Body:
    """vertices (V,3) meters, y down; triangles (T,3); weights (V,J); joints (J,3); parents first; directions (V,3,B)
    and joint_directions (J,3,B) of the targets; parts (V): which of PARTS a vertex belongs to, as an index."""

    vertices: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    joints: np.ndarray
    parents: list[int]
    names: list[str]
    directions: np.ndarray
    joint_directions: np.ndarray
    parts: np.ndarray


def read_body(folder: Path, rig: str = "game_engine", parts: dict[str, list[tuple[int, int]]] = PARTS) -> Body:
    """Reads the mesh, or other parts of it, one rig and every target in the folder."""
    lines = (folder / "3dobjs_base.obj").read_text().splitlines()
    every = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float) * TO_METERS
    faces = [[int(c.split("/")[0]) - 1 for c in line.split()[1:]] for line in lines if line.startswith("f ")]
    number, kinds = np.full(len(every), -1), np.full(len(every), -1)
    for index, ranges in enumerate(parts.values()):
        for first, end in ranges:
            kinds[first:end] = index
    used = np.nonzero(kinds >= 0)[0]
    number[used] = np.arange(len(used))
    shown = [f for f in faces if (number[f] >= 0).all()]
    triangles = [[f[0], f[i], f[i + 1]] for f in shown for i in range(1, len(f) - 1)]
    bones = json.loads((folder / f"rigs_standard_rig.{rig}.json").read_text())
    groups = json.loads((folder / "mesh_metadata_basemesh_vertex_groups.json").read_text())
    names = parents_first(bones)
    heads = np.zeros((len(names), len(every)))
    for row, name in enumerate(names):
        picked = head_vertices(bones[name]["head"], groups)
        heads[row, picked] = 1 / len(picked)
    weights = np.zeros((len(every), len(names)))
    listed = json.loads((folder / f"rigs_standard_weights.{rig}.json").read_text())["weights"]
    for column, name in enumerate(names):
        for vertex, weight in listed.get(name, []):
            weights[vertex, column] = weight
    weights = weights[used]
    weights[weights.sum(1) == 0, 0] = 1
    targets = [read_target(path, len(every)) for path in sorted(folder.glob("*.target.gz"))]
    moves = np.stack(targets, 2) if targets else np.zeros((len(every), 3, 0))
    return Body(
        every[used],
        number[np.array(triangles)],
        weights / weights.sum(1, keepdims=True),
        heads @ every,
        [names.index(bones[name]["parent"]) if bones[name]["parent"] else -1 for name in names],
        names,
        moves[used],
        np.einsum("jv,vcb->jcb", heads, moves),
        kinds[used],
    )


def head_vertices(head: dict[str, Any], groups: dict[str, list[list[int]]]) -> list[int]:
    """Vertices whose mean a bone's head is: listed, or all of a helper cube, whose ranges include their ends."""
    if head["strategy"] == "CUBE":
        return [vertex for first, last in groups[head["cube_name"]] for vertex in range(first, last + 1)]
    return list(head["vertex_indices"])


def parents_first(bones: dict[str, dict[str, Any]]) -> list[str]:
    """Names of bones, every parent before its children."""
    order: list[str] = []
    while len(order) < len(bones):
        ready = [n for n, bone in bones.items() if n not in order and (not bone["parent"] or bone["parent"] in order)]
        if not ready:
            raise ValueError(f"bones without a way to a root: {sorted(set(bones) - set(order))}")
        order += ready
    return order


def read_target(path: Path, count: int) -> np.ndarray:
    """Offsets of vertices (count,3), meters."""
    moves = np.zeros((count, 3))
    for line in gzip.decompress(path.read_bytes()).decode().splitlines():
        fields = line.split()
        if len(fields) == 4 and not line.startswith("#"):
            moves[int(fields[0])] = [float(x) for x in fields[1:]]
    return moves * TO_METERS
