"""PSNR, SSIM and LPIPS of images against photographs: reads {"pairs": [[image, photograph], ...]} from stdin, writes a list of {psnr, ssim, lpips} to stdout."""

import json
import sys

import numpy as np
from PIL import Image
from skimage.metrics import structural_similarity


def load(path: str) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), dtype=np.float64) / 255


def lpips_measure():
    """The package `lpips` with AlexNet, as the papers of 3D Gaussian Splatting measure; None where it or its weights are missing."""
    try:
        import lpips
        import torch

        net = lpips.LPIPS(net="alex", verbose=False)
    except Exception as error:  # noqa: BLE001: no package, no weights, no network: all the same here
        print(f"LPIPS is not measured: {error}", file=sys.stderr)
        return None

    def measure(a: np.ndarray, b: np.ndarray) -> float:
        tensors = [torch.tensor(2 * x - 1, dtype=torch.float32).permute(2, 0, 1)[None] for x in (a, b)]
        with torch.no_grad():
            return float(net(*tensors))

    return measure


def main() -> None:
    lpips = lpips_measure()
    rows = []
    for image, photograph in json.load(sys.stdin)["pairs"]:
        a, b = load(image), load(photograph)
        error = float(np.mean((a - b) ** 2))
        # The window of Wang et al. 2004: 11 pixels, sigma 1.5.
        options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
        ssim = structural_similarity(a, b, data_range=1.0, channel_axis=2, **options)
        row = {"psnr": -10 * np.log10(max(error, 1e-12)), "ssim": float(ssim)}
        rows.append({**row, "lpips": lpips(a, b) if lpips else None})
    json.dump(rows, sys.stdout)


main()
