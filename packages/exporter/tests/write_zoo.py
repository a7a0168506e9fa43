"""Writes the small file of each family, for tests in browsers:
python -m tests.write_zoo ../../tests/fixtures/families"""

from __future__ import annotations

import sys
from pathlib import Path

from .zoo import every_family, halves


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    models = {name: model for name, (model, _) in every_family().items()}
    models |= {f"{name}-half": model for name, model in halves().items()}
    for name, model in models.items():
        (folder / f"{name}.onnx").write_bytes(model.SerializeToString(deterministic=True))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
