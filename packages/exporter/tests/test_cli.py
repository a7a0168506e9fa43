from __future__ import annotations

from pathlib import Path

import onnx
import pytest

from gaussian_exporter.cli import main

from .test_classic import cloud
from .test_hexplane import write_cloud

FIXTURES = Path(__file__).parents[3] / "tests/fixtures"
FACTS = ["--license", "CC0-1.0", "--attribution", "nobody"]


def test_a_scene_is_exported_and_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_cloud(tmp_path / "scene.ply", cloud(50, 1))
    out = tmp_path / "scene.onnx"
    assert main(["classic", str(tmp_path / "scene.ply"), str(out), *FACTS, "--colours", "view"]) == 0
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


def test_what_leaves_the_gpu_is_said_without_a_contract_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rule = FIXTURES / "rules/grid-sample-20.onnx"
    (tmp_path / "a.onnx").write_bytes(rule.read_bytes())
    assert main(["check", str(tmp_path / "a.onnx")]) == 1
    written = capsys.readouterr()
    assert "export opset 18" in written.out and "gaussian_contract" in written.err


def test_what_pages_refuse_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(FIXTURES / "generators/faulty-cast.onnx")]) == 1
    assert "cannot cast" in capsys.readouterr().err
