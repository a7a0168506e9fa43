"""Cuts the object out of its photographs: python masks.py PHOTOS OUT

PHOTOS holds images/*.jpg and sparse/0 (COLMAP text). OUT receives, per view, NAME.jpg (unchanged) and NAME.png, whose
red is the object's coverage in 0..255 and whose green is 255 where the pixel may teach the trainer anything, 0 where
the post hides or touches the object.

Colour alone cannot tell the pale object from the pale plate below it, and one photograph alone cannot tell it from a
lamp behind it; all together can. So: GrabCut per photograph, a visual hull from all of them, and GrabCut again inside
the hull's projection.
"""

import shutil
import sys
from pathlib import Path

import cv2
import numpy as np

from capture import Capture, View, read_colmap, to_upright

# View 44 is left out everywhere: its pose or exposure disagrees with the others.
LEFT_OUT = {"44"}
VOXEL = 0.012
# Share of the views that must see a voxel as object. Below 1, because one faulty silhouette must not cut a hole.
HULL_AGREEMENT = 0.95


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
    """Depth of the nearest voxel in each pixel; infinite where there is none."""
    k = capture.intrinsics
    pixels, depth = project(points, view, capture)
    half = int(np.ceil(VOXEL * k.fx / np.median(depth) / 2))
    image = np.full((k.height, k.width), np.inf, np.float32)
    column, row = np.floor(pixels).astype(int).T
    for down in range(-half, half + 1):
        for right in range(-half, half + 1):
            x, y = column + right, row + down
            seen = (x >= 0) & (x < k.width) & (y >= 0) & (y < k.height)
            np.minimum.at(image, (y[seen], x[seen]), depth[seen])
    return image


def grab_cut(photograph: np.ndarray, sure: np.ndarray, possible: np.ndarray) -> np.ndarray:
    """GrabCut at half size: `sure` is object, outside `possible` is not, between them colour decides."""
    small = cv2.resize(photograph, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    labels = np.where(possible, cv2.GC_PR_BGD, cv2.GC_BGD).astype(np.uint8)
    bright = photograph.max(axis=2) > 90
    labels[possible & bright] = cv2.GC_PR_FGD
    labels[sure & possible] = cv2.GC_FGD
    labels = np.ascontiguousarray(labels[::2, ::2])
    cv2.setRNGSeed(1)
    cv2.grabCut(small, labels, None, np.zeros((1, 65)), np.zeros((1, 65)), 4, cv2.GC_INIT_WITH_MASK)
    found = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.float32)
    size = (photograph.shape[1], photograph.shape[0])
    return cv2.GaussianBlur(cv2.resize(found, size, interpolation=cv2.INTER_LINEAR), (0, 0), 1.5) > 0.5


def largest_part(mask: np.ndarray) -> np.ndarray:
    """The largest connected part, small holes filled (no hole of this object shows the background)."""
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(opened)
    if count < 2:
        return mask
    part = (labels == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])).astype(np.uint8)
    contours, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return cv2.drawContours(np.zeros_like(part), contours, -1, 1, cv2.FILLED) > 0


def voxels(capture: Capture) -> np.ndarray:
    """Centres of a grid round the object and the upper part of its post, (N,3)."""
    low = np.percentile(capture.points, 0.3, axis=0) - 0.08
    high = np.percentile(capture.points, 99.7, axis=0) + 0.08
    axes = [np.arange(a, b, VOXEL) for a, b in zip(low, high)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


def visual_hull(capture: Capture, masks: dict[str, np.ndarray]) -> np.ndarray:
    """Voxels that HULL_AGREEMENT of the views that see them call object. Outside a picture nothing is said."""
    grid = voxels(capture)
    said_yes, said = np.zeros(len(grid)), np.zeros(len(grid))
    k = capture.intrinsics
    for view in capture.views:
        if view.name not in masks:
            continue
        pixels, _ = project(grid, view, capture)
        column, row = np.floor(pixels).astype(int).T
        seen = (column >= 0) & (column < k.width) & (row >= 0) & (row < k.height)
        said += seen
        said_yes[seen] += masks[view.name][row[seen], column[seen]]
    return grid[said_yes >= HULL_AGREEMENT * np.maximum(said, 20)]


def first_masks(capture: Capture, photographs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """From the sparse points alone: what lies close to them is object, what lies far from them is not."""
    on_object = capture.points[np.linalg.norm(capture.points, axis=1) < 0.85]
    masks = {}
    for view in capture.views:
        if view.name in photographs:
            sure = cv2.erode(stamp(on_object, view, capture, 0.06).astype(np.uint8), np.ones((31, 31))) > 0
            possible = stamp(on_object, view, capture, 0.09)
            masks[view.name] = largest_part(grab_cut(photographs[view.name], sure, possible))
    return masks


def final_mask(view: View, capture: Capture, photograph: np.ndarray, hull: np.ndarray) -> np.ndarray:
    """Coverage and validity, (height, width, 3) uint8 in OpenCV's channel order."""
    upper, lower = hull[hull[:, 1] < capture.cut_height], hull[hull[:, 1] >= capture.cut_height]
    above, below = nearest_depth(upper, view, capture), nearest_depth(lower, view, capture)
    projected = np.isfinite(above) | np.isfinite(below)
    sure = cv2.erode(projected.astype(np.uint8), np.ones((19, 19))) > 0
    possible = cv2.dilate(projected.astype(np.uint8), np.ones((13, 13))) > 0
    object_or_post = largest_part(grab_cut(photograph, sure, possible))
    # The post hides the object where it is nearer. Its silhouette is not trusted to the pixel, hence the margin.
    reach = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))
    post = cv2.dilate((below < above).astype(np.uint8), reach) > 0
    inside = object_or_post & np.isfinite(cv2.erode(above, reach))
    coverage = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), 0.8)
    valid = ~post
    return np.dstack([np.zeros_like(coverage), valid * 255.0, coverage * 255.0]).round().astype(np.uint8)


def main(photos: Path, out: Path) -> None:
    capture = to_upright(read_colmap(photos / "sparse" / "0"))
    out.mkdir(parents=True, exist_ok=True)
    names = [view.name for view in capture.views if view.name not in LEFT_OUT]
    photographs = {name: cv2.imread(str(photos / "images" / f"{name}.jpg")) for name in names}
    masks = first_masks(capture, photographs)
    hull = visual_hull(capture, masks)
    print(f"visual hull: {len(hull)} voxels of {VOXEL}, {hull.min(0)} to {hull.max(0)}")
    np.save(out / "hull.npy", hull.astype(np.float32))
    for view in capture.views:
        if view.name in photographs:
            mask = final_mask(view, capture, photographs[view.name], hull)
            cv2.imwrite(str(out / f"{view.name}.png"), mask)
            shutil.copyfile(photos / "images" / f"{view.name}.jpg", out / f"{view.name}.jpg")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
