"""A trained model, larger: python tile.py scaffold|hexplane CHECKPOINT COUNT OUT.onnx

For measuring time only: anchors or Gaussians of the checkpoint are repeated, moved aside, until there are COUNT. The
checkpoint `random` has the sizes of what scaffold.py and hexplane.py train, and random numbers, on which a run's time
does not depend.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from gaussian_exporter.checkpoints.hexplane_folder import read_hexplane
from gaussian_exporter.checkpoints.scaffold_folder import read_scaffold
from gaussian_exporter.contract import Facts
from gaussian_exporter.families.classic import Cloud
from gaussian_exporter.families.hexplane import PLANES, Deformation, export_hexplane
from gaussian_exporter.families.scaffold import Scaffold, export_scaffold
from gaussian_exporter.outputs import Options, save
from gaussian_exporter.pieces.mlp import Linear

FACTS = Facts("Tiled", "not for showing", "see demo/generators/ATTRIBUTION.md", duration=6)
COMPACT = Options(weights="compact")

# Sizes of what scaffold.py and hexplane.py train.
ANCHORS, FEATURES, OFFSETS = 16_000, 32, 5
GAUSSIANS, CHANNELS, WIDTH, RESOLUTIONS, TIMES = 30_000, 16, 64, (32, 64), 25


def repeated(table: np.ndarray, count: int) -> np.ndarray:
    """Rows over and over, `count` of them."""
    return table[np.arange(count) % len(table)]


def aside(positions: np.ndarray, count: int) -> np.ndarray:
    """Positions (count,3): copies on a grid in x and z."""
    copy = np.arange(count) // len(positions)
    side = int(np.ceil(np.sqrt(copy[-1] + 1)))
    step = np.ptp(positions, axis=0).max() * 1.1
    shift = np.stack([copy % side, np.zeros_like(copy), copy // side], 1) * step
    return (repeated(positions, count) + shift).astype(np.float32)


def normal(rng: np.random.Generator, *shape: int, by: float = 1.0) -> np.ndarray:
    """Random numbers around 0."""
    return (by * rng.standard_normal(shape)).astype(np.float32)


def network(rng: np.random.Generator, *widths: int) -> list[Linear]:
    """Layers of these widths, whose numbers stay of the size that they begin with."""
    return [Linear(normal(rng, out, into, by=into**-0.5), normal(rng, out, by=0.1)) for into, out in pairwise(widths)]


def random_scaffold() -> Scaffold:
    """As scaffold.py leaves one."""
    rng, into = np.random.default_rng(0), FEATURES + 3
    return Scaffold(
        anchors=normal(rng, ANCHORS, 3),
        offsets=normal(rng, ANCHORS, OFFSETS, 3),
        features=normal(rng, ANCHORS, FEATURES),
        scales=np.exp(normal(rng, ANCHORS, 6, by=0.5) - 4),
        opacity=network(rng, into, FEATURES, OFFSETS),
        color=network(rng, into, FEATURES, 3 * OFFSETS),
        covariance=network(rng, into, FEATURES, 7 * OFFSETS),
    )


def random_hexplane() -> tuple[Cloud, Deformation]:
    """As hexplane.py leaves one."""
    rng = np.random.default_rng(0)
    cloud = Cloud(
        positions=normal(rng, GAUSSIANS, 3),
        log_scales=normal(rng, GAUSSIANS, 3, by=0.5) - 4,
        rotations=normal(rng, GAUSSIANS, 4),
        opacity_logits=normal(rng, GAUSSIANS, 1),
        sh=normal(rng, GAUSSIANS, 1, 3),
    )
    sizes = [(size, size, size, TIMES) for size in RESOLUTIONS]
    deformation = Deformation(
        box=np.array([[-3.0] * 3, [3.0] * 3], np.float32),
        resolutions=[[1 + normal(rng, CHANNELS, s[b], s[a], by=0.1) for a, b in PLANES] for s in sizes],
        trunk=network(rng, CHANNELS * len(RESOLUTIONS), WIDTH),
        position=network(rng, WIDTH, WIDTH, 3),
        scale=network(rng, WIDTH, WIDTH, 3),
        rotation=network(rng, WIDTH, WIDTH, 4),
    )
    return cloud, deformation


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=("scaffold", "hexplane"))
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("count", type=int)
    parser.add_argument("out", type=Path)
    given = parser.parse_args(argv)
    count, is_random = given.count, given.checkpoint == Path("random")
    if given.family == "scaffold":
        model = random_scaffold() if is_random else read_scaffold(given.checkpoint, 0)
        tables = {name: repeated(getattr(model, name), count) for name in ("offsets", "features", "scales")}
        written = export_scaffold(replace(model, anchors=aside(model.anchors, count), **tables), FACTS, COMPACT)
    else:
        cloud, deformation = random_hexplane() if is_random else read_hexplane(given.checkpoint)
        tables = {name: repeated(getattr(cloud, name), count) for name in vars(cloud) if name != "positions"}
        # Outside the planes their border values continue, at the same cost.
        larger = replace(cloud, positions=aside(cloud.positions, count), **tables)
        written = export_hexplane(larger, deformation, FACTS, COMPACT)
    print(f"{given.out}: {save(written, given.out):,} bytes")


if __name__ == "__main__":
    main()
