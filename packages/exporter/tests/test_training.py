"""Runs trainers for a few steps on tiny images, up to files that conform to the contract and agree with PyTorch's own
forward pass. Needs PyTorch: npm run test:exporter -- --torch.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

from gaussian_exporter.arrays import AnyArray
from gaussian_exporter.checkpoints.avatar_file import read_avatar
from gaussian_exporter.checkpoints.hexplane_folder import read_hexplane
from gaussian_exporter.checkpoints.networks import read_feed_forward, read_image_filter
from gaussian_exporter.checkpoints.scaffold_folder import read_scaffold
from gaussian_exporter.conformance import check_outputs
from gaussian_exporter.families.avatar import export_avatar
from gaussian_exporter.families.feed_forward import export_feed_forward
from gaussian_exporter.families.hexplane import export_hexplane
from gaussian_exporter.families.image_filter import export_image_filter
from gaussian_exporter.families.scaffold import export_scaffold
from gaussian_exporter.placement import gpu_findings

from .running import FACTS, error, parts, run
from .test_classic import cloud
from .test_hexplane import write_cloud

torch: Any = pytest.importorskip("torch", reason="PyTorch is not installed: npm run test:exporter -- --torch")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "training"))
# The machine is shared: threads that wait for one another take ten times as long as one.
torch.set_num_threads(1)
SIZE = 16


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Orbits around a still and a swaying heap of Gaussians: still.npz, sway.npz and their points."""
    import make_views

    folder = tmp_path_factory.mktemp("views")
    write_cloud(folder / "scene.ply", cloud(40, 0))
    for kind, name in (("orbit", "still"), ("sway", "sway")):
        arguments = [kind, str(folder / "scene.ply"), str(folder / name), "--size", str(SIZE), "--count", "16"]
        make_views.main(arguments)
    return folder


def inputs(folder: Path, name: str) -> list[str]:
    return [str(folder / f"{name}.npz"), str(folder / f"{name}.npy")]


def recorded(folder: Path) -> dict[str, Any]:
    record: dict[str, Any] = json.loads((folder / "record.json").read_text())
    assert record["options"]["seed"] == 0 and record["seconds"] >= 0
    return record


def assert_agrees(model: onnx.ModelProto, feeds: dict[str, AnyArray], splats: Any) -> None:
    """The exported file writes what PyTorch computes."""
    check_outputs(model)
    assert gpu_findings(model) == []
    found = parts(run(model, feeds))
    full = splats.covariances.detach().numpy()
    assert error(found["positions"], splats.positions.detach().numpy()) < 1e-4
    assert error(found["covariances"], full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]) < 1e-3
    assert error(found["opacities"][:, 0], splats.opacities.detach().numpy()) < 1e-4


def test_scaffold(views: Path, tmp_path: Path) -> None:
    import common
    import scaffold

    still = common.load_views(views / "still.npz", "cpu")
    points = np.load(views / "still.npy")
    _, untrained = scaffold.train(still, points, common.Schedule(1), 60, 0)
    scaffold.main([str(views / "still.npz"), str(views / "still.npy"), str(tmp_path), "--steps", "80", "--count", "40"])
    assert recorded(tmp_path)["whole_picture_psnr"] > untrained["whole_picture_psnr"] + 1
    model = export_scaffold(read_scaffold(tmp_path), FACTS)
    again, _ = scaffold.train(still, points, common.Schedule(3), 60, 0)
    again.save(tmp_path / "again")
    eye = np.array([0.5, -0.3, -3.0], np.float32)
    exported = export_scaffold(read_scaffold(tmp_path / "again"), FACTS)
    assert_agrees(exported, {"camera_position": eye}, again(torch.tensor(eye)))
    assert gpu_findings(model) == []


