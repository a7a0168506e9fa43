"""Scaffold-GS and Octree-GS against the published formulas written out in float64, one anchor at a time."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime as ort
import pytest

from gaussian_exporter.arrays import AnyArray, Doubles, Floats
from gaussian_exporter.checkpoints.scaffold_folder import read_scaffold
from gaussian_exporter.checkpoints.torch_file import read_weights
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.scaffold import DistanceToLevel, Levels, Scaffold, export_scaffold
from gaussian_exporter.pieces.mlp import Linear

from .running import FACTS, covariance, error, parts, rows, run, write_ply

CAMERA = np.array([0.4, -0.3, -3.0])


def layers(rng: np.random.Generator, *sizes: int) -> list[Linear]:
    return [
        Linear((rng.normal(size=(o, i)) / np.sqrt(i)).astype(np.float32), (rng.normal(size=o) * 0.1).astype(np.float32))
        for i, o in pairwise(sizes)
    ]


def scaffold(count: int = 60, k: int = 5, width: int = 8, distance: tuple[str, ...] = (), **more: Any) -> Scaffold:
    rng = np.random.default_rng(1)

    def inputs(name: str) -> int:
        fed = "levels" in more and more["levels"].fed_to_networks
        own = len(more["appearance"]) if name == "color" and "appearance" in more else 0
        return width + 3 + (name in distance) + fed + own

    return Scaffold(
        anchors=rng.normal(size=(count, 3)).astype(np.float32),
        offsets=rng.normal(size=(count, k, 3)).astype(np.float32),
        features=rng.normal(size=(count, width)).astype(np.float32),
        scales=np.exp(rng.normal(-2, 0.5, size=(count, 6))).astype(np.float32),
        opacity=layers(rng, inputs("opacity"), width, k),
        color=layers(rng, inputs("color"), width, 3 * k),
        covariance=layers(rng, inputs("covariance"), width, 7 * k),
        uses_distance=distance,
        **more,
    )


def apply(network: Any, x: Doubles) -> Doubles:
    for index, layer in enumerate(network):
        x = np.float64(layer.weight) @ (np.maximum(x, 0) if index else x) + layer.bias
    return x


def shown(levels: Levels, anchor: int, center: Doubles, camera: Doubles, resolution: float) -> float:
    """How present one anchor is, by the steps of the trainer's code: distance, level, rounding, comparison."""
    own, extra = float(levels.levels[anchor, 0]), float(levels.extra_levels[anchor, 0])
    at = center + levels.voxel_size / 2 / levels.fork**own
    distance = np.linalg.norm(at - camera) * resolution
    level = np.log2(levels.standard_distance / distance) / np.log2(levels.fork) + extra
    top = float(levels.levels.max() - levels.levels.min())
    if levels.rule == "progressive":
        level = np.clip(level + 1, 0.9999, top + 0.9999)
        whole = np.floor(level)
        return 0.0 if own > whole else float(level - whole) if own == whole else 1.0
    rounding: Any = {"floor": np.floor, "round": np.round, "ceil": np.ceil}
    return float(own <= np.clip(rounding[levels.rule](level), 0, top))


def network(model: Scaffold, name: str, seen: tuple[list[float], float, list[float]]) -> Doubles:
    near, distance, level = seen
    appearance = [] if model.appearance is None or name != "color" else model.appearance.tolist()
    return apply(
        getattr(model, name), np.array([*near, *([distance] * (name in model.uses_distance)), *level, *appearance])
    )


def reference(model: Scaffold, camera: Doubles, resolution: float = 1) -> dict[str, Doubles]:
    rows: dict[str, list[AnyArray]] = {"positions": [], "scales": [], "rotations": [], "opacities": [], "color": []}
    for i, anchor in enumerate(model.anchors.astype(np.float64)):
        offset = anchor - camera
        distance = float(np.linalg.norm(offset))
        direction = offset / distance
        feature = model.features[i].astype(np.float64)
        levels = model.levels
        level = [float(levels.levels[i, 0])] if levels is not None and levels.fed_to_networks else []
        if model.feature_bank is not None:
            fed = level if levels is not None else [distance]
            mix = np.exp(apply(model.feature_bank, np.array([*direction, *fed])))
            mix /= mix.sum()
            feature = np.tile(feature[::4], 4) * mix[0] + np.tile(feature[::2], 2) * mix[1] + feature * mix[2]

        near = [*feature, *direction], distance, level
        present = 1.0 if levels is None else shown(levels, i, anchor, camera, resolution)
        shape = network(model, "covariance", near).reshape(-1, 7)
        rows["positions"].append(anchor + np.float64(model.offsets[i]) * model.scales[i, :3])
        rows["scales"].append(np.float64(model.scales[i, 3:]) / (1 + np.exp(-shape[:, :3])))
        rows["rotations"].append(shape[:, 3:])
        rows["opacities"].append(np.maximum(np.tanh(network(model, "opacity", near)) * present, 0)[:, None])
        rows["color"].append(1 / (1 + np.exp(-network(model, "color", near).reshape(-1, 3))))
    found = {name: np.concatenate(values) for name, values in rows.items()}
    found["covariances"] = covariance(found.pop("scales"), found.pop("rotations"))
    return found


