"""The diffusion model of demo/generators on vessels that it has not learned from, run after run as a page runs it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort
import pytest

from gaussian_exporter.arrays import AnyArray

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "packages/exporter/training"))
from vessels import CHANNELS, COLUMNS, POSITION, ROWS, held_out  # noqa: E402

START, END, SECONDS = 20.0, 0.01, 3.0
DEVIATION = 0.5


@pytest.fixture(scope="module")
def session() -> Any:
    """The file of the gallery."""
    path = ROOT / "demo/generators/vessels/model.onnx"
    return ort.InferenceSession(str(path), providers=["CPUExecutionProvider"])


def run(session: Any, seconds: float, seed: int, previous: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Positions (N,3) and the next state."""
    feeds = {"t": np.array([seconds], np.float32), "seed": np.array([seed], np.int32), "previous": previous}
    written = dict(zip([each.name for each in session.get_outputs()], session.run(None, feeds), strict=True))
    return written["positions"], next(each for each in written.values() if each.shape == previous.shape)


def generated(session: Any, seed: int, runs: int) -> AnyArray:
    """Positions after these runs, from noise."""
    kept = np.zeros((CHANNELS + 1, ROWS, COLUMNS), np.float32)
    for seconds in np.linspace(0, SECONDS, runs):
        positions, kept = run(session, seconds, seed, kept)
    assert np.isfinite(positions).all()
    return positions


def grid(positions: AnyArray) -> AnyArray:
    """Positions (3,ROWS,COLUMNS) of rows (N,3)."""
    return positions.T.reshape(3, ROWS, COLUMNS)


def decibels(noisy: AnyArray, found: AnyArray, clean: AnyArray) -> float:
    """Gain of found positions over noisy ones, dB."""
    return float(10 * np.log10(np.square(noisy - clean).mean() / np.square(found - clean).mean()))


def blurred(x: AnyArray, radius: int) -> AnyArray:
    """Means of the neighbors in the grid, the best that a filter without training does; its columns go around."""
    ends = np.pad(np.pad(x, ((0, 0), (0, 0), (radius,) * 2), "wrap"), ((0, 0), (radius,) * 2, (0, 0)), "reflect")
    windows: AnyArray = np.lib.stride_tricks.sliding_window_view(ends, (2 * radius + 1,) * 2, axis=(1, 2))
    return np.asarray(windows.mean((3, 4)))


@pytest.mark.parametrize(("sigma", "gain"), [(0.25, 20.0), (1.0, 20.0)])
def test_noisy_gaussians_of_new_vessels_become_clean(session: Any, sigma: float, gain: float) -> None:
    gains, filtered = [], []
    for number, clean in enumerate(held_out(4)):
        noisy = clean + sigma * np.random.default_rng(number).standard_normal(clean.shape).astype(np.float32)
        kept = np.concatenate([noisy, np.full((1, ROWS, COLUMNS), sigma, np.float32)])
        begin = SECONDS * np.log(sigma / START) / np.log(END / START)
        for seconds in np.linspace(begin, SECONDS, 9)[1:]:
            positions, kept = run(session, seconds, 0, kept)
        given, truth = noisy[:3] / POSITION, clean[:3] / POSITION
        gains.append(decibels(given, grid(positions), truth))
        filtered.append(max(decibels(given, blurred(given, radius), truth) for radius in range(1, 9)))
    print(sigma, np.round(gains, 1), np.round(filtered, 1))
    assert np.mean(gains) > gain and np.mean(gains) > np.mean(filtered) + 3, (gains, filtered)


def roughness(x: AnyArray) -> float:
    """Second differences around the axis, relative to the size."""
    return float(np.abs(np.roll(x, 1, 2) - 2 * x + np.roll(x, -1, 2)).mean() / x.std())


def test_noise_becomes_other_vessels_with_each_seed(session: Any) -> None:
    made = [grid(generated(session, seed, 30)) for seed in range(4)]
    known = [each[:3] / POSITION for each in held_out(64)]
    limit = np.quantile([roughness(each) for each in known], 0.95)
    print([round(roughness(each), 4) for each in made], limit)
    assert all(roughness(each) < limit for each in made), "as smooth as vessels"
    heights = [np.ptp(each[1]) for each in made]
    assert min(heights) > 0.6 and max(heights) < 2, heights
    assert np.ptp(heights) > 0.1, "each seed has its own"
    # The same seed again, and in fewer runs: a slow page ends at a vessel, too.
    assert np.array_equal(made[0], grid(generated(session, 0, 30)))
    assert roughness(grid(generated(session, 0, 6))) < 2 * limit
