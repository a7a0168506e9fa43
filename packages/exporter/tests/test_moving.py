"""Gaussians that move, against the formulas of the trainers' code, written out in float64; and their files."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

from gaussian_exporter.arrays import Doubles
from gaussian_exporter.checkpoints.clouds import read_cloud
from gaussian_exporter.checkpoints.hexplane_folder import read_hexplane
from gaussian_exporter.checkpoints.moving import (
    deform_of,
    gaussian4d_of,
    read_deformable,
    read_gaussian4d,
    read_spacetime,
)
from gaussian_exporter.checkpoints.torch_file import Weights
from gaussian_exporter.cli import main
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.classic import export_classic
from gaussian_exporter.families.deformable import Deform, export_deformable
from gaussian_exporter.families.gaussian4d import Gaussian4D, export_gaussian4d
from gaussian_exporter.families.spacetime import Spacetime, export_spacetime
from gaussian_exporter.outputs import Options
from gaussian_exporter.pieces.mlp import Linear

from .running import FACTS, UPPER, covariance, error, parts, run, write_ply
from .test_classic import cloud
from .test_hexplane import layers, write_cloud

TIMES = [0.0, 0.13, 0.5, 1.0]
COUNT = 50
ORACLES = Path(__file__).parents[3] / "tests/fixtures/oracles"


def spacetime() -> Spacetime:
    rng = np.random.default_rng(4)

    def draw(width: int, size: float = 1.0, middle: float = 0.0) -> Any:
        return rng.normal(middle, size, (COUNT, width)).astype(np.float32)

    return Spacetime(
        positions=draw(3),
        centers=rng.uniform(0, 1, (COUNT, 1)).astype(np.float32),
        widths=draw(1, 0.5, -1),
        motion=draw(9, 0.5),
        rotations=draw(4),
        turns=draw(4, 0.3),
        log_scales=draw(3, 0.5, -3),
        opacity_logits=draw(1, 2),
        colors=rng.uniform(0, 1, (COUNT, 3)).astype(np.float32),
    )


def reference_of_spacetime(model: Spacetime, time: float) -> dict[str, Doubles]:
    """thirdparty/gaussian_splatting/renderer, train_ours_lite, with its basic function exp(-x^2)."""
    t = time - np.float64(model.centers)
    motion: Any = np.float64(model.motion)
    at = model.positions + motion[:, 0:3] * t + motion[:, 3:6] * t * t + motion[:, 6:9] * t * t * t
    gate = np.exp(-((t / np.exp(np.float64(model.widths))) ** 2))
    return {
        "positions": at,
        "covariances": covariance(np.exp(np.float64(model.log_scales)), model.rotations + t * model.turns),
        "opacities": gate / (1 + np.exp(-np.float64(model.opacity_logits))),
        "color": np.float64(model.colors),
    }


@pytest.mark.parametrize("time", TIMES)
def test_spacetime_gaussians(time: float) -> None:
    found = parts(run(export_spacetime(spacetime(), FACTS), {"time": np.array([time])}))
    for name, values in reference_of_spacetime(spacetime(), time).items():
        assert error(found[name], values) < 1e-5, name


def test_instances_of_spacetime_gaussians_are_each_their_own() -> None:
    many = run(export_spacetime(spacetime(), FACTS, Options(instances=4)), {"time": np.array([[0.1], [0.7]])})
    for i, time in enumerate((0.1, 0.7)):
        alone = run(export_spacetime(spacetime(), FACTS), {"time": np.array([time])})
        for name, values in alone.items():
            assert error(many[name][i], values) < 1e-5, name


def deform(blender: bool = False) -> Deform:
    rng = np.random.default_rng(8)
    moments, width = (30 if blender else 21), 16
    given = 63 + moments
    inner = [given, *[width] * 4, width + given, width, width]
    return Deform(
        layers=[layers(rng, size, width)[0] for size in inner],
        position=layers(rng, width, 3)[0],
        rotation=layers(rng, width, 4)[0],
        scale=Linear(layers(rng, width, 3)[0].weight * 0.02, np.full(3, 0.01, np.float32)),
        time_network=layers(rng, 13, 24, 30) if blender else None,
        time_octaves=6 if blender else 10,
    )


def reference_of_deform(model: Deform, time: float) -> dict[str, Doubles]:
    """utils/time_utils.py and gaussian_renderer, with the rasterizer's covariance of a quaternion as it is."""
    given = cloud(COUNT, 3)

    def code(x: Doubles, octaves: int) -> Doubles:
        waves = [wave(x * 2.0**i) for i in range(octaves) for wave in (np.sin, np.cos)]
        return np.concatenate([x, *waves], 1)

    def layer(one: Linear, x: Doubles) -> Doubles:
        result: Doubles = x @ np.float64(one.weight).T + one.bias
        return result

    moment = code(np.array([[float(np.float32(time))]]), model.time_octaves)
    if model.time_network:
        moment = layer(model.time_network[1], np.maximum(layer(model.time_network[0], moment), 0))
    place = code(given.positions.astype(np.float64), 10)
    codes = np.concatenate([place, np.repeat(moment, len(place), 0)], 1)
    x = codes
    for index, one in enumerate(model.layers):
        x = np.maximum(layer(one, x), 0)
        if index == 4:
            x = np.concatenate([codes, x], 1)
    rest = given.rotations / np.linalg.norm(given.rotations, axis=1, keepdims=True)
    w, i, j, k = (rest + layer(model.rotation, x)).T
    rows = [1 - 2 * (j * j + k * k), 2 * (i * j - w * k), 2 * (i * k + w * j)]
    rows += [2 * (i * j + w * k), 1 - 2 * (i * i + k * k), 2 * (j * k - w * i)]
    rows += [2 * (i * k - w * j), 2 * (j * k + w * i), 1 - 2 * (i * i + j * j)]
    scales = np.exp(np.float64(given.log_scales)) + layer(model.scale, x)
    half = np.stack(rows, 1).reshape(-1, 3, 3) * scales[:, None, :]
    return {
        "positions": given.positions + layer(model.position, x),
        "covariances": (half @ half.transpose(0, 2, 1))[:, UPPER[0], UPPER[1]],
        "opacities": 1 / (1 + np.exp(-np.float64(given.opacity_logits))),
        "color": np.float64(given.sh).reshape(COUNT, -1),
    }


