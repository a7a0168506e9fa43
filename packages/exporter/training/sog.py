"""Reads captured scenes in SOG version 2 (PlayCanvas), and writes them as PLY: python sog.py SCENE.sog OUT.ply

Plain colors only. Needs OpenCV, for WebP.
"""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path

import cv2
import numpy as np
import torch

from ply import write_ply


def read_sog(path: Path) -> dict[str, np.ndarray]:
    """Columns of INRIA's PLY: positions (N,3), dc (N,3), opacity logits (N,1), log scales (N,3), rotations (N,4)."""
    with zipfile.ZipFile(path) as archive:
        meta = json.loads(archive.read("meta.json"))
        if meta.get("version") != 2:
            raise ValueError(f"{path}: expected SOG version 2, found {meta.get('version')}")

        def pixels(name: str) -> np.ndarray:
            picture = cv2.imdecode(np.frombuffer(archive.read(name), np.uint8), cv2.IMREAD_UNCHANGED)
            order = [2, 1, 0, 3][: picture.shape[2]]
            return picture[..., order].reshape(-1, picture.shape[2])[: meta["count"]]

        low, high = (pixels(name)[:, :3].astype(np.float64) for name in meta["means"]["files"])
        minimum, maximum = np.array(meta["means"]["mins"]), np.array(meta["means"]["maxs"])
        squeezed = minimum + (high * 256 + low) / 65535 * (maximum - minimum)
        scales = np.array(meta["scales"]["codebook"])[pixels(meta["scales"]["files"][0])[:, :3]]
        quats = pixels(meta["quats"]["files"][0])
        sh0 = pixels(meta["sh0"]["files"][0])
        opacity = np.clip(sh0[:, 3:] / 255.0, 1e-6, 1 - 1e-6)
        return {
            "x,y,z": np.sign(squeezed) * np.expm1(np.abs(squeezed)),
            "f_dc_": np.array(meta["sh0"]["codebook"])[sh0[:, :3]],
            "opacity": np.log(opacity / (1 - opacity)),
            "scale_": scales,
            "rot_": unpacked(quats),
        }


def unpacked(quats: np.ndarray) -> np.ndarray:
    """Quaternions wxyz (N,4): three components in bytes, in units of 1/sqrt 2; the fourth byte names the largest."""
    three = (quats[:, :3] / 255.0 - 0.5) * np.sqrt(2)
    largest = quats[:, 3].astype(int) - 252
    result = np.zeros((len(quats), 4))
    left = np.sqrt(np.clip(1 - (three**2).sum(1), 0, 1))
    for axis in range(4):
        rows = largest == axis
        result[np.ix_(rows, [a for a in range(4) if a != axis])] = three[rows]
        result[rows, axis] = left[rows]
    return result


if __name__ == "__main__":
    write_ply(Path(sys.argv[2]), {name: torch.tensor(value) for name, value in read_sog(Path(sys.argv[1])).items()})
