"""The rules of what a run writes are those of the checker of pages and shells: tests/contract/written.test.ts holds it
against the same file."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from gaussian_exporter.arrays import AnyArray
from gaussian_exporter.cli import main
from gaussian_exporter.conformance import check_outputs, faults_of
from gaussian_exporter.errors import ExportError
from gaussian_exporter.infer import infer

FIXTURES = Path(__file__).parents[3] / "tests/fixtures"
CORPUS = json.loads((FIXTURES / "written.json").read_text())


def tensor(dims: list[int], numbers: list[float], dtype: str = "float32") -> AnyArray:
    return np.resize(np.array(numbers, dtype), dims)


@pytest.mark.parametrize("case", CORPUS["cases"], ids=[case["what"] for case in CORPUS["cases"]])
def test_what_is_wrong_with_what_a_run_wrote(case: Any) -> None:
    base = CORPUS["bases"][case["base"]]
    tensors = base["tensors"] | case.get("tensors", {})
    contract = case | {"outputs": base["outputs"] | case.get("outputs", {})}
    found = faults_of(contract, {name: tensor(**given) for name, given in tensors.items() if given})
    assert sorted({f"{fault.code} {fault.tensor}" for fault in found}) == case["faults"]


@pytest.mark.parametrize(("name", "codes"), json.loads((FIXTURES / "verdicts.json").read_text()).items())
def test_both_checkers_say_the_same(name: str, codes: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(FIXTURES / "verdicts" / name)]) == (1 if codes else 0)
    assert sorted(set(re.findall(r"\[(contract/[a-z-]+)\]", capsys.readouterr().err))) == codes


@pytest.mark.parametrize("case", json.loads((FIXTURES / "inference.json").read_text()), ids=lambda case: case["what"])
def test_both_checkers_infer_the_same(case: Any) -> None:
    inputs, outputs = (
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, dims) for name, dims in case[side]]
        for side in ("inputs", "outputs")
    )
    contract, faults = infer(helper.make_model(helper.make_graph([], "g", inputs, outputs)))
    assert sorted(fault.tensor or fault.where for fault in faults) == sorted(case.get("faults", []))
    assert faults or contract == case["contract"]
    assert {fault.code for fault in faults} <= {"inference"}


@pytest.mark.parametrize("name", ["packed", "split", "instances", "state", "frames"])
def test_files_that_keep_their_contract(name: str) -> None:
    assert main(["check", str(FIXTURES / f"generators/{name}.onnx")]) == 0


@pytest.mark.parametrize(
    ("name", "said"), [("values", "a count of"), ("quarter", "0.25 of the time"), ("random", "twice")]
)
def test_files_that_break_it(name: str, said: str) -> None:
    model = onnx.load(FIXTURES / f"generators/faulty-{name}.onnx")
    with pytest.raises(ExportError, match=said):
        check_outputs(model)
