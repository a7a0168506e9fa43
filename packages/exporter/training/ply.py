"""Writing PLY files of one float property for each column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from torch import Tensor


def write_ply(path: Path, groups: dict[str, Tensor]) -> None:
    """Groups of columns (N,n): `name_` gives name_0, name_1, ...; a comma-separated name gives each column its own."""
    path.parent.mkdir(parents=True, exist_ok=True)
    names: list[str] = []
    for name, table in groups.items():
        names += name.split(",") if not name.endswith("_") else [f"{name}{i}" for i in range(table.shape[1])]
    rows = np.concatenate([table.detach().cpu().numpy() for table in groups.values()], 1).astype("<f4")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    header += [f"property float {name}" for name in names] + ["end_header", ""]
    path.write_bytes("\n".join(header).encode() + rows.tobytes())
