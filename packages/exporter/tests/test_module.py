"""Modules of people, in one call: both of PyTorch's exporters, the contract, and what a page would do with the file."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

import gaussian_exporter as gs
from gaussian_exporter.arrays import rotation_matrices
from gaussian_exporter.conformance import check_outputs
from gaussian_exporter.contract import Coordinates
from gaussian_exporter.errors import ExportError
from gaussian_exporter.header import header_faults
from gaussian_exporter.module.capture import widened
from gaussian_exporter.placement import gpu_findings

from .running import run

torch: Any = pytest.importorskip("torch")
pytest.importorskip("onnxscript")
COUNT = 64


def contract_of(path: Path) -> Any:
    props = {prop.key: prop.value for prop in onnx.load(path).metadata_props}
    return json.loads(props["gaussian_contract"])


class Ball(torch.nn.Module):  # type: ignore[misc]
    """A time and a slider; scales and opacities that never change; one scale a splat; a batch of one."""

    def __init__(self) -> None:
        super().__init__()
        points = torch.randn(COUNT, 3, generator=torch.Generator().manual_seed(1))
        self.register_buffer("points", torch.nn.functional.normalize(points, dim=-1))

    def forward(self, t: Any, twist: Any) -> Any:
        angle = twist * self.points[:, 1:2] * math.pi
        x, y, z = self.points.split(1, -1)
        turned = torch.cat([angle.cos() * x - angle.sin() * z, y, angle.sin() * x + angle.cos() * z], -1)
        colors = torch.cat([self.points * 0.5 + 0.5, torch.ones(COUNT, 1)], -1)
        rest = torch.tensor([1.0, 0, 0, 0]).repeat(COUNT, 1)
        return (turned * (1 + 0.3 * t.sin()))[None], torch.full((COUNT,), 0.05), rest, colors, torch.ones(1, COUNT, 1)


INPUTS = {"t": gs.time(duration=6.2832), "twist": gs.control(-1, 1, label="Twist")}


def test_a_module_in_one_call(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = gs.export_module(Ball(), INPUTS, out=tmp_path / "ball.onnx", license="MIT", attribution="A. Person")
    assert max(report.errors.values()) < 1e-5 and report.findings == [] and report.exporter == "dynamo"
    said = capsys.readouterr().out
    assert "differs from PyTorch by" in said
    assert '<gaussian-splat src="ball.onnx" alt="ball" camera-controls autoplay loop controls-panel>' in said
    model = onnx.load(tmp_path / "ball.onnx")
    shapes = {o.name: [d.dim_value for d in o.type.tensor_type.shape.dim] for o in model.graph.output}
    assert shapes == {
        "positions": [COUNT, 3],
        "scales": [COUNT, 3],
        "rotations": [COUNT, 4],
        "colors": [COUNT, 3],
        "opacities": [COUNT, 1],
    }
    contract = contract_of(tmp_path / "ball.onnx")
    assert contract["inputs"]["twist"] == {"role": "control", "range": [-1, 1], "default": 0.0, "label": "Twist"}
    assert contract["inputs"]["t"] == {"role": "time", "unit": "seconds"} and contract["duration"] == 6.2832
    assert contract["bounds"]["max"][1] > 1.2
    assert check_outputs(model)["positions"].shape == (COUNT, 3)
    # PyTorch notes the file and the lines of the code in every node.
    assert b".py" not in (tmp_path / "ball.onnx").read_bytes()


class Arm(torch.nn.Module):  # type: ignore[misc]
    """The angle's length with a little added: PyTorch's rewriter drops that, and the rest pose becomes NaN."""

    def forward(self, pose: Any) -> Any:
        angle = pose[0].norm() + 1e-8
        axis = pose[0] / angle
        points = torch.linspace(-1, 1, 3 * COUNT).reshape(COUNT, 3)
        cross = torch.linalg.cross(axis.expand_as(points), points)
        return {
            "positions": points * angle.cos() + cross * angle.sin(),
            "covariances": (0.01 * torch.eye(3)).repeat(1, COUNT, 1, 1),
            "colors": points * 0.5 + 0.5,
            "opacities": torch.sigmoid(points[:, 0]),
        }


def test_a_small_addend_survives(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    layout = gs.split("positions", "covariances", "colors", "opacities")
    # The rest pose is tried even if defaults are not zero.
    for rest in (None, [0.1] * 3):
        inputs = {"pose": gs.pose(["hip"], [-1], rest=rest)}
        report = gs.export_module(Arm(), inputs, layout, out=tmp_path / "arm.onnx")
        assert max(report.errors.values()) < 1e-6 and report.exporter == "dynamo"
        assert sum(len(text.splitlines()) for text in capfd.readouterr()) <= 12
        still = run(onnx.load(report.path), {"pose": np.zeros((1, 3))})
        assert np.isfinite(still["positions"]).all() and still["covariances"].shape == (COUNT, 6)
    assert contract_of(report.path)["inputs"]["pose"]["joints"] == ["hip"]


class Bare(Arm):
    """The same without the addend: the module itself is NaN at rest."""

    def forward(self, pose: Any) -> Any:
        written = super().forward(pose)
        return {**written, "positions": written["positions"] * (pose.norm() / pose.norm())}


def test_a_rest_pose_of_nan_is_refused_by_the_name_of_the_output(tmp_path: Path) -> None:
    layout = gs.split("positions", "covariances", "colors", "opacities")
    inputs = {"pose": gs.pose(["hip"], [-1], rest=[0.1] * 3)}
    with pytest.raises(ExportError, match=r"output positions.*of the module, with pose = 0 0 0"):
        gs.export_module(Bare(), inputs, layout, out=tmp_path / "arm.onnx", quiet=True)
    assert not (tmp_path / "arm.onnx").exists()


class Rig(torch.nn.Module):  # type: ignore[misc]
    """Rotations as SMPL's code has them (batch_rodrigues), scales by diag_embed, and inverses of matrices."""

    def __init__(self) -> None:
        super().__init__()
        draw = torch.Generator().manual_seed(2)
        self.register_buffer("points", torch.randn(COUNT, 3, generator=draw))
        self.register_buffer("scales", torch.rand(COUNT, 3, generator=draw) * 0.1 + 0.01)
        self.register_buffer("bind", torch.linalg.qr(torch.randn(4, 4, generator=draw))[0])

    def forward(self, pose: Any, camera: Any) -> Any:
        angle = torch.norm(pose + 1e-8, dim=1, keepdim=True)
        x, y, z = torch.split(pose / angle, 1, dim=1)
        zero = torch.zeros((1, 1))
        k = torch.cat([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).view(1, 3, 3)
        turn = (torch.eye(3) + angle.sin() * k + (1 - angle.cos()) * torch.bmm(k, k))[0]
        eye = camera.inverse()[:3, 3] + torch.linalg.inv(self.bind)[:3, 3]
        half = turn @ torch.inverse(torch.eye(3) + 0.1 * turn) @ torch.diag_embed(self.scales)
        return self.points @ turn.T + 0.01 * eye, half @ half.mT, self.points.sigmoid(), torch.ones(COUNT)


def test_rodrigues_diagonals_and_inverses(tmp_path: Path) -> None:
    layout = gs.split("positions", "covariances", "colors", "opacities", colors="linear")
    inputs = {"pose": gs.pose(["hip"], [-1]), "camera": gs.view()}
    before = torch.linalg.inv, torch.inverse, torch.Tensor.inverse
    report = gs.export_module(Rig(), inputs, layout, out=tmp_path / "rig.onnx", quiet=True)
    assert max(report.errors.values()) < 1e-5 and report.findings == []
    assert before == (torch.linalg.inv, torch.inverse, torch.Tensor.inverse)
    written = run(onnx.load(report.path), {"pose": np.zeros((1, 3)), "camera": np.eye(4)})
    linear = Rig().points.sigmoid().numpy()
    assert np.allclose(written["colors"], 1.055 * linear ** (1 / 2.4) - 0.055, atol=1e-5)


def test_the_code_of_smpl_itself(tmp_path: Path) -> None:
    """smplx.lbs, with a body of random numbers: its model files may not be in a repository."""
    lbs = pytest.importorskip("smplx.lbs").lbs
    draw = torch.Generator().manual_seed(4)
    joints, parents = 5, torch.tensor([-1, 0, 1, 1, 3])
    weights = torch.softmax(4 * torch.randn(COUNT, joints, generator=draw), 1)
    body = {
        "v_template": torch.randn(COUNT, 3, generator=draw),
        "shapedirs": 0.1 * torch.randn(COUNT, 3, 4, generator=draw),
        "posedirs": 0.01 * torch.randn(9 * (joints - 1), 3 * COUNT, generator=draw),
        "J_regressor": torch.softmax(4 * torch.randn(joints, COUNT, generator=draw), 1),
    }

    class Body(torch.nn.Module):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            for name, value in body.items():
                self.register_buffer(name, value)

        def forward(self, pose: Any, betas: Any) -> Any:
            given = (self.v_template[None], self.shapedirs, self.posedirs, self.J_regressor, parents, weights)
            vertices, _ = lbs(betas, pose, *given)
            covariances = 0.01 * torch.tensor([1.0, 0, 0, 1, 0, 1]).repeat(COUNT, 1)
            return vertices, covariances, vertices[0].sigmoid(), torch.ones(COUNT, 1)

    layout = gs.split("positions", "covariances", "colors", "opacities")
    inputs = {"pose": gs.pose(joints, flat=True), "betas": gs.shape(4)}
    report = gs.export_module(Body(), inputs, layout, out=tmp_path / "smpl.onnx", batched=True, quiet=True)
    assert max(report.errors.values()) < 1e-5 and report.findings == []


class Views(torch.nn.Module):  # type: ignore[misc]
    """Two images in one tensor, weights in bfloat16."""

    def __init__(self) -> None:
        super().__init__()
        self.head = torch.nn.Conv2d(3, 4, 3, padding=1)

    def forward(self, images: Any) -> Any:
        x = self.head(images).permute(0, 2, 3, 1).reshape(-1, 4)
        covariances = 0.01 * torch.tensor([1.0, 0, 0, 1, 0, 1]).repeat(len(x), 1)
        return x[:, :3], covariances, x[:, :3].sigmoid(), x[:, 3].sigmoid()


def test_views_in_one_tensor_and_weights_in_bfloat16(tmp_path: Path) -> None:
    layout = gs.split("positions", "covariances", "colors", "opacities")
    module = Views().bfloat16()
    inputs = {"images": gs.image(12, 8, views=2)}
    report = gs.export_module(module, inputs, layout, out=tmp_path / "views.onnx", quiet=True)
    assert "weights of 16 bits became float32: head.weight, head.bias" in str(report)
    assert module.head.weight.dtype == torch.bfloat16
    model = onnx.load(report.path)
    assert [d.dim_value for d in model.graph.input[0].type.tensor_type.shape.dim] == [2, 3, 8, 12]
    assert all(tensor.data_type != onnx.TensorProto.BFLOAT16 for tensor in model.graph.initializer)


def test_a_temporal_filter_keeps_what_it_returns_second(tmp_path: Path) -> None:
    class Temporal(torch.nn.Module):  # type: ignore[misc]
        def forward(self, image: Any, previous: Any, keep: Any) -> Any:
            kept = image * (1 - keep) + previous * keep
            return kept, kept

    inputs = {"image": gs.image(16, 8), "previous": gs.state([1, 3, 8, 16]), "keep": gs.control(0, 0.98, 0.9)}
    for layout in (gs.image_output(), gs.image_output(state="previous")):
        report = gs.export_module(Temporal(), inputs, layout, out=tmp_path / "t.onnx", quiet=True)
        contract = contract_of(report.path)
        assert contract["inputs"]["previous"]["output"] == "next_previous"
        assert contract["outputs"] == {"layout": "image", "image": "processed"}


class Fog(torch.nn.Module):  # type: ignore[misc]
    """The post-processor of docs/guide/own-generator.md."""

    def forward(self, image: Any, depth: Any, density: Any, color: Any) -> Any:
        share = 1 - torch.exp(-density * depth)
        return image * (1 - share) + color.reshape(1, 3, 1, 1) * share


def test_a_post_processor_takes_the_depth_of_the_frame(tmp_path: Path) -> None:
    inputs = {
        "image": gs.image(16, 8),
        "depth": gs.depth(16, 8),
        "density": gs.control(0, 2, 0.2),
        "color": gs.control(0, 1, [0.7, 0.75, 0.8], shape=[3]),
    }
    report = gs.export_module(Fog(), inputs, gs.image_output(), out=tmp_path / "fog.onnx", quiet=True)
    assert contract_of(report.path)["inputs"]["depth"] == {"role": "depth"}
    assert max(report.errors.values()) < 1e-5 and report.findings == []


class Eye(torch.nn.Module):  # type: ignore[misc]
    """The place of the camera, -(R^T t), which ONNX Runtime's optimiser computes as -(R t)."""

    def forward(self, view: Any) -> Any:
        eye = -(view[:3, :3].T @ view[:3, 3])
        points = torch.linspace(-1, 1, 3 * COUNT).reshape(COUNT, 3)
        covariances = 0.01 * torch.tensor([1.0, 0, 0, 1, 0, 1]).repeat(COUNT, 1)
        return torch.cat([points + 0.1 * eye, covariances, points * 0.5 + 0.5, torch.ones(COUNT, 1)], -1).reshape(
            -1, 13
        )


def test_the_place_of_a_camera_survives_the_optimiser(tmp_path: Path) -> None:
    report = gs.export_module(Eye(), {"view": gs.view()}, gs.packed(), out=tmp_path / "eye.onnx", quiet=True)
    # The last operator only changes the shape: a kernel writes the output all the same.
    assert max(report.errors.values()) < 1e-5 and report.findings == []


def test_a_decorated_function_and_class(tmp_path: Path) -> None:
    @gs.generator({"t": gs.time()}, gs.packed(), license="MIT")
    def rows(t: Any) -> Any:
        return torch.cat([torch.zeros(COUNT, 3), torch.ones(COUNT, 10) * 0.5], -1) * (1 + 0 * t)

    report = rows.export(tmp_path / "rows.onnx", quiet=True)
    contract = contract_of(report.path)
    assert contract["license"] == "MIT"
    # Pages show credits: a name that was not given is not among them.
    assert "attribution" not in contract
    decorated = gs.generator(INPUTS)(type("Ball2", (Ball,), {}))
    assert decorated().export(tmp_path / "b.onnx", quiet=True).contract["name"] == "b"


class Batched(torch.nn.Module):  # type: ignore[misc]
    """As feed-forward and avatar code writes it: a batch before everything, a flat pose of matrices, a dict."""

    def forward(self, pose: Any, betas: Any, c2w: Any, k: Any) -> Any:
        b = pose.shape[0]
        turn = pose.view(b, 2, 3, 3)[:, 0]
        points = torch.linspace(-1, 1, 3 * COUNT).reshape(1, COUNT, 3).expand(b, -1, -1)
        places = points @ turn.transpose(1, 2) + 0.1 * c2w[:, None, :3, 3] + betas.sum(-1)[:, None, None] + k[:, 0, 2]
        return {
            "positions": places,
            "covariances": 0.01 * torch.eye(3).expand(b, COUNT, 3, 3),
            "sh": torch.zeros(b, COUNT, 4, 3),
            "opacities": torch.ones(b, COUNT, 1),
        }


def test_a_module_that_takes_batches(tmp_path: Path) -> None:
    inputs = {
        "pose": gs.pose(["hip", "knee"], format="matrix", flat=True),
        "betas": gs.shape(4),
        "c2w": gs.camera_to_world(axes="RUB"),
        "k": gs.intrinsics(normalized=True),
    }
    layout = gs.split("positions", "covariances", "sh", "opacities")
    report = gs.export_module(Batched(), inputs, layout, out=tmp_path / "b.onnx", batched=True, quiet=True)
    assert max(report.errors.values()) < 1e-5 and report.findings == []
    given = {v.name: [d.dim_value for d in v.type.tensor_type.shape.dim] for v in onnx.load(report.path).graph.input}
    assert given == {"pose": [18], "betas": [4], "c2w": [4, 4], "k": [3, 3]}
    with pytest.raises(ExportError, match=r"pose \[18\].*Give batched=True"):
        gs.export_module(Batched(), inputs, layout, out=tmp_path / "b.onnx", quiet=True)


class Falling(torch.nn.Module):  # type: ignore[misc]
    """Continues from the heights of its last run."""

    def forward(self, t: Any, heights: Any) -> Any:
        lower = heights - 0.01 + 0 * t
        flat = torch.linspace(-1, 1, COUNT)
        places = torch.stack([flat, lower, 0 * flat], -1)
        return places, torch.full((COUNT, 6), 0.01), torch.full((COUNT, 3), 0.5), torch.ones(COUNT, 1), lower


def test_a_module_that_goes_on_from_what_it_wrote(tmp_path: Path) -> None:
    layout = gs.split("positions", "covariances", "colors", "opacities", state="heights")
    inputs = {"t": gs.time(), "heights": gs.state([COUNT], default=2.0)}
    report = gs.export_module(Falling(), inputs, layout, out=tmp_path / "f.onnx", quiet=True)
    assert max(report.errors.values()) < 1e-5
    bound = contract_of(report.path)["inputs"]["heights"]
    assert bound == {"role": "state", "default": 2.0, "output": "next_heights"}


def test_the_module_stays_in_training(tmp_path: Path) -> None:
    module = torch.nn.Sequential(Ball(), torch.nn.Dropout()).train()
    module[1].eval()
    with pytest.raises(ExportError, match="a role for each argument"):
        gs.export_module(module, {"t": gs.time(), "a": gs.time(), "b": gs.time()}, out=tmp_path / "x.onnx")
    assert [part.training for part in module] == [True, False] and module.training


def test_a_module_elsewhere_is_copied_to_the_cpu() -> None:
    from torch._subclasses.fake_tensor import FakeTensorMode

    with FakeTensorMode(allow_non_fake_inputs=True):
        module = torch.nn.Module()
        module.register_buffer("points", torch.ones(2, device="cuda"))
        own, narrow = widened(module, torch)
    assert [each.points.device.type for each in (own, module)] == ["cpu", "cuda"] and narrow == []


def test_what_frames_reach_has_no_known_bounds(tmp_path: Path) -> None:
    class Rising(torch.nn.Module):  # type: ignore[misc]
        def forward(self, frame: Any) -> Any:
            up = frame.float().expand(COUNT)
            return torch.stack([up, up, up], -1), torch.full((COUNT, 6), 0.01), torch.full((COUNT, 3), 0.5), up * 0 + 1

    layout = gs.split("positions", "covariances", "colors", "opacities")
    report = gs.export_module(Rising(), {"frame": gs.frame()}, layout, out=tmp_path / "r.onnx", fps=2, quiet=True)
    assert "bounds" not in report.contract


def test_a_state_of_one_number(tmp_path: Path) -> None:
    class Counting(torch.nn.Module):  # type: ignore[misc]
        def forward(self, runs: Any) -> Any:
            places = torch.linspace(-1, 1, COUNT)[:, None].repeat(1, 3) * (runs + 1)
            return places, torch.full((COUNT, 6), 0.01), torch.full((COUNT, 3), 0.5), torch.ones(COUNT, 1), runs + 1

    layout = gs.split("positions", "covariances", "colors", "opacities")
    report = gs.export_module(Counting(), {"runs": gs.state(())}, layout, out=tmp_path / "c.onnx", quiet=True)
    [given] = onnx.load(report.path).graph.input
    assert len(given.type.tensor_type.shape.dim) == 0 and max(report.errors.values()) < 1e-5


def test_what_does_not_fit_is_named(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"found no folder .*none"):
        gs.export_module(Ball(), INPUTS, out=tmp_path / "none" / "x.onnx")
    with pytest.raises(ExportError, match=r"a role for each argument.*found t"):
        gs.export_module(Ball(), {"t": gs.time()}, out=tmp_path / "x.onnx")
    with pytest.raises(ExportError, match=r"expected 4 tensors .* found 5"):
        layout = gs.split("positions", "covariances", "colors", "opacities")
        gs.export_module(Ball(), INPUTS, layout, out=tmp_path / "x.onnx")

    class Nan(Ball):
        def forward(self, t: Any, twist: Any) -> Any:
            first, *rest = super().forward(t, twist)
            return (first / (t * 0), *rest)

    with pytest.raises(ExportError, match=r"at its inputs' defaults.*expected finite numbers"):
        gs.export_module(Nan(), INPUTS, out=tmp_path / "x.onnx")


def test_a_dict_with_names_of_its_own(tmp_path: Path) -> None:
    class Own(torch.nn.Module):  # type: ignore[misc]
        def forward(self, t: Any) -> Any:
            xyz = torch.ones(5, 3) * t
            return {"alpha": 0 * xyz[:, :1] + 0.5, "xyz": xyz, "rgb": 0.1 * xyz, "cov": 0 * xyz.repeat(1, 2) + 1}

    keys = {"positions": "xyz", "covariances": "cov", "colors": "rgb", "opacities": "alpha"}
    report = gs.export_module(Own(), {"t": gs.time(duration=1)}, gs.split(keys), out=tmp_path / "a.onnx", quiet=True)
    assert max(report.errors.values()) == 0
    with pytest.raises(ExportError, match=r"a tensor 'means' in the dict.*Say which key is what"):
        gs.export_module(
            Own(), {"t": gs.time(duration=1)}, gs.split(keys | {"positions": "means"}), out=tmp_path / "b.onnx"
        )


class Given(torch.nn.Module):  # type: ignore[misc]
    """Writes its inputs; the positions follow the time and a slider."""

    def __init__(self, **changes: Any) -> None:
        super().__init__()
        plain = {
            "positions": torch.linspace(-1, 1, 3 * COUNT).reshape(COUNT, 3),
            "scales": torch.full((COUNT, 3), 0.02),
            "rotations": torch.tensor([1.0, 0, 0, 0]).repeat(COUNT, 1),
            "colors": torch.full((COUNT, 3), 0.5),
            "opacities": torch.full((COUNT, 1), 0.9),
        }
        for name, value in (plain | changes).items():
            self.register_buffer(name, value)

    def forward(self, t: Any, k: Any) -> Any:
        moved = self.positions + 0.1 * t.sin() + 0 * k
        return {"positions": moved} | {n: x + 0 * t for n, x in self.named_buffers() if n != "positions"}


SLIDER = {"t": gs.time(duration=2), "k": gs.control(-1, 1)}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"scales": torch.ones(COUNT, 4)}, r"output scales .*expected \[N, 3\].*found \[64, 4\].*Is the order of"),
        ({"opacities": torch.ones(COUNT, 3)}, r"output opacities .*expected \[N\] or \[N, 1\], found \[64, 3\]"),
        ({"colors": torch.ones(COUNT - 1, 3)}, r"output colors .*expected 64 rows, as positions has, found 63 rows"),
        ({"scales": torch.full((COUNT, 3), -3.0)}, r"output scales, row 0 .*found -3 -3 -3.*scales=.log"),
        ({"opacities": torch.full((COUNT, 1), 5.0)}, r"output opacities, row 0 .*found 5.*opacities=.logit"),
    ],
)
def test_outputs_that_break_the_contract_are_refused(changes: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=said):
        gs.export_module(Given(**changes), SLIDER, out=tmp_path / "x.onnx", quiet=True)
    assert not (tmp_path / "x.onnx").exists()