def test_hexplane(views: Path, tmp_path: Path) -> None:
    import common
    import hexplane

    swaying = common.load_views(views / "sway.npz", "cpu")
    points = np.load(views / "sway.npy")
    _, untrained = hexplane.train(swaying, points, common.Schedule(1), 60, 0)
    hexplane.main([*inputs(views, "sway"), str(tmp_path), "--steps", "60", "--count", "40"])
    assert recorded(tmp_path)["held_out_psnr"] > untrained["held_out_psnr"] + 1
    again, _ = hexplane.train(swaying, points, common.Schedule(20), 60, 0)
    again.save(tmp_path / "again")
    exported = export_hexplane(*read_hexplane(tmp_path / "again"), FACTS)
    assert_agrees(exported, {"time": np.array([0.3])}, again(torch.tensor([0.3])))


def tiny_body() -> Any:
    """A bent tube of two bones, which one target makes longer."""
    import makehuman

    rng = np.random.default_rng(0)
    height, angle = rng.uniform(-1, 1, 60), rng.uniform(0, 2 * np.pi, 60)
    vertices = np.stack([0.25 * np.cos(angle), height, 0.25 * np.sin(angle)], 1)
    upper = 1 / (1 + np.exp(-6 * vertices[:, 1]))
    directions = np.zeros((60, 3, 1))
    directions[:, 1, 0] = vertices[:, 1] * 0.5
    triangles = np.array([rng.choice(60, 3, replace=False) for _ in range(80)])
    joints = np.array([[0.0, 1, 0], [0, 0, 0]])
    moves = np.array([[[0.0], [0.5], [0]], [[0], [0], [0]]])
    weights = np.stack([upper, 1 - upper], 1)
    parts = np.zeros(60, int)
    return makehuman.Body(vertices, triangles, weights, joints, [-1, 0], ["root", "knee"], directions, moves, parts)


def test_avatar(tmp_path: Path) -> None:
    import avatar
    import common

    body = tiny_body()
    bank = {"bank": 12, "samples": 3000}
    _, untrained = avatar.train(body, common.Schedule(1), 40, 0, SIZE, **bank)
    model, pairs = avatar.train(body, common.Schedule(50), 40, 0, SIZE, **bank)
    assert avatar.scores_of(pairs)["held_out_psnr"] > avatar.scores_of(untrained)["held_out_psnr"] + 1
    model.save(tmp_path)
    exported = export_avatar(read_avatar(tmp_path / "avatar.npz"), FACTS)
    pose, shape = np.array([[0, 0, 0], [0.6, -0.2, 0.3]], np.float32), np.array([0.7], np.float32)
    feeds: dict[str, AnyArray] = {"pose": pose, "shape": shape, "translation": np.zeros(3)}
    assert_agrees(exported, feeds, model(torch.tensor(pose), torch.tensor(shape)))


def test_the_real_body_is_read_and_exported(shared: Path, tmp_path: Path) -> None:
    import avatar
    import makehuman

    body = makehuman.read_body(shared / "avatars" / "body-cc0")
    # The skin and two eyeballs of 72 vertices.
    assert body.vertices.shape == (13380 + 144, 3) and len(body.parents) == len(body.names) > 30
    assert 1.5 < np.ptp(body.vertices[:, 1]) < 1.9
    model = avatar.Avatar(body, 5000, np.random.default_rng(0))
    model.save(tmp_path)
    exported = export_avatar(read_avatar(tmp_path / "avatar.npz"), FACTS)
    rng = np.random.default_rng(0)
    pose = (rng.normal(size=(len(body.parents), 3)) * 0.3).astype(np.float32)
    shape = np.array([0.4], np.float32)
    feeds: dict[str, AnyArray] = {"pose": pose, "shape": shape, "translation": np.zeros(3)}
    assert_agrees(exported, feeds, model(torch.tensor(pose), torch.tensor(shape)))


