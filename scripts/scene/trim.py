"""Trims a trained scene by the photographs' outlines: python trim.py TRAINED.ply VIEWS SPARSE OUT.spz

Shade that lies in the air below the object costs training little, because the photographs are as dark there; over a
white page it shows. But a Gaussian on the object projects inside the object's outline in every photograph, whatever
hides it. So what is dark and projects outside in several goes, and the post is cut off level. Needs no GPU.
"""

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from capture import Capture, View, read_colmap, to_upright
from gaussians import SH_C0, Gaussians, read_ply, write_ply
from masks import project
from spz import write_spz

# Pixels by which a point must miss an outline: cameras moved about that much when they were refined.
OUTLINE_MARGIN = 2
# Photographs in which a Gaussian must miss the outline before it goes. Where a mask is in doubt, it says half.
MISSES = 2
# Half the length, in standard deviations along its longest axis, with which a Gaussian is held against the outlines.
REACH_SIGMAS = 1.5
# Brightest channel, seen from nowhere in particular, below which a Gaussian is shade. Nothing bright hangs in the air.
DARK = 0.3
# The post is dark itself and its outline is not known: nothing is trimmed from here down, this near to its axis.
POST_TOP = 0.2
POST_SLACK = 1.1
# Nearest to the mask of the post the outline is blurred; the object ends this much higher.
CUT_MARGIN = 0.04
# Gaussians over the cut by their extent only are shrunk until this many standard deviations fit, if they need not
# shrink beyond recognition: dropping them all would fray the edge.
CUT_SIGMAS = 2.0
LEAST_SHRINK = 0.15


def rotation_matrices(wxyz: np.ndarray) -> np.ndarray:
    """Rotation matrices (N,3,3) of unit quaternions (N,4)."""
    w, x, y, z = wxyz.T
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return np.stack(rows, 1).reshape(-1, 3, 3)


def axes(gaussians: Gaussians) -> np.ndarray:
    """The three half axes of one standard deviation as columns, (N,3,3)."""
    return rotation_matrices(gaussians.rotations) * np.exp(gaussians.log_scales)[:, None]


def witnesses(gaussians: Gaussians) -> np.ndarray:
    """Each Gaussian's centre and both ends of its longest axis, (3,N,3)."""
    half = axes(gaussians)
    longest = np.argmax(gaussians.log_scales, axis=1)
    end = REACH_SIGMAS * np.take_along_axis(half, longest[:, None, None], 2)[..., 0]
    return np.stack([gaussians.positions, gaussians.positions + end, gaussians.positions - end])


def charges(mask: np.ndarray) -> np.ndarray:
    """What a point at each pixel counts as a miss: 1 well outside the outline, 0.5 where the mask is in doubt."""
    doubtful, valid, coverage = (mask[..., channel] > 127 for channel in range(3))
    covered = (coverage | ~valid).astype(np.uint8)
    near = cv2.dilate(covered, np.ones((2 * OUTLINE_MARGIN + 1, 2 * OUTLINE_MARGIN + 1))) > 0
    return np.where(near, 0, np.where(doubtful, 0.5, 1)).astype(np.float32)


def misses(points: np.ndarray, view: View, capture: Capture, charge: np.ndarray) -> np.ndarray:
    pixels, _ = project(points, view, capture)
    column, row = np.floor(pixels).astype(int).T
    seen = (column >= 0) & (column < charge.shape[1]) & (row >= 0) & (row < charge.shape[0])
    found = np.zeros(len(points), np.float32)
    found[seen] = charge[row[seen], column[seen]]
    return found


def beside_object(gaussians: Gaussians, views: Path, capture: Capture) -> np.ndarray:
    """Which Gaussians reach outside the object's outline in too many photographs, (N,) booleans."""
    total = np.zeros(len(gaussians), np.float32)
    points = witnesses(gaussians)
    for view in capture.views:
        path = views / f"{view.name}.png"
        if path.exists():
            charge = charges(cv2.imread(str(path)))
            total += np.max([misses(end, view, capture, charge) for end in points], axis=0)
    return total > MISSES


def is_dark(gaussians: Gaussians) -> np.ndarray:
    return (0.5 + SH_C0 * gaussians.sh[:, 0]).max(1) < DARK


def near_post(gaussians: Gaussians, hull: np.ndarray, cut_height: float) -> np.ndarray:
    """Which Gaussians lie in the upright cylinder round the post, as wide as the hull just below the cut."""
    post = hull[(hull[:, 1] > cut_height - 0.01) & (hull[:, 1] < cut_height + 0.06)][:, [0, 2]]
    axis = post.mean(0)
    radius = POST_SLACK * np.percentile(np.linalg.norm(post - axis, axis=1), 99)
    away = np.linalg.norm(gaussians.positions[:, [0, 2]] - axis, axis=1)
    return (away < radius) & (gaussians.positions[:, 1] > POST_TOP)


def cut_level(gaussians: Gaussians, height: float) -> Gaussians:
    """Leaves out what lies below the height (y grows downwards) and shrinks what reaches over it."""
    down = np.linalg.norm(axes(gaussians)[:, 1], axis=1)
    room = (height - gaussians.positions[:, 1]) / (CUT_SIGMAS * down)
    shrunk = np.log(np.clip(room, LEAST_SHRINK, 1)).astype(np.float32)
    return replace(gaussians, log_scales=gaussians.log_scales + shrunk[:, None]).at(room > LEAST_SHRINK)


def main() -> None:
    trained, views, sparse, out = map(Path, sys.argv[1:5])
    gaussians = read_ply(trained)
    capture = to_upright(read_colmap(sparse))
    post = near_post(gaussians, np.load(views / "hull.npy"), capture.cut_height)
    shade = beside_object(gaussians, views, capture) & is_dark(gaussians) & ~post
    kept = cut_level(gaussians.at(~shade), capture.cut_height - CUT_MARGIN)
    write_ply(out.with_suffix(".ply"), kept)
    size = write_spz(out, kept, antialiased=True)
    print(
        f"{out}: {shade.sum()} of shade beside the object left out of {len(gaussians)}, {len(kept)} kept, {size} bytes"
    )


if __name__ == "__main__":
    main()
