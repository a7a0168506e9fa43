"""Every family against the classes of its trainer: numbers that the public code wrote on the CPU, of random weights.

A folder of tests/fixtures/oracles is one case: a checkpoint as the trainer saves it, oracle.json (the code that wrote
it and its numbers, the command that reads it, the inputs of each run), and want.npz (the results of that code).
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import pytest

from gaussian_exporter.cli import main
from gaussian_exporter.conformance import check_outputs

from .running import error, parts, run

ORACLES = Path(__file__).parents[3] / "tests/fixtures/oracles"
CASES = sorted(path.parent.name for path in ORACLES.glob("*/oracle.json"))


@pytest.mark.parametrize("name", CASES)
def test_a_family_computes_what_its_trainer_computes(name: str, tmp_path: Path) -> None:
    folder, out = ORACLES / name, tmp_path / "x.onnx"
    case = json.loads((folder / "oracle.json").read_text())
    want = np.load(folder / "want.npz")
    family, *given = (word.replace("{folder}", str(folder)) for word in case["command"])
    source = folder / given.pop(0) if given and not given[0].startswith("-") else folder
    assert main([family, str(source), str(out), "--license", "x", "--attribution", "x", *given]) == 0
    model = onnx.load(out)
    check_outputs(model)
    names = {each.name for each in model.graph.input}
    assert {f"{attribute}.0" for attribute in ("positions", "covariances", "opacities")} <= set(want)
    for i, inputs in enumerate(case["inputs"]):
        found = parts(run(model, {key: value for key, value in inputs.items() if key in names}))
        shown = want[f"shown.{i}"] if f"shown.{i}" in want else np.ones(len(found["positions"]), bool)
        assert np.array_equal(found["opacities"][:, 0] > 0, shown), "rows that are drawn"
        for attribute, values in found.items():
            # Colors of 4DGS depend on the view, which its class leaves to CUDA.
            if shown.any() and f"{attribute}.{i}" in want:
                assert error(values[shown], want[f"{attribute}.{i}"]) < 1e-4, (attribute, inputs)


def test_the_cases_are_there() -> None:
    assert len(CASES) >= 12, CASES
