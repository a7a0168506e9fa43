"""Every family on ONNX Runtime's native WebGPU provider, where onnxruntime-webgpu is installed instead of onnxruntime:
`npm run test:exporter -- --webgpu`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime as ort
import pytest
from onnx import helper

from gaussian_exporter.arrays import AnyArray
from gaussian_exporter.placement import gpu_findings

from .running import activated, error, run
from .test_placement import made
from .zoo import every_family

pytestmark = pytest.mark.skipif(
    "WebGpuExecutionProvider" not in ort.get_available_providers(),
    reason="onnxruntime has no WebGPU provider: npm run test:exporter -- --webgpu",
)
# SwiftShader's sine and cosine are good to 1e-4 only; a hardware GPU's and every other operator's to 1e-6.
TOLERANCE = {"avatar": 3e-3}


def placed(
    model: onnx.ModelProto, feeds: dict[str, AnyArray], folder: Path
) -> tuple[dict[str, AnyArray], dict[str, str]]:
    """Outputs, and the provider of every node that ran."""
    options = ort.SessionOptions()
    options.enable_profiling = True
    options.profile_file_prefix = str(folder / "profile")
    providers = ["WebGpuExecutionProvider", "CPUExecutionProvider"]
    session = ort.InferenceSession(model.SerializeToString(), options, providers=providers)
    given = {key: np.asarray(value, np.float32) for key, value in feeds.items()}
    names = [output.name for output in session.get_outputs()]
    outputs = dict(zip(names, session.run(None, given), strict=True))
    events: list[dict[str, Any]] = json.loads(Path(session.end_profiling()).read_text())
    suffix = "_kernel_time"
    ran = {e["name"].removesuffix(suffix): e["args"]["provider"] for e in events if e["name"].endswith(suffix)}
    return outputs, ran


@pytest.mark.parametrize("name", list(every_family()))
def test_all_nodes_are_placed_on_the_gpu_and_agree_with_the_cpu(name: str, tmp_path: Path) -> None:
    model, feeds = every_family()[name]
    raw, providers = placed(model, feeds, tmp_path)
    found = activated(model, raw)
    for key, values in run(model, feeds).items():
        assert error(found[key].reshape(len(values), -1), values.reshape(len(values), -1)) < TOLERANCE.get(
            name.removesuffix("-instances"), 1e-5
        )
    assert {node: where for node, where in providers.items() if where != "WebGpuExecutionProvider"} == {}
    # A constant file has no nodes left once it is loaded.
    assert providers or not model.graph.input


def test_nodes_that_are_said_to_fall_back_do(tmp_path: Path) -> None:
    nodes = [
        helper.make_node("Round", ["x"], ["whole"], name="whole"),
        helper.make_node("ArgMax", ["whole"], ["i"], axis=1, keepdims=0, name="best"),
        helper.make_node("Unsqueeze", ["i", "axis"], ["j"], name="column"),
        helper.make_node("Gather", ["table", "j"], ["picked"], name="pick"),
        helper.make_node("Compress", ["picked", "mask"], ["y"], axis=0, name="dead"),
    ]
    constants: dict[str, AnyArray] = {
        "axis": np.array([1], np.int64),
        "table": np.ones((4, 2), np.float32),
        "mask": np.arange(8) % 2 == 0,
    }
    model = made(nodes, constants)
    said = {
        finding.node for finding in gpu_findings(model) if finding.kind == "fallback" and finding.operator != "shape"
    }
    _, providers = placed(model, {"x": np.random.default_rng(0).random((8, 4))}, tmp_path)
    assert said == {node for node, where in providers.items() if where == "CPUExecutionProvider"}
    assert said == {"whole", "column", "dead"}
