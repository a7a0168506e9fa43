"""Makes the training images.

python make_views.py photos MASKS SPARSE OUT [--size 512]    photographs, masked by scripts/scene/masks.py
python make_views.py orbit SCENE.ply OUT [--count 96]        a captured scene, drawn from all directions
python make_views.py sway SCENE.ply OUT [--count 200]        the same, bending to and fro over time
python make_views.py wind SCENE.ply OUT [--count 400]        a potted plant whose leaves move in the wind
OUT.npz holds images and cameras, OUT.npy initial points on the surface. Drawn scenes have plain colors (harmonics
of degree 0), and are moved to the origin and scaled to a radius of 1.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from common import Views, device
from gaussian_exporter.arrays import sigmoid
from gaussian_exporter.checkpoints.clouds import read_cloud
from gaussian_exporter.families.classic import usable
from rasterizer import Camera, Splats, covariances, picture

SH_C0 = 0.28209479177387814
DISTANCE, FOCAL = 3.2, 1.4
# How far the top leans, in radians, and how often in the time from 0 to 1.
LEAN, SWINGS = 0.35, 1.0
# The plant: where its leaves begin, how wide its pot is, over what distance leaves grow limber, how far they turn.
HEART, POT, LIMBER, GUST = (0.05, 0.05, 0.0), 0.34, 0.6, 0.32


def scene_of(path: Path, where: str) -> Splats:
    """A PLY file's Gaussians, centerd and scaled by the 5th to the 95th percentile of their places."""
    cloud = usable(read_cloud(path))
    low, high = np.percentile(cloud.positions, [5, 95], axis=0)
    scale = 2 / np.linalg.norm(high - low)
    near = np.linalg.norm((cloud.positions - (low + high) / 2) * scale, axis=1) < 2

    def tensor(values: np.ndarray) -> torch.Tensor:
        return torch.tensor(np.ascontiguousarray(values[near]), dtype=torch.float32, device=where)

    return Splats(
        tensor((cloud.positions - (low + high) / 2) * scale),
        covariances(tensor(np.exp(cloud.log_scales) * scale), tensor(cloud.rotations)),
        tensor(np.clip(cloud.sh[:, 0] * SH_C0 + 0.5, 0, 1)),
        tensor(sigmoid(cloud.opacity_logits)[:, 0]),
    )


def swayed(scene: Splats, time: float) -> Splats:
    """Every Gaussian turned about the z axis, the more the higher it is (y points down)."""
    height = (scene.positions[:, 1].max() - scene.positions[:, 1]) / 2
    angle = LEAN * height * float(np.sin(2 * np.pi * SWINGS * time))
    zero, one = torch.zeros_like(angle), torch.ones_like(angle)
    rows = [torch.cos(angle), -torch.sin(angle), zero, torch.sin(angle), torch.cos(angle), zero, zero, zero, one]
    turn = torch.stack(rows, 1).reshape(-1, 3, 3)
    foot = torch.tensor([0.0, float(scene.positions[:, 1].max()), 0.0], device=angle.device)
    placed = torch.einsum("nab,nb->na", turn, scene.positions - foot) + foot
    return Splats(placed, turn @ scene.covariances @ turn.mT, scene.colors, scene.opacities)


def blown(scene: Splats, time: float) -> Splats:
    """Leaves turn about the plant's heart, the more the farther out they are, neighbors nearly together; the pot and
    the trunk stand still. Time 1 is time 0 again."""
    heart = torch.tensor(HEART, device=scene.positions.device)
    away = scene.positions - heart
    outside = torch.maximum(away[:, [0, 2]].norm(dim=1) - POT, -away[:, 1])
    give = (outside / LIMBER).clamp(0, 1.4)
    phase = 2.5 * away[:, 0] + 1.7 * away[:, 2] + 1.3 * away[:, 1]
    first, second = 2 * np.pi * time, 4 * np.pi * time
    about_z = GUST * give * (torch.sin(first + phase) + 0.35 * torch.sin(second + 2.3 * phase))
    about_x = 0.6 * GUST * give * torch.cos(first + 1.4 * phase)
    zero = torch.zeros_like(give)
    rows = [zero, -about_z, zero, about_z, zero, -about_x, zero, about_x, zero]
    turn = torch.linalg.matrix_exp(torch.stack(rows, 1).reshape(-1, 3, 3))
    placed = torch.einsum("nab,nb->na", turn, away) + heart
    return Splats(placed, turn @ scene.covariances @ turn.mT, scene.colors, scene.opacities)


