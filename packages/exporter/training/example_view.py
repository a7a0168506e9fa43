"""Makes the reference image of an included example:

python example_view.py HELD_OUT.npz INDEX OUT [--size 256] [--given 2]
HELD_OUT is the file that a trainer wrote beside its record. OUT/view.png has the image, on black; its alpha is 255
for compared pixels (inside the outline, not occluded, not doubtful) and 0 elsewhere. OUT/view.json has the camera
in the format of `gaussian-splat render`, and the time, pose or shape. `--given`: the images before INDEX are the
inputs of a feed-forward generator; they are written as OUT/image.png and OUT/image_2.png, its controls into
view.json. Needs OpenCV.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np


def view_of(archive: dict[str, np.ndarray], index: int, size: int) -> tuple[np.ndarray, dict[str, object]]:
    """Returns the image (size,size,4) as bytes, blue first, and the content of view.json."""
    picture = archive["pictures"][index]
    counts = picture[3] > 250
    if "valid" in archive:
        counts &= (archive["valid"][index, 0] > 0) & (archive["doubtful"][index, 0] == 0)
    small = cv2.resize(picture[:3].transpose(1, 2, 0), (size, size), interpolation=cv2.INTER_AREA)
    # A scaled pixel counts only if all of it did.
    whole = cv2.resize(counts.astype(np.float32), (size, size), interpolation=cv2.INTER_AREA) > 0.999
    k = archive["intrinsics"][index].astype(float)
    k[:2] *= size / picture.shape[2]
    facts: dict[str, object] = {"width": size, "height": size, "K": k.round(6).tolist()}
    facts["worldToCamera"] = archive["views"][index].astype(float).round(7).tolist()
    for plural, name in (("times", "time"), ("poses", "pose"), ("shapes", "shape")):
        if plural in archive:
            facts[name] = np.asarray(archive[plural][index], float).round(6).tolist()
    return np.dstack([small[..., ::-1], whole.astype(np.uint8) * 255]), facts


def given_pictures(archive: dict[str, np.ndarray], index: int, count: int, out: Path) -> dict[str, object]:
    """Writes the `count` images before one; returns their content of view.json. Cameras are relative to the first."""
    names = ["image", "image_2"][:count]
    rows = range(index - count, index)
    for name, row in zip(names, rows, strict=True):
        cv2.imwrite(str(out / f"{name}.png"), archive["pictures"][row][2::-1].transpose(1, 2, 0))
    height, width = archive["pictures"].shape[2:]
    k = archive["intrinsics"][index].astype(float)
    controls = {
        "focal_length": [k[0, 0] / width, k[1, 1] / height],
        "principal_point": [k[0, 2] / width, k[1, 2] / height],
    }
    if count == 2:
        controls["relative_pose"] = archive["views"][index - 1].astype(float).round(7).ravel().tolist()
    return {"pictures": {name: f"{name}.png" for name in names}, "controls": controls}


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("held_out", type=Path)
    parser.add_argument("index", type=int)
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--given", type=int, default=0, choices=(0, 1, 2), help="number of given images before it")
    given = parser.parse_args(argv)
    given.out.mkdir(parents=True, exist_ok=True)
    with np.load(given.held_out) as opened:
        archive = dict(opened)
    picture, facts = view_of(archive, given.index, given.size)
    if given.given > 0:
        facts |= given_pictures(archive, given.index, given.given, given.out)
    cv2.imwrite(str(given.out / "view.png"), picture)
    (given.out / "view.json").write_text(json.dumps(facts, indent=1) + "\n")


if __name__ == "__main__":
    main()
