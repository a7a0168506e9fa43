"""Cuts the object out of its photographs: python masks.py PHOTOS OUT

PHOTOS holds images/*.jpg and sparse/0 (COLMAP text). OUT receives, per view, NAME.jpg (unchanged) and NAME.png: red
is the object's coverage in 0..255; green is 255 if the trainer uses the pixel, 0 if the post hides
or touches the object; blue is 255 if the photograph is too dark to distinguish shaded object from dark room.

Brightness alone cannot separate the pale object from the pale plate below it or a lamp behind it, nor a dark eye socket
from the dark room; all photographs together can. So: a threshold per photograph, a visual hull from all of them, and
the threshold again, trusted only near the hull's outline.
"""

import shutil
import sys
from pathlib import Path

import cv2
import numpy as np

from capture import Capture, View, read_colmap, to_upright

# View 44 is left out everywhere: its pose or exposure disagrees with the others.
LEFT_OUT = {"44"}
VOXEL = 0.008
# How much of the way from its surroundings' brightness to its own a pixel must have gone to count as lit.
CONTRAST = 0.2
# Pixels within which the hull's outline and a photograph's may differ; there the photograph decides.
HULL_MARGIN = 4
# A pixel this deep inside the hull is object, however dark.
CORE_MARGIN = 10
# Fraction of the views that must see a voxel as object. Below 1, because one faulty silhouette must not cut a hole.
HULL_AGREEMENT = 0.96
# From this height down (upright frame) the object shades itself; see visual_hull. What fewer views agree on may still
# be object there.
UNDERSIDE = 0.08
STRICT_AGREEMENT = 0.9
LOOSE_AGREEMENT = 0.75
# Views from higher than this above the horizon see the underside in the flash's shadow, before plate and lamps.
HIGH_VIEW_DEGREES = 25
# Pixels within which the hull's outline and a photograph's may differ; there the photograph decides.
HULL_MARGIN = 4
# A pixel this deep inside the hull is object, however dark.
CORE_MARGIN = 10
# Fraction of the views that must see a voxel as object. Below 1, because one faulty silhouette must not cut a hole.
HULL_AGREEMENT = 0.96
# From this height down (upright frame) the object shades itself; see visual_hull.
UNDERSIDE = 0.08
UNDERSIDE_AGREEMENT = 0.7


def project(points: np.ndarray, view: View, capture: Capture) -> tuple[np.ndarray, np.ndarray]:
    """World points (N,3) to pixels (N,2) and depths (N,)."""
    camera = points @ view.rotation.T + view.translation
    k = capture.intrinsics
    pixels = camera[:, :2] / camera[:, 2:] * [k.fx, k.fy] + [k.cx, k.cy]
    return pixels, camera[:, 2]


def stamp(points: np.ndarray, view: View, capture: Capture, radius: float) -> np.ndarray:
    """Pixels within `radius` world units of any projected point (bool, height x width)."""
    k = capture.intrinsics
    pixels, depth = project(points, view, capture)
    image = np.zeros((k.height, k.width), np.uint8)
    column, row = np.floor(pixels).astype(int).T
    seen = (column >= 0) & (column < k.width) & (row >= 0) & (row < k.height)
    image[row[seen], column[seen]] = 255
    size = 2 * int(np.ceil(radius * k.fx / np.median(depth))) + 1
    return cv2.dilate(image, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))) > 0


def nearest_depth(points: np.ndarray, view: View, capture: Capture) -> np.ndarray:
    """Depth of the nearest voxel in each pixel; infinite if there is none."""
    k = capture.intrinsics
    pixels, depth = project(points, view, capture)
    half = int(np.ceil(VOXEL * k.fx / np.median(depth) / 2))
    image = np.full((k.height, k.width), np.inf, np.float32)
    far_first = np.argsort(-depth)
    depth = depth[far_first]
    column, row = np.floor(pixels[far_first]).astype(int).T
    for down in range(-half, half + 1):
        for right in range(-half, half + 1):
            x, y = column + right, row + down
            seen = (x >= 0) & (x < k.width) & (y >= 0) & (y < k.height)
            # The last of several writes to one pixel stays: the nearest. Between shifts the nearer of both.
            shifted = np.full_like(image, np.inf)
            shifted[y[seen], x[seen]] = depth[seen]
            image = np.minimum(image, shifted)
    return image


def bright_part(photograph: np.ndarray, near: np.ndarray) -> np.ndarray:
    """The pixels that the flash lit, inside the region `near`: brighter than that region's dark surroundings by CONTRAST."""
    value = photograph.max(axis=2)
    ring = (cv2.dilate(near.astype(np.uint8), np.ones((61, 61))) > 0) & ~near
    dark, lit = np.median(value[ring]), np.median(value[near])
    smooth = cv2.GaussianBlur(value, (0, 0), 1.0)
    return largest_part(near & (smooth > dark + CONTRAST * (lit - dark)))