@pytest.mark.parametrize("count", [1, 2])
def test_feed_forward(views: Path, tmp_path: Path, count: int) -> None:
    import common
    import feed_forward
    import make_views
    import shots

    scene = make_views.scene_of(views / "scene.ply", "cpu")
    # Solid and enlarged, because the images are only a few pixels wide.
    scene = replace(scene, opacities=torch.full_like(scene.opacities, 0.95), covariances=scene.covariances * 6)
    rng = np.random.default_rng(0)
    learned, kept = (shots.draw_shots([scene], n, SIZE, count, 2, rng) for n in (12, 4))
    sizes = {"fine": 8, "coarse": 8, "depths": 8}
    models = [feed_forward.train(learned, common.Schedule(n), 0, jitter=False, **sizes) for n in (1, 240)]
    before, after = (feed_forward.measure(each, kept) for each in models)
    assert after["psnr"] > before["psnr"] + 2 and after["depth_error"] < before["depth_error"], (before, after)
    # Trainings that end in nothing to be seen begin by losing this, and never get it back.
    assert after["opacity"] > 0.3, after
    model = models[1]
    model.save(tmp_path)
    shot = kept[0].unpacked()
    made = feed_forward.make(model, shot)
    k = feed_forward.shares(shot.intrinsics, SIZE, SIZE)
    images = shot.pictures[:count, :3].numpy()
    feeds = {"focal_length": k[:2].numpy(), "principal_point": k[2:].numpy(), "image": images[:1]}
    if count == 2:
        feeds |= {"image_2": images[1:], "relative_pose": shot.camera(1).view.numpy()}
    exported = export_feed_forward(read_feed_forward(tmp_path), FACTS)
    assert_agrees(exported, feeds, made.splats)


def test_a_shot_is_as_deep_as_its_scene() -> None:
    import make_views
    import rasterizer
    import shots

    # A solid sheet across the view, 2 world units away.
    across = torch.linspace(-1, 1, 21)
    places = torch.cartesian_prod(across, across, torch.tensor([0.0]))
    flat = torch.diag(torch.tensor([0.1, 0.1, 1e-4])).square().expand(len(places), 3, 3)
    sheet = rasterizer.Splats(places, flat, torch.full((len(places), 3), 0.5), torch.full((len(places),), 0.99))
    view = torch.tensor(shots.looking(np.array([0, 0, -2.0]), np.zeros(3), 0)).float()
    assert torch.allclose(view, torch.eye(4) + torch.tensor([[0.0] * 4, [0] * 4, [0, 0, 0, 2], [0] * 4]), atol=1e-6)
    k = torch.tensor([[make_views.FOCAL * 16, 0, 8], [0, make_views.FOCAL * 16, 8], [0, 0, 1.0]])
    drawn, depth = rasterizer.pictures_with_depth(sheet, [rasterizer.Camera(view, k, 16, 16)])
    assert drawn[:, 3].min() > 0.98 and (depth - 2).abs().max() < 1e-4
    # Two cameras at the ends, one between; the first is where the others are seen from.
    shot = shots.draw_shot(sheet, 16, 2, 1, np.random.default_rng(1))
    assert torch.allclose(shot.camera(0).view, torch.eye(4), atol=1e-5)
    ends, middle = ([shot.camera(i).position for i in (0, 1)], shot.camera(2).position)
    assert (middle - (ends[0] + ends[1]) / 2).norm() < 0.1 * (ends[1] - ends[0]).norm()


@pytest.mark.parametrize("kind", ["oil", "denoise"])
def test_style(views: Path, tmp_path: Path, kind: str) -> None:
    import common
    import style

    arguments = [str(tmp_path), str(views / "still.npz"), "--kind", kind, "--steps", "10", "--count", "8"]
    style.main(arguments)
    assert recorded(tmp_path)["held_out_psnr"] > 5
    pictures = common.load_views(views / "still.npz", "cpu").pictures
    model, scores = style.train([pictures], kind, common.Schedule(2), 8, 0)
    pictures = pictures[:, :3]
    assert set(scores) == {"held_out_psnr", "untouched_psnr"}
    model.save(tmp_path, SIZE, SIZE)
    network, _ = read_image_filter(tmp_path)
    exported = export_image_filter(network, SIZE, SIZE, FACTS)
    feeds = {"image": pictures[:1].numpy(), "strength": np.ones(1)}
    expected = model(pictures[:1]).detach().clamp(0, 1).numpy()
    assert error(run(exported, feeds)["processed"].reshape(-1, 1), expected.reshape(-1, 1)) < 1e-4


