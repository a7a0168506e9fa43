"""The file `cfg_args` of INRIA's trainer and its descendants: an argparse Namespace as text, read and not evaluated."""

import ast
from pathlib import Path

from ..errors import ExportError
from .untrusted import read_text


def find_cfg_args(folder: Path) -> Path | None:
    """Path of the file: in the folder itself or, for the folder of an iteration, up to two levels up."""
    around = [folder, *folder.resolve().parents[:2]]
    return next((path for each in around if (path := each / "cfg_args").is_file()), None)


def require_cfg_args(folder: Path, why: str) -> dict[str, object]:
    """Names and values of the settings. Raises checkpoint/incomplete if the file is missing."""
    path = find_cfg_args(folder)
    if path is None:
        raise ExportError(
            "checkpoint/incomplete",
            where=str(folder),
            expected=f"cfg_args in it or up to two folders above it: {why}",
            found="no such file",
            remedy="copy the file that the trainer wrote into the training's folder",
        )
    return read_cfg_args(path)


def read_cfg_args(path: Path) -> dict[str, object]:
    """Names and literal values. An absent file gives no names; values that are not literals are left out."""
    if not path.exists():
        return {}
    text = ""
    try:
        text = read_text(path)
        call = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise _unreadable(path, text) from error
    if not isinstance(call, ast.Call):
        raise _unreadable(path, text)
    return {word.arg: value for word in call.keywords if word.arg for value in _literal(word.value)}


def _literal(node: ast.expr) -> list[object]:
    try:
        return [ast.literal_eval(node)]
    except (ValueError, TypeError, MemoryError, RecursionError):
        return []


def _unreadable(path: Path, text: str) -> ExportError:
    return ExportError(
        "checkpoint/unreadable",
        where=str(path),
        expected="the text Namespace(name=value, ...)",
        found=repr(text[:60]),
        remedy="remove the file and give the facts as options",
    )