def test_values_are_checked_where_visitors_go(tmp_path: Path) -> None:
    class Fading(Given):
        def forward(self, t: Any, k: Any) -> Any:
            given = super().forward(t, k)
            return given | {"opacities": given["opacities"] - k}

    with pytest.raises(ExportError, match=r"output opacities, row 0 \(run with controls at their minimum\).*found 1.9"):
        gs.export_module(Fading(), SLIDER, out=tmp_path / "x.onnx", quiet=True)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_rotation_matrices_become_quaternions(order: Any, tmp_path: Path) -> None:
    quaternions = np.random.default_rng(3).normal(size=(COUNT, 4))
    # Half turns, too, where the real part is 0.
    quaternions[:4] = np.eye(4)
    matrices = torch.tensor(rotation_matrices(quaternions), dtype=torch.float32)
    layout = gs.split("positions", "scales", "rotations", "colors", "opacities", rotations=order)
    report = gs.export_module(Given(rotations=matrices), SLIDER, layout, out=tmp_path / "r.onnx", quiet=True)
    assert report.findings == []
    written = check_outputs(onnx.load(report.path))["rotations"]
    found = np.roll(written, 1, 1) if order == "xyzw" else written
    np.testing.assert_allclose(rotation_matrices(found), matrices, atol=1e-6)
    with pytest.raises(ExportError, match=r"expected rotations.*found other 3x3 matrices.*'covariances'"):
        gs.export_module(Given(rotations=0.1 * matrices), SLIDER, layout, out=tmp_path / "x.onnx", quiet=True)


