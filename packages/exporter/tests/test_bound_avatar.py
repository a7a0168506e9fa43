"""GaussianAvatars: Gaussians on triangles of the user's own head. tests/test_oracles.py has the numbers."""

from __future__ import annotations

import json
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import onnx
import pytest

from gaussian_exporter.checkpoints.body_model import read_bound
from gaussian_exporter.cli import main
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.bound_avatar import export_bound
from gaussian_exporter.outputs import Options
from gaussian_exporter.placement import gpu_findings

from .running import FACTS, error, rows, run

CASE = Path(__file__).parents[3] / "tests/fixtures/oracles/gaussian-avatars"
GIVEN = ["--license", "MIT", "--attribution", "A"]


def changed(path: Path, **arrays: Any) -> None:
    """Replaces arrays of a .npz file; None removes one."""
    with np.load(path) as archive:
        found = dict(archive) | arrays
    np.savez(path, **{name: value for name, value in found.items() if value is not None})


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """A writable copy of the oracle's folder, in the layout of a training."""
    copytree(CASE, tmp_path / "out/point_cloud/iteration_600000")
    return tmp_path / "out"


def inputs(index: int = 1) -> dict[str, Any]:
    given: dict[str, Any] = json.loads((CASE / "oracle.json").read_text())["inputs"][index]
    return given


def test_the_folder_of_a_training_becomes_a_head(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = case / "head.onnx"
    [mesh] = case.rglob("head.npz")
    assert main(["avatar", str(case), str(out), "--smplx", str(mesh), *GIVEN]) == 0
    assert "the graph can be captured" in capsys.readouterr().out
    assert main(["check", str(out)]) == 0
    model = onnx.load(out)
    contract = json.loads(model.metadata_props[0].value)
    assert contract["coordinates"]["up"] == "+y"
    assert contract["inputs"]["pose"]["joints"] == ["global", "neck", "jaw", "left_eye", "right_eye"]
    assert list(contract["inputs"]) == ["pose", "expression", "translation"]
    assert contract["shDegree"] == 1
    low, high = (np.array(contract["bounds"][side]) for side in ("min", "max"))
    still = run(model, inputs(0))["positions"]
    assert np.abs(still.min(0) - low).max() < 1e-5 and np.abs(still.max(0) - high).max() < 1e-5
    assert main(["classic", str(case), str(out), *GIVEN]) == 1
    assert "GaussianAvatars" in capsys.readouterr().err


def test_a_head_in_the_layout_of_flame_gives_the_same(case: Path) -> None:
    [cloud], [mesh] = case.rglob("point_cloud.ply"), case.rglob("head.npz")
    wanted = rows(run(export_bound(read_bound(cloud, mesh), FACTS), inputs()))
    with np.load(mesh) as archive:
        found = dict(archive)
    bends = found.pop("posedirs")
    parents = found.pop("parents").astype(np.uint32)
    own = {
        "posedirs": bends.reshape(len(bends), -1, 3).transpose(1, 2, 0),
        "kintree_table": np.stack([parents, np.arange(len(parents))]),
        "weights": found.pop("lbs_weights"),
        "f": found.pop("faces"),
    }
    np.savez(mesh, **found, **own)
    assert np.array_equal(rows(run(export_bound(read_bound(cloud, mesh), FACTS), inputs())), wanted)


def test_fewer_expressions_and_less_of_a_file(case: Path) -> None:
    [cloud], [mesh] = case.rglob("point_cloud.ply"), case.rglob("head.npz")
    given = inputs()
    few = read_bound(cloud, mesh, expressions=3)
    cut = {**given, "expression": given["expression"][:3] + [0] * 5}
    whole = export_bound(read_bound(cloud, mesh), FACTS)
    found = rows(run(export_bound(few, FACTS), {**given, "expression": given["expression"][:3]}))
    assert error(found, rows(run(whole, cut))) < 1e-5
    several = export_bound(read_bound(cloud, mesh), FACTS, Options(instances=4))
    both = {name: np.stack([np.array(value), 0 * np.array(value)]) for name, value in given.items()}
    assert error(run(several, both)["positions"][0], run(whole, given)["positions"]) < 1e-5
    assert not gpu_findings(several)
    # Triangles 0 to 9 carry no Gaussian.
    assert len(few.faces) == 90 and few.binding.min() >= 10
    sizes = {init.name: list(init.dims) for init in whole.graph.initializer}
    assert next(dims for name, dims in sizes.items() if name.startswith("weights"))[0] < 70


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"faces": None}, r"the triangles of the head"),
        ({"faces": np.zeros((20, 3), np.int64)}, r"binding: expected indices of the 20 triangles"),
        ({"shapedirs": np.zeros((70, 3, 9))}, r"6 directions of the shape and 8 of expressions.*found 9"),
    ],
)
def test_another_head_is_refused(case: Path, change: dict[str, Any], said: str) -> None:
    [cloud], [mesh] = case.rglob("point_cloud.ply"), case.rglob("head.npz")
    changed(mesh, **change)
    with pytest.raises(ExportError, match=said):
        export_bound(read_bound(cloud, mesh), FACTS)


def test_offsets_of_another_mesh_are_refused(case: Path) -> None:
    [cloud], [mesh], [person] = (case.rglob(name) for name in ("point_cloud.ply", "head.npz", "flame_param.npz"))
    changed(person, static_offset=np.zeros((1, 50, 3)))
    with pytest.raises(ExportError, match=r"static_offset of the 70 vertices.*static_offset \(50, 3\)"):
        read_bound(cloud, mesh)
    changed(person, static_offset=None)
    bare = read_bound(cloud, mesh)
    person.unlink()
    with pytest.raises(ExportError, match=r"flame_param.npz beside the Gaussians"):
        read_bound(cloud, mesh)
    assert len(bare.positions) == 150