def largest_part(mask: np.ndarray) -> np.ndarray:
    """The largest connected part, holes filled (no hole of this object shows the background)."""
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(opened)
    if count < 2:
        return mask
    part = (labels == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])).astype(np.uint8)
    contours, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return cv2.drawContours(np.zeros_like(part), contours, -1, 1, cv2.FILLED) > 0


def disc(radius: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))


def voxels(capture: Capture) -> np.ndarray:
    """Centres of a grid round the object and the upper part of its post, (N,3)."""
    low = np.percentile(capture.points, 0.3, axis=0) - 0.08
    high = np.percentile(capture.points, 99.7, axis=0) + 0.08
    axes = [np.arange(a, b, VOXEL) for a, b in zip(low, high)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


def from_high(view: View) -> bool:
    return -view.center[1] > np.sin(np.radians(HIGH_VIEW_DEGREES)) * np.linalg.norm(view.center)


def visual_hull(capture: Capture, masks: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Voxels that the views that see them call object, each with whether enough of them agree to be sure of it.
    Outside an image nothing is said, and views from high above say nothing about the underside: it lies in the
    flash's shadow there and looks like background."""
    grid = voxels(capture)
    said_yes, said = np.zeros(len(grid)), np.zeros(len(grid))
    k = capture.intrinsics
    underside = grid[:, 1] > UNDERSIDE
    for view in capture.views:
        if view.name not in masks:
            continue
        pixels, _ = project(grid, view, capture)
        column, row = np.floor(pixels).astype(int).T
        seen = (column >= 0) & (column < k.width) & (row >= 0) & (row < k.height)
        if from_high(view):
            seen &= ~underside
        said += seen
        said_yes[seen] += masks[view.name][row[seen], column[seen]]
    share = said_yes / np.maximum(said, 12)
    sure = share >= np.where(underside, STRICT_AGREEMENT, HULL_AGREEMENT)
    possible = sure | (underside & (share >= LOOSE_AGREEMENT))
    return grid[possible], sure[possible]


def first_masks(capture: Capture, photographs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Uses the sparse points alone: places far from all of them are not the object."""
    on_object = capture.points[np.linalg.norm(capture.points, axis=1) < 0.85]
    return {
        view.name: bright_part(photographs[view.name], stamp(on_object, view, capture, 0.07))
        for view in capture.views
        if view.name in photographs
    }


def final_mask(view: View, capture: Capture, first: np.ndarray, hull: np.ndarray, sure: np.ndarray) -> np.ndarray:
    """Doubt, validity and coverage, (height, width, 3) uint8: OpenCV's channel order."""
    upper, lower = hull[hull[:, 1] < capture.cut_height], hull[hull[:, 1] >= capture.cut_height]
    above, below = nearest_depth(upper, view, capture), nearest_depth(lower, view, capture)
    margin = disc(HULL_MARGIN)
    projected = np.isfinite(above) | np.isfinite(below)
    possible = cv2.dilate(projected.astype(np.uint8), margin) > 0
    certain = np.isfinite(nearest_depth(hull[sure], view, capture)).astype(np.uint8)
    core, reach = cv2.erode(certain, disc(CORE_MARGIN)) > 0, cv2.dilate(certain, margin) > 0
    silhouette = largest_part((first & (reach if from_high(view) else possible)) | core)
    doubtful = projected & ~silhouette & ~first
    # The post hides the object when it is nearer. Its silhouette is not trusted to the pixel, hence the margin.
    post = cv2.dilate((below < above).astype(np.uint8), margin) > 0
    inside = silhouette & np.isfinite(cv2.erode(above, margin))
    coverage = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), 0.8)
    valid = ~post & ~(possible & first & ~silhouette)
    return np.dstack([doubtful * 255.0, valid * 255.0, coverage * 255.0]).round().astype(np.uint8)


def main(photos: Path, out: Path) -> None:
    capture = to_upright(read_colmap(photos / "sparse" / "0"))
    out.mkdir(parents=True, exist_ok=True)
    names = [view.name for view in capture.views if view.name not in LEFT_OUT]
    photographs = {name: cv2.imread(str(photos / "images" / f"{name}.jpg")) for name in names}
    masks = first_masks(capture, photographs)
    hull, sure = visual_hull(capture, masks)
    print(f"visual hull: {len(hull)} voxels of {VOXEL}, {sure.sum()} sure, {hull.min(0)} to {hull.max(0)}")
    np.save(out / "hull.npy", hull.astype(np.float32))
    for view in capture.views:
        if view.name in photographs:
            mask = final_mask(view, capture, masks[view.name], hull, sure)
            cv2.imwrite(str(out / f"{view.name}.png"), mask)
            shutil.copyfile(photos / "images" / f"{view.name}.jpg", out / f"{view.name}.jpg")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