def assert_matches(model: Scaffold, camera: Doubles = CAMERA, resolution: float | None = None) -> dict[str, Doubles]:
    feeds: dict[str, AnyArray] = {"camera_position": camera}
    if resolution is not None:
        feeds["resolution_scale"] = np.array([resolution])
    found = parts(run(export_scaffold(model, FACTS), feeds))
    expected = reference(model, camera.astype(np.float64), resolution or 1)
    for name, values in expected.items():
        assert error(found[name], values) < 1e-5, name
    return found


def test_gaussians_of_anchors() -> None:
    found = assert_matches(scaffold())
    dead = found["opacities"] == 0
    assert 0.2 < dead.mean() < 0.8


@pytest.mark.parametrize("distance", [("opacity",), ("color", "covariance"), ("opacity", "color", "covariance")])
def test_networks_that_know_the_distance(distance: tuple[str, ...]) -> None:
    assert_matches(scaffold(distance=distance))


def test_k_comes_from_the_model() -> None:
    assert len(assert_matches(scaffold(k=3))["positions"]) == 180


def test_feature_bank() -> None:
    assert_matches(scaffold(feature_bank=layers(np.random.default_rng(5), 4, 8, 3)))


def test_appearance_is_folded_into_a_bias() -> None:
    assert_matches(scaffold(appearance=np.random.default_rng(5).normal(size=6).astype(np.float32)))


def levels(count: int, rule: DistanceToLevel, fed: bool = False, fork: float = 2.0) -> Levels:
    rng = np.random.default_rng(3)
    own = rng.integers(0, 5, (count, 1)).astype(np.float32)
    return Levels(own, rng.uniform(0, 0.7, (count, 1)).astype(np.float32), 0.4, 9.0, fork, rule, fed)


@pytest.mark.parametrize("rule", ["floor", "round", "ceil", "progressive"])
@pytest.mark.parametrize("resolution", [1.0, 3.7])
def test_levels_of_detail(rule: DistanceToLevel, resolution: float) -> None:
    model = scaffold(levels=levels(60, rule))
    found = assert_matches(model, resolution=resolution)
    without = parts(run(export_scaffold(replace(model, levels=None), FACTS), {"camera_position": CAMERA}))
    hidden = (found["opacities"] < without["opacities"]).mean()
    assert 0.02 < hidden < 0.6


def test_levels_fed_to_the_networks_and_other_forks() -> None:
    bank = layers(np.random.default_rng(5), 4, 8, 3)
    assert_matches(scaffold(levels=levels(60, "round", True, 3.0), feature_bank=bank), resolution=1.0)


def test_a_camera_inside_an_anchor_gives_finite_numbers() -> None:
    model = scaffold(levels=levels(60, "progressive"))
    written = run(export_scaffold(model, FACTS), {"camera_position": model.anchors[0], "resolution_scale": np.ones(1)})
    assert np.isfinite(rows(written)).all()


def test_networks_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ExportError, match=r"11 inputs and 15 outputs .* found 11 and 12.*\[checkpoint/mismatch\]"):
        model = scaffold()
        export_scaffold(replace(model, color=layers(np.random.default_rng(0), 11, 8, 12)), FACTS)


def write_checkpoint(folder: Path, model: Scaffold, networks: Path, settings: str) -> None:
    """As Octree-GS writes one: log scales, offsets by axis, facts about the octree in the column `info`."""
    assert model.levels is not None
    columns = {axis: model.anchors[:, i] for i, axis in enumerate("xyz")}
    info = np.zeros(len(model.anchors), np.float32)
    info[:2] = model.levels.voxel_size, model.levels.standard_distance
    columns |= {"level": model.levels.levels[:, 0], "extra_level": model.levels.extra_levels[:, 0], "info": info}
    flat = model.offsets.transpose(0, 2, 1).reshape(len(model.offsets), -1)
    for prefix, table in (("f_offset_", flat), ("f_anchor_feat_", model.features), ("scale_", np.log(model.scales))):
        columns |= {f"{prefix}{i}": table[:, i] for i in range(table.shape[1])}
    point_cloud = folder / "point_cloud" / "iteration_40000"
    write_ply(point_cloud / "point_cloud.ply", columns)
    (folder / "point_cloud" / "iteration_7000").mkdir()
    for name in ("opacity", "cov", "color"):
        (point_cloud / f"{name}_mlp.pt").write_bytes((networks / f"{name}_mlp.pt").read_bytes())
    (folder / "cfg_args").write_text(settings)