@pytest.mark.parametrize("blender", [False, True])
@pytest.mark.parametrize("time", TIMES)
def test_deformable_gaussians(time: float, blender: bool) -> None:
    model = deform(blender)
    found = parts(run(export_deformable(cloud(COUNT, 3), model, FACTS), {"time": np.array([time])}))
    for name, values in reference_of_deform(model, time).items():
        assert error(found[name], values) < 1e-4, name


def test_a_rigid_deform_network_is_refused() -> None:
    with pytest.raises(ExportError, match=r"is_6dof.*\[checkpoint/unsupported\]"):
        deform_of(Weights({"branch_w.weight": np.zeros((3, 4), np.float32)}, "deform.pth"))


def captured(turned: bool = True, degree_t: int = 2) -> list[Any]:
    """As GaussianModel.capture gives it for Gaussians of four dimensions."""
    rng = np.random.default_rng(6)

    def draw(*shape: int, size: float = 1.0, middle: float = 0.0) -> Any:
        return rng.normal(middle, size, (COUNT, *shape)).astype(np.float32)

    terms = 16 * (degree_t + 1)
    own = [3, draw(3), draw(1, 3), draw(terms - 1, 3, size=0.2), draw(3, size=0.5, middle=-2), draw(4), draw(1, size=2)]
    times = rng.uniform(0, 10, (COUNT, 1)).astype(np.float32)
    return [*own, *[None] * 6, times, draw(1, middle=0.3), draw(4), turned, np.zeros(0, np.float32), degree_t]


