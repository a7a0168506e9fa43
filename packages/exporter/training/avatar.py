"""Trains an avatar on a body with pose and shape parameters: python avatar.py BODY OUT [--steps 12000] [--count 40000]

BODY is the folder of MakeHuman's files (CC0). There are no photographs of this body: `painted.py` draws the
training images from its mesh, in random poses and shapes. OUT/avatar.npz is the input of `gaussian-export avatar`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from common import Record, Schedule, Views, device, fit, options, seed
from losses import loss_of, psnr
from makehuman import PARTS, Body, read_body
from painted import Painted, interpolated, surface_points
from rasterizer import Camera, Splats, picture, rotation_matrices
from show import sheet

SIZE = 512
SH_C0 = 0.28209479177387814
HELD_OUT = 16
# Training images, and the surface points from which they are drawn.
BANK, SAMPLES = 640, 6_000_000
# Standard deviation of each joint's turn about each axis, radians, by the beginning of its name.
BENDS = {"root": 0.0, "pelvis": 0.1, "spine": 0.12, "neck": 0.2, "head": 0.2, "clavicle": 0.1, "upperarm": 0.45}
BENDS |= {"lowerarm": 0.4, "hand": 0.25, "thigh": 0.4, "calf": 0.4, "foot": 0.2, "ball": 0.1}
OTHER_BEND = 0.2
# How much more densely than the rest some parts are covered.
FAVOUR = {"head": 3.0, "hand": 2.0, "eye": 6.0}


def axis_angle_matrices(pose: Tensor) -> Tensor:
    """(J,3,3) of axes times angles (J,3)."""
    x, y, z = pose.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.linalg.matrix_exp(torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(-1, 3, 3))


class Rig(nn.Module):
    """Carries points at rest into a pose and shape; the same steps as the exported graph."""

    def __init__(self, body: Body):
        """The skeleton of a body."""
        super().__init__()
        self.parents, self.names = body.parents, body.names
        for name in ("joints", "joint_directions"):
            self.register_buffer(name, torch.tensor(getattr(body, name), dtype=torch.float32))

    def forward(self, points: Tensor, weights: Tensor, directions: Tensor, pose: Tensor, shape: Tensor) -> list[Tensor]:
        """Returns the posed points (N,3), and the matrix (N,3,3) that transforms the neighborhood of each."""
        points, joints = points + directions @ shape, self.joints + self.joint_directions @ shape
        turns, frames = axis_angle_matrices(pose), list[Tensor]()
        bottom = torch.tensor([[0.0, 0, 0, 1]], device=points.device)
        for joint, parent in enumerate(self.parents):
            offset = joints[joint] - (joints[parent] if parent >= 0 else 0)
            local = torch.cat([torch.cat([turns[joint], offset[:, None]], 1), bottom])
            frames.append(frames[parent] @ local if parent >= 0 else local)
        stacked = torch.stack(frames)
        turn = stacked[:, :3, :3]
        shift = stacked[:, :3, 3] - torch.einsum("jab,jb->ja", turn, joints)
        blend = torch.einsum("nj,jab->nab", weights, turn)
        return [torch.einsum("nab,nb->na", blend, points) + weights @ shift, blend]


class Avatar(nn.Module):
    """Gaussians on the body's surface, at rest."""

    def __init__(self, body: Body, count: int, rng: np.random.Generator):
        """`count` Gaussians all over it."""
        super().__init__()
        self.rig = Rig(body)
        chosen, share = surface_points(body, count, rng, favour_of(body))

        def at(values: np.ndarray) -> Tensor:
            return torch.tensor(interpolated(body, values, chosen, share), dtype=torch.float32)

        self.positions = nn.Parameter(at(body.vertices))
        self.log_scales = nn.Parameter(torch.full((count, 3), float(np.log(0.6 / count**0.5))))
        self.rotations = nn.Parameter(torch.randn(count, 4))
        self.opacity_logits = nn.Parameter(torch.full((count, 1), 2.0))
        self.colors = nn.Parameter(torch.full((count, 3), 0.5))
        self.register_buffer("weights", at(body.weights))
        self.register_buffer("directions", at(body.directions))

    def forward(self, pose: Tensor, shape: Tensor) -> Splats:
        """The Gaussians in a pose (J,3) and shape (B)."""
        placed, blend = self.rig(self.positions, self.weights, self.directions, pose, shape)
        half = blend @ (rotation_matrices(self.rotations) * torch.exp(self.log_scales)[:, None])
        return Splats(placed, half @ half.mT, torch.relu(self.colors), torch.sigmoid(self.opacity_logits[:, 0]))

    def save(self, folder: Path) -> None:
        """As the exporter's Avatar."""
        folder.mkdir(parents=True, exist_ok=True)
        arrays = {
            "positions": self.positions,
            "scales": torch.exp(self.log_scales),
            "rotations": self.rotations,
            "opacities": torch.sigmoid(self.opacity_logits),
            "sh": ((torch.relu(self.colors) - 0.5) / SH_C0)[:, None],
            "weights": self.weights,
            "joints": self.rig.joints,
            "shape_directions": self.directions,
            "joint_directions": self.rig.joint_directions,
        }
        plain = {name: value.detach().cpu().numpy() for name, value in arrays.items()}
        np.savez(folder / "avatar.npz", **plain, parents=self.rig.parents, joint_names=self.rig.names)


def favour_of(body: Body) -> np.ndarray:
    """How much more densely than by its area each triangle (T) is covered."""
    result = np.ones(len(body.triangles))
    weights = body.weights[body.triangles].mean(1)
    for begin, factor in FAVOUR.items():
        carried = weights[:, [name.startswith(begin) for name in body.names]].sum(1) > 0.5
        result[carried] = factor
    result[body.parts[body.triangles[:, 0]] == list(PARTS).index("eye")] = FAVOUR["eye"]
    return result


