from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gaussian_exporter.checkpoints.clouds import read_cloud
from gaussian_exporter.checkpoints.ply import read_ply
from gaussian_exporter.conformance import check_outputs
from gaussian_exporter.contract import METADATA_KEY, Filter
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.classic import Cloud, export_classic
from gaussian_exporter.outputs import Options

from .running import FACTS, covariance, error, parts, run
from .sh_reference import basis


def cloud(count: int = 500, degree: int = 3, seed: int = 0) -> Cloud:
    rng = np.random.default_rng(seed)
    arrays = (
        rng.normal(size=(count, 3)),
        rng.normal(-3, 1, (count, 3)),
        rng.normal(size=(count, 4)) * 3,
        rng.normal(0, 3, (count, 1)),
        rng.normal(size=(count, (degree + 1) ** 2, 3)) * 0.3,
    )
    return Cloud(*(array.astype(np.float32) for array in arrays))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_packed_rows_hold_activated_gaussians(degree: int) -> None:
    given = cloud(degree=degree)
    rows = run(export_classic(given, FACTS))["gaussians"]
    assert rows.shape == (500, 10 + 3 * (degree + 1) ** 2)
    found = parts(rows)
    assert error(found["positions"], given.positions) == 0
    assert error(found["covariances"], covariance(np.exp(np.float64(given.log_scales)), given.rotations)) < 1e-6
    assert error(found["color"], given.sh.reshape(500, -1)) == 0
    assert error(found["opacities"], 1 / (1 + np.exp(-np.float64(given.opacity_logits)))) < 1e-6


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_view_dependent_colors_match_harmonics_from_their_recurrence(degree: int) -> None:
    given = cloud(degree=degree)
    camera = np.array([0.3, -2.0, 1.5])
    model = export_classic(given, FACTS, colors="view")
    found = parts(run(model, {"camera_position": camera}))
    offset = given.positions - camera
    values = basis(offset / np.linalg.norm(offset, axis=1, keepdims=True), degree)
    expected = np.maximum(np.einsum("nk,nkc->nc", values, given.sh) + 0.5, 0)
    assert error(found["color"], expected) < 1e-5


def test_split_layout_writes_one_tensor_for_each_attribute() -> None:
    given = cloud()
    packed = parts(run(export_classic(given, FACTS)))
    split = run(export_classic(given, FACTS, Options(layout="split")))
    assert set(split) == {"positions", "scales", "rotations", "sh", "opacities"}
    assert split["sh"].shape == (500, 16, 3)
    assert error(split["sh"].reshape(500, -1), packed["color"]) == 0
    assert error(parts(split)["covariances"], packed["covariances"]) < 1e-5


def test_float16_halves_the_output_and_keeps_three_digits() -> None:
    given = cloud()
    rows = run(export_classic(given, FACTS, Options("packed", "float16")))["gaussians"]
    assert rows.dtype == np.float16
    full = run(export_classic(given, FACTS))["gaussians"]
    assert error(rows, full) < 1e-3


def test_float16_keeps_needles_as_scales_and_rotations() -> None:
    given = cloud()
    given.log_scales[:] = [0.0, -5.0, -6.0]
    model = export_classic(given, FACTS, Options(dtype="float16"))
    check_outputs(model)
    found = run(model)
    assert set(found) == {"positions", "scales", "rotations", "sh", "opacities"}
    assert error(found["scales"], np.exp(np.float64(given.log_scales))) < 1e-3
    full = parts(run(export_classic(given, FACTS)))["covariances"]
    assert error(covariance(found["scales"], found["rotations"]), full) < 2e-3


def test_unusable_gaussians_are_left_out_and_infinite_opacities_are_exact() -> None:
    given = cloud(10, 0)
    given.positions[1, 0] = np.nan
    given.rotations[2] = 0
    given.opacity_logits[3], given.opacity_logits[4] = np.inf, -np.inf
    rows = run(export_classic(given, FACTS))["gaussians"]
    assert len(rows) == 8
    assert (rows[1, -1], rows[2, -1]) == (1, 0)
    with pytest.raises(ExportError, match=r"\[checkpoint/unreadable\]"):
        export_classic(replace(given, positions=given.positions * np.float32(np.nan)), FACTS)


@pytest.mark.parametrize(("filter_", "antialiased"), [("classic", False), ("antialiased", True), ("mip", True)])
def test_contract_says_the_filter(filter_: Filter, antialiased: bool) -> None:
    model = export_classic(cloud(degree=0), replace(FACTS, filter=filter_))
    contract = json.loads({prop.key: prop.value for prop in model.metadata_props}[METADATA_KEY])
    assert (contract["filter"], contract["antialiased"]) == (filter_, antialiased)


def test_contract_says_what_the_file_holds() -> None:
    model = export_classic(cloud(degree=2), FACTS, colors="view")
    contract = json.loads({prop.key: prop.value for prop in model.metadata_props}[METADATA_KEY])
    assert contract["version"] == 1 and contract["nMax"] == 500 and contract["dtype"] == "float32"
    assert contract["license"] == "CC0-1.0" and contract["antialiased"] is False
    assert contract["inputs"] == {"camera_position": {"role": "camera_position"}}
    assert contract["outputs"]["color"] == "rgb" and "shDegree" not in contract
    low, high = contract["bounds"]["min"], contract["bounds"]["max"]
    positions = run(model, {"camera_position": np.zeros(3)})["gaussians"][:, :3]
    assert np.array_equal(positions.min(0), np.float32(low)) and np.array_equal(positions.max(0), np.float32(high))


def test_a_captured_scene(shared: Path) -> None:
    path = shared / "formats" / "playbot3.ply"
    given = read_cloud(path)
    rows = run(export_classic(given, FACTS))["gaussians"]
    raw = read_ply(path).rows
    assert rows.shape == (31000, 37)
    assert error(rows[:, 0], raw["x"]) == 0
    # Harmonics: the file holds red's 8 coefficients first; a row holds red, green, blue of each coefficient.
    assert error(rows[:, 9 + 3 * 5 + 1], raw[f"f_rest_{8 + 4}"]) == 0
    scales = np.stack([np.exp(np.float64(raw[f"scale_{i}"])) for i in range(3)], 1)
    quaternions = np.stack([raw[f"rot_{i}"] for i in range(4)], 1)
    assert error(parts(rows)["covariances"], covariance(scales, quaternions)) < 1e-6