MOTIONS = {"sway": swayed, "wind": blown}


def orbit_camera(index: int, count: int, size: int, where: str) -> Camera:
    """One of `count` cameras spread evenly over a band around the origin."""
    rise = -0.2 + 0.9 * ((index * 0.618034) % 1)
    angle = 2 * np.pi * index / count * 7
    eye = DISTANCE * np.array([np.sin(angle) * np.cos(rise), -np.sin(rise), -np.cos(angle) * np.cos(rise)])
    forward = -eye / DISTANCE
    right = np.array([np.cos(angle), 0, np.sin(angle)])
    view = np.eye(4)
    view[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    view[:3, 3] = -view[:3, :3] @ eye
    k = [[FOCAL * size, 0, size / 2], [0, FOCAL * size, size / 2], [0, 0, 1]]
    return Camera(torch.tensor(view).float().to(where), torch.tensor(k).float().to(where), size, size)


@torch.no_grad()
def drawn(scene: Splats, count: int, size: int, kind: str) -> Views:
    """Images of a scene from all directions; of an animated one, each at a different time."""
    where = str(scene.positions.device)
    cameras = [orbit_camera(i, count, size, where) for i in range(count)]
    times = np.linspace(0, 1, count)[np.random.default_rng(0).permutation(count)]
    motion = MOTIONS.get(kind)
    pictures = [picture(motion(scene, float(t)) if motion else scene, c) for t, c in zip(times, cameras, strict=True)]
    views, intrinsics = torch.stack([c.view for c in cameras]), torch.stack([c.intrinsics for c in cameras])
    extra = {"times": torch.tensor(times).float()} if motion else {}
    return Views(torch.stack(pictures), views, intrinsics, extra)


def photographed(masks: Path, sparse: Path, size: int) -> tuple[Views, np.ndarray]:
    """Photographs cut out and scaled so that the longer side of each crop fits `size`, and COLMAP's points on them."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "scripts" / "scene"))
    from capture import read_colmap, to_upright
    from dataset import load_pictures

    capture, hull = to_upright(read_colmap(sparse)), np.load(masks / "hull.npy")
    loaded = load_pictures(masks, capture, "cpu")
    rows, intrinsics = [], []
    for each in loaded:
        scale = size / max(each.size)
        shape = [round(side * scale) for side in reversed(each.size)]
        shown = torch.maximum(each.alpha, each.doubtful)
        full = torch.cat([each.rgb * shown, each.alpha, each.valid, each.doubtful])[None]
        small = torch.nn.functional.interpolate(full, shape, mode="area")[0]
        rows.append(torch.nn.functional.pad(small, [0, size - shape[1], 0, size - shape[0]]))
        k = each.intrinsics.clone()
        k[:2] *= scale
        intrinsics.append(k)
    table = torch.stack(rows)
    # A scaled pixel is valid only if all of it was, and doubtful if any of it was. Beyond the crop nothing is valid.
    extra = {"valid": (table[:, 4:5] > 0.999).byte(), "doubtful": (table[:, 5:6] > 0).byte()}
    matrices = torch.stack([each.view_matrix for each in loaded])
    near = np.linalg.norm(capture.points, axis=1) < 1.2 * np.linalg.norm(hull, axis=1).max()
    points = capture.points[near & (capture.points[:, 1] < capture.cut_height)]
    return Views(table[:, :4], matrices, torch.stack(intrinsics), extra), points


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = parser.add_subparsers(dest="kind", required=True)
    for kind, paths, count in (
        ("photos", ("masks", "sparse"), 0),
        ("orbit", ("scene",), 96),
        ("sway", ("scene",), 200),
        ("wind", ("scene",), 400),
    ):
        each = kinds.add_parser(kind)
        for name in (*paths, "out"):
            each.add_argument(name, type=Path)
        each.add_argument("--size", type=int, default=512)
        each.add_argument("--count", type=int, default=count)
    given = parser.parse_args(argv)
    if given.kind == "photos":
        views, points = photographed(given.masks, given.sparse, given.size)
    else:
        scene = scene_of(given.scene, device())
        views = drawn(scene, given.count, given.size, given.kind)
        points = scene.positions[scene.opacities > 0.3].cpu().numpy()
    views.save(given.out.with_suffix(".npz"))
    np.save(given.out.with_suffix(".npy"), points.astype(np.float32))
    print(f"{given.out}: {len(views.pictures)} pictures, {len(points)} points")


if __name__ == "__main__":
    main()