def test_scalar_times_and_controls(tmp_path: Path) -> None:
    inputs = {"t": gs.time(duration=2, shape=()), "k": gs.control(-1, 1, shape=())}
    report = gs.export_module(Given(), inputs, out=tmp_path / "s.onnx", quiet=True)
    assert max(report.errors.values()) < 1e-5 and "bounds" in report.contract


def test_float64_becomes_float32(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    class Wide(Given):
        def forward(self, t: Any, k: Any) -> Any:
            turned, _ = self.cell(t.double().reshape(1, 1, 1))
            return super().forward(t, k) | {"scales": (0.02 + 0 * turned.sum()).expand(COUNT, 3)}

    wide = Wide(positions=torch.linspace(-1, 1, 3 * COUNT).double().reshape(COUNT, 3))
    wide.cell = torch.nn.GRU(1, 3).double()
    report = gs.export_module(wide, SLIDER, out=tmp_path / "w.onnx")
    assert "became float32: cell.weight_ih_l0, cell.weight_hh_l0" in capsys.readouterr().out
    assert not any("float64" in str(finding) for finding in report.findings)
    assert not any(t.data_type == onnx.TensorProto.DOUBLE for t in onnx.load(report.path).graph.initializer)


def test_types_that_pages_cannot_cast_are_refused(tmp_path: Path) -> None:
    class Stepped(Given):
        def forward(self, t: Any, k: Any) -> Any:
            return super().forward(t, k) | {"colors": self.colors * (1 + k).to(torch.int16).float()}

    with pytest.raises(ExportError, match=r"Cast .*is int16, which builds for the web cannot cast.*uint8"):
        gs.export_module(Stepped(), SLIDER, out=tmp_path / "x.onnx", quiet=True)


class Branching(Given):
    """Operations that PyTorch's own exporter refuses, and that TorchScript's bakes in."""

    def forward(self, t: Any, k: Any) -> Any:
        given = super().forward(t, k)
        return {name: 2 * x if name == "positions" and float(k) > 0.9 else x for name, x in given.items()}


def test_why_no_exporter_is_taken_is_said(tmp_path: Path) -> None:
    with pytest.raises(ExportError) as raised:
        gs.export_module(Branching(), SLIDER, out=tmp_path / "x.onnx", quiet=True)
    assert re.search(r"dynamo: \w+: Could not .*data-dependent", raised.value.found)
    assert re.search(r"TorchScript: .*: positions differs by 5.*, with t = .*, k = 1", raised.value.found)
    assert "\x1b" not in str(raised.value)


def test_a_number_of_rows_that_follows_an_input(tmp_path: Path) -> None:
    class Rows(Given):
        def forward(self, t: Any, k: Any) -> Any:
            count = COUNT if float(k) > 0.9 else COUNT // 2
            return {name: x[:count] for name, x in super().forward(t, k).items()}

    with pytest.raises(ExportError, match=r"found 32 at its inputs' defaults, 64 with .*k = 1.*opacity 0.*n_max=128"):
        gs.export_module(Rows(), SLIDER, out=tmp_path / "x.onnx", quiet=True)
    with pytest.raises(ExportError, match=r"is \[32, 3\] where the module writes \[64, 3\]: .*\.item\(\)"):
        gs.export_module(Rows(), SLIDER, out=tmp_path / "x.onnx", n_max=128, quiet=True)


def test_what_a_module_takes_instead_is_found(tmp_path: Path) -> None:
    class Posed(Given):
        def forward(self, t: Any, joints: Any) -> Any:
            return super().forward(t, joints[0].det())

    inputs = {"t": gs.time(), "joints": gs.pose(["hip", "knee"])}
    with pytest.raises(ExportError, match=r'joints \[2, 3\].*Give pose\(\.\.\., format="matrix"\): it runs'):
        gs.export_module(Posed(), inputs, out=tmp_path / "x.onnx", quiet=True)

    class Scalars(Given):
        def forward(self, t: Any, k: Any) -> Any:
            return super().forward(t[0], k) if t.dim() < 2 else self.missing

    with pytest.raises(ExportError, match=r"t \[1, 1\].*Give batched=False: it runs"):
        gs.export_module(Scalars(), SLIDER, out=tmp_path / "x.onnx", batched=True, quiet=True)

    class Layered(Given):
        def forward(self, t: Any, k: Any) -> Any:
            return super().forward(self.layer(t), k)

    layered = Layered()
    layered.layer = torch.nn.Linear(1, 1).double()
    with pytest.raises(ExportError, match=r"Its parameter layer.weight is float64: call module.float\(\)"):
        gs.export_module(layered, SLIDER, out=tmp_path / "x.onnx", quiet=True)

    class Halved(Given):
        def forward(self, t: Any, k: Any) -> Any:
            return super().forward(t, [0 * t, k][int(2 * k)] if k > 0 else k)

    with pytest.raises(
        ExportError, match=r"given t \[1\], k \[1\], with t = .*, k = 1: .*IndexError.*Narrow the ranges"
    ):
        gs.export_module(Halved(), SLIDER, out=tmp_path / "x.onnx", quiet=True)


def test_random_numbers_are_named(tmp_path: Path) -> None:
    class Noise(Given):
        def forward(self, t: Any, k: Any) -> Any:
            given = super().forward(t, k)
            return given | {"positions": given["positions"] + 0.01 * torch.randn(COUNT, 3)}

    with pytest.raises(ExportError, match=r"output positions .*run twice.*equal inputs.*torch\.randn"):
        gs.export_module(Noise(), SLIDER, out=tmp_path / "x.onnx", quiet=True)


def test_which_axis_is_up(tmp_path: Path) -> None:
    for given in ({"up": "y"}, gs.Coordinates("+y"), "y"):
        assert Coordinates.of(given).json() == {"up": "+y", "handedness": "right"}
    report = gs.export_module(Given(), SLIDER, out=tmp_path / "u.onnx", coordinates={"up": "+z"}, quiet=True)
    assert contract_of(report.path)["coordinates"]["up"] == "+z"
    for wrong in ({"up": "w"}, {"upward": "y"}, 3, gs.Coordinates("up")):  # type: ignore[arg-type]
        with pytest.raises(ExportError, match=r"coordinates: expected up, one of \+x.*found"):
            gs.export_module(Given(), SLIDER, out=tmp_path / "x.onnx", coordinates=wrong, quiet=True)  # type: ignore[arg-type]


def test_the_line_for_a_post_processor(tmp_path: Path) -> None:
    report = gs.export_module(
        torch.nn.ReLU(),
        {"image": gs.image(8, 8)},
        gs.image_output(),
        out=tmp_path / "f.onnx",
        name='"A" & B',
        quiet=True,
    )
    words = 'src="scene.ply" postprocess="f.onnx" alt="&quot;A&quot; &amp; B" camera-controls'
    assert report.html() == f"<gaussian-splat {words}></gaussian-splat>"


def test_largest_sign_and_parametric_rectifiers_stay_on_the_gpu(tmp_path: Path) -> None:
    class Limits(torch.nn.Module):  # type: ignore[misc]
        def forward(self, t: Any) -> Any:
            x = torch.linspace(-1, 1, COUNT)[:, None] * torch.ones(3) * t
            places = (
                torch.maximum(x, 0.3 * t)
                + torch.minimum(x.flip(0), x**2)
                + x.clamp(-0.5, 0.5).sign()
                + torch.nn.functional.prelu(x, torch.tensor([0.1, 0.2, 0.3]))
                + t.clamp(0.2, 0.8)
            )
            covariances = 0.01 * torch.tensor([1.0, 0, 0, 1, 0, 1]).repeat(COUNT, 1)
            return places, covariances, places.sigmoid(), torch.ones(COUNT, 1)

    layout = gs.split("positions", "covariances", "colors", "opacities")
    report = gs.export_module(Limits(), {"t": gs.time(2)}, layout, out=tmp_path / "x.onnx", quiet=True)
    assert max(report.errors.values()) < 1e-6
    assert [str(found) for found in report.findings] == []
    used = {node.op_type for node in onnx.load(report.path).graph.node}
    assert "Sign" not in used


def of_the_guide(name: str) -> dict[str, Any]:
    """The names of a class's example in docs/guide/own-generator.md, which writes its file into the current folder."""
    guide = (Path(__file__).parents[3] / "docs/guide/own-generator.md").read_text()
    code = next(part for part in guide.split("```python\n") if f"class {name}" in part).split("```")[0]
    scope: dict[str, Any] = {}
    exec(code, scope)
    return scope


def test_the_world_of_the_guide_reacts_to_actions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scope = of_the_guide("Pond")
    model, side = onnx.load("pond.onnx"), scope["SIDE"]
    assert gpu_findings(model) == []
    heights: dict[float, list[Any]] = {0.0: [], 1.0: []}
    for push, seen in heights.items():
        kept = np.zeros((3, side, side), np.float32)
        for frame in range(120):
            given = {"t": np.array([frame / 60]), "push": np.array([push * (frame < 10)]), "at": np.array([-0.5, 0.25])}
            written = run(model, {**given, "previous": kept})
            kept = next(values for values in written.values() if values.shape == kept.shape)
            seen.append(written["positions"][:, 2].reshape(side, side))
    assert not np.any(heights[0.0])
    highest = np.unravel_index(heights[1.0][12].argmax(), (side, side))
    # The rows are x, from -1 to 1.
    assert abs(highest[0] - 16) <= 1 and abs(highest[1] - 39) <= 1, highest
    far = [np.abs(each[40:, :]).max() for each in heights[1.0]]
    assert far[12] < 1e-3 and max(far[60:]) > 0.01, (far[12], max(far[60:]))
    assert np.abs(heights[1.0][-1]).max() < heights[1.0][12].max(), "waves lose height"


def test_the_diffusion_of_the_guide_converges_in_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scope = of_the_guide("Diffusion")
    model, count, points = onnx.load("diffusion.onnx"), scope["N"], scope["Diffusion"]().data[:, :3].numpy()
    ends = []
    for seed in (0, 1):
        kept = np.zeros((count + 1, 3), np.float32)
        far = []
        for time in np.linspace(0, scope["SECONDS"], 40):
            written = run(model, {"t": np.array([time]), "seed": np.array([seed], np.int32), "previous": kept})
            kept = next(values for name, values in written.items() if values.shape == kept.shape)
            nearest = np.sqrt(((written["positions"][::16, None] - points) ** 2).sum(2)).min(1)
            far.append(nearest.mean())
        assert far[0] > 0.4 and far[-1] < 0.03, far
        ends.append(written["positions"])
    # A slow page makes few runs: their large steps must not end in the middle of the data.
    kept = np.zeros((count + 1, 3), np.float32)
    for time in (0.0, scope["SECONDS"]):
        written = run(model, {"t": np.array([time]), "seed": np.array([0], np.int32), "previous": kept})
        kept = next(values for values in written.values() if values.shape == kept.shape)
    distances = np.sqrt(((written["positions"][:, None] - points) ** 2).sum(2))
    close = distances.min(1) < 0.1
    arcs = set(distances.argmin(1)[close] // 16)
    assert distances.min(1).mean() < 0.06 and len(arcs) == 64, (distances.min(1).mean(), len(arcs))
    assert np.abs(ends[0] - ends[1]).max() > 0.5


def flat_colors(places: Any) -> Any:
    """Covariances, colors and opacities for positions (N,3)."""
    covariances = 0.01 * torch.tensor([1.0, 0, 0, 1, 0, 1]).repeat(len(places), 1)
    return places, covariances, places.sigmoid(), torch.ones(len(places), 1)


COVARIANCES = gs.split("positions", "covariances", "colors", "opacities")


def test_convolutions_of_nine_channels_are_padded_and_stay_on_the_gpu(tmp_path: Path) -> None:
    class Rays(torch.nn.Module):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            torch.manual_seed(0)
            self.first = torch.nn.Conv2d(9, 8, 3, padding=1)
            self.last = torch.nn.Conv2d(8, 3, 1)

        def forward(self, image: Any) -> Any:
            x = self.last(self.first(torch.cat([image, image**2, image.flip(-1)], 1)).relu())
            return flat_colors(x[0].flatten(1).T)

    report = gs.export_module(Rays(), {"image": gs.image(8, 8)}, COVARIANCES, out=tmp_path / "x.onnx", quiet=True)
    assert max(report.errors.values()) < 1e-5 and report.findings == []
    weights = {tensor.name: list(tensor.dims) for tensor in onnx.load(report.path).graph.initializer}
    assert [8, 12, 3, 3] in weights.values() and [8, 9, 3, 3] not in weights.values()


class Detector(torch.nn.Module):  # type: ignore[misc]
    """Splits pixels above 0.9 from others: at 0.9 it decides by less than float32 holds."""

    def forward(self, image: Any) -> Any:
        return flat_colors(torch.sigmoid(1e7 * (image[0] - 0.9)).flatten(1).T)


def test_a_network_is_compared_at_examples_and_not_where_it_jumps(tmp_path: Path) -> None:
    image = np.eye(8, dtype=np.float32).reshape(1, 1, 8, 8).repeat(3, 1)
    close = np.full((1, 3, 8, 8), 0.9, np.float32)
    with pytest.raises(ExportError, match=r"change by a millionth.*image\(\.\.\., examples=\[photo\]\)"):
        gs.export_module(
            Detector(), {"image": gs.image(8, 8, examples=[close])}, COVARIANCES, out=tmp_path / "x.onnx", quiet=True
        )
    report = gs.export_module(
        Detector(), {"image": gs.image(8, 8, examples=[image])}, COVARIANCES, out=tmp_path / "x.onnx", quiet=True
    )
    assert max(report.errors.values()) < 1e-5
    mixed = gs.export_module(
        Detector(), {"image": gs.image(8, 8, examples=[image, close])}, COVARIANCES, out=tmp_path / "x.onnx", quiet=True
    )
    assert any("1 of 3 sets of inputs prove nothing" in note for note in mixed.notes), mixed.notes


def test_a_wrong_file_is_refused_at_an_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gaussian_exporter.module import export

    monkeypatch.setattr(export, "finish_graph", lambda model, *_: _doubled(model))
    with pytest.raises(ExportError, match=r"computes other numbers than PyTorch"):
        gs.export_module(Ball(), INPUTS, out=tmp_path / "x.onnx", quiet=True)


def _doubled(model: onnx.ModelProto) -> None:
    """Doubles the first stored table of the model, as a wrong exporter may."""
    table = next(t for t in model.graph.initializer if list(t.dims) == [COUNT, 3])
    table.CopyFrom(onnx.numpy_helper.from_array(2 * onnx.numpy_helper.to_array(table), table.name))


def test_columns_in_an_order_of_their_own(tmp_path: Path) -> None:
    class Rows(torch.nn.Module):  # type: ignore[misc]
        def forward(self, t: Any) -> Any:
            x = torch.linspace(0.1, 1, COUNT)[:, None] * t.clamp(min=0.1)
            return torch.cat([x.repeat(1, 3), x, x.repeat(1, 3), torch.ones(COUNT, 4), x.repeat(1, 3)], 1)[None]

    columns = ["positions", "opacities", "scales", "rotations", "colors"]
    report = gs.export_module(
        Rows(), {"t": gs.time(1)}, gs.packed(columns=columns, scales="log"), out=tmp_path / "x.onnx", quiet=True
    )
    outputs: Any = report.contract["outputs"]
    assert outputs["columns"] == columns and outputs["scaleActivation"] == "log"
    assert check_outputs(onnx.load(report.path))["gaussians"].shape == (COUNT, 14)


def test_several_poses_and_shapes_as_body_models_take_them(tmp_path: Path) -> None:
    class Head(torch.nn.Module):  # type: ignore[misc]
        def forward(self, betas: Any, expression: Any, global_orient: Any, neck: Any, jaw: Any) -> Any:
            turns = torch.cat([global_orient, neck, jaw]).reshape(3, 3)
            places = torch.linspace(-1, 1, COUNT)[:, None] * (1 + turns.sum(0)) + betas.sum() * 0.1
            return flat_colors(places + expression.mean())

    roles = {"betas": gs.shape(10), "expression": gs.shape(5), "global_orient": gs.pose(["global"], flat=True)}
    roles |= {"neck": gs.pose(["neck"], flat=True), "jaw": gs.pose(["jaw"], flat=True)}
    report = gs.export_module(Head(), roles, COVARIANCES, out=tmp_path / "x.onnx", quiet=True)
    contract = contract_of(report.path)
    assert [contract["inputs"][name]["role"] for name in roles] == ["shape"] * 2 + ["pose"] * 3
    assert header_faults(onnx.load(report.path), contract, tmp_path) == []


def test_a_role_of_which_a_page_has_one_is_refused_before_the_work(tmp_path: Path) -> None:
    class Clocks(torch.nn.Module):  # type: ignore[misc]
        def forward(self, a: Any, b: Any) -> Any:
            raise AssertionError("the module ran")

    with pytest.raises(ExportError, match=r"inputs a and b: expected one input with the role time"):
        gs.export_module(Clocks(), {"a": gs.time(1), "b": gs.time(1)}, out=tmp_path / "x.onnx")


def test_weights_in_eight_bits_have_their_measured_loss(tmp_path: Path) -> None:
    class Network(torch.nn.Module):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            torch.manual_seed(0)
            self.first = torch.nn.Conv2d(3, 64, 3, padding=1)
            self.second = torch.nn.Conv2d(64, 64, 3, padding=1)
            self.last = torch.nn.Linear(64, 64)
            self.head = torch.nn.Linear(64, 3)

        def forward(self, image: Any) -> Any:
            x = self.second(self.first(image).relu()).relu()[0].flatten(1).T
            return flat_colors(self.head(self.last(x).relu()))

    inputs, reports = {"image": gs.image(8, 8)}, []
    for weights in ("float32", "int8"):
        reports.append(
            gs.export_module(
                Network(), inputs, COVARIANCES, out=tmp_path / f"{weights}.onnx", weights=weights, quiet=True
            )
        )
    plain, small = reports
    assert small.path.stat().st_size < 0.4 * plain.path.stat().st_size
    assert [finding.kind for finding in small.findings] == []
    note = next(note for note in small.notes if "in 8 bits" in note)
    loss = re.search(r"(\d+) tables .* positions ([\d.]+) dB", note)
    assert loss is not None and int(loss[1]) == 3 and 30 < float(loss[2]) < 70, note
    image = np.random.default_rng(0).random((1, 3, 8, 8)).astype(np.float32)
    first, second = (run(onnx.load(report.path), {"image": image})["positions"] for report in reports)
    assert 0 < np.abs(first - second).max() < 0.03 * np.abs(first).max()


def test_a_module_that_goes_on_from_another_generator(tmp_path: Path) -> None:
    class Turn(torch.nn.Module):  # type: ignore[misc]
        def forward(self, places: Any, shapes: Any, tints: Any, alphas: Any, angle: Any) -> Any:
            x, y, z = places.split(1, -1)
            turned = torch.cat([angle.cos() * x + angle.sin() * z, y, angle.cos() * z - angle.sin() * x], -1)
            return turned, shapes, tints, alphas

    names = {"places": "positions", "shapes": "covariances", "tints": "colors", "alphas": "opacities"}
    inputs: dict[str, Any] = {name: gs.gaussians(attribute, COUNT) for name, attribute in names.items()}  # type: ignore[arg-type]
    inputs["angle"] = gs.control(-1, 1)
    report = gs.export_module(Turn(), inputs, COVARIANCES, out=tmp_path / "x.onnx", quiet=True)
    contract = contract_of(report.path)
    assert contract["inputs"]["alphas"] == {
        "role": "gaussians",
        "attribute": "opacities",
        "opacityActivation": "linear",
    }
    model = onnx.load(report.path)
    assert header_faults(model, contract, tmp_path) == [] and len(check_outputs(model)["positions"]) == COUNT
    assert max(report.errors.values()) < 1e-6
