"""Trained splats rounded to small archives, and archives to PLY. Rounding comes before measuring.

`python pack.py ply ARCHIVE OUT.ply`, `python pack.py frames ARCHIVE MOTION FOLDER [RADIUS]`. With a radius in meters, frames are splats around the middle, with harmonics of degree 1.
"""

import io
import lzma
import sys
from pathlib import Path

import numpy as np

# Each number is kept as a whole multiple of its step.
STEPS = {"means": 1 / 8192, "scales": 1 / 48, "quats": 1 / 1024, "opacities": 1 / 24, "sh0": 1 / 200, "shN": 1 / 48}
LIMITS = {"means": 1000, "scales": 30, "quats": 1, "opacities": 12, "sh0": 20, "shN": 2.6}


def rounded(values: dict) -> dict:
    """The arrays as archives keep them."""
    return {k: _codes(k, v) * np.float32(STEPS[k]) for k, v in values.items()}


def _codes(name: str, values: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(values, -LIMITS[name], LIMITS[name]) / STEPS[name]).astype(np.int32)


def ordered(values: dict) -> dict:
    """The splats in the order of archives: motion is kept by the indices of splats."""
    order = np.argsort(_morton(values["means"]), kind="stable")
    return {k: v[order] for k, v in values.items()}


def archive(values: dict) -> bytes:
    """Byte planes of all codes, splats in Morton order, compressed."""
    out = {}
    for name, array in ordered(values).items():
        codes = _codes(name, array.reshape(len(array), -1)).T
        if name == "means":
            codes = np.diff(codes, axis=1, prepend=0)
        zigzag = ((codes << 1) ^ (codes >> 31)).astype("<u4")
        planes = [((zigzag >> (8 * k)) & 255).astype(np.uint8) for k in range(4)]
        out[name] = np.stack([p for k, p in enumerate(planes) if any(q.any() for q in planes[k:])])
    raw = io.BytesIO()
    np.savez(raw, **out)
    return lzma.compress(raw.getvalue(), preset=4)


def opened(data: bytes) -> dict:
    """The arrays of an archive."""
    found = {}
    for name, planes in np.load(io.BytesIO(lzma.decompress(data))).items():
        zigzag = sum(plane.astype(np.uint32) << (8 * k) for k, plane in enumerate(planes))
        codes = (zigzag >> 1).astype(np.int32) ^ -(zigzag & 1).astype(np.int32)
        if name == "means":
            codes = np.cumsum(codes, axis=1)
        found[name] = codes.T.astype(np.float32) * np.float32(STEPS[name])
    found["opacities"] = found["opacities"][:, 0]
    return found


def _morton(points: np.ndarray) -> np.ndarray:
    low, high = np.percentile(points, [1, 99], axis=0)
    cells = (np.clip((points - low) / np.maximum(high - low, 1e-6), 0, 1) * 2047).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for bit in range(11):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code


def near(values: dict, radius: float) -> np.ndarray:
    """Small splats within a radius of the vertical axis, from just below the floor to above a person."""
    x, y, z = values["means"].T
    is_small = np.exp(values["scales"]).max(axis=1) < 0.1 * radius
    return (np.hypot(x, z) < radius) & (y > -2.2) & (y < 0.1) & is_small


def write_ply(path: Path, values: dict) -> None:
    """The layout of the first trainers, without normals."""
    count = len(values["means"])
    rest = values["shN"].reshape(count, -1, 3)
    names = ["x", "y", "z"] + [f"f_dc_{k}" for k in range(3)] + [f"f_rest_{k}" for k in range(3 * rest.shape[1])]
    names += ["opacity"] + [f"scale_{k}" for k in range(3)] + [f"rot_{k}" for k in range(4)]
    quats = values["quats"] / np.maximum(np.linalg.norm(values["quats"], axis=1, keepdims=True), 1e-9)
    color = values["sh0"].reshape(count, 3)
    columns = [
        values["means"],
        color,
        rest.transpose(0, 2, 1).reshape(count, -1),
        values["opacities"][:, None],
        values["scales"],
        quats,
    ]
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n" + "".join(
        f"property float {n}\n" for n in names
    )
    path.write_bytes((head + "end_header\n").encode() + np.concatenate(columns, 1).astype("<f4").tobytes())


def motion(frames: list) -> bytes:
    """Later frames of moving splats as differences from the frame before."""
    out = {
        name: np.diff(np.stack([_codes(name, f[name]) for f in frames]), axis=0).astype(np.int16) for name in frames[0]
    }
    raw = io.BytesIO()
    np.savez(
        raw,
        **{name: np.stack([(a & 255).astype(np.uint8), ((a >> 8) & 255).astype(np.uint8)]) for name, a in out.items()},
    )
    return lzma.compress(raw.getvalue(), preset=4)


def frames_of(base: dict, chosen: np.ndarray, data: bytes):
    """Yields all frames of a moving scene, the first included."""
    yield base
    loaded = np.load(io.BytesIO(lzma.decompress(data)))
    steps = {
        name: (a[0].astype(np.uint16) | (a[1].astype(np.uint16) << 8)).astype(np.int16) for name, a in loaded.items()
    }
    codes = {name: _codes(name, base[name][chosen].reshape(len(chosen), -1)) for name in steps}
    for frame in range(len(next(iter(steps.values())))):
        values = dict(base)
        for name, step in steps.items():
            codes[name] = codes[name] + step[frame].reshape(codes[name].shape)
            changed = base[name].reshape(len(base["means"]), -1).copy()
            changed[chosen] = codes[name] * np.float32(STEPS[name])
            values[name] = changed.reshape(base[name].shape)
        yield values


if __name__ == "__main__":
    if sys.argv[1] == "ply":
        write_ply(Path(sys.argv[3]), opened(Path(sys.argv[2]).read_bytes()))
    else:
        scene, chosen = opened(Path(sys.argv[2]).read_bytes()), np.load(sys.argv[3] + ".chosen.npy")
        for number, values in enumerate(frames_of(scene, chosen, Path(sys.argv[3]).read_bytes())):
            if len(sys.argv) > 5:
                # Chosen in the first frame: a splat of the walker may leave the circle, and must not come and go.
                kept = near(scene, float(sys.argv[5]))
                values = {k: v[kept] for k, v in values.items()}
                values["shN"] = values["shN"].reshape(len(values["means"]), -1, 3)[:, :3]
            write_ply(Path(sys.argv[4]) / f"{number:03}.ply", values)
