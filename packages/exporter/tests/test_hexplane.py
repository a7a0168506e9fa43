"""4DGS against the published trainer's formulas in float64, and against PyTorch's own grid_sample and files."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gaussian_exporter.arrays import Doubles, Floats
from gaussian_exporter.checkpoints.hexplane_folder import read_hexplane
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.classic import Cloud
from gaussian_exporter.families.hexplane import PLANES, Deformation, export_hexplane
from gaussian_exporter.pieces.mlp import Linear
from gaussian_exporter.planes import sample_plane

from .running import FACTS, covariance, error, parts, run, write_ply
from .test_classic import cloud

WIDTH = 12


def layers(rng: np.random.Generator, *sizes: int) -> list[Linear]:
    draw = [(rng.normal(size=(o, i)) / np.sqrt(i), rng.normal(size=o) * 0.1) for i, o in pairwise(sizes)]
    return [Linear(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in draw]


def planes(rng: np.random.Generator, channels: int, sizes: tuple[int, int, int, int]) -> list[Floats]:
    return [rng.uniform(0.3, 1.3, size=(channels, sizes[b], sizes[a])).astype(np.float32) for a, b in PLANES]


def deformation(**more: Any) -> Deformation:
    rng = np.random.default_rng(2)
    return Deformation(
        box=np.array([[1.5, 1.4, 1.3], [-1.5, -1.4, -1.3]], np.float32),
        resolutions=[planes(rng, 4, (8, 9, 10, 6)), planes(rng, 3, (16, 18, 20, 6))],
        trunk=layers(rng, 7, WIDTH, WIDTH),
        position=layers(rng, WIDTH, WIDTH, 3),
        scale=layers(rng, WIDTH, WIDTH, 3),
        rotation=layers(rng, WIDTH, WIDTH, 4),
        **more,
    )


def bilinear(plane: Floats, x: float, y: float) -> Doubles:
    """One point of a plane (C,H,W) as a sum over all of its points, each weighted by a hat; coordinates are clamped."""
    _, height, width = plane.shape
    column = np.clip((x + 1) / 2 * (width - 1), 0, width - 1)
    row = np.clip((y + 1) / 2 * (height - 1), 0, height - 1)
    across = np.maximum(0, 1 - np.abs(np.arange(width) - column))
    down = np.maximum(0, 1 - np.abs(np.arange(height) - row))
    result: Doubles = np.einsum("chw,h,w->c", plane.astype(np.float64), down, across)
    return result


def sequential(network: Any, x: Doubles) -> Doubles:
    for index, layer in enumerate(network):
        x = layer.weight.astype(np.float64) @ (np.maximum(x, 0) if index else x) + layer.bias
    return x


def reference(given: Cloud, model: Deformation, time: float) -> dict[str, Doubles]:
    high, low = model.box.astype(np.float64)
    rows: dict[str, list[Doubles]] = {"positions": [], "scales": [], "rotations": [], "opacities": [], "color": []}
    for i in range(len(given.positions)):
        at = [*((given.positions[i].astype(np.float64) - high) * (2 / (low - high)) - 1), time]
        features: list[float] = []
        for level in model.resolutions:
            product: Doubles = np.prod([bilinear(p, at[a], at[b]) for p, (a, b) in zip(level, PLANES, strict=True)], 0)
            features += list(product)
        hidden = np.maximum(sequential(model.trunk, np.array(features)), 0)
        mask = sequential(model.mask, hidden) if model.mask else np.ones(1)
        heads = {name: getattr(model, name) for name in ("position", "scale", "rotation", "opacity", "sh")}
        delta = {name: sequential(head, hidden) if head else None for name, head in heads.items()}

        def moved(rest: Any, by: Doubles | None, mask: Doubles) -> Doubles:
            still: Doubles = np.asarray(rest, np.float64).ravel()
            return still if by is None else still * mask + by

        rows["positions"].append(moved(given.positions[i], delta["position"], mask))
        rows["scales"].append(np.exp(moved(given.log_scales[i], delta["scale"], mask)))
        rows["rotations"].append(moved(given.rotations[i], delta["rotation"], np.ones(1)))
        rows["opacities"].append(1 / (1 + np.exp(-moved(given.opacity_logits[i], delta["opacity"], mask))))
        rows["color"].append(moved(given.sh[i], delta["sh"], mask))
    found = {name: np.stack(values) for name, values in rows.items()}
    found["covariances"] = covariance(found.pop("scales"), found.pop("rotations"))
    return found


def small(degree: int = 3) -> Cloud:
    return cloud(40, degree)


def assert_matches(given: Cloud, model: Deformation, time: float) -> None:
    found = parts(run(export_hexplane(given, model, FACTS), {"time": np.array([time])}))
    for name, values in reference(given, model, time).items():
        assert error(found[name], values) < 1e-5, (name, time)


@pytest.mark.parametrize("time", [0.0, 0.37, 1.0])
def test_gaussians_at_a_time(time: float) -> None:
    """Some Gaussians lie outside the box, for which planes continue with their border values."""
    assert (np.abs(small().positions) > 1.5).any()
    assert_matches(small(), deformation(), time)


def test_opacities_and_harmonics_that_change() -> None:
    rng = np.random.default_rng(7)
    model = deformation(opacity=layers(rng, WIDTH, WIDTH, 1), sh=layers(rng, WIDTH, WIDTH, 48))
    assert_matches(small(), model, 0.5)


def test_a_mask_and_heads_left_out() -> None:
    model = deformation(mask=layers(np.random.default_rng(7), WIDTH, WIDTH, 1))
    assert_matches(small(1), model, 0.5)
    assert_matches(small(1), replace(model, scale=None, rotation=None, mask=None), 0.5)


def test_time_moves_what_should_move() -> None:
    model = export_hexplane(small(), deformation(), FACTS)
    first, last = (parts(run(model, {"time": np.array([t])})) for t in (0.0, 1.0))
    assert error(first["positions"], last["positions"]) > 1e-2
    assert error(first["opacities"], last["opacities"]) == 0


def test_as_many_rows_as_gaussians() -> None:
    model = export_hexplane(small(), deformation(), FACTS)
    written = run(model, {"time": np.zeros(1)})
    assert {name: values.shape for name, values in written.items()} == {
        "positions": (40, 3),
        "scales": (40, 3),
        "rotations": (40, 4),
        "sh": (40, 16, 3),
        "opacities": (40, 1),
    }
    samples = [node for node in model.graph.node if node.op_type == "GridSample"]
    # One for each resolution samples the planes of all three axes.
    assert len(samples) == 2 and model.opset_import[0].version < 20


def test_planes_are_sampled_as_hats() -> None:
    rng = np.random.default_rng(0)
    plane = rng.normal(size=(3, 5, 7)).astype(np.float32)
    x, y = rng.uniform(-1.4, 1.4, (2, 50))
    expected = np.stack([bilinear(plane, float(a), float(b)) for a, b in zip(x, y, strict=True)])
    assert error(sample_plane(plane, x, y), expected) < 1e-12
    flat = rng.normal(size=(2, 1, 1)).astype(np.float32)
    assert np.array_equal(sample_plane(flat, x, y), np.tile(flat[:, 0, 0], (50, 1)))


def test_heads_that_do_not_fit_are_refused() -> None:
    model = deformation(sh=layers(np.random.default_rng(7), WIDTH, WIDTH, 48))
    with pytest.raises(ExportError, match=r"outputs of the sh head: expected 12, found 48.*\[checkpoint/mismatch\]"):
        export_hexplane(small(1), model, FACTS)


def test_a_folder_written_by_pytorch(tmp_path: Path) -> None:
    """The trainer's layout and its own operators, in PyTorch, where it is installed."""
    torch = pytest.importorskip("torch")
    given, model = small(), deformation()
    folder = tmp_path / "point_cloud" / "iteration_14000"
    write_cloud(folder / "point_cloud.ply", given)
    state = {"deformation_net.grid.aabb": torch.tensor(model.box)}
    for level, group in enumerate(model.resolutions):
        state |= {f"deformation_net.grid.grids.{level}.{i}": torch.tensor(p[None]) for i, p in enumerate(group)}
    heads = {"pos_deform": model.position, "scales_deform": model.scale, "rotations_deform": model.rotation}
    for name, network, first in [("feature_out", model.trunk, 0), *((n, h, 1) for n, h in heads.items())]:
        for i, layer in enumerate(network or []):
            state[f"deformation_net.{name}.{first + 2 * i}.weight"] = torch.nn.Parameter(torch.tensor(layer.weight))
            state[f"deformation_net.{name}.{first + 2 * i}.bias"] = torch.tensor(layer.bias)
    torch.save(state, folder / "deformation.pth")
    (tmp_path / "cfg_args").write_text("Namespace(no_do=True, no_dshs=True, multires=[1, 2])")
    read, moving = read_hexplane(tmp_path)
    ours = parts(run(export_hexplane(read, moving, FACTS), {"time": np.array([0.6])}))

    at = torch.tensor(given.positions).double()
    high, low = torch.tensor(model.box).double()
    at = torch.cat([(at - high) * (2 / (low - high)) - 1, torch.full((len(at), 1), 0.6, dtype=torch.float64)], 1)
    columns = []
    for group in model.resolutions:
        product: Any = 1
        for p, (a, b) in zip(group, PLANES, strict=True):
            grid = at[:, [a, b]].reshape(1, 1, -1, 2)
            plane = torch.tensor(p[None]).double()
            sample = torch.nn.functional.grid_sample(plane, grid, align_corners=True, padding_mode="border")
            product = product * sample[0, :, 0].T
        columns.append(product)
    hidden = torch.cat(columns, 1).numpy()
    moved = [sequential(model.position, np.maximum(sequential(model.trunk, row), 0)) for row in hidden]
    assert error(ours["positions"], given.positions + np.stack(moved)) < 1e-5


def write_cloud(path: Path, given: Cloud) -> None:
    rest = given.sh[:, 1:].transpose(0, 2, 1).reshape(len(given.sh), -1)
    tables = {"f_dc_": given.sh[:, 0], "f_rest_": rest, "scale_": given.log_scales, "rot_": given.rotations}
    columns = {axis: given.positions[:, i] for i, axis in enumerate("xyz")} | {"opacity": given.opacity_logits[:, 0]}
    for prefix, table in tables.items():
        columns |= {f"{prefix}{i}": table[:, i] for i in range(table.shape[1])}
    write_ply(path, columns)


def test_switches_without_an_exporter_are_refused(tmp_path: Path) -> None:
    (tmp_path / "cfg_args").write_text("Namespace(empty_voxel=True)")
    with pytest.raises(ExportError, match=r"empty_voxel.*\[checkpoint/unsupported\]"):
        read_hexplane(tmp_path)
