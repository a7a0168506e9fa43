"""Finding the files of a checkpoint."""

import re
from pathlib import Path

from ..errors import ExportError, listed


def existing(path: Path, what: str) -> Path:
    """The path, if it exists."""
    if path.exists():
        return path
    there = sorted(item.name for item in path.parent.iterdir()) if path.parent.is_dir() else []
    raise ExportError(
        "checkpoint/not-found",
        where=str(path),
        expected=what,
        found=f"no such file; beside it lie {listed(there)}",
        remedy="give the folder that the trainer wrote, or the file itself",
    )


def latest_iteration(folder: Path, inside: str = "point_cloud") -> Path:
    """The folder `inside`/iteration_N with the largest N, or `folder` itself without any."""
    found = [(int(match[1]), path) for path in folder.glob(f"{inside}/iteration_*") if (match := _number(path))]
    return max(found)[1] if found else folder


def _number(path: Path) -> re.Match[str] | None:
    return re.fullmatch(r"(?:coarse_)?iteration_(\d+)", path.name)
