"""Measures and shows a finished file: python evaluate.py SCENE.spz VIEWS SPARSE SHEET.png [CLOSE.png]

Prints the PSNR inside the object's outline for every eighth view (kept from training with --hold-out) and for the
others, after fitting one gain per channel, since the exposure of a photograph is not the scene's. Draws an orbit.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import torch

from capture import read_colmap, to_upright
from dataset import Picture, load_pictures
from model import Parameters, from_gaussians, render
from orbit import orbit_matrix
from spz import read_spz
from train import HELD_OUT_EVERY

AZIMUTHS = range(0, 360, 30)
ORBIT_RADIUS = 2.6
FIELD_OF_VIEW = 35.0


def shot(parameters: Parameters, degree: int, matrix: np.ndarray, size: int, background: float) -> np.ndarray:
    """A square image, uint8 RGB, over a grey background."""
    focal = size / 2 / np.tan(np.radians(FIELD_OF_VIEW) / 2)
    intrinsics = torch.tensor(
        [[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]], dtype=torch.float32, device="cuda"
    )
    view = torch.tensor(matrix, dtype=torch.float32, device="cuda")
    with torch.no_grad():
        color, alpha, _ = render(parameters, view, intrinsics, (size, size), degree)
    picture = color + background * (1 - alpha)
    return (picture.clamp(0, 1).permute(1, 2, 0).cpu().numpy() * 255).round().astype(np.uint8)


def masked_psnr(parameters: Parameters, degree: int, picture: Picture) -> tuple[float, float]:
    """PSNR of the colour on the object's pixels, and the coverage's mean error on the pixels with known coverage."""
    with torch.no_grad():
        color, alpha, _ = render(parameters, picture.view_matrix, picture.intrinsics, picture.size, degree)
    inside = ((picture.alpha > 0.99) & (picture.valid > 0) & (picture.doubtful == 0))[0]
    got, wanted = color[:, inside], picture.rgb[:, inside]
    gain = (got * wanted).sum(1, keepdim=True) / (got * got).sum(1, keepdim=True)
    error = (got * gain - wanted).square().mean().item()
    known = picture.valid * (1 - picture.doubtful)
    coverage = ((alpha - picture.alpha).abs() * known).sum() / known.sum()
    return -10 * np.log10(error), coverage.item()


def main() -> None:
    scene, views, sparse = map(Path, sys.argv[1:4])
    gaussians = read_spz(scene)
    parameters, degree = from_gaussians(gaussians), gaussians.sh_degree
    results: dict[bool, list[tuple[float, float, str]]] = {True: [], False: []}
    for picture in load_pictures(views, to_upright(read_colmap(sparse))):
        results[int(picture.name) % HELD_OUT_EVERY == 0].append(
            (*masked_psnr(parameters, degree, picture), picture.name)
        )
    for every_eighth, figures in results.items():
        psnr, coverage = np.mean([figure[:2] for figure in figures], axis=0)
        worst = ", ".join(f"{name} {value:.2f}" for value, _, name in sorted(figures)[:3])
        name = "every eighth view" if every_eighth else "the other views"
        print(f"{scene.name}: {name}: PSNR {psnr:.2f} dB (worst: {worst}), coverage error {coverage:.4f}")
    rows = []
    for phi, background in ((90, 1.0), (62, 0.1), (112, 0.5)):
        row = [shot(parameters, degree, orbit_matrix(theta, phi, ORBIT_RADIUS), 400, background) for theta in AZIMUTHS]
        rows += [np.concatenate(row[:6], 1), np.concatenate(row[6:], 1)]
    cv2.imwrite(sys.argv[4], cv2.cvtColor(np.concatenate(rows), cv2.COLOR_RGB2BGR))
    if len(sys.argv) > 5:
        views = ((25, 78, 1.0), (-35, 80, 0.05))
        close = [shot(parameters, degree, orbit_matrix(t, p, 2.4), 1000, background) for t, p, background in views]
        cv2.imwrite(sys.argv[5], cv2.cvtColor(np.concatenate(close, 1), cv2.COLOR_RGB2BGR))


if __name__ == "__main__":
    main()
