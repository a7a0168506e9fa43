"""A trained model, larger: python tile.py scaffold|hexplane CHECKPOINT COUNT OUT.onnx

For measuring time only: anchors or Gaussians of the checkpoint are repeated, moved aside, until there are COUNT.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gaussian_exporter.checkpoints.hexplane_folder import read_hexplane
from gaussian_exporter.checkpoints.scaffold_folder import read_scaffold
from gaussian_exporter.contract import Facts
from gaussian_exporter.families.hexplane import export_hexplane
from gaussian_exporter.families.scaffold import export_scaffold
from gaussian_exporter.outputs import Options, save

FACTS = Facts("Tiled", "not for showing", "see demo/generators/ATTRIBUTION.md", duration=6)
COMPACT = Options(weights="compact")


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


def main(argv: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=("scaffold", "hexplane"))
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("count", type=int)
    parser.add_argument("out")
    given = parser.parse_args(argv)
    count = given.count
    if given.family == "scaffold":
        model = read_scaffold(given.checkpoint, 0)
        tables = {name: repeated(getattr(model, name), count) for name in ("offsets", "features", "scales")}
        written = export_scaffold(replace(model, anchors=aside(model.anchors, count), **tables), FACTS, COMPACT)
    else:
        cloud, deformation = read_hexplane(given.checkpoint)
        tables = {name: repeated(getattr(cloud, name), count) for name in vars(cloud) if name != "positions"}
        # Beyond the planes their border goes on, at the same cost.
        larger = replace(cloud, positions=aside(cloud.positions, count), **tables)
        written = export_hexplane(larger, deformation, FACTS, COMPACT)
    print(f"{given.out}: {save(written, given.out):,} bytes")


if __name__ == "__main__":
    main()
