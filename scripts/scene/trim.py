"""Trims a trained scene: python trim.py TRAINED.ply HULL.npy SPARSE OUT.spz (and OUT.ply beside it)

Shade that hangs in the air by the object costs training little, because the photographs are as dark there; over a
white page it shows. It can be detected without photographs: seen from all around, haze lies mostly on translucent pixels, while Gaussians on a surface have, from most sides, more surface behind them. So haze goes,
and the post is cut off level. Needs no GPU; takes some minutes.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from capture import read_colmap, to_upright
from gaussians import Gaussians, read_ply, write_ply
from orbit import orbit_matrix
from rasterize import axes, project_ellipses, thin_and_solid
from spz import write_spz

# Rounds of looking from all round; what haze hid is haze in the next one.
ROUNDS = 2
POLAR_ANGLES = (45, 65, 80, 92, 104, 116)
AZIMUTHS = range(0, 360, 18)
PICTURE = (420, 380)
FIELD_OF_VIEW = 24.0
ORBIT_RADIUS = 2.9
# A pixel covered less than this is translucent, and a Gaussian with more than this fraction of its weight there is
# haze.
MAX_THIN = 0.9
MAX_HAZE = 0.4
# The end of the post is open, its rim thin from everywhere: nothing is haze from here down, this near to its axis.
POST_TOP = 0.2
POST_SLACK = 1.1
# Nearest to the mask of the post the outline is blurred; the object ends this much higher.
CUT_MARGIN = 0.04
# Gaussians over the cut by their extent only are shrunk until this many standard deviations fit, if they need not
# shrink beyond recognition: dropping them all would fray the edge.
CUT_SIGMAS = 2.0
MIN_SHRINK = 0.15


def haze(gaussians: Gaussians) -> np.ndarray:
    """Fraction of each Gaussian's visible weight, from all round, that falls on translucent pixels, (N,)."""
    focal = PICTURE[0] / 2 / np.tan(np.radians(FIELD_OF_VIEW) / 2)
    thin, solid = np.zeros(len(gaussians)), np.full(len(gaussians), 1e-9)
    for ring, phi in enumerate(POLAR_ANGLES):
        for theta in AZIMUTHS:
            # Rings are turned against each other, so that no side is seen from one column of cameras only.
            matrix = orbit_matrix(theta + 3 * ring, phi, ORBIT_RADIUS)
            seen = thin_and_solid(project_ellipses(gaussians, matrix, focal, PICTURE), PICTURE, MAX_THIN)
            thin, solid = thin + seen[0], solid + seen[1]
    return thin / (thin + solid)


def near_post(gaussians: Gaussians, hull: np.ndarray, cut_height: float) -> np.ndarray:
    """Which Gaussians lie in the upright cylinder round the post, as wide as the hull just below the cut."""
    post = hull[(hull[:, 1] > cut_height - 0.01) & (hull[:, 1] < cut_height + 0.06)][:, [0, 2]]
    axis = post.mean(0)
    radius = POST_SLACK * np.percentile(np.linalg.norm(post - axis, axis=1), 99)
    away = np.linalg.norm(gaussians.positions[:, [0, 2]] - axis, axis=1)
    return (away < radius) & (gaussians.positions[:, 1] > POST_TOP)


def cut_level(gaussians: Gaussians, height: float) -> Gaussians:
    """Removes Gaussians below the height (y grows downwards) and shrinks those that reach over it."""
    down = np.linalg.norm(axes(gaussians)[:, 1], axis=1)
    room = (height - gaussians.positions[:, 1]) / (CUT_SIGMAS * down)
    shrunk = np.log(np.clip(room, MIN_SHRINK, 1)).astype(np.float32)
    return replace(gaussians, log_scales=gaussians.log_scales + shrunk[:, None]).at(room > MIN_SHRINK)


def main() -> None:
    trained, hull_path, sparse, out = map(Path, sys.argv[1:5])
    capture, hull = to_upright(read_colmap(sparse)), np.load(hull_path)
    whole = read_ply(trained)
    kept = cut_level(whole, capture.cut_height - CUT_MARGIN)
    print(f"{len(whole) - len(kept)} below the cut left out of {len(whole)}", flush=True)
    for _ in range(ROUNDS):
        hazy = (haze(kept) > MAX_HAZE) & ~near_post(kept, hull, capture.cut_height)
        kept = kept.at(~hazy)
        print(f"{hazy.sum()} of haze left out, {len(kept)} kept", flush=True)
    write_ply(out.with_suffix(".ply"), kept)
    print(f"{out}: {len(kept)} Gaussians, {write_spz(out, kept, antialiased=True)} bytes")


if __name__ == "__main__":
    main()
