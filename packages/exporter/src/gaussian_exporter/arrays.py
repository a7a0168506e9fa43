"""Types of numpy arrays, and functions of arrays that several modules need while exporting."""

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
AnyArray = npt.NDArray[Any]


def sigmoid(x: AnyArray) -> Doubles:
    """The logistic function in float64, without overflow; infinite logits give exactly 0 and 1."""
    x = np.asarray(x, np.float64)
    z = np.exp(-np.abs(x))
    return np.where(x >= 0, 1 / (1 + z), z / (1 + z))


def rotation_matrices(quaternions: AnyArray) -> Doubles:
    """Matrices (N,3,3) of quaternions w x y z (N,4) of any length but 0."""
    q = np.asarray(quaternions, np.float64)
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return np.stack(rows, 1).reshape(-1, 3, 3)


def covariances(scales: AnyArray, quaternions: AnyArray) -> Doubles:
    """Upper triangles xx xy xz yy yz zz (N,6) of standard deviations (N,3) turned by quaternions w x y z (N,4)."""
    half = rotation_matrices(quaternions) * np.asarray(scales, np.float64)[:, None, :]
    full = half @ half.transpose(0, 2, 1)
    return full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
