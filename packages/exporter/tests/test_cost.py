"""Cost of a run: counted by hand on small graphs, and tested for the included families."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest

from gaussian_exporter.cli import main
from gaussian_exporter.cost import BYTES_PER_SECOND, MICROSECONDS_PER_DISPATCH, cost_of, report
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.scaffold import export_scaffold
from gaussian_exporter.graph import Graph
from gaussian_exporter.outputs import Options

from . import test_scaffold
from .running import FACTS
from .zoo import every_family


def graph(instances: bool = False) -> tuple[Graph, onnx.ModelProto]:
    """A row times a table, in another shape: the table is a sum of constants, which costs nothing in a run."""
    made = Graph("counted", instances=instances)
    x = made.input("x", *made.lead, 1, 8)
    table = made.constant(np.ones((8, 40)), "table") + made.constant(np.full((8, 40), 2.0), "more")
    y = (x @ table).unary("Relu").reshape(*made.lead, 5, 8)
    made.output("y", y)
    return made, made.model({})


def test_a_graph_counted_by_hand() -> None:
    cost = cost_of(graph()[1])
    assert [(node.operator, node.dispatches, node.read, node.written) for node in cost.nodes] == [
        ("MatMul", 1, 4 * (8 + 8 * 40), 4 * 40),
        ("Relu", 1, 4 * 40, 4 * 40),
        ("Reshape", 1, 4 * 40, 4 * 40),
    ]
    # Tiles are computed whole: 32 rows for one, 64 columns for 40.
    assert cost.flops == 2 * 32 * 64 * 8
    assert cost.nodes[2].remark == "a copy into an output, lost in recorded runs"
    expected = cost.dispatches * MICROSECONDS_PER_DISPATCH + 1e6 * cost.bytes / BYTES_PER_SECOND
    assert cost.milliseconds == pytest.approx(expected / 1000)


def test_instances_are_counted() -> None:
    one, ten = (cost_of(graph(instances=True)[1], count) for count in (1, 10))
    assert ten.nodes[1].written == 10 * one.nodes[1].written and ten.dispatches == one.dispatches


def test_shapes_in_between_cost_nothing_and_slow_kernels_are_named() -> None:
    made = Graph("broadcast")
    x = made.input("x", 9, 3)
    y = x.reshape(9, 3, 1) * made.constant(np.ones((3, 2)), "table") * made.constant(np.ones((3, 1)), "column")
    made.output("y", (y.reshape(54) + 1.0))
    nodes = cost_of(made.model({})).nodes
    assert [node.dispatches for node in nodes] == [0, 1, 1, 0, 1]
    assert "looked up separately" in nodes[1].remark and nodes[4].remark == ""


def test_unknown_sizes_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = graph()[1]
    model.graph.node[1].op_type, model.graph.node[1].domain = "Mystery", "com.nobody"
    with pytest.raises(ExportError, match=r"\[graph/invalid\]"):
        cost_of(model)
    model = graph(instances=True)[1]
    for value in [*model.graph.input, *model.graph.output]:
        value.type.tensor_type.shape.dim[0].dim_param = "rows"
    with pytest.raises(ExportError, match="fixed shapes"):
        cost_of(model)
    onnx.save(graph()[1], tmp_path / "a.onnx")
    assert main(["cost", str(tmp_path / "a.onnx"), "--rows", "1"]) == 0
    printed = capsys.readouterr().out
    assert "and 2 more" in printed and "3 dispatches" in printed
    assert main(["cost", str(tmp_path / "b.onnx")]) == 1
    assert "[checkpoint/not-found]" in capsys.readouterr().err


@pytest.mark.parametrize("name", list(every_family()))
def test_nothing_is_copied_into_an_output_where_recordings_would_lose_it(name: str) -> None:
    model, _ = every_family()[name]
    if model.graph.input:
        assert [node.name for node in cost_of(model, 2).nodes if "lost" in node.remark] == []
        made = {name for node in model.graph.node for name in node.output}
        constants = {each.name for each in model.graph.initializer}
        assert all(output.name in made - constants for output in model.graph.output)
        assert len(list(report(cost_of(model, 2)))) > 3


@pytest.mark.parametrize(
    ("name", "dispatches"),
    [("hexplane", 29), ("avatar", 49), ("avatar-instances", 51), ("octree-round", 34), ("scaffold", 36)],
)
def test_families_take_no_more_dispatches_than_they_did(name: str, dispatches: int) -> None:
    assert cost_of(every_family()[name][0], 2).dispatches <= dispatches


def test_split_costs_half_of_packed() -> None:
    model = test_scaffold.scaffold(count=4000, k=10, width=32)
    split, packed = (cost_of(export_scaffold(model, FACTS, Options(layout))) for layout in ("split", "packed"))
    assert split.dispatches <= 23 and split.bytes < 0.5 * packed.bytes
