"""Files whose tables lie in 16 bits: fewer bytes, the same generator."""

from __future__ import annotations

import numpy as np
import onnx
import pytest

from gaussian_exporter.conformance import check_outputs
from gaussian_exporter.families.classic import Cloud, export_classic
from gaussian_exporter.graph import Errors, Graph
from gaussian_exporter.outputs import Options
from gaussian_exporter.placement import gpu_findings

from .running import FACTS, parts, run
from .test_classic import cloud


def large() -> Cloud:
    return cloud(3000, 1)


def test_tables_take_fewer_bytes_and_stay_float32_in_use() -> None:
    whole, compact = (export_classic(large(), FACTS, Options(weights=w)) for w in ("float32", "compact"))
    assert compact.ByteSize() < 0.7 * whole.ByteSize()
    assert gpu_findings(compact) == []
    check_outputs(compact)
    wide, close = (parts(run(model, {})) for model in (whole, compact))
    reach = np.ptp(wide["positions"], axis=0).max()
    # Places are evenly spaced: half a step of 65,535 to the reach, and float32's own rounding.
    assert np.abs(wide["positions"] - close["positions"]).max() < reach / 65535
    # Rounded, covariances of needles would have negative eigenvalues.
    assert np.array_equal(wide["covariances"], close["covariances"])
    assert np.abs(wide["opacities"] - close["opacities"]).max() <= 2**-11


@pytest.mark.parametrize("errors", ["even", "relative"])
def test_what_is_constant_or_zero_stays_so(errors: Errors) -> None:
    table = np.zeros((2000, 3))
    table[:, 1] = 0.25
    table[5, 2] = 1
    graph = Graph("test", "compact")
    graph.output("out", graph.constant(table, "table", errors=errors) * 1.0)
    found = run(graph.model({}), {})["out"]
    assert np.array_equal(found, table.astype(np.float32))


def test_what_the_web_cannot_cast_is_found() -> None:
    table = onnx.numpy_helper.from_array(np.zeros((4, 4), np.uint16), "table")
    nodes = [onnx.helper.make_node("Cast", ["table"], ["out"], name="cast", to=onnx.TensorProto.FLOAT)]
    out = onnx.helper.make_tensor_value_info("out", onnx.TensorProto.FLOAT, [4, 4])
    opset = onnx.helper.make_opsetid("", 17)
    model = onnx.helper.make_model(onnx.helper.make_graph(nodes, "g", [], [out], [table]), opset_imports=[opset])
    model.ir_version = 8
    assert [(finding.kind, finding.operator) for finding in gpu_findings(model)] == [("failure", "Cast")]


def test_small_tables_and_numbers_too_large_for_16_bits_stay_float32() -> None:
    graph = Graph("test", "compact")
    small, huge = np.full((10, 3), 1 / 3), np.full((3000, 2), 1e6)
    graph.output("small", graph.constant(small, "small") * 1.0)
    graph.output("huge", graph.constant(huge, "huge") * 1.0)
    found = run(graph.model({}), {})
    assert np.array_equal(found["small"], small.astype(np.float32)) and np.array_equal(found["huge"], np.float32(huge))
