"""Files with an axis for instances: three of them in one run are three runs of one each."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

from gaussian_exporter.arrays import AnyArray
from gaussian_exporter.conformance import check_outputs
from gaussian_exporter.contract import METADATA_KEY
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.avatar import export_avatar
from gaussian_exporter.families.classic import export_classic
from gaussian_exporter.families.hexplane import export_hexplane
from gaussian_exporter.graph import INSTANCES, Graph
from gaussian_exporter.header import contract_faults, header_faults
from gaussian_exporter.outputs import Options
from gaussian_exporter.placement import gpu_findings

from . import test_avatar, test_classic, test_hexplane
from .running import FACTS, error, parts, rows, run

ONE, MANY = Options(), Options(instances=8)
CORPUS = json.loads((Path(__file__).parents[3] / "tests/fixtures/instances.json").read_text())


@pytest.mark.parametrize("case", CORPUS["cases"], ids=[case["what"] for case in CORPUS["cases"]])
def test_the_rules_of_the_axis_are_those_of_the_checker_of_pages(case: Any) -> None:
    # tests/contract/instances.test.ts holds the other checker against the same file.
    contract = {key: value for key, value in (CORPUS["contract"] | case.get("contract", {})).items() if value}

    def declared(name: str, dims: list[int | str], dtype: str = "float32") -> onnx.ValueInfoProto:
        return onnx.helper.make_tensor_value_info(name, onnx.helper.np_dtype_to_tensor_dtype(np.dtype(dtype)), dims)

    inputs, outputs = ([declared(*each) for each in case[end]] for end in ("inputs", "outputs"))
    graph = onnx.helper.make_graph([], "declared", inputs, outputs)
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    faults = [*contract_faults(contract), *header_faults(model, contract, Path())]
    assert sorted(f"{fault.code} {fault.tensor or fault.where}" for fault in faults) == case["faults"]


def body(options: Options, **how: Any) -> onnx.ModelProto:
    rng = np.random.default_rng(8)
    model = test_avatar.avatar(
        degree=2,
        shape_directions=(rng.normal(size=(80, 3, 5)) * 0.1).astype(np.float32),
        joint_directions=(rng.normal(size=(8, 3, 5)) * 0.1).astype(np.float32),
        expression_directions=(rng.normal(size=(80, 3, 4)) * 0.1).astype(np.float32),
        pose_directions=(rng.normal(size=(80, 3, 63)) * 0.02).astype(np.float32),
    )
    return export_avatar(model, FACTS, options, **how)


def given_to_body(joint: int, seed: int) -> dict[str, AnyArray]:
    rng = np.random.default_rng(seed)
    shapes = {"pose": (8, joint), "translation": (3,), "shape": (5,), "expression": (4,), "camera_position": (3,)}
    return {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}


def plain_body(options: Options) -> onnx.ModelProto:
    # Joints that no coefficient moves: all instances have the same.
    return export_avatar(test_avatar.avatar(), FACTS, options)


def plant(options: Options) -> onnx.ModelProto:
    heads = {"mask": (12, 12, 1), "opacity": (12, 12, 1)}
    rng = np.random.default_rng(5)
    moving = test_hexplane.deformation(**{k: test_hexplane.layers(rng, *v) for k, v in heads.items()})
    return export_hexplane(test_hexplane.small(), moving, FACTS, options)


def half_still_plant(options: Options) -> onnx.ModelProto:
    moving = replace(test_hexplane.deformation(), scale=None, rotation=None)
    return export_hexplane(test_hexplane.small(), moving, FACTS, options)


CASES: dict[str, Any] = {
    "avatar": (body, lambda seed: given_to_body(3, seed)),
    "avatar, quaternions": (
        lambda options: body(options, pose_format="quaternion"),
        lambda seed: given_to_body(4, seed),
    ),
    "avatar, pose alone": (
        plain_body,
        lambda seed: {name: given_to_body(3, seed)[name] for name in ("pose", "translation")},
    ),
    "hexplane": (plant, lambda seed: {"time": np.array([0.3 * seed], np.float32)}),
    "hexplane, scales at rest": (half_still_plant, lambda seed: {"time": np.array([0.2 * seed], np.float32)}),
}


@pytest.mark.parametrize("name", CASES)
def test_three_at_once_are_three_one_by_one(name: str) -> None:
    build, given = CASES[name]
    one, many = build(ONE), build(MANY)
    feeds = [given(seed) for seed in range(3)]
    together = run(many, {key: np.stack([each[key] for each in feeds]) for key in feeds[0]})
    for index, given_alone in enumerate(feeds):
        expected = run(one, given_alone)
        for part, values in parts(expected).items():
            assert error(parts(of_instance(together, index))[part], values) < 1e-6, part
    assert np.abs(together["positions"][0] - together["positions"][2]).max() > 0.01
    # Alone in a run of one, too.
    alone = run(many, {key: value[None] for key, value in feeds[1].items()})
    assert error(rows(of_instance(alone, 0)), rows(run(one, feeds[1]))) < 1e-6


def of_instance(written: dict[str, AnyArray], index: int) -> dict[str, AnyArray]:
    return {name: values[index] for name, values in written.items()}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("options", [MANY, replace(MANY, layout="split"), replace(MANY, dtype="float16")])
def test_the_file_declares_the_axis_and_stays_on_the_gpu(name: str, options: Options) -> None:
    model = CASES[name][0](options)
    contract = json.loads({prop.key: prop.value for prop in model.metadata_props}[METADATA_KEY])
    assert contract["instances"] == {"axis": "B", "most": 8}
    for value in [*model.graph.input, *model.graph.output]:
        dims = value.type.tensor_type.shape.dim
        assert dims[0].dim_param == "B" and all(dim.dim_value > 0 for dim in dims[1:]), value.name
    check_outputs(model)
    halves = [finding for finding in gpu_findings(model) if "shader-f16" not in finding.reason]
    assert halves == []


def test_files_without_the_axis_are_as_they_were_and_say_so() -> None:
    with pytest.raises(ExportError, match=r"avatar, hexplane or spacetime.*found classic.*\[argument/value\]"):
        export_classic(test_classic.cloud(), FACTS, MANY)
    model = body(ONE)
    assert all(dim.dim_param == "" for value in model.graph.input for dim in value.type.tensor_type.shape.dim)
    assert "instances" not in json.loads({prop.key: prop.value for prop in model.metadata_props}[METADATA_KEY])


def test_sizes_that_hang_on_the_instances_are_left_to_the_runtime() -> None:
    graph = Graph("sizes", instances=True)
    x = graph.input("x", *graph.lead, 6)
    graph.output("y", x.reshape(INSTANCES * 2, 3).reshape(*graph.lead, 3, 2))
    values = np.arange(12).reshape(2, 6)
    assert np.array_equal(run(graph.model({}), {"x": values})["y"], values.reshape(2, 3, 2))