def test_diffusion(tmp_path: Path) -> None:
    import diffusion

    diffusion.main(["train", str(tmp_path), "--vessels", "1", "--batch", "2", "--steps", "2"])
    assert recorded(tmp_path)["steps"] == 2
    diffusion.main(["package", str(tmp_path), str(tmp_path / "model.onnx")])
    model = onnx.load(tmp_path / "model.onnx")
    assert gpu_findings(model) == []
    # Another seed is other noise, whose numbers are normal.
    noise = [diffusion.Generator(diffusion.Denoiser()).noise(torch.tensor([number])) for number in (0, 1, 5000)]
    for each in noise:
        assert abs(float(each.mean())) < 0.02 and abs(float(each.std()) - 1) < 0.02
    assert abs(float((noise[0] * noise[1]).mean())) < 0.02 and abs(float((noise[1] * noise[2]).mean())) < 0.02


def test_the_plain_rasterizer_draws_one_gaussian_as_its_formula_says() -> None:
    import rasterizer

    covariance = torch.tensor([[0.02, 0.005, 0], [0.005, 0.01, 0], [0, 0, 0.01]])
    splats = rasterizer.Splats(
        torch.tensor([[0.1, -0.05, 2.0]]), covariance[None], torch.tensor([[0.9, 0.5, 0.1]]), torch.tensor([0.8])
    )
    k = torch.tensor([[30.0, 0, 10], [0, 30, 8], [0, 0, 1]])
    found = rasterizer.picture(splats, rasterizer.Camera(torch.eye(4), k, 20, 16))
    jacobian = np.array([[15, 0, -0.75], [0, 15, 0.375]])
    flat = jacobian @ covariance.numpy() @ jacobian.T + 0.3 * np.eye(2)
    offset = np.array([8.5, 9.5]) - [11.5, 7.25]
    alpha = 0.8 * np.exp(-0.5 * offset @ np.linalg.inv(flat) @ offset)
    assert np.allclose(found[:, 9, 8].numpy(), alpha * np.array([0.9, 0.5, 0.1, 1]), rtol=1e-5)


def test_the_plain_rasterizer_blends_from_near_to_far() -> None:
    import rasterizer

    rng = np.random.default_rng(0)
    count, k = 30, torch.tensor([[20.0, 0, 6], [0, 20, 5], [0, 0, 1]])
    places = torch.tensor(rng.normal(size=(count, 3)) * 0.3 + [0, 0, 2]).float()
    sizes = torch.tensor(rng.uniform(0.02, 0.3, count)).float()
    colors, opacities = (torch.tensor(rng.random(shape)).float() for shape in ((count, 3), (count,)))
    round_ = sizes.square()[:, None, None] * torch.eye(3)
    camera = rasterizer.Camera(torch.eye(4), k, 12, 10)
    found = rasterizer.picture(rasterizer.Splats(places, round_, colors, opacities), camera).numpy()
    for row, column in ((5, 6), (2, 3), (9, 11)):
        left, wanted = 1.0, np.zeros(3)
        for i in np.argsort(places[:, 2].numpy(), kind="stable"):
            x, y, z = places[i].double().numpy()
            jacobian = np.array([[20 / z, 0, -20 * x / z**2], [0, 20 / z, -20 * y / z**2]])
            flat = jacobian @ round_[i].double().numpy() @ jacobian.T + 0.3 * np.eye(2)
            offset = np.array([column + 0.5, row + 0.5]) - [20 * x / z + 6, 20 * y / z + 5]
            alpha = min(float(opacities[i]) * np.exp(-0.5 * offset @ np.linalg.inv(flat) @ offset), 0.999)
            if alpha >= 1 / 255:
                wanted, left = wanted + left * alpha * colors[i].numpy(), left * (1 - alpha)
        assert np.abs(found[:, row, column] - [*wanted, 1 - left]).max() < 1e-5


