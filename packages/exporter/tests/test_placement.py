from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import onnx
import onnx.defs
import pytest
from onnx import TensorProto, helper, numpy_helper

from gaussian_exporter.arrays import AnyArray
from gaussian_exporter.conformance import check_outputs
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.classic import export_classic
from gaussian_exporter.graph import Graph
from gaussian_exporter.outputs import Options
from gaussian_exporter.placement import KERNELS, Finding, finding_lines, gpu_findings

from .running import FACTS
from .test_classic import cloud
from .zoo import every_family


def made(
    nodes: list[onnx.NodeProto],
    constants: dict[str, AnyArray] | None = None,
    size: int | str = 8,
    opset: int = 17,
    kind: int = TensorProto.FLOAT,
) -> onnx.ModelProto:
    """A model x [size, 4] -> y with the given nodes."""
    given = [numpy_helper.from_array(value, name) for name, value in (constants or {}).items()]
    x = helper.make_tensor_value_info("x", kind, [size, 4])
    y = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
    graph = helper.make_graph(nodes, "g", [x], [y], given)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)


def found(model: onnx.ModelProto) -> set[tuple[str, str]]:
    return {(finding.kind, finding.operator) for finding in gpu_findings(model) if finding.operator != "shape"}


@pytest.mark.parametrize("name", list(every_family()))
def test_every_family_stays_on_the_gpu(name: str) -> None:
    model, _ = every_family()[name]
    assert [str(finding) for finding in gpu_findings(model) if finding.kind != "inexact"] == []


def test_outputs_that_a_recording_would_lose_are_named() -> None:
    shape: dict[str, AnyArray] = {"shape": np.array([4, 8])}
    last = helper.make_node("Reshape", ["x", "shape"], ["y"])
    assert ("slow", "Reshape") in found(made([last], shape))
    first = helper.make_node("Reshape", ["x", "shape"], ["z"])
    assert ("slow", "Reshape") not in found(made([first, helper.make_node("Relu", ["z"], ["y"])], shape))
    constant = made([helper.make_node("Identity", ["c"], ["y"])], {"c": np.ones((2, 2), np.float32)})
    assert not any(kind == "slow" for kind, _ in found(constant))


@pytest.mark.parametrize("name", list(every_family()))
def test_every_family_keeps_the_contract(name: str) -> None:
    model, _ = every_family()[name]
    assert all(np.isfinite(values).all() for values in check_outputs(model).values())


def test_what_falls_back_is_named_with_what_to_write_instead() -> None:
    mask = helper.make_node("Compress", ["x", "m"], ["c"], axis=0, name="dead")
    turn = helper.make_node("Round", ["c"], ["y"], name="whole")
    findings = gpu_findings(made([mask, turn], {"m": np.ones(8, bool)}))
    named = {finding.node: str(finding) for finding in findings}
    assert "opacity 0" in named["dead"] and "Floor(x + 0.5)" in named["whole"]


def test_operators_after_their_last_kernel() -> None:
    plane: dict[str, AnyArray] = {"plane": np.zeros((1, 1, 4, 4), np.float32), "s": np.array([1, 8, 2, 2], np.int64)}
    for opset, mode, expected in ((17, "bilinear", set()), (20, "linear", {("fallback", "GridSample")})):
        nodes = [
            helper.make_node("Reshape", ["x", "s"], ["grid"]),
            helper.make_node("GridSample", ["plane", "grid"], ["y"], mode=mode),
        ]
        assert found(made(nodes, plane, opset=opset)) == expected


def test_int64_arithmetic_but_not_indices() -> None:
    nodes = [
        helper.make_node("ArgMax", ["x"], ["i"], axis=1, keepdims=0),
        helper.make_node("Unsqueeze", ["i", "axis"], ["j"]),
        helper.make_node("Gather", ["table", "j"], ["y"]),
    ]
    constants: dict[str, AnyArray] = {"axis": np.array([1], np.int64), "table": np.ones((4, 2), np.float32)}
    assert found(made(nodes, constants)) == {("fallback", "Unsqueeze")}


def test_arithmetic_of_constants_does_not_count() -> None:
    nodes = [helper.make_node("Round", ["c"], ["r"]), helper.make_node("Add", ["x", "r"], ["y"])]
    assert found(made(nodes, {"c": np.ones(4, np.float32)})) == set()


def test_wide_splits_and_long_sums() -> None:
    parts = [f"p{i}" for i in range(12)]
    split = helper.make_node("Split", ["x"], parts, axis=0)
    join = helper.make_node("Concat", parts, ["y"], axis=0)
    assert found(made([split, join], size=12)) == {("failure", "Split")}
    total = helper.make_node("CumSum", ["x", "axis"], ["y"])
    axis = {"axis": np.array(0, np.int64)}
    assert found(made([total], axis, size=100)) == set()
    assert found(made([total], axis, size=100_000)) == {("slow", "CumSum")}


