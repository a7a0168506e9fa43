"""A photograph of a face to Gaussians, in one file, with the networks of MediaPipe (Apache-2.0):

npm pack @mediapipe/face_mesh@0.4.1657299874 && tar xzf mediapipe-face_mesh-*.tgz
python portrait.py package PHOTO.png OUT.onnx

The face is found, cut out twice, and becomes a soft surface through the 468 points of the mesh. Hair, shoulders and the
wall are a guess. Needs PyTorch, Pillow, tflite and this package with the extra `module`.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from torch import Tensor
from torch.nn import functional

import gaussian_exporter as gs
from tflite_module import TfliteModule

# Sides of the photograph, of the networks' inputs, and of the grid of Gaussians.
PHOTO, DETECTOR, MESH, GRID = 256, 128, 192, 96
# Points of the mesh: the outer corners of both eyes.
_RIGHT_EYE, _LEFT_EYE = 33, 263


def network(package: Path, name: str) -> TfliteModule:
    """A network of the npm package @mediapipe/face_mesh, by the name of its file."""
    loader = (package / "face_mesh_solution_packed_assets_loader.js").read_text()
    place = re.search(rf'"filename":\s*"[^"]*{name}",\s*"start":\s*(\d+),\s*"end":\s*(\d+)', loader)
    if place is None:
        raise ValueError(f"{package}: expected the package @mediapipe/face_mesh with {name}, found none")
    content = (package / "face_mesh_solution_packed_assets.data").read_bytes()
    return TfliteModule(content[int(place[1]) : int(place[2])])


def centers(size: int) -> Tensor:
    """Centers of pixels (size,size,2), x first, in 0..1."""
    line = (torch.arange(size) + 0.5) / size
    y, x = torch.meshgrid(line, line, indexing="ij")
    return torch.stack([x, y], -1)


class Portrait(torch.nn.Module):
    """Image [1,3,256,256] and the depth of the relief; a split layout of 96 x 96 Gaussians."""

    def __init__(self, package: Path):
        """`package`: the folder of @mediapipe/face_mesh."""
        super().__init__()
        self.detector = network(package, "face_detection_short_range.tflite")
        self.mesh = network(package, "face_landmark.tflite")
        # Anchors of the detector: 2 in each of 16 x 16 cells, then 6 in each of 8 x 8.
        cells = ((16, 2), (8, 6))
        anchors = [centers(size).reshape(-1, 1, 2).repeat(1, count, 1).reshape(-1, 2) for size, count in cells]
        self.register_buffer("anchors", torch.cat(anchors))
        self.register_buffer("places", centers(GRID).reshape(-1, 2))
        self.register_buffer("cut", centers(MESH) - 0.5)
        self.register_buffer("whole", centers(DETECTOR))

    def sample(self, image: Tensor, places: Tensor) -> Tensor:
        """The image at places (H,W,2) in 0..1."""
        grid = (places * 2 - 1)[None]
        return functional.grid_sample(image, grid, mode="bilinear", padding_mode="border", align_corners=False)

    def found_face(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Center (2) of the face, and the x axis (2) of a square around it, times its size."""
        boxes, scores = self.detector(self.sample(image, self.whole) * 2 - 1)
        weights = torch.softmax(scores.reshape(-1, 1) * 4, 0)
        # A box has its center, its size, and the offsets of six points; the size has no anchor.
        offsets = self.anchors[:, None] * torch.tensor([1.0, 0, 1, 1, 1, 1, 1, 1])[None, :, None]
        points = (weights * (boxes[0].reshape(-1, 8, 2) / DETECTOR + offsets).reshape(-1, 16)).sum(0).reshape(8, 2)
        eyes = points[3] - points[2]
        return points[0], eyes / torch.linalg.norm(eyes) * points[1].mean() * 1.5

    def points_of(self, image: Tensor, center: Tensor, axis: Tensor) -> tuple[Tensor, Tensor]:
        """Places (468,2) of the mesh in the image, and depths (468,1) in the same unit."""
        upright = torch.stack([-axis[1], axis[0]])
        cut = center + self.cut[..., :1] * axis + self.cut[..., 1:] * upright
        points = self.mesh(self.sample(image, cut))[0].reshape(468, 3) / MESH
        places = center + (points[:, :1] - 0.5) * axis + (points[:, 1:2] - 0.5) * upright
        return places, points[:, 2:] * torch.linalg.norm(axis)

    def forward(self, image: Tensor, relief: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Positions, covariances, colors, opacities."""
        center, axis = self.found_face(image)
        points, _ = self.points_of(image, center, axis)
        # Once more, around the points that were found.
        low, high = points.amin(0), points.amax(0)
        eyes = points[_LEFT_EYE] - points[_RIGHT_EYE]
        axis = eyes / torch.linalg.norm(eyes) * (high - low).max() * 1.5
        points, depths = self.points_of(image, (low + high) / 2, axis)
        depth = self.surface(points, depths, torch.linalg.norm(axis)) * relief
        positions = torch.cat([self.places - 0.5, depth], 1) * 2
        colors = self.sample(image, self.places.reshape(GRID, GRID, 2)).reshape(3, -1).T
        return positions, covariances(positions), colors, torch.full((GRID * GRID, 1), 0.95)

    def surface(self, points: Tensor, depths: Tensor, size: Tensor) -> Tensor:
        """Depths (N,1) of the grid: near points of the mesh are averaged, and what is away from them falls back."""
        squares = (self.places**2).sum(1, keepdim=True) - 2 * self.places @ points.T + (points**2).sum(1)
        near = torch.softmax(-squares / (0.02 * size) ** 2, 1)
        distance = torch.sqrt(torch.relu((near * squares).sum(1, keepdim=True)) + 1e-6)
        wall = 1 - torch.exp(-torch.relu(distance - 0.03 * size) / (0.25 * size))
        return (near @ depths) * (1 - wall) + 0.45 * size * wall


def covariances(positions: Tensor) -> Tensor:
    """Covariances (N,6) of flat Gaussians that span the cells of the grid of positions (N,3)."""
    grid = positions.reshape(GRID, GRID, 3)
    across = grid[:, 1:] - grid[:, :-1]
    down = grid[1:] - grid[:-1]
    across = torch.cat([across, across[:, -1:]], 1).reshape(-1, 3)
    down = torch.cat([down, down[-1:]]).reshape(-1, 3)
    upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    columns = [0.36 * (across[:, a] * across[:, b] + down[:, a] * down[:, b]) + 1e-6 * (a == b) for a, b in upper]
    return torch.stack(columns, 1)


def main(arguments: Sequence[str] | None = None) -> None:
    """Exports the generator, compared with PyTorch at the photograph."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("package", type=Path, help="the folder of the npm package @mediapipe/face_mesh")
    parser.add_argument("photo", type=Path, help="a square photograph of a face")
    parser.add_argument("out", type=Path)
    given = parser.parse_args(arguments)
    pixels = np.asarray(Image.open(given.photo).convert("RGB").resize((PHOTO, PHOTO)), np.float32)
    photo = pixels.transpose(2, 0, 1)[None] / 255
    gs.export_module(
        Portrait(given.package),
        {"image": gs.image(PHOTO, PHOTO, examples=[photo]), "relief": gs.control(0, 2, 1.0, label="Relief")},
        gs.split("positions", "covariances", "colors", "opacities"),
        out=given.out,
        name="A portrait",
        license="Apache-2.0",
        attribution="Face detector and face mesh by Google MediaPipe",
    )


if __name__ == "__main__":
    main()
