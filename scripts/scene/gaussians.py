"""A set of Gaussians as arrays, and the PLY layout every trainer writes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

SH_C0 = 0.28209479177387814
"""The constant spherical harmonic, 1 / (2 sqrt(pi)): colour = 0.5 + SH_C0 * sh[0] + ..."""


@dataclass(frozen=True)
class Gaussians:
    """N Gaussians in the trainers' frame (x right, y down, z forward), float32.

    positions (N,3); log_scales (N,3), natural logarithm; rotations (N,4), quaternions w x y z, any length;
    opacity_logits (N,); sh (N,(degree+1)^2,3), the constant term first.
    """

    positions: np.ndarray
    log_scales: np.ndarray
    rotations: np.ndarray
    opacity_logits: np.ndarray
    sh: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def sh_degree(self) -> int:
        return round(self.sh.shape[1] ** 0.5) - 1

    def at(self, which: np.ndarray) -> "Gaussians":
        """The Gaussians a boolean mask or an index array picks, in its order."""
        arrays = (self.positions, self.log_scales, self.rotations, self.opacity_logits, self.sh)
        return Gaussians(*(array[which] for array in arrays))


def write_ply(path: Path, gaussians: Gaussians) -> None:
    """INRIA's property names without normals; f_rest holds all of red, then green, then blue."""
    rest = gaussians.sh[:, 1:].transpose(0, 2, 1).reshape(len(gaussians), -1)
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"]
    names += [f"f_rest_{i}" for i in range(rest.shape[1])]
    names += ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    columns = [gaussians.positions, gaussians.sh[:, 0], rest, gaussians.opacity_logits[:, None]]
    columns += [gaussians.log_scales, gaussians.rotations]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(gaussians)}"]
    header += [f"property float {name}" for name in names] + ["end_header", ""]
    path.write_bytes("\n".join(header).encode("ascii") + np.hstack(columns).astype("<f4").tobytes())


def read_ply(path: Path) -> Gaussians:
    """Reads what write_ply wrote: little-endian floats only, in any order."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = head.decode("ascii").splitlines()
    names = [line.split()[2] for line in lines if line.startswith("property float ")]
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex "))
    if len(body) != count * len(names) * 4:
        raise ValueError(f"{path}: expected {count * len(names) * 4} bytes of floats, found {len(body)}")
    column = dict(zip(names, np.frombuffer(body, "<f4").reshape(count, -1).T))

    def columns(prefix: str, total: int) -> np.ndarray:
        return np.stack([column[f"{prefix}{i}"] for i in range(total)], 1)

    rest = columns("f_rest_", sum(name.startswith("f_rest_") for name in names)).reshape(count, 3, -1)
    sh = np.concatenate([columns("f_dc_", 3)[:, None], rest.transpose(0, 2, 1)], 1)
    positions = np.stack([column["x"], column["y"], column["z"]], 1)
    return Gaussians(positions, columns("scale_", 3), columns("rot_", 4), column["opacity"], sh)