def test_kuwahara_keeps_edges_and_evens_the_rest() -> None:
    import style

    picture = torch.zeros(1, 3, 20, 20)
    picture[..., 10:] = 1
    noisy = picture + 0.05 * torch.randn_like(picture)
    painted = style.kuwahara(noisy, 3)
    assert (painted - picture).abs().mean() < 0.4 * (noisy - picture).abs().mean()
    assert torch.equal(style.kuwahara(picture, 3), picture)


def test_a_schedule_ends_by_steps_or_by_the_clock() -> None:
    import common

    schedule = common.Schedule(4)
    assert list(schedule) == [0, 0.25, 0.5, 0.75] and schedule.done == 4
    late = common.Schedule(10**9, seconds=0.05)
    *_, last = late
    assert 0.5 < last < 1 and 0 < late.done < 10**9


def test_rows_grow_and_shrink_with_their_moments() -> None:
    import anchors

    module = torch.nn.Module()
    module.table = torch.nn.Parameter(torch.arange(6.0).reshape(3, 2))
    adam = torch.optim.Adam([module.table], lr=0.1)
    (module.table**2).sum().backward()
    adam.step()
    before = adam.state[module.table]["exp_avg"].clone()
    anchors.replace_rows(module, ["table"], torch.tensor([0, 2]), {"table": torch.full((1, 2), 9.0)}, [adam])
    assert module.table.shape == (3, 2) and module.table[2].tolist() == [9, 9]
    moment = adam.state[module.table]["exp_avg"]
    assert torch.equal(moment[:2], before[[0, 2]]) and moment[2].tolist() == [0, 0]
    (module.table**2).sum().backward()
    adam.step()


def test_new_anchors_take_free_cells_in_order() -> None:
    import anchors

    candidates = torch.tensor([[0.1, 0, 0], [5.2, 0, 0], [5.5, 0, 0], [9.0, 0, 0]])
    chosen = anchors.free_cells(candidates, torch.tensor([[0.2, 0, 0]]), 1.0, 5)
    assert chosen.tolist() == [1, 3]
    assert anchors.free_cells(candidates, torch.tensor([[0.2, 0, 0]]), 1.0, 1).tolist() == [1]


def test_a_photograph_judges_only_what_it_knows() -> None:
    import losses

    picture = torch.zeros(4, 16, 16)
    picture[:, 4:12, 4:12] = torch.tensor([0.6, 0.5, 0.4, 1.0])[:, None, None]
    none = torch.zeros(1, 16, 16)
    valid = 1 - none
    valid[:, 8:] = 0
    photograph = losses.Photograph(picture, valid, none)
    spoilt = picture.clone()
    spoilt[:, 8:] = 1
    torch.manual_seed(0)
    assert float(photograph.loss(spoilt)) == pytest.approx(0, abs=1e-6)
    assert photograph.psnr(spoilt * 0.5) > 60
    spoilt[0, 5, 5] = 0
    assert float(photograph.loss(spoilt)) > 1e-4 and photograph.psnr(spoilt) < 40


def test_the_nearest_point_of_a_painted_surface_is_seen(tmp_path: Path) -> None:
    import avatar
    import painted
    import rasterizer

    body = tiny_body()
    truth = painted.Painted(body, 4000, np.random.default_rng(0))
    _, _, camera = avatar.random_case(np.random.default_rng(1), body, "cpu", 32, False)
    vertices = torch.tensor(body.vertices, dtype=torch.float32)
    drawn = truth(vertices, camera)
    assert 0.01 < drawn[3].mean() < 0.9 and (drawn[:3] <= drawn[3:] + 1e-6).all()
    k = torch.tensor([[20.0, 0, 4], [0, 20, 4], [0, 0, 1]])
    truth.corners = torch.zeros(2, 3, dtype=torch.long) + torch.tensor([[0], [1]])
    truth.share, truth.color = torch.full((2, 3), 1 / 3), torch.tensor([[1.0, 0, 0], [0, 1, 0]])
    found = truth(torch.tensor([[0.0, 0, 3], [0, 0, 2]]), rasterizer.Camera(torch.eye(4), k, 8, 8))
    assert found[1].sum() > 0 and found[0].sum() == 0
