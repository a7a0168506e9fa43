"""Errors for users: place, expected and found state, and remedy, with a stable code."""

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Literal

ErrorCode = Literal[
    "checkpoint/not-found",  # a file of the checkpoint is not there
    "checkpoint/unreadable",  # not the format it should be, truncated, or it holds more than data
    "checkpoint/incomplete",  # a known format without something the model needs
    "checkpoint/mismatch",  # two parts of a checkpoint contradict one another
    "checkpoint/unsupported",
    "checkpoint/other-family",  # a known model with a part that has no exporter
    "argument/value",  # an option outside its range
    "argument/package",  # a call that needs a package that is not installed
    "graph/invalid",  # a graph that ONNX refuses
    "graph/parts",  # a tensor above a limit of bytes, whose operators cannot be split
]


class ExportError(Exception):
    """Base of all errors of the exporter. `code` is stable and meant for programs; the text is meant for readers."""

    def __init__(self, code: ErrorCode | str, *, where: str, expected: str, found: str, remedy: str):
        """Every part is a full phrase without a trailing full stop. `code`: an ErrorCode, or the code of a contract
        fault: `contract/...`, as in the checker of pages.
        """
        super().__init__(f"{where}: expected {expected}, found {found}. {remedy[:1].upper()}{remedy[1:]}. [{code}]")
        self.code = code
        self.where = where
        self.expected = expected
        self.found = found
        self.remedy = remedy


def require_package(name: str, extra: str) -> None:
    """Raises argument/package if a package that only some calls need is missing. `extra` installs it."""
    if find_spec(name) is None:
        raise ExportError(
            "argument/package",
            where="this Python",
            expected=f"the package {name}",
            found="none",
            remedy=f"pip install 'gaussian-splat-exporter[{extra}]'",
        )


def listed(names: Sequence[str], limit: int = 8) -> str:
    """Names for a message, at most `limit` of them."""
    shown = ", ".join(list(names)[:limit])
    return f"{shown} and {len(names) - limit} more" if len(names) > limit else shown or "nothing"
