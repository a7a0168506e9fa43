"""Running exported files, and comparing what they write."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime as ort

from gaussian_exporter.arrays import AnyArray, Doubles
from gaussian_exporter.contract import METADATA_KEY, Coordinates, Facts

FACTS = Facts("test", "CC0-1.0", "nobody", coordinates=Coordinates("-y", "right", 1.0), duration=2.0)
UPPER = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])


def run(model: onnx.ModelProto, feeds: dict[str, AnyArray] | None = None) -> dict[str, AnyArray]:
    """All outputs of a model on the CPU provider; scales and opacities after the activations that it declares."""
    session = ort.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    whole = {each.name for each in session.get_inputs() if each.type == "tensor(int32)"}
    given = {
        name: np.asarray(value, np.int32 if name in whole else np.float32) for name, value in (feeds or {}).items()
    }
    names = [output.name for output in session.get_outputs()]
    return activated(model, dict(zip(names, session.run(None, given), strict=True)))


def activated(model: onnx.ModelProto, written: dict[str, AnyArray]) -> dict[str, AnyArray]:
    """Scales and opacities after the activations that the model declares."""
    contract: Any = json.loads({prop.key: prop.value for prop in model.metadata_props}.get(METADATA_KEY, "{}"))
    outputs = contract.get("outputs", {})
    if outputs.get("scaleActivation") == "log":
        written["scales"] = np.exp(written["scales"])
    if outputs.get("opacityActivation") == "logit":
        written["opacities"] = 1 / (1 + np.exp(-written["opacities"]))
    return written


def parts(written: dict[str, AnyArray] | AnyArray) -> dict[str, Doubles]:
    """Rows that a file wrote, packed (or the rows alone) or split, by their content; covariances also of scales and
    rotations.
    """
    if not isinstance(written, dict) or "gaussians" in written:
        rows = np.asarray(written["gaussians"] if isinstance(written, dict) else written, np.float64)
        return {
            "positions": rows[:, :3],
            "covariances": rows[:, 3:9],
            "color": rows[:, 9:-1],
            "opacities": rows[:, -1:],
        }
    wide = {name: np.asarray(values, np.float64).reshape(len(values), -1) for name, values in written.items()}
    covariances = wide["covariances"] if "covariances" in wide else covariance(wide["scales"], wide["rotations"])
    color = wide["sh"] if "sh" in wide else wide["colors"]
    return {
        "positions": wide["positions"],
        "covariances": covariances,
        "color": color,
        "opacities": wide["opacities"],
    }


def rows(written: dict[str, AnyArray]) -> Doubles:
    """All of it as rows: position, covariance, color, opacity."""
    return np.concatenate(list(parts(written).values()), 1)


def error(found: AnyArray, expected: AnyArray) -> float:
    """Largest difference, relative to the largest magnitude among the expected numbers of the same column."""
    found, expected = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    assert found.shape == expected.shape, (found.shape, expected.shape)
    assert np.isfinite(found).all()
    return float((np.abs(found - expected) / np.maximum(np.abs(expected).max(0), 1e-30)).max())


def covariance(scales: AnyArray, quaternions: AnyArray) -> Doubles:
    """Upper triangles of R S S R^T, by turning each axis with the quaternion product q v q*."""
    q = np.asarray(quaternions, np.float64)
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    axes = []
    for axis in np.eye(3):
        u, w = q[:, 1:], q[:, :1]
        t = 2 * np.cross(u, axis)
        axes.append(axis + w * t + np.cross(u, t))
    half = np.stack(axes, 2) * np.asarray(scales, np.float64)[:, None, :]
    full = np.einsum("nij,nkj->nik", half, half)
    upper: Doubles = full[:, UPPER[0], UPPER[1]]
    return upper


def write_ply(path: Path, columns: dict[str, AnyArray]) -> Path:
    """A binary PLY file with one float property for each name."""
    count = len(next(iter(columns.values())))
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    header += [f"property float {name}" for name in columns] + ["end_header", ""]
    rows = np.stack([np.asarray(value, "<f4") for value in columns.values()], 1)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes("\n".join(header).encode() + rows.tobytes())
    return path
