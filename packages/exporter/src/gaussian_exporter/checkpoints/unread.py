"""Requires that each name in a checkpoint was read, or is known to change nothing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from ..errors import ExportError, listed

# Settings of INRIA's trainer for the locations of data, or for reading images.
_SETTINGS = re.compile(
    r"sh_degree|source_path|model_path|images|depths|resolution|white_background|train_test_exp|data_device|eval"
)


def refuse_unread(
    where: str | Path,
    kind: str,
    names: Iterable[str],
    read: Iterable[str],
    *,
    ignored: Sequence[str] = (),
    harmless: str = "(?!)",
    family: str = "an unknown family",
) -> None:
    """Raises checkpoint/other-family for unread names. `kind` is what the names denote, `harmless` is a pattern of
    names that change nothing, `ignored` are names that the user declares as such.
    """
    known, passed = set(read), re.compile(harmless)
    # A file may hold thousands of tensors of one part, so its prefix names them, too.
    unread = [name for name in names if name not in known and not passed.fullmatch(name)]
    unread = [name for name in unread if not any(name == each or name.startswith(f"{each}.") for each in ignored)]
    if unread:
        raise ExportError(
            "checkpoint/other-family",
            where=str(where),
            expected=f"no {kind} but those that this family has",
            found=f"{kind} {listed(unread)}: a checkpoint of {family}",
            remedy=f"if they change nothing that is drawn, give --ignore {','.join(unread[:8])}; if they do, "
            "export the model as a module (gaussian_exporter.export_module)",
        )


def refuse_settings(path: Path, settings: Mapping[str, object], ignored: Sequence[str], harmless: str = "(?!)") -> None:
    """Raises the same error for enabled settings of cfg_args, beside plain Gaussians."""
    # Settings that are off, or "none" as a number, change nothing.
    active = [name for name, value in settings.items() if value not in (None, False, 0, -1, "", [], ())]
    read = [name for name in active if _SETTINGS.fullmatch(name)]
    refuse_unread(path, "settings", active, read, ignored=ignored, harmless=harmless)
