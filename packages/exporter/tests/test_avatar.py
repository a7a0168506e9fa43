"""Skinned avatars against linear blend skinning written out joint by joint in float64."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gaussian_exporter.arrays import AnyArray, Doubles
from gaussian_exporter.checkpoints.avatar_file import read_avatar
from gaussian_exporter.checkpoints.body_model import read_skinned
from gaussian_exporter.errors import ExportError
from gaussian_exporter.families.avatar import Avatar, PoseFormat, export_avatar

from .running import FACTS, UPPER, error, parts, rows, run
from .sh_reference import basis

PARENTS = [-1, 0, 0, 1, 3, 3, 2, 6]


def avatar(count: int = 80, degree: int = 0, **more: Any) -> Avatar:
    rng = np.random.default_rng(4)

    def draw(*shape: int, scale: float = 1.0) -> Any:
        return (rng.normal(size=shape) * scale).astype(np.float32)

    weights = rng.random((count, len(PARENTS))) ** 6
    return Avatar(
        positions=draw(count, 3),
        scales=np.exp(draw(count, 3) - 3),
        rotations=draw(count, 4),
        opacities=rng.random((count, 1)).astype(np.float32),
        sh=draw(count, (degree + 1) ** 2, 3, scale=0.4),
        weights=(weights / weights.sum(1, keepdims=True)).astype(np.float32),
        joints=draw(len(PARENTS), 3),
        parents=PARENTS,
        joint_names=[f"joint {i}" for i in range(len(PARENTS))],
        **more,
    )


def turned(axis_angle: AnyArray) -> Doubles:
    """The matrix of an axis times an angle, as the exponential of its cross product, by its series."""
    x, y, z = np.asarray(axis_angle, np.float64)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    result, term = np.eye(3), np.eye(3)
    for n in range(1, 60):
        term = term @ cross / n
        result = result + term
    return result


def reference(model: Avatar, feeds: dict[str, AnyArray]) -> dict[str, Doubles]:
    rotations = np.stack([turned(row) for row in feeds["pose"]])
    positions, joints = model.positions.astype(np.float64), model.joints.astype(np.float64)
    if model.shape_directions is not None and model.joint_directions is not None:
        positions = positions + model.shape_directions @ feeds["shape"]
        joints = joints + model.joint_directions @ feeds["shape"]
    if model.expression_directions is not None:
        positions = positions + model.expression_directions @ feeds["expression"]
    if model.pose_directions is not None:
        positions = positions + model.pose_directions @ (rotations[1:] - np.eye(3)).ravel()
    frames: list[Doubles] = []
    for joint, parent in enumerate(model.parents):
        local = np.eye(4)
        local[:3, :3] = rotations[joint]
        local[:3, 3] = joints[joint] - (joints[parent] if parent >= 0 else 0)
        frames.append(frames[parent] @ local if parent >= 0 else local)
    for frame, joint in zip(frames, joints, strict=True):
        frame[:3, 3] -= frame[:3, :3] @ joint
    blend = np.einsum("nj,jab->nab", model.weights.astype(np.float64), np.stack(frames))
    moved = np.einsum("nab,nb->na", blend[:, :3, :3], positions) + blend[:, :3, 3] + feeds["translation"]
    q = model.rotations.astype(np.float64)
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    own = np.stack([turned(2 * np.arccos(np.clip(r[0], -1, 1)) * r[1:] / np.linalg.norm(r[1:])) for r in q])
    rest = np.einsum("nab,nb,ncb->nac", own, model.scales.astype(np.float64) ** 2, own)
    covariances = blend[:, :3, :3] @ rest @ blend[:, :3, :3].transpose(0, 2, 1)
    degree = round(model.sh.shape[1] ** 0.5) - 1
    view = moved - feeds.get("camera_position", np.array([9.0, 9, 9]))
    view = np.einsum("nab,na->nb", blend[:, :3, :3], view / np.linalg.norm(view, axis=1, keepdims=True))
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    color = np.maximum(np.einsum("nk,nkc->nc", basis(view, degree), model.sh) + 0.5, 0)
    return {
        "positions": moved,
        "covariances": covariances[:, UPPER[0], UPPER[1]],
        "color": color,
        "opacities": model.opacities.astype(np.float64),
    }


def feeds(scale: float = 0.7, **more: AnyArray) -> dict[str, AnyArray]:
    rng = np.random.default_rng(9)
    return {"pose": rng.normal(size=(len(PARENTS), 3)) * scale, "translation": np.array([0.1, 0.2, -0.3]), **more}


def assert_matches(model: Avatar, given: dict[str, AnyArray]) -> None:
    found = parts(run(export_avatar(model, FACTS), given))
    # The graph gets float32 numbers; so does the reference.
    rounded = {name: np.asarray(value, np.float32).astype(np.float64) for name, value in given.items()}
    for name, values in reference(model, rounded).items():
        assert error(found[name], values) < 1e-5, name


@pytest.mark.parametrize("scale", [0.0, 1e-5, 0.02, 0.7, 2.0])
def test_poses_from_rest_to_far(scale: float) -> None:
    assert_matches(avatar(), feeds(scale))


def test_blend_shapes_move_gaussians_and_joints() -> None:
    rng = np.random.default_rng(8)
    model = avatar(
        shape_directions=(rng.normal(size=(80, 3, 5)) * 0.1).astype(np.float32),
        joint_directions=(rng.normal(size=(8, 3, 5)) * 0.1).astype(np.float32),
        expression_directions=(rng.normal(size=(80, 3, 4)) * 0.1).astype(np.float32),
        pose_directions=(rng.normal(size=(80, 3, 63)) * 0.02).astype(np.float32),
    )
    assert_matches(model, feeds(shape=rng.normal(size=5), expression=rng.normal(size=4)))


@pytest.mark.parametrize("degree", [1, 3])
def test_harmonics_turn_with_the_limbs(degree: int) -> None:
    assert_matches(avatar(degree=degree), feeds(camera_position=np.array([0.5, 1.0, -4.0])))


def test_quaternion_poses_agree_with_axis_angles() -> None:
    model, given = avatar(), feeds()
    angle = np.linalg.norm(given["pose"], axis=1, keepdims=True)
    quaternions = np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * given["pose"] / angle], 1)
    formats: dict[PoseFormat, AnyArray] = {"axis-angle": given["pose"], "quaternion": quaternions * 1.7}
    both = [
        rows(run(export_avatar(model, FACTS, pose_format=kind), {**given, "pose": pose}))
        for kind, pose in formats.items()
    ]
    assert error(both[1], both[0]) < 1e-5


def test_at_rest_nothing_moves() -> None:
    model = avatar()
    given = {"pose": np.zeros((8, 3)), "translation": np.zeros(3)}
    found = parts(run(export_avatar(model, FACTS), given))
    assert error(found["positions"], model.positions) < 1e-6


def chain(length: int) -> Avatar:
    """A snake: every joint hangs on the one before it."""
    rng = np.random.default_rng(2)
    weights = rng.random((30, length)).astype(np.float32)
    return replace(
        avatar(30),
        weights=weights / weights.sum(1, keepdims=True),
        joints=rng.normal(size=(length, 3)).astype(np.float32),
        parents=list(range(-1, length - 1)),
        joint_names=[f"joint {i}" for i in range(length)],
    )


@pytest.mark.parametrize(("length", "products"), [(1, 1), (2, 1), (3, 2), (5, 3), (16, 4)])
def test_products_of_joints_double_their_reach(length: int, products: int) -> None:
    model = chain(length)
    given = {"pose": np.random.default_rng(1).normal(size=(length, 3)), "translation": np.array([0.1, 0.2, -0.3])}
    assert_matches(model, given)
    operators = [node.op_type for node in export_avatar(model, FACTS).graph.node]
    # Steps, and: turns around joints, weights, points, halves padded and carried.
    assert operators.count("MatMul") == products + 5
    assert not set(operators) & {"Split", "Loop", "Scan"}


def test_faults_are_named() -> None:
    with pytest.raises(ExportError, match=r"weights: expected rows that sum to 1.*\[checkpoint/mismatch\]"):
        export_avatar(replace(avatar(), weights=avatar().weights * np.float32(2)), FACTS)
    with pytest.raises(ExportError, match=r"parents: expected every parent before its children"):
        export_avatar(replace(avatar(), parents=[-1, 2, 0, 1, 3, 3, 2, 6]), FACTS)


def test_a_file_is_read_back(tmp_path: Path) -> None:
    model = avatar(degree=1)
    arrays: dict[str, Any] = {name: value for name, value in vars(model).items() if value is not None}
    np.savez(tmp_path / "avatar.npz", **arrays)
    again = read_avatar(tmp_path / "avatar.npz")
    given = feeds(camera_position=np.array([0.5, 1.0, -4.0]))
    both = [rows(run(export_avatar(each, FACTS), given)) for each in (model, again)]
    assert np.array_equal(both[0], both[1])
    arrays.pop("weights")
    np.savez(tmp_path / "avatar.npz", **arrays)
    with pytest.raises(ExportError, match=r"expected arrays weights.*\[checkpoint/incomplete\]"):
        read_avatar(tmp_path / "avatar.npz")


def test_a_body_model_that_is_none_is_named(tmp_path: Path) -> None:
    folder = Path(__file__).parents[3] / "tests/fixtures/oracles/avatar-smplx"
    with np.load(folder / "model.npz") as archive:
        arrays = dict(archive)
    cloud = folder / "point_cloud.ply"
    for change, said in (
        ({"posedirs": None}, "no posedirs among"),
        ({"weights": arrays["weights"][:, 1:]}, r"weights \(60, 6\)"),
    ):
        path = tmp_path / "model.npz"
        np.savez(path, **{name: value for name, value in (arrays | change).items() if value is not None})
        with pytest.raises(ExportError, match=said):
            read_skinned(cloud, path)
    few = read_skinned(cloud, folder / "model.npz", shapes=3, expressions=2)
    assert few.shape_directions is not None and few.shape_directions.shape == (40, 3, 3)
    assert few.expression_directions is not None and few.expression_directions.shape == (40, 3, 2)
