"""Moments of generators as PLY files: the same Gaussians that the generator writes, for every family that moves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import helper, numpy_helper

from gaussian_exporter.checkpoints.moving import gaussian4d_of
from gaussian_exporter.cli import main
from gaussian_exporter.families.deformable import export_deformable
from gaussian_exporter.families.gaussian4d import export_gaussian4d
from gaussian_exporter.families.hexplane import export_hexplane
from gaussian_exporter.families.spacetime import export_spacetime
from gaussian_exporter.frames import SH_C0
from gaussian_exporter.outputs import Options

from . import test_hexplane, test_moving
from .running import FACTS, covariance, error, parts, run
from .test_classic import cloud


def four_dimensional() -> Any:
    return gaussian4d_of(Path("x"), test_moving.captured(), {"time_duration": [0.0, 10.0]})


FAMILIES: dict[str, Any] = {
    "spacetime": lambda options: export_spacetime(test_moving.spacetime(), FACTS, options),
    "deformable": lambda options: export_deformable(cloud(50, 3), test_moving.deform(), FACTS, options),
    "4dgs": lambda options: export_gaussian4d(four_dimensional(), FACTS, options),
    "4dgaussians": lambda options: export_hexplane(test_hexplane.small(), test_hexplane.deformation(), FACTS, options),
}


def read_ply(path: Path) -> dict[str, Any]:
    head, _, body = path.read_bytes().partition(b"end_header\n")
    names = [line.split()[-1] for line in head.decode().splitlines() if line.startswith("property")]
    rows = np.frombuffer(body, "<f4").reshape(-1, len(names))
    return {name: rows[:, k].astype(np.float64) for k, name in enumerate(names)}


@pytest.mark.parametrize("layout", ["split", "packed"])
@pytest.mark.parametrize("family", FAMILIES)
def test_frames_are_what_the_generator_writes(family: str, layout: Any, tmp_path: Path) -> None:
    model = FAMILIES[family](Options(layout))
    onnx.save(model, tmp_path / "model.onnx")
    folder = tmp_path / "frames"
    assert main(["frames", str(tmp_path / "model.onnx"), str(folder), "--fps", "4"]) == 0
    manifest = json.loads((folder / "frames.json").read_text())
    # Two seconds, in which the normalized time goes from 0 to 1.
    assert (manifest["count"], manifest["framesPerSecond"]) == (8, 4)
    for frame in (0, 3, 7):
        expected = parts(run(model, {"time": np.array([frame / 8])}))
        found = read_ply(folder / f"frame-{frame + 1:04}.ply")
        stacked = {k: np.stack([found[f"{k}_{i}"] for i in range(n)], 1) for k, n in (("scale", 3), ("rot", 4))}
        assert error(np.stack([found[k] for k in "xyz"], 1), expected["positions"]) < 1e-5
        turned = covariance(np.exp(stacked["scale"]), stacked["rot"])
        assert np.abs(turned - expected["covariances"]).max() < 2e-4 * np.abs(expected["covariances"]).max()
        opacities = 1 / (1 + np.exp(-found["opacity"]))
        assert np.abs(opacities - expected["opacities"][:, 0]).max() < 2e-6
        first = np.stack([found[f"f_dc_{k}"] for k in range(3)], 1)
        color = expected["color"]
        given = (color - 0.5) / SH_C0 if color.shape[1] == 3 and "f_rest_0" not in found and is_rgb(model) else color
        assert error(first, given[:, :3]) < 1e-5
        if color.shape[1] > 3:
            count = color.shape[1] // 3
            rest = np.stack([found[f"f_rest_{k}"] for k in range(3 * (count - 1))], 1)
            assert error(rest, color.reshape(-1, count, 3)[:, 1:].transpose(0, 2, 1).reshape(len(color), -1)) < 1e-5


def is_rgb(model: onnx.ModelProto) -> bool:
    contract = next(json.loads(each.value) for each in model.metadata_props if "outputs" in each.value)
    return contract["outputs"].get("color") == "rgb" or "colors" in contract["outputs"]


def test_orders_of_quaternions_and_harmonics_are_those_of_the_contract(tmp_path: Path) -> None:
    model = FAMILIES["4dgaussians"](Options("split"))
    (tmp_path / "b").mkdir()
    onnx.save(model, tmp_path / "a.onnx")
    graph, [prop] = model.graph, model.metadata_props
    contract = json.loads(prop.value)
    # The same Gaussians in the other orders, and the contract beside the file.
    contract["outputs"] |= {"rotationOrder": "xyzw", "shOrder": "channel-major"}
    graph.initializer.append(numpy_helper.from_array(np.array([1, 2, 3, 0]), "last_first"))
    turns = helper.make_node("Gather", ["rotations_before", "last_first"], ["rotations"], axis=1)
    harmonics = helper.make_node("Transpose", ["sh_before"], ["sh"], perm=[0, 2, 1])
    for each in [*graph.node]:
        for names in (each.input, each.output):
            names[:] = [f"{name}_before" if name in ("rotations", "sh") else name for name in names]
    graph.node.extend([turns, harmonics])
    [value] = [value for value in graph.output if value.name == "sh"]
    count, terms, _ = (dim.dim_value for dim in value.type.tensor_type.shape.dim)
    value.CopyFrom(helper.make_tensor_value_info("sh", 1, [count, 3, terms]))
    del model.metadata_props[:]
    onnx.save(model, tmp_path / "b.onnx")
    (tmp_path / "b.contract.json").write_text(json.dumps(contract))
    for name in ("a", "b"):
        assert main(["frames", str(tmp_path / f"{name}.onnx"), str(tmp_path / name), "--fps", "1"]) == 0
    first, second = (read_ply(tmp_path / name / "frame-0002.ply") for name in ("a", "b"))
    assert first.keys() == second.keys()
    assert all(np.array_equal(first[name], second[name]) for name in first)


def test_frames_follow_a_state_and_say_what_their_contract_says(tmp_path: Path) -> None:
    def given(name: str, value: Any) -> onnx.TensorProto:
        return numpy_helper.from_array(np.array(value, np.float32), name)

    def float32(name: str, shape: list[int]) -> onnx.ValueInfoProto:
        return helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape)

    # Each frame is at the place of the frame before, one meter further; time changes nothing.
    nodes = [
        helper.make_node("Mul", ["time", "zero"], ["still"]),
        helper.make_node("Add", ["place", "still"], ["positions"]),
        helper.make_node("Add", ["positions", "one"], ["next"]),
    ]
    fixed: dict[str, Any] = {
        "scales": [[0.1] * 3],
        "rotations": [[1, 0, 0, 0]],
        "colors": [[0.5] * 3],
        "opacities": [[0.5]],
    }
    nodes += [helper.make_node("Identity", [f"{name}_stored"], [name]) for name in fixed]
    stored = [given("zero", [0]), given("one", [1]), *(given(f"{name}_stored", value) for name, value in fixed.items())]
    widths = {"positions": 3, "next": 3} | {name: len(value[0]) for name, value in fixed.items()}
    outputs = [float32(name, [1, width]) for name, width in widths.items()]
    graph = helper.make_graph(nodes, "g", [float32("time", [1]), float32("place", [1, 3])], outputs, stored)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    contract: Any = {
        "version": 1,
        "inputs": {"time": {"role": "time"}, "place": {"role": "state", "output": "next", "default": 2}},
        "outputs": {"layout": "split", "positions": "positions"} | {name: name for name in fixed},
        "nMax": 1,
        "duration": 1,
        "coordinates": {"up": "+z"},
        "antialiased": True,
    }
    onnx.save(model, tmp_path / "a.onnx")
    for settings, comment in (({"filter": "mip"}, b"SplatRenderMode: mip"), ({}, b"antialiased 1")):
        (tmp_path / "a.contract.json").write_text(json.dumps(contract | settings))
        assert main(["frames", str(tmp_path / "a.onnx"), str(tmp_path / "a"), "--fps", "3"]) == 0
        frames = [tmp_path / "a" / f"frame-000{frame}.ply" for frame in (1, 2, 3)]
        assert [float(read_ply(path)["x"][0]) for path in frames] == [2, 3, 4]
        head = frames[0].read_bytes().partition(b"end_header")[0]
        assert b"comment Vertical Axis: +z\n" in head and b"comment " + comment + b"\n" in head


def test_what_does_not_move_has_no_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from gaussian_exporter.families.classic import export_classic

    onnx.save(export_classic(cloud(20, 0), FACTS), tmp_path / "still.onnx")
    assert main(["frames", str(tmp_path / "still.onnx"), str(tmp_path / "frames")]) == 1
    assert "input of the role time" in capsys.readouterr().err
