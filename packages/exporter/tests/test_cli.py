from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from gaussian_exporter.cli import main
from gaussian_exporter.conformance import check_outputs, clocks_at, default_feeds
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.classic import export_classic
from gaussian_exporter.outputs import Options, save

from .running import FACTS as SOME_FACTS
from .test_classic import cloud
from .test_hexplane import write_cloud

FIXTURES = Path(__file__).parents[3] / "tests/fixtures"
FACTS = ["--license", "CC0-1.0", "--attribution", "nobody"]


def test_a_scene_is_exported_and_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_cloud(tmp_path / "scene.ply", cloud(50, 1))
    out = tmp_path / "scene.onnx"
    assert main(["classic", str(tmp_path / "scene.ply"), str(out), *FACTS, "--colors", "view"]) == 0
    assert "writes gaussians [50, 13]" in capsys.readouterr().out
    assert main(["check", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "gaussians [50, 13] float32, all checks passed" in printed and "the graph can be captured" in printed


def test_half_floats_are_said_to_need_a_feature(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_cloud(tmp_path / "scene.ply", cloud(50, 1))
    command = ["classic", str(tmp_path / "scene.ply"), str(tmp_path / "a.onnx"), *FACTS, "--dtype", "float16"]
    assert main(command) == 0
    assert "shader-f16" in capsys.readouterr().out


def test_faults_end_with_a_message_and_no_traceback(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.ply").write_bytes(b"version https://git-lfs.github.com/spec/v1\n")
    assert main(["classic", str(tmp_path / "scene.ply"), str(tmp_path / "a.onnx"), *FACTS]) == 1
    assert "found a git-LFS pointer" in capsys.readouterr().err
    assert main(["hexplane", str(tmp_path / "nowhere"), str(tmp_path / "a.onnx"), *FACTS]) == 1
    assert "[checkpoint/not-found]" in capsys.readouterr().err


def test_a_license_must_be_given(tmp_path: Path) -> None:
    with pytest.raises(SystemExit):
        main(["classic", "a.ply", str(tmp_path / "a.onnx")])


def test_a_contract_beside_the_file_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_cloud(tmp_path / "scene.ply", cloud(50, 1))
    assert main(["classic", str(tmp_path / "scene.ply"), str(tmp_path / "m.onnx"), *FACTS]) == 0
    model = onnx.load(tmp_path / "m.onnx")
    [prop] = [each for each in model.metadata_props if each.key == "gaussian_contract"]
    (tmp_path / "m.contract.json").write_text(prop.value)
    del model.metadata_props[:]
    onnx.save(model, tmp_path / "m.onnx")
    assert main(["check", str(tmp_path / "m.onnx")]) == 0
    assert "all checks passed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "family"),
    [("flame_param.npz", "GaussianAvatars"), ("offset.ply", "LAM"), ("other.txt", "unknown avatar")],
)
def test_a_folder_is_no_avatar_file(name: str, family: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / name).write_text("")
    given = ["avatar", str(tmp_path), str(tmp_path / "o.onnx"), "--license", "MIT", "--attribution", "A"]
    assert main(given) == 1
    assert family in capsys.readouterr().err


def test_gaussians_without_a_body_are_no_avatar(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_cloud(tmp_path / "scene.ply", cloud(5, 1))
    assert main(["avatar", str(tmp_path / "scene.ply"), str(tmp_path / "o.onnx"), *FACTS]) == 1
    message = capsys.readouterr().err
    assert "Gaussians at rest need --smplx MODEL.npz" in message and "pickle" not in message


def test_a_byte_order_mark_before_a_ply(tmp_path: Path) -> None:
    write_cloud(tmp_path / "scene.ply", cloud(5, 1))
    (tmp_path / "mark.ply").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "scene.ply").read_bytes())
    assert main(["classic", str(tmp_path / "mark.ply"), str(tmp_path / "o.onnx"), *FACTS]) == 0


def test_what_leaves_the_gpu_is_said_without_a_contract_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rule = FIXTURES / "rules/grid-sample-20.onnx"
    (tmp_path / "a.onnx").write_bytes(rule.read_bytes())
    assert main(["check", str(tmp_path / "a.onnx")]) == 1
    written = capsys.readouterr()
    assert "export opset 18" in written.out and "[contract/inference]" in written.err


def test_a_contract_inferred_from_names_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.onnx").write_bytes((FIXTURES / "generators/canonical.onnx").read_bytes())
    assert main(["check", str(tmp_path / "a.onnx")]) == 0
    printed = capsys.readouterr().out
    assert "inferred from names" in printed and "all checks passed" in printed


def test_what_pages_refuse_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(FIXTURES / "generators/faulty-cast.onnx")]) == 1
    assert "cannot cast" in capsys.readouterr().err


def test_what_cannot_be_written_is_said_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_cloud(tmp_path / "scene.ply", cloud(50, 1))
    before = (tmp_path / "scene.ply").read_bytes()
    for out, found in (("scene.ply", "the file that is read"), ("none/a.onnx", "no folder"), (".", "a folder")):
        assert main(["classic", str(tmp_path / "scene.ply"), str(tmp_path / out), *FACTS]) == 1
        assert f"found {found}" in capsys.readouterr().err
    assert (tmp_path / "scene.ply").read_bytes() == before
    assert main(["check", str(tmp_path)]) == 1
    assert "Is a directory" in capsys.readouterr().err


