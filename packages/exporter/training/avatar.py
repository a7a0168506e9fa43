"""Trains an avatar on a body that pose and shape drive: python avatar.py BODY OUT [--steps 6000] [--count 13380]

BODY is the folder of MakeHuman's files (CC0). There are no photographs of this body: the pictures to learn from are
drawn from its own mesh, coloured and lit by `Painted`, as a dense cloud of discs in random poses and shapes.
OUT/avatar.npz is what `gaussian-export avatar` reads.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from common import Record, device, loss_of, options, psnr, seed
from makehuman import Body, read_body
from rasterizer import Camera, Splats, picture, rotation_matrices

SIZE = 512
SH_C0 = 0.28209479177387814
SKIN, CLOTH = (0.80, 0.62, 0.52), (0.22, 0.33, 0.48)
LIGHT = (-0.4, -0.7, -0.6)
HELD_OUT = 16


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
        """Where points (N,3) go (N,3), and the matrix (N,3,3) that carries each one's surroundings."""
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

    def __init__(self, body: Body, chosen: np.ndarray):
        """One Gaussian at each chosen vertex."""
        super().__init__()
        self.rig = Rig(body)
        start = torch.tensor(body.vertices[chosen], dtype=torch.float32)
        self.positions = nn.Parameter(start)
        self.log_scales = nn.Parameter(torch.full((len(chosen), 3), float(np.log(0.6 / len(chosen) ** 0.5))))
        self.rotations = nn.Parameter(torch.randn(len(chosen), 4))
        self.opacity_logits = nn.Parameter(torch.full((len(chosen), 1), 2.0))
        self.colors = nn.Parameter(torch.full((len(chosen), 3), 0.5))
        self.register_buffer("weights", torch.tensor(body.weights[chosen], dtype=torch.float32))
        self.register_buffer("directions", torch.tensor(body.directions[chosen], dtype=torch.float32))

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


class Painted(nn.Module):
    """The body to learn from: a disc on each triangle, dressed below the neck, lit at rest."""

    def __init__(self, body: Body):
        """One flat Gaussian for each triangle."""
        super().__init__()
        self.rig = Rig(body)
        corners = body.vertices[body.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = normal / np.maximum(area, 1e-12)
        axes = np.stack([np.cross(normal, np.roll(normal, 1, 1) + np.array([0, 0, 1e-3])), normal], 1)
        first = axes[:, 0] / np.maximum(np.linalg.norm(axes[:, 0], axis=1, keepdims=True), 1e-12)
        second = np.cross(normal, first)
        half = np.sqrt(area)[:, :, None] * np.stack([first, second, normal * 0.05], 2) * 0.45
        middle = corners.mean(1)
        height = (middle[:, 1] - middle[:, 1].min()) / np.ptp(middle[:, 1])
        dressed = ((height > 0.2) & (height < 0.93) & (np.abs(middle[:, 0]) < 0.45))[:, None]
        colour = np.where(dressed, CLOTH, SKIN)
        towards = -np.array(LIGHT) / np.linalg.norm(LIGHT)
        lit = 0.35 + 0.65 * np.abs(normal @ towards)[:, None]
        weights, moves = body.weights[body.triangles].mean(1), body.directions[body.triangles].mean(1)
        named = {"middle": middle, "spread": half, "colour": colour * lit, "weights": weights, "moves": moves}
        for name, value in named.items():
            self.register_buffer(name, torch.tensor(value, dtype=torch.float32))

    @torch.no_grad()
    def forward(self, pose: Tensor, shape: Tensor) -> Splats:
        """The discs in a pose and shape."""
        placed, blend = self.rig(self.middle, self.weights, self.moves, pose, shape)
        half = blend @ self.spread
        return Splats(placed, half @ half.mT, self.colour, torch.full_like(placed[:, 0], 0.99))


def random_case(rng: np.random.Generator, body: Body, where: str, size: int) -> tuple[Tensor, Tensor, Camera]:
    """A pose (J,3) near rest, a shape (B), and a camera that looks at the whole body from somewhere around it."""
    pose = torch.tensor(rng.normal(size=(len(body.parents), 3)) * 0.25, dtype=torch.float32)
    pose[0] = 0
    shape = torch.tensor(rng.uniform(0, 0.3, body.directions.shape[2]), dtype=torch.float32)
    middle = (body.vertices.min(0) + body.vertices.max(0)) / 2
    angle, rise = rng.uniform(0, 2 * np.pi), rng.uniform(-0.3, 0.5)
    eye = middle + 3.2 * np.array([np.sin(angle) * np.cos(rise), -np.sin(rise), -np.cos(angle) * np.cos(rise)])
    forward = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross([0, 1, 0], forward)
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    view[:3, 3] = -view[:3, :3] @ eye
    k = torch.tensor([[1.3 * size, 0, size / 2], [0, 1.3 * size, size / 2], [0, 0, 1]])
    camera = Camera(torch.tensor(view, dtype=torch.float32).to(where), k.to(where), size, size)
    return pose.to(where), shape.to(where), camera


def train(body: Body, steps: int, count: int, number: int, size: int) -> tuple[Avatar, float]:
    """The model, and its PSNR in poses and shapes that it was not trained on."""
    rng, where = seed(number), device()
    chosen = np.sort(rng.choice(len(body.vertices), min(count, len(body.vertices)), replace=False))
    model, truth = Avatar(body, chosen).to(where), Painted(body).to(where)
    rates = {"positions": 2e-4, "log_scales": 5e-3, "rotations": 2e-3, "opacity_logits": 3e-2, "colors": 5e-3}
    optimizer = torch.optim.Adam([{"params": [getattr(model, name)], "lr": rate} for name, rate in rates.items()])
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, 0.05 ** (1 / steps))
    held = [random_case(np.random.default_rng(10_000 + i), body, where, size) for i in range(HELD_OUT)]
    for step in range(steps):
        pose, shape, camera = random_case(rng, body, where, size)
        loss = loss_of(picture(model(pose, shape), camera), picture(truth(pose, shape), camera))
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        schedule.step()
        if step % 500 == 0 or step == steps - 1:
            print(f"step {step}: loss {loss.item():.4f}", flush=True)
    with torch.no_grad():
        pictures = [(picture(model(p, s), c)[:3], picture(truth(p, s), c)[:3]) for p, s, c in held]
    return model, float(np.mean([psnr(found, wanted) for found, wanted in pictures]))


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    given = options(__doc__ or "", 6_000, argv, "body")
    record = Record(given)
    body = read_body(given.body)
    model, score = train(body, given.steps, given.count or len(body.vertices), given.seed, SIZE)
    model.save(given.out)
    record.write(held_out_psnr=score, gaussians=len(model.positions), joints=len(body.parents))


if __name__ == "__main__":
    main()