def reference_of_4d(model: Gaussian4D, time: float) -> dict[str, Doubles]:
    """cuda_rasterizer/forward.cu: computeCov3D_conditional and computeColorFromSH_4D, a Gaussian at a time."""
    now = model.start + time * (model.end - model.start)
    rows: dict[str, list[Any]] = {"positions": [], "covariances": [], "opacities": [], "color": []}
    for i in range(len(model.positions)):
        dt = now - float(model.times[i, 0])
        scale, scale_t = np.exp(np.float64(model.log_scales[i])), float(np.exp(np.float64(model.log_scales_t[i, 0])))
        moved = np.zeros(3)
        if model.rotations_r is None:
            cut = covariance(scale[None], model.rotations[i : i + 1])[0]
            sigma = scale_t
        else:
            first: Any = np.float64(model.rotations[i]) / np.linalg.norm(np.float64(model.rotations[i]))
            second: Any = np.float64(model.rotations_r[i]) / np.linalg.norm(np.float64(model.rotations_r[i]))
            (a, b, c, d), (p, q, r, s) = first, second
            # Columns, as glm stores them.
            left = np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]]).T
            right = np.array([[p, q, r, s], [-q, p, -s, r], [-r, s, p, -q], [-s, -r, q, p]]).T
            m = np.diag([*scale, scale_t]) @ (right @ left)
            full = m.T @ m
            sigma = full[3, 3]
            cut = (full[:3, :3] - np.outer(full[:3, 3], full[:3, 3]) / sigma)[UPPER[0], UPPER[1]]
            moved = full[:3, 3] / sigma * dt
        share = np.exp(-0.5 * dt * dt / sigma)
        waves = [np.cos(2 * np.pi * k * -dt / (model.end - model.start)) for k in range(3)]
        sh = sum(waves[k] * np.float64(model.sh[i, 16 * k : 16 * k + 16]) for k in range(model.sh.shape[1] // 16))
        rows["positions"].append(model.positions[i] + moved)
        rows["covariances"].append(cut)
        rows["opacities"].append([share / (1 + np.exp(-np.float64(model.opacity_logits[i, 0]))) * (share > 0.05)])
        rows["color"].append(np.ravel(sh))
    return {name: np.array(values) for name, values in rows.items()}


@pytest.mark.parametrize(("turned", "degree_t"), [(True, 2), (True, 0), (False, 1)])
@pytest.mark.parametrize("time", TIMES)
def test_gaussians_of_four_dimensions(time: float, turned: bool, degree_t: int) -> None:
    model = gaussian4d_of(Path("x"), captured(turned, degree_t), {"time_duration": [0.0, 10.0]}, "straight")
    found = parts(run(export_gaussian4d(model, FACTS), {"time": np.array([time])}))
    for name, values in reference_of_4d(model, time).items():
        assert error(found[name], values) < 1e-4, name


def test_four_dimensions_as_the_trainers_own_class_cuts_them(tmp_path: Path) -> None:
    """want.json: GaussianModel of fudan-zvg/4d-gaussian-splatting at 63725f2, which saved the checkpoint, too."""
    folder = ORACLES / "4dgs"
    out = tmp_path / "x.onnx"
    given = ["4dgs", str(folder), str(out), "--license", "x", "--attribution", "x"]
    assert main(given) == 1
    assert main([*given, "--time-duration", "0", "10"]) == 0
    for wanted in json.loads((folder / "want.json").read_text()):
        found = parts(run(onnx.load(out), {"time": np.array([wanted["share_of_duration_0_to_10"]])}))
        shown = np.array(wanted["shown"])
        assert np.array_equal(found["opacities"][:, 0] > 0, shown)
        assert error(found["opacities"][shown], np.array(wanted["opacities"]).reshape(-1, 1)[shown]) < 1e-5
        for name, key in (("positions", "positions"), ("covariances", "covariances_xx_xy_xz_yy_yz_zz")):
            assert error(found[name][shown], np.array(wanted[key])[shown]) < 1e-5, name


def test_a_frame_ratio_shortens_the_time_as_the_trainer_does(tmp_path: Path) -> None:
    shutil.copy(ORACLES / "4dgs/chkpnt30000.pth", tmp_path)
    (tmp_path / "cfg_args").write_text("Namespace(frame_ratio=2, prefilter_var=-1.0)")
    found = read_gaussian4d(tmp_path, duration=(0, 10))
    assert (found.start, found.end) == (0, 5)
    (tmp_path / "cfg_args").write_text("Namespace(wavelets=True, bells=False)")
    with pytest.raises(ExportError, match=r"settings wavelets:"):
        read_gaussian4d(tmp_path, duration=(0, 10))


def write_spacetime(folder: Path) -> Path:
    model = spacetime()
    columns = {axis: model.positions[:, i] for i, axis in enumerate("xyz")}
    columns |= {"trbf_center": model.centers[:, 0], "trbf_scale": model.widths[:, 0]}
    for prefix, values in (
        ("motion", model.motion),
        ("f_dc", model.colors),
        ("opacity", model.opacity_logits),
        ("scale", model.log_scales),
        ("rot", model.rotations),
        ("omega", model.turns),
    ):
        many = values.shape[1] > 1
        columns |= {f"{prefix}_{i}" if many else prefix: values[:, i] for i in range(values.shape[1])}
    return write_ply(folder / "point_cloud" / "iteration_25000" / "point_cloud.ply", columns)


def test_files_of_spacetime_gaussians(tmp_path: Path) -> None:
    path = write_spacetime(tmp_path)
    again = read_spacetime(tmp_path)
    for name in Spacetime.__dataclass_fields__:
        assert np.array_equal(getattr(again, name), getattr(spacetime(), name)), name
    with pytest.raises(
        ExportError, match=r"trbf_center: a checkpoint of SpacetimeGaussians. Run gaussian-export spacetime"
    ):
        read_cloud(path)


def test_a_property_that_nobody_knows_is_not_passed_over(tmp_path: Path) -> None:
    given = cloud(5, 0)
    columns = {axis: given.positions[:, i] for i, axis in enumerate("xyz")} | {"opacity": given.opacity_logits[:, 0]}
    for prefix, values in (("scale", given.log_scales), ("rot", given.rotations), ("f_dc", given.sh[:, 0])):
        columns |= {f"{prefix}_{i}": values[:, i] for i in range(values.shape[1])}
    path = write_ply(tmp_path / "a.ply", columns | {"wobble": given.opacity_logits[:, 0]})
    with pytest.raises(ExportError, match=r"properties wobble.*--ignore wobble"):
        read_cloud(path)
    assert len(read_cloud(path, ["wobble"]).positions) == 5
    for neighbor, family in (("deform", "Deformable-3D"), ("mlp_ckpt", "GauHuman")):
        folder = tmp_path / neighbor
        write_ply(folder / "point_cloud" / "iteration_7" / "point_cloud.ply", columns)
        (folder / neighbor).mkdir()
        with pytest.raises(ExportError, match=family):
            read_cloud(folder)


def test_mip_splattings_filter_widens_and_fades(tmp_path: Path) -> None:
    given = cloud(5, 0)
    columns = {axis: given.positions[:, i] for i, axis in enumerate("xyz")} | {"opacity": given.opacity_logits[:, 0]}
    for prefix, values in (("scale", given.log_scales), ("rot", given.rotations), ("f_dc", given.sh[:, 0])):
        columns |= {f"{prefix}_{i}": values[:, i] for i in range(values.shape[1])}
    width = np.full(5, 0.1, np.float32)
    found = read_cloud(write_ply(tmp_path / "a.ply", columns | {"filter_3D": width}))
    squared = np.exp(2 * np.float64(given.log_scales))
    assert error(np.exp(np.float64(found.log_scales)), np.sqrt(squared + 0.01)) < 1e-5
    shares: Any = np.sqrt(squared.prod(1) / (squared + 0.01).prod(1)) / (
        1 + np.exp(-np.float64(given.opacity_logits[:, 0]))
    )
    assert error(1 / (1 + np.exp(-np.float64(found.opacity_logits[:, 0]))), shares) < 1e-5
    # As the reader of pages has it, so that both draw one scene.
    contract: Any = json.loads(export_classic(found, FACTS).metadata_props[0].value)
    assert contract["filter"] == "mip" and contract["antialiased"] is True


def test_a_4dgaussians_training_without_cfg_args_is_refused(tmp_path: Path) -> None:
    (tmp_path / "point_cloud" / "iteration_3").mkdir(parents=True)
    with pytest.raises(ExportError, match=r"cfg_args in it or up to two folders above it.*\[checkpoint/incomplete\]"):
        read_hexplane(tmp_path / "point_cloud" / "iteration_3")
    (tmp_path / "cfg_args").write_text("Namespace(no_do=False)")
    # Found: what is missing now is another file.
    with pytest.raises(ExportError, match=r"deformation.pth"):
        read_hexplane(tmp_path / "point_cloud" / "iteration_3")


def gsplat_splats(torch: Any, colors: bool = False) -> dict[str, Any]:
    given = cloud(COUNT, 3)
    own = {"means": given.positions, "scales": given.log_scales, "quats": given.rotations}
    own |= {"opacities": given.opacity_logits[:, 0], "sh0": given.sh[:, :1], "shN": given.sh[:, 1:]}
    return {name: torch.nn.Parameter(torch.from_numpy(np.ascontiguousarray(value))) for name, value in own.items()}


def same_cloud(path: Path) -> None:
    found, given = read_cloud(path), cloud(COUNT, 3)
    for name in ("positions", "log_scales", "rotations", "opacity_logits", "sh"):
        assert np.array_equal(getattr(found, name), getattr(given, name)), name


def test_files_of_gsplat_and_nerfstudio(tmp_path: Path) -> None:
    torch: Any = pytest.importorskip("torch")
    splats = gsplat_splats(torch)
    folder = tmp_path / "ckpts"
    folder.mkdir()
    half = {name: value[:20] for name, value in splats.items()}
    rest = {name: value[20:] for name, value in splats.items()}
    torch.save({"step": 29999, "splats": half}, folder / "ckpt_29999_rank0.pt")
    torch.save({"step": 29999, "splats": rest}, folder / "ckpt_29999_rank1.pt")
    torch.save({"step": 6999, "splats": rest}, folder / "ckpt_6999_rank0.pt")
    same_cloud(tmp_path)
    names = {"sh0": "features_dc", "shN": "features_rest"}
    state = {f"_model.gauss_params.{names.get(name, name)}": value for name, value in splats.items()}
    state["_model.gauss_params.features_dc"] = state["_model.gauss_params.features_dc"][:, 0]
    state["_model.gauss_params.opacities"] = state["_model.gauss_params.opacities"][:, None]
    file = tmp_path / "run" / "nerfstudio_models" / "step-000029999.ckpt"
    file.parent.mkdir(parents=True)
    metrics = {"_model.lpips.net.weight": torch.zeros(3), "_model.camera_optimizer.pose_adjustment": torch.zeros(4, 6)}
    extra = {"optimizers": {}, "scalers": {"scale": 1.0}}
    torch.save({"step": 29999, "pipeline": {**state, **metrics}, **extra}, file)
    same_cloud(tmp_path / "run")
    assert main(["classic", str(file), str(tmp_path / "x.onnx"), "--license", "MIT", "--attribution", "A"]) == 0
    # Without harmonics, colors are a sigmoid: what the page then shows of 0.5 + c Y is the same.
    state["_model.gauss_params.features_rest"] = torch.zeros(COUNT, 0, 3)
    torch.save({"pipeline": state}, file)
    shown: Any = 0.5 + 0.28209479177387814 * np.float64(read_cloud(file).sh[:, 0])
    assert error(shown, 1 / (1 + np.exp(-cloud(COUNT, 3).sh[:, 0].astype(np.float64)))) < 1e-6
    for name in ("_model.gauss_params.appearance_features", "_model.color_nn.0.weight"):
        torch.save({"pipeline": {**state, name: torch.zeros(COUNT, 3)}}, file)
        with pytest.raises(ExportError, match=rf"tensors {name}:"):
            read_cloud(file)
        assert len(read_cloud(file, [name.removesuffix(".0.weight")]).positions) == COUNT
    torch.save({"splats": {**splats, "features": splats["means"]}}, file)
    with pytest.raises(ExportError, match=r"appearance optimisation"):
        read_cloud(file)
    torch.save({"state_dict": {}, "epoch": 3}, file)
    with pytest.raises(ExportError, match=r"a PyTorch file with state_dict, epoch"):
        read_cloud(file)


@pytest.mark.parametrize("is_plain", [True, False])
def test_settings_around_a_checkpoint_give_the_filter_and_the_up_axis(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], is_plain: bool
) -> None:
    torch: Any = pytest.importorskip("torch")
    splats = gsplat_splats(torch)
    names = {"sh0": "features_dc", "shN": "features_rest"}
    state = {f"_model.module.gauss_params.{names.get(name, name)}": value for name, value in splats.items()}
    turned, filter_ = ("none", "classic") if is_plain else ("vertical", "antialiased")
    made: dict[str, tuple[str, Any, str]] = {
        "cfg.yml": (
            "ckpts/ckpt_7_rank0.pt",
            {"splats": splats},
            f"antialiased: {str(not is_plain).lower()}\nnormalize_world_space: {str(not is_plain).lower()}\n",
        ),
        "config.yml": (
            "nerfstudio_models/step-000000007.ckpt",
            {"pipeline": state},
            f"dataparser: !!python/object:x\n  orientation_method: {turned}\nmodel:\n  rasterize_mode: {filter_}\n",
        ),
    }
    for name, (file, content, settings) in made.items():
        path = tmp_path / name / file
        path.parent.mkdir(parents=True)
        torch.save(content, path)
        out = tmp_path / "x.onnx"
        given = ["classic", str(path), str(out), "--license", "MIT", "--attribution", "A"]
        assert main(given) == 0 and f"no {name} around" in capsys.readouterr().out
        (path.parents[1] / name).write_text(settings)
        same_cloud(path)
        assert main(given) == 0 and "note" not in capsys.readouterr().out
        contract = json.loads(onnx.load(out).metadata_props[0].value)
        assert contract["coordinates"]["up"] == ("-y" if is_plain else "+z")
        assert (contract["filter"], contract["antialiased"]) == (filter_, not is_plain)
        # Options of the author count more.
        assert main([*given, "--up", "+x", "--filter", "mip"]) == 0
        contract = json.loads(onnx.load(out).metadata_props[0].value)
        assert contract["coordinates"]["up"] == "+x" and contract["filter"] == "mip"


@pytest.mark.parametrize(("neighbor", "family"), [("skin.glb", "LAM"), ("embedding.json", "SplattingAvatar")])
def test_parts_of_avatars_are_refused_by_name(tmp_path: Path, neighbor: str, family: str) -> None:
    write_cloud(tmp_path / "offset.ply", cloud(COUNT, 0))
    same = read_cloud(tmp_path / "offset.ply")
    (tmp_path / neighbor).write_text("")
    with pytest.raises(ExportError, match=rf"{neighbor}.*a checkpoint of {family}"):
        read_cloud(tmp_path / "offset.ply")
    assert np.array_equal(read_cloud(tmp_path / "offset.ply", [neighbor]).positions, same.positions)
    # The folder, which has no point_cloud.ply, gets the same name; one without any of these files is not a training.
    with pytest.raises(ExportError, match=rf"{neighbor}.*a checkpoint of {family}"):
        read_cloud(tmp_path)
    with pytest.raises(ExportError, match=rf"expected a training.*beside it lie .*{neighbor}"):
        read_cloud(tmp_path, [neighbor])


def test_what_gsplat_saves_besides_is_refused_by_name(tmp_path: Path) -> None:
    torch: Any = pytest.importorskip("torch")
    splats = gsplat_splats(torch)
    path = tmp_path / "ckpt_7_rank0.pt"
    for name in ("post_processing", "app_module"):
        torch.save({"step": 7, "splats": splats, name: {"weight": torch.zeros(3)}}, path)
        with pytest.raises(ExportError, match=rf"entries {name}:"):
            read_cloud(path)
    torch.save({"step": 7, "splats": splats | {"velocities": splats["means"], "times": splats["opacities"]}}, path)
    with pytest.raises(ExportError, match=r"velocities, times"):
        read_cloud(path)
    torch.save({"step": 7, "splats": splats, "pose_adjust": {"embeds.weight": torch.zeros(3, 9)}}, path)
    same_cloud(path)
    # gsplat's trainer of 2D Gaussians writes the same keys into a file without a rank.
    with pytest.raises(ExportError, match=r"2D Gaussian Splatting"):
        read_cloud(path.rename(tmp_path / "ckpt_7.pt"))
    assert len(read_cloud(tmp_path / "ckpt_7.pt", ["2d"]).positions) == COUNT


def test_captured_models(tmp_path: Path) -> None:
    torch: Any = pytest.importorskip("torch")
    own = gsplat_splats(torch)
    parameters = [own[name] for name in ("means", "sh0", "shN", "scales", "quats")] + [own["opacities"][:, None]]
    optimizer = torch.optim.Adam([{"params": [own["means"]], "name": "xyz"}], lr=0.0).state_dict()
    zeros = torch.zeros(COUNT)
    path = tmp_path / "chkpnt30000.pth"
    torch.save(((3, *parameters, zeros, zeros, zeros, optimizer, 1.5), 30000), path)
    same_cloud(path)
    (tmp_path / "cfg_args").write_text("Namespace(eval=True, kernel_size=0.1, ray_jitter=False)")
    with pytest.raises(ExportError, match=r"Mip-Splatting. Give its point_cloud.ply"):
        read_cloud(path)
    (tmp_path / "cfg_args").write_text("Namespace(eval=True, sh_degree=3, deblur=True)")
    with pytest.raises(ExportError, match=r"settings deblur:"):
        read_cloud(path)
    assert len(read_cloud(path, ["deblur"]).positions) == COUNT
    (tmp_path / "cfg_args").unlink()
    entries = [torch.from_numpy(x) if isinstance(x, np.ndarray) else x for x in captured()]
    torch.save((tuple(entries), 30000), path)
    with pytest.raises(ExportError, match=r"4D Gaussian Splatting. Run gaussian-export 4dgs"):
        read_cloud(path)
    (tmp_path / "cfg_args").write_text("Namespace(eval=True)")
    with pytest.raises(ExportError, match=r"--time-duration"):
        read_gaussian4d(tmp_path)
    (tmp_path / "cfg_args").write_text("Namespace(time_duration=[0.0, 10.0], rot_4d=True, gaussian_dim=4)")
    found = read_gaussian4d(tmp_path)
    assert found.rotations_r is not None and found.sh.shape == (COUNT, 48, 3) and found.end == 10
    assert main(["4dgs", str(tmp_path), str(tmp_path / "x.onnx"), "--license", "MIT", "--attribution", "A"]) == 0


def test_files_of_a_deform_network(tmp_path: Path) -> None:
    torch: Any = pytest.importorskip("torch")
    model = deform(True)
    named = {"gaussian_warp": model.position, "gaussian_rotation": model.rotation, "gaussian_scaling": model.scale}
    named |= {f"linear.{i}": layer for i, layer in enumerate(model.layers)}
    assert model.time_network is not None
    named |= {f"timenet.{2 * i}": layer for i, layer in enumerate(model.time_network)}
    state = {f"{name}.weight": torch.from_numpy(layer.weight) for name, layer in named.items()}
    state |= {f"{name}.bias": torch.from_numpy(layer.bias) for name, layer in named.items()}
    path = tmp_path / "deform" / "iteration_40000" / "deform.pth"
    path.parent.mkdir(parents=True)
    torch.save(state, path)
    from gaussian_exporter.checkpoints.torch_file import read_weights

    torch.save(state | {"mask_net.weight": torch.zeros(2)}, path)
    write_cloud(tmp_path / "point_cloud/iteration_40000/point_cloud.ply", cloud(COUNT, 3))
    with pytest.raises(ExportError, match=r"tensors mask_net.weight:"):
        read_deformable(tmp_path)
    assert len(read_deformable(tmp_path, ["mask_net"])[0].positions) == COUNT
    again = deform_of(read_weights(path))
    at = {"time": np.array([0.3])}
    first, second = (run(export_deformable(cloud(COUNT, 3), one, FACTS), at) for one in (model, again))
    assert all(np.array_equal(first[name], second[name]) for name in first)


@pytest.mark.parametrize(
    ("entry", "name", "network"),
    [
        ("state_dict", "encoder.epipolar_transformer.transformer.layers.0.0.norm.weight", "pixelSplat"),
        ("state_dict", "encoder.depth_predictor.corr_refine_net.0.weight", "MVSplat"),
        ("model_state_dict", "network_with_offset.out.weight", "Splatter Image"),
        ("", "gs_tokens", "TokenGS"),
        ("state_dict", "encoder.gaussian_regressor.0.weight", "DepthSplat"),
        ("state_dict", "encoder.aggregator.patch_embed.weight", "AnySplat"),
        ("", "unet.down_blocks.0.nets.0.conv1.weight", "LGM"),
        ("", "deformation_dec", "HUGS"),
        ("network", "module.human_gaussian.triplane", "ExAvatar"),
        ("", "exp_color_mlp.layers.0.weight", "gaussian-head"),
        ("converter", "deformer.non_rigid.mlp.weight", "3DGS-Avatar"),
    ],
)
def test_weights_of_networks_are_refused_by_name(tmp_path: Path, entry: str, name: str, network: str) -> None:
    torch: Any = pytest.importorskip("torch")
    state = {name: torch.zeros(3)}
    torch.save({entry: state, "global_step": 3} if entry else state, tmp_path / "last.ckpt")
    with pytest.raises(ExportError, match=rf"a checkpoint of {network}\. .*export_module"):
        read_cloud(tmp_path / "last.ckpt")