def test_a_file_that_pages_refuse_is_not_written(tmp_path: Path) -> None:
    model = export_classic(cloud(20, 0), replace(SOME_FACTS, license=""))
    with pytest.raises(ExportError, match=r"contract\.license.*\[contract/schema\]"):
        save(model, tmp_path / "a.onnx")
    assert list(tmp_path.iterdir()) == []


def test_json_that_is_broken_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = export_classic(cloud(20, 0), SOME_FACTS)
    for text in ("{", "[]", '{"version": 1, "instances": 5}'):
        onnx.helper.set_model_props(model, {"gaussian_contract": text})
        onnx.save(model, tmp_path / "a.onnx")
        assert main(["check", str(tmp_path / "a.onnx")]) == 1
        assert "[contract/" in capsys.readouterr().err


def test_an_input_with_a_value_in_the_file_needs_no_other(tmp_path: Path) -> None:
    model = export_classic(cloud(20, 0), SOME_FACTS)
    model.graph.initializer.append(numpy_helper.from_array(np.ones(1, np.float32), "gain"))
    model.graph.input.append(helper.make_tensor_value_info("gain", TensorProto.FLOAT, [1]))
    onnx.save(model, tmp_path / "a.onnx")
    assert main(["check", str(tmp_path / "a.onnx")]) == 0


def test_inputs_without_a_default_are_what_a_page_gives() -> None:
    inputs = {"pose": [2, 4], "turns": [1, 3, 4]}
    values = [helper.make_tensor_value_info(name, TensorProto.FLOAT, dims) for name, dims in inputs.items()]
    model = helper.make_model(helper.make_graph([], "g", values, []))
    bindings = {
        "pose": {"role": "pose", "format": "quaternion", "quaternionOrder": "xyzw"},
        "turns": {"role": "gaussians", "attribute": "rotations", "rotationOrder": "wxyz"},
    }
    feeds = default_feeds(model, {"inputs": bindings})
    assert feeds["pose"].tolist() == [[0, 0, 0, 1]] * 2
    assert feeds["turns"].tolist() == [[[1, 0, 0, 0]] * 3]


def test_the_package_is_a_command_too() -> None:
    ran = subprocess.run([sys.executable, "-m", "gaussian_exporter", "--help"], capture_output=True, text=True)
    assert ran.returncode == 0 and "gaussian-export" in ran.stdout


def test_clocks_show_what_a_page_shows() -> None:
    given: dict[str, Any] = {"t": np.zeros(1, np.float32), "share": np.zeros((1, 1), np.float32)}
    given["index"] = np.zeros(1, np.int64)
    inputs = {
        "t": {"role": "time", "unit": "seconds"},
        "share": {"role": "time", "unit": "normalized"},
        "index": {"role": "frame"},
        "gain": {"role": "control"},
    }
    contract = {"inputs": inputs, "duration": 2.0, "fps": 25}
    for seconds, frame in ((0, 0), (29 / 25, 29), (2.0, 49)):
        found = clocks_at(seconds, contract, given)
        assert found["index"].dtype == np.int64 and found["index"].tolist() == [frame]
        assert found["t"] == np.float32(seconds) and found["share"] == np.float32(seconds / 2)
    assert clocks_at(3, {"inputs": inputs}, {"index": given["index"]})["index"].tolist() == [0]


@pytest.mark.parametrize("layout", ["split", "packed"])
def test_a_wrong_degree_is_named(layout: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = export_classic(cloud(20, 2), SOME_FACTS, Options(layout))
    [prop] = model.metadata_props
    for degree, status in ((2, 0), (1, 1)):
        prop.value = json.dumps({**json.loads(prop.value), "shDegree": degree})
        onnx.save(model, tmp_path / "a.onnx")
        assert main(["check", str(tmp_path / "a.onnx")]) == status
    assert "[contract/sh-degree]" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"<!doctype html><html>", "decode/html"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0", "decode/lfs-pointer"),
        (b"ply\nformat ascii 1.0\n", "decode/unknown-format"),
        (b"\x08\x08\x3a\xff\xff", "graph/invalid"),
    ],
)
def test_files_of_another_kind_have_the_codes_of_pages(
    content: bytes, code: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "x.onnx").write_bytes(content)
    assert main(["check", str(tmp_path / "x.onnx")]) == 1
    assert f"[{code}]" in capsys.readouterr().err


def test_a_tensor_that_no_page_can_hold_is_refused_before_it_is_made(tmp_path: Path) -> None:
    nodes = [
        helper.make_node("ConstantOfShape", ["size"], ["large"]),
        helper.make_node("Slice", ["large", "start", "end"], ["zero"]),
        helper.make_node("Add", ["zero", "row"], ["gaussians"]),
    ]
    row = np.array([[0, 0, 0, 1, 0, 0, 1, 0, 1, 0.5, 0.5, 0.5, 1]], np.float32)
    constants = {"size": np.array([1_600_000_000]), "start": np.array([0]), "end": np.array([1]), "row": row}
    output = helper.make_tensor_value_info("gaussians", TensorProto.FLOAT, [1, 13])
    given = [numpy_helper.from_array(value, name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "large", [], [output], given)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    contract = '{"version":1,"inputs":{},"outputs":{"layout":"packed","gaussians":"gaussians","color":"rgb",'
    helper.set_model_props(model, {"gaussian_contract": contract + '"opacityActivation":"linear"}}'})
    with pytest.raises(ExportError, match=r"large: expected less than 4 GiB in a tensor, found 6,400,000,000 bytes"):
        check_outputs(model)