def test_convolutions_that_come_out_wrong() -> None:
    for inputs, expected in ((6, {("wrong", "Conv")}), (8, set()), (3, set()), (5, set())):
        weight: dict[str, AnyArray] = {"w": np.zeros((8, inputs, 3, 3), np.float32)}
        weight["s"] = np.array([1, inputs, 4, 4], np.int64)
        nodes = [helper.make_node("Reshape", ["x", "s"], ["p"]), helper.make_node("Conv", ["p", "w"], ["y"])]
        assert found(made(nodes, weight, size=inputs * 4)) == expected


def test_symbolic_sizes_half_floats_and_foreign_operators() -> None:
    relu = helper.make_node("Relu", ["x"], ["y"])
    assert any("cannot be recorded" in str(finding) for finding in gpu_findings(made([relu], size="n")))
    assert ("failure", "type") in found(export_classic(cloud(), FACTS, Options(dtype="float16")))
    assert found(made([helper.make_node("Magic", ["x"], ["y"], domain="com.nobody")])) == {("failure", "Magic")}


def test_outputs_that_break_the_contract_are_named() -> None:
    def rows(covariance: list[float], opacity: float) -> onnx.ModelProto:
        graph = Graph("broken")
        scale = graph.input("scale", 1)
        graph.output("gaussians", graph.constant(np.array([[0.0] * 3 + covariance + [0.5] * 3 + [opacity]])) * scale)
        contract = (
            '{"version":1,"inputs":{"scale":{"role":"control","range":[0,1],"default":1}},'
            '"outputs":{"layout":"packed","gaussians":"gaussians","color":"rgb","opacityActivation":"linear"}}'
        )
        return graph.model({"gaussian_contract": contract})

    good = [1.0, 0, 0, 1, 0, 1]
    assert check_outputs(rows(good, 1.0))["gaussians"].shape == (1, 13)
    with pytest.raises(ExportError, match=r"opacities of row 0 .*an opacity of 0 to 1, found 1.5\. "):
        check_outputs(rows(good, 1.5))
    with pytest.raises(ExportError, match=r"covariances of row 0 .*positive semi-definite"):
        check_outputs(rows([1.0, 2, 0, 1, 0, 1], 1.0))
    infinite = {"scale": np.array([np.inf], np.float32)}
    with pytest.raises(
        ExportError, match=r"output gaussians, positions of row 0 \(run with defaults\): expected finite numbers"
    ):
        check_outputs(rows(good, 1.0), infinite)


def test_what_one_change_mends_is_said_once() -> None:
    one = Finding("fallback", "a", "Add", "x is int64", "compute in int32", "x")
    other = Finding("fallback", "b", "NonZero", "no kernel", "keep every row", "y")
    lines = finding_lines([one, other, one, one])
    assert lines == [f"{one} (and 2 more of this kind)", str(other)]


def test_the_list_of_kernels_names_operators_that_exist() -> None:
    assert {schema.name for schema in onnx.defs.get_all_schemas()} >= KERNELS


FIXTURES = Path(__file__).parents[3] / "tests/fixtures"
# Its weights are known to shape inference alone, which a page has not: there the comparison with the CPU finds it.
ONLY_INFERRED = "generators/spelled-hidden.onnx"


def findings_of(path: Path) -> list[list[str]]:
    model = onnx.load(str(path), load_external_data=False)
    found = [f for f in gpu_findings(model) if (f.kind, f.operator) != ("failure", "Cast")]
    return sorted([f.kind, f.operator, f.tensor] for f in found)


def test_both_checkers_are_one_rule_set_on_one_corpus() -> None:
    """tests/onnx/webgpu-rules.test.ts holds the checker of pages and shells against the same file."""
    paths = sorted(FIXTURES.glob("*/*.onnx"))
    found = {str(path.relative_to(FIXTURES)): findings_of(path) for path in paths}
    assert ["wrong", "Conv", "y"] in found.pop(ONLY_INFERRED)
    rules = {name: rows for name, rows in found.items() if name.startswith("rules/")}
    assert len(rules) > 20 and all(("kept-" in name) == (not rows) for name, rows in rules.items())
    expected = FIXTURES / "gpu-findings.json"
    if os.environ.get("WRITE_FINDINGS"):
        lines = [f"  {json.dumps(name)}: {json.dumps(rows)}" for name, rows in found.items()]
        expected.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    assert found == json.loads(expected.read_text())
