"""Samples feature planes between their points, while exporting."""

import numpy as np

from .arrays import AnyArray, Doubles, Floats


def sample_plane(plane: Floats, x: AnyArray, y: AnyArray) -> Doubles:
    """Bilinear values (N,C) of a plane (C,H,W) at x, y (N), -1 at the first point's center and 1 at the last one's.
    Positions outside the plane get its border, as in PyTorch's grid_sample with align_corners and border padding.
    """
    _, height, width = plane.shape
    column = np.clip((np.float64(x) + 1) / 2 * (width - 1), 0, width - 1)
    row = np.clip((np.float64(y) + 1) / 2 * (height - 1), 0, height - 1)
    left = np.minimum(column.astype(np.int64), max(width - 2, 0))
    top = np.minimum(row.astype(np.int64), max(height - 2, 0))
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    u, v = column - left, row - top
    upper = plane[:, top, left] * (1 - u) + plane[:, top, right] * u
    lower = plane[:, bottom, left] * (1 - u) + plane[:, bottom, right] * u
    result: Doubles = (upper * (1 - v) + lower * v).T
    return result