def bends(body: Body) -> np.ndarray:
    """Standard deviations (J,1)."""
    found = [next((v for k, v in BENDS.items() if name.lower().startswith(k)), OTHER_BEND) for name in body.names]
    return np.array(found)[:, None]


Case = tuple[Tensor, Tensor, Camera]


def random_case(rng: np.random.Generator, body: Body, where: str, size: int, near: bool) -> Case:
    """A pose (J,3) near rest, a shape (B), and a camera that looks at the body from somewhere around it, with `near`
    sometimes at a part of it."""
    pose = torch.tensor(rng.normal(size=(len(body.parents), 3)) * bends(body), dtype=torch.float32)
    shape = torch.tensor(rng.uniform(0, 0.6, body.directions.shape[2]), dtype=torch.float32)
    middle, distance = (body.vertices.min(0) + body.vertices.max(0)) / 2, 3.2
    if near and rng.random() < 0.5:
        middle, distance = body.vertices[rng.integers(len(body.vertices))], 2.0
    angle, rise = rng.uniform(0, 2 * np.pi), rng.uniform(-0.3, 0.5)
    eye = middle + distance * np.array([np.sin(angle) * np.cos(rise), -np.sin(rise), -np.cos(angle) * np.cos(rise)])
    forward = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross([0, 1, 0], forward)
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    view[:3, 3] = -view[:3, :3] @ eye
    k = torch.tensor([[1.3 * size, 0, size / 2], [0, 1.3 * size, size / 2], [0, 0, 1]])
    camera = Camera(torch.tensor(view, dtype=torch.float32).to(where), k.to(where), size, size)
    return pose.to(where), shape.to(where), camera


class Truth(nn.Module):
    """The mesh in any pose and shape."""

    def __init__(self, body: Body, samples: int, rng: np.random.Generator):
        """`samples`: points on the surface."""
        super().__init__()
        self.rig, self.painted = Rig(body), Painted(body, samples, rng)
        for name in ("vertices", "weights", "directions"):
            self.register_buffer(name, torch.tensor(getattr(body, name), dtype=torch.float32))

    @torch.no_grad()
    def forward(self, case: Case) -> Tensor:
        """The image (4,H,W)."""
        pose, shape, camera = case
        placed, _ = self.rig(self.vertices, self.weights, self.directions, pose, shape)
        drawn: Tensor = self.painted(placed, camera)
        return drawn


Pairs = list[tuple[Tensor, Tensor]]


def held_out_cases(body: Body, where: str, size: int) -> list[Case]:
    """Test set: the whole body, in poses and shapes of its own."""
    return [random_case(np.random.default_rng(10_000 + i), body, where, size, near=False) for i in range(HELD_OUT)]


def train(
    body: Body, schedule: Schedule, count: int, number: int, size: int, bank: int = BANK, samples: int = SAMPLES
) -> tuple[Avatar, Pairs]:
    """Returns the model, and images (4,H,W) as drawn and as references, in held-out poses and shapes."""
    rng, where = seed(number), device()
    model, truth = Avatar(body, count, rng).to(where), Truth(body, samples, rng).to(where)
    rates = {"positions": 2e-4, "log_scales": 5e-3, "rotations": 2e-3, "opacity_logits": 3e-2, "colors": 5e-3}
    groups = [{"params": [getattr(model, name)], "lr": rate} for name, rate in rates.items()]
    cases = [random_case(rng, body, where, size, near=True) for _ in range(bank)]
    pictures = [(truth(case) * 255).round().byte() for case in cases]
    print(f"{bank} training images", flush=True)

    def loss_at(index: int, progress: float) -> Tensor:
        pose, shape, camera = cases[index]
        return loss_of(picture(model(pose, shape), camera), pictures[index] / 255)

    fit(range(bank), loss_at, [torch.optim.Adam(groups, eps=1e-15)], schedule, rng)
    with torch.no_grad():
        return model, [(picture(model(*case[:2]), case[2]), truth(case)) for case in held_out_cases(body, where, size)]


def scores_of(pairs: Pairs) -> dict[str, float]:
    """Mean PSNR on black, and inside the body's outline only."""
    whole = [psnr(found[:3], wanted[:3]) for found, wanted in pairs]
    inside = [psnr(found[:3, wanted[3] > 0.5], wanted[:3, wanted[3] > 0.5]) for found, wanted in pairs]
    return {"held_out_psnr": float(np.mean(whole)), "outline_psnr": float(np.mean(inside))}


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    given = options(__doc__ or "", 12_000, argv, "body")
    record = Record(given)
    body, schedule = read_body(given.body), Schedule(given.steps, given.seconds)
    model, pairs = train(body, schedule, given.count or 40_000, given.seed, SIZE)
    model.save(given.out)
    counts = {"gaussians": len(model.positions), "joints": len(body.parents)}
    record.write(**scores_of(pairs), steps=schedule.done, **counts)
    found, wanted = zip(*pairs[:6], strict=True)
    sheet(given.out / "held-out.png", wanted, found)
    poses, shapes, cameras = zip(*held_out_cases(body, device(), SIZE)[:6], strict=True)
    extra = {"poses": torch.stack(poses), "shapes": torch.stack(shapes)}
    views, intrinsics = torch.stack([c.view for c in cameras]), torch.stack([c.intrinsics for c in cameras])
    Views(torch.stack(wanted), views, intrinsics, extra).save(given.out / "held-out.npz")


if __name__ == "__main__":
    main()
