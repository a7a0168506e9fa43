"""SPZ version 3, written and read back: gzip round a 16-byte header and six planes.

Layout and quantization follow nianticlabs/spz, src/cc/load-spz.cc. On disk the frame is RUB (x right, y up, z back);
ours is RDF, so y and z change sign, and with them two quaternion components and every harmonic odd in y or z.
"""

import gzip
import struct
from pathlib import Path

import numpy as np

from gaussians import Gaussians

MAGIC = 0x5053474E
VERSION = 3
ANTIALIASED = 1
# 24-bit fixed point with 16 bits after the point: +-128 units in steps of 1/65536. The scene is about one unit long.
FRACTIONAL_BITS = 16
# The constant harmonic as a byte: 0.15 of a unit a full range, so colours may pass 0 and 1 a little.
COLOR_SCALE = 0.15
# Bits kept of each harmonic's byte, first order and above; gzip gains from the zeros. The reference writer keeps one
# less of each.
SH_BITS = (6, 5)
# Sign of each harmonic after the first when y and z change sign, in the order of the usual real basis.
SH_FLIP = np.array([-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)
AXIS_FLIP = np.array([1, -1, -1], np.float32)


def to_bytes(values: np.ndarray) -> np.ndarray:
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def pack_positions(positions: np.ndarray) -> np.ndarray:
    limit = 1 << 23
    fixed = np.round(positions * AXIS_FLIP * (1 << FRACTIONAL_BITS)).astype(np.int64)
    if np.abs(fixed).max() >= limit:
        raise ValueError(f"expected positions within +-{limit >> FRACTIONAL_BITS}, found {np.abs(positions).max()}")
    return (fixed[..., None] >> np.array([0, 8, 16]) & 0xFF).astype(np.uint8)


def pack_rotations(wxyz: np.ndarray) -> np.ndarray:
    """Smallest three: 2 bits name the largest of x y z w, then sign and 9 bits of magnitude for each other one."""
    xyzw = np.roll(wxyz, -1, axis=1).astype(np.float64)
    xyzw /= np.linalg.norm(xyzw, axis=1, keepdims=True)
    xyzw[:, 1:3] *= -1
    largest = np.argmax(np.abs(xyzw), axis=1)
    xyzw *= np.where(np.take_along_axis(xyzw, largest[:, None], 1) < 0, -1, 1)
    packed = largest.astype(np.uint32)
    for i in range(4):
        magnitude = (511 * np.abs(xyzw[:, i]) * np.sqrt(2) + 0.5).astype(np.uint32)
        component = (xyzw[:, i] < 0).astype(np.uint32) << 9 | magnitude
        packed = np.where(largest == i, packed, packed << 10 | component)
    return packed.astype("<u4").view(np.uint8).reshape(-1, 4)


def unpack_rotations(data: np.ndarray) -> np.ndarray:
    packed = np.ascontiguousarray(data).view("<u4").ravel()
    largest = packed >> 30
    xyzw = np.zeros((len(packed), 4))
    for i in (3, 2, 1, 0):
        stored = largest != i
        magnitude = (packed & 511) / 511 / np.sqrt(2)
        xyzw[:, i] = np.where(stored, np.where(packed >> 9 & 1, -magnitude, magnitude), 0)
        packed = np.where(stored, packed >> 10, packed)
    rest = np.sqrt(np.maximum(0, 1 - (xyzw**2).sum(1)))
    np.put_along_axis(xyzw, largest[:, None].astype(np.int64), rest[:, None], 1)
    xyzw[:, 1:3] *= -1
    return np.roll(xyzw, 1, axis=1).astype(np.float32)


def pack_sh(sh: np.ndarray) -> np.ndarray:
    """Harmonics above the constant, (N,K,3), to bytes centred at 128, the lowest bits rounded away."""
    count = sh.shape[1]
    bits = np.where(np.arange(count) < 3, SH_BITS[0], SH_BITS[1])[:, None]
    bucket = 1 << (8 - bits)
    whole = np.round(sh * SH_FLIP[:count, None] * 128).astype(np.int64) + 128
    return np.clip((whole + bucket // 2) // bucket * bucket, 0, 255).astype(np.uint8)


def write_spz(path: Path, gaussians: Gaussians, antialiased: bool) -> int:
    """Writes the file and returns its size in bytes."""
    header = struct.pack(
        "<IIIBBBB", MAGIC, VERSION, len(gaussians), gaussians.sh_degree, FRACTIONAL_BITS, ANTIALIASED * antialiased, 0
    )
    opacity = 1 / (1 + np.exp(-gaussians.opacity_logits.astype(np.float64)))
    planes = [
        pack_positions(gaussians.positions),
        to_bytes(opacity * 255),
        to_bytes(gaussians.sh[:, 0] * (COLOR_SCALE * 255) + 127.5),
        to_bytes((gaussians.log_scales + 10) * 16),
        pack_rotations(gaussians.rotations),
        pack_sh(gaussians.sh[:, 1:]),
    ]
    # mtime 0: the same Gaussians give the same bytes.
    packed = gzip.compress(header + b"".join(plane.tobytes() for plane in planes), 9, mtime=0)
    path.write_bytes(packed)
    return len(packed)


def read_spz(path: Path) -> Gaussians:
    """Reads what write_spz wrote; only that. What viewers will see, to measure and to look at."""
    data = gzip.decompress(path.read_bytes())
    magic, version, count, degree, fraction, _, _ = struct.unpack_from("<IIIBBBB", data)
    if (magic, version) != (MAGIC, VERSION):
        raise ValueError(f"{path}: expected SPZ version {VERSION}, found magic {magic:#x}, version {version}")
    harmonics = (degree + 1) ** 2 - 1
    at = 16

    def plane(width: int) -> np.ndarray:
        nonlocal at
        found = np.frombuffer(data, np.uint8, count * width, at).reshape(count, width)
        at += count * width
        return found

    fixed = plane(9).reshape(count, 3, 3).astype(np.int32) @ np.array([1, 1 << 8, 1 << 16])
    fixed = np.where(fixed >= 1 << 23, fixed - (1 << 24), fixed)
    opacity = np.clip(plane(1)[:, 0] / 255, 1e-6, 1 - 1e-6)
    constant = (plane(3) / 255 - 0.5) / COLOR_SCALE
    log_scales = plane(3) / 16 - 10
    rotations = unpack_rotations(plane(4))
    rest = (plane(harmonics * 3).reshape(count, harmonics, 3).astype(np.float32) - 128) / 128
    sh = np.concatenate([constant[:, None], rest * SH_FLIP[:harmonics, None]], 1)
    if at != len(data):
        raise ValueError(f"{path}: expected {at} bytes for {count} Gaussians of degree {degree}, found {len(data)}")
    return Gaussians(
        (fixed / (1 << fraction) * AXIS_FLIP).astype(np.float32),
        log_scales.astype(np.float32),
        rotations,
        np.log(opacity / (1 - opacity)).astype(np.float32),
        sh.astype(np.float32),
    )