def octree(shared: Path, count: int) -> Scaffold:
    """The published viewer's anchors and networks. It left out features, offsets and the scales of offsets."""
    folder = shared / "generators" / "octree-gs"
    rng = np.random.default_rng(0)

    def column(name: str, width: int) -> Floats:
        return np.fromfile(folder / f"anchor_{name}.bin", np.float32).reshape(-1, width)[:count]

    voxel, standard = np.fromfile(folder / "anchor_info.bin", np.float32)
    sigma = column("scales", 3)
    return Scaffold(
        anchors=column("positions", 3),
        offsets=rng.normal(size=(count, 10, 3)).astype(np.float32),
        features=(rng.normal(size=(count, 32)) * 0.5).astype(np.float32),
        scales=np.concatenate([sigma, sigma], 1),
        opacity=read_weights(folder / "opacity_mlp.pt").linears(),
        color=read_weights(folder / "color_mlp.pt").linears(),
        covariance=read_weights(folder / "cov_mlp.pt").linears(),
        levels=Levels(
            column("levels", 1), column("extra_levels", 1), float(voxel), float(standard), 2.0, "progressive"
        ),
    )


def test_traced_networks_are_read_without_torch_as_their_published_onnx_computes(shared: Path) -> None:
    folder = shared / "generators" / "octree-gs"
    x = np.random.default_rng(0).normal(size=(50, 1, 1, 35)).astype(np.float32)
    last: dict[str, Any] = {"opacity": np.tanh, "color": lambda v: 1 / (1 + np.exp(-v)), "cov": lambda v: v}
    for name, activation in last.items():
        theirs = ort.InferenceSession(folder / f"{name}_mlp.onnx").run(None, {"input": x})[0].reshape(50, -1)
        linears = read_weights(folder / f"{name}_mlp.pt").linears()
        ours = np.stack([activation(apply(linears, row.astype(np.float64))) for row in x.reshape(50, 35)])
        assert error(theirs, ours) < 1e-5


def test_the_published_octree_model_runs(shared: Path) -> None:
    model = octree(shared, 1500)
    camera = model.anchors.mean(0, dtype=np.float64)
    found = assert_matches(model, camera, 1.0)
    assert len(found["positions"]) == 15000


def test_all_its_anchors_run(shared: Path) -> None:
    model = octree(shared, 265550)
    written = run(
        export_scaffold(model, FACTS), {"camera_position": model.anchors.mean(0), "resolution_scale": np.ones(1)}
    )
    assert written["rotations"].shape == (2655500, 4) and all(np.isfinite(each).all() for each in written.values())


def test_a_checkpoint_folder_is_read_back(shared: Path, tmp_path: Path) -> None:
    model = octree(shared, 300)
    settings = (
        "Namespace(dist2level='progressive', fork=2, add_level=False, n_offsets=10, source_path='x', f=open('y'))"
    )
    write_checkpoint(tmp_path, model, shared / "generators" / "octree-gs", settings)
    again = read_scaffold(tmp_path)
    assert again.levels is not None and again.levels.rule == "progressive"
    assert np.array_equal(again.offsets, model.offsets) and np.array_equal(again.features, model.features)
    assert error(again.scales, model.scales) < 1e-6
    feeds = {"camera_position": model.anchors.mean(0), "resolution_scale": np.ones(1)}
    both = [rows(run(export_scaffold(each, FACTS), feeds)) for each in (model, again)]
    assert error(both[1], both[0]) < 1e-5


def test_broken_checkpoints_are_named(shared: Path, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"\[checkpoint/not-found\]"):
        read_scaffold(tmp_path / "nothing")
    write_checkpoint(tmp_path, octree(shared, 10), shared / "generators" / "octree-gs", "Namespace(dist2level='magic')")
    with pytest.raises(ExportError, match=r"found 'magic'.*\[checkpoint/unsupported\]"):
        read_scaffold(tmp_path)
    network = tmp_path / "point_cloud" / "iteration_40000" / "cov_mlp.pt"
    network.write_bytes(network.read_bytes()[:5000])
    with pytest.raises(ExportError, match=r"cov_mlp.pt.*\[checkpoint/unreadable\]"):
        read_scaffold(tmp_path)
    network.unlink()
    with pytest.raises(ExportError, match=r"cov_mlp.pt.*color_mlp.pt.*\[checkpoint/not-found\]"):
        read_scaffold(tmp_path)


def test_a_pickle_that_would_run_something_runs_nothing(tmp_path: Path) -> None:
    path = tmp_path / "evil.pt"
    target = tmp_path / "touched"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a/data.pkl", b"cposix\nsystem\n(V" + f"touch {target}".encode() + b"\ntR.")
    with pytest.raises(ExportError, match=r"\[checkpoint/incomplete\]"):
        read_weights(path).linears()
    assert not target.exists()


def test_no_operator_lists_the_living() -> None:
    model: onnx.ModelProto = export_scaffold(scaffold(levels=levels(60, "round")), FACTS)
    operators = {node.op_type for node in model.graph.node}
    assert not operators & {"Compress", "NonZero", "CumSum", "TopK", "ScatterND", "Split", "Round"}
