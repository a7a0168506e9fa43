"""Gaussians and a body model of the SMPL family (SMPL, SMPL-H, SMPL-X, FLAME as .npz): one skinned avatar. They
are at rest, or bound to triangles as those of GaussianAvatars.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import AnyArray, Doubles, Floats
from ..errors import ExportError, listed
from ..families.avatar import Avatar, Skinned
from ..families.bound_avatar import BoundAvatar
from ..families.classic import Cloud, cloud_of_vertices, usable, usable_rows
from .clouds import newest_in, read_cloud
from .files import existing
from .kinds import refuse_other_properties
from .ply import read_ply
from .untrusted import read_arrays

# Arrays of a model that place its vertices. Files of SMPL-X also hold pickled objects, which are not opened.
_NEEDED = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table")
# Names of the same arrays in the classes that load the model.
_SAME = {"lbs_weights": "weights", "parents": "kintree_table", "faces": "f"}
# SMPL-X has 300 directions of shape, then 100 of expressions; in its first files 10 and 10.
_SHAPES_BEFORE_EXPRESSIONS = {400: 300, 20: 10}

_BODY = [
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
]
_FINGERS = [
    f"{side}_{finger}{joint}"
    for side in ("left", "right")
    for finger in ("index", "middle", "pinky", "ring", "thumb")
    for joint in (1, 2, 3)
]
# Names of the joints, by index.
_NAMES = {
    5: ["global", "neck", "jaw", "left_eye", "right_eye"],
    24: [*_BODY, "left_hand", "right_hand"],
    52: [*_BODY, *_FINGERS],
    55: [*_BODY, "jaw", "left_eye_smplhf", "right_eye_smplhf", *_FINGERS],
}


def read_skinned(
    gaussians: Path, body: Path, ignored: Sequence[str] = (), shapes: int = 10, expressions: int = 10
) -> Avatar:
    """Gaussians (a PLY file or checkpoint) in the rest pose of a body model, each with the skinning weights and the
    blend shapes of the nearest vertex. `shapes`, `expressions`: numbers of coefficients that are inputs.
    """
    cloud, model = usable(read_cloud(gaussians, ignored)), read_body(body)
    template, regressor = model["v_template"], model["J_regressor"]
    nearest = nearest_rows(cloud.positions, template)
    shape, expression = _directions(model["shapedirs"], shapes, expressions)
    parents = _parents(model)
    weights = model["weights"][nearest]
    return Avatar(
        **_resting(cloud),
        weights=_floats(weights / weights.sum(1, keepdims=True)),
        joints=_floats(regressor @ template),
        parents=parents,
        joint_names=_names(len(parents)),
        shape_directions=_floats(shape[nearest]),
        joint_directions=_floats(np.einsum("jv,vcb->jcb", regressor, shape)),
        expression_directions=_floats(expression[nearest]) if expression.size else None,
        expression_joint_directions=(
            _floats(np.einsum("jv,vcb->jcb", regressor, expression)) if expression.size else None
        ),
        pose_directions=_floats(model["posedirs"][nearest]),
    )


def read_body(path: Path) -> dict[str, Doubles]:
    """Arrays of a body model that determine its vertices: v_template (V,3), shapedirs (V,3,B), posedirs (V,3,9(J-1)),
    J_regressor (J,V), weights (V,J), kintree_table (2,J); f (F,3), triangles, if the file has them.
    """
    remedy = "take the .npz of the model's site; a .pkl is converted by smplx/tools/clean_ch.py and numpy.savez"
    arrays = read_arrays(path, "a body model (.npz)", remedy, (*_NEEDED, "f", *_SAME))
    found = {_SAME.get(name, name): np.asarray(array, np.float64) for name, array in arrays.items()}
    if "parents" in arrays:
        found["kintree_table"] = np.stack([found["kintree_table"], np.arange(len(found["kintree_table"]))])
    bends = found.get("posedirs")
    if bends is not None and bends.ndim == 2 and bends.shape[1] % 3 == 0:
        # The classes hold them as a matrix from rotations to coordinates.
        found["posedirs"] = bends.T.reshape(-1, 3, len(bends))
    missing = [name for name in _NEEDED if name not in found]
    vertices, joints = len(found.get("v_template", ())), len(found.get("J_regressor", ()))
    shapes: dict[str, tuple[int, ...]] = {
        "v_template": (vertices, 3),
        "J_regressor": (joints, vertices),
        "weights": (vertices, joints),
        "posedirs": (vertices, 3, 9 * (joints - 1)),
        "kintree_table": (2, joints),
    }
    held = {name: found[name].shape for name in shapes if name in found}
    wrong = [f"{name} {shape}" for name, shape in held.items() if shape != shapes[name]]
    if missing or wrong:
        raise ExportError(
            "checkpoint/mismatch",
            where=str(path),
            expected=f"a body model of the SMPL family: arrays {', '.join(_NEEDED)}",
            found=f"no {listed(missing)} among {listed(list(found))}" if missing else ", ".join(wrong),
            remedy="give the model's own file, for example SMPLX_NEUTRAL.npz",
        )
    return found


def is_bound(gaussians: Path) -> bool:
    """Whether a PLY file, or the newest of a training's folder, has Gaussians that are bound to triangles."""
    path = newest_in(existing(gaussians, "a PLY file, or the folder of a training"))
    with path.open("rb") as file:
        return b" binding_0" in file.read(1 << 16).partition(b"end_header")[0]


def read_bound(gaussians: Path, body: Path, ignored: Sequence[str] = (), expressions: int | None = None) -> BoundAvatar:
    """The Gaussians of GaussianAvatars, flame_param.npz beside them, and the head that they are bound to. The person's
    shape and static offsets are part of the mesh. `expressions`: number of coefficients that are inputs; default: those
    of the training.
    """
    path = newest_in(gaussians)
    vertices, model = read_ply(path), read_body(body)
    refuse_other_properties([name for name in vertices.names if name != "binding_0"], path, ignored)
    if "f" not in model:
        raise ExportError(
            "checkpoint/mismatch",
            where=str(body),
            expected="the triangles of the head, an array f or faces (F,3)",
            found=listed(list(model)),
            remedy=_HEAD,
        )
    cloud, binding = cloud_of_vertices(vertices), vertices.columns("binding_0")[:, 0].astype(np.int64)
    kept = usable_rows(cloud)
    person = _person(path.parent / "flame_param.npz", len(model["v_template"]))
    shape, looks = _of_training(model["shapedirs"], len(person["shape"]), person["expr"].shape[1], body)
    looks = looks[:, :, :expressions]
    rest = model["v_template"] + shape @ person["shape"] + person["static_offset"]
    regressor, joints = model["J_regressor"], len(model["J_regressor"])
    mesh = Skinned(
        positions=_floats(rest),
        weights=_floats(model["weights"]),
        joints=_floats(regressor @ rest),
        parents=_parents(model),
        joint_names=_names(joints),
        expression_directions=_floats(looks),
        expression_joint_directions=_floats(np.einsum("jv,vcb->jcb", regressor, looks)),
        pose_directions=_floats(model["posedirs"]),
    )
    local = {name: table[kept] for name, table in _resting(cloud).items()}
    return BoundAvatar(mesh=mesh, faces=model["f"].astype(np.int64), binding=binding[kept], **local)


def _person(path: Path, vertices: int) -> dict[str, Doubles]:
    """shape (B), expr (T,E) and static_offset (V,3) of flame_param.npz."""
    needed = ("shape", "expr", "static_offset")
    arrays = read_arrays(path, "flame_param.npz beside the Gaussians", "copy it from the training's folder", needed)
    found: dict[str, Doubles] = {name: np.asarray(array, np.float64) for name, array in arrays.items()}
    offset = found.setdefault("static_offset", np.zeros((vertices, 3)))
    found["static_offset"] = offset.reshape(-1, 3) if offset.size % 3 == 0 else offset
    shapes = {name: found[name].shape if name in found else () for name in needed}
    if len(shapes["shape"]) != 1 or len(shapes["expr"]) != 2 or shapes["static_offset"] != (vertices, 3):
        raise ExportError(
            "checkpoint/mismatch",
            where=str(path),
            expected=f"shape (B), expr (T,E), and static_offset of the {vertices} vertices of the head",
            found=", ".join(f"{name} {shape}" for name, shape in shapes.items()),
            remedy=_HEAD,
        )
    return found


# The template of FLAME has no teeth, which the class of GaussianAvatars adds.
_HEAD = 'write the head of the training, with its teeth: "GaussianAvatars" in packages/exporter/README.md'


def _of_training(both: Doubles, shapes: int, expressions: int, where: Path) -> tuple[Doubles, Doubles]:
    """Directions (V,3,B) of the shape and (V,3,E) of the expressions that the training used."""
    count = int(both.shape[2])
    border = shapes if count == shapes + expressions else _SHAPES_BEFORE_EXPRESSIONS.get(count, count)
    if shapes > border or border + expressions > count:
        raise ExportError(
            "checkpoint/mismatch",
            where=str(where),
            expected=f"{shapes} directions of the shape and {expressions} of expressions, as flame_param.npz has",
            found=f"{count}",
            remedy=_HEAD,
        )
    return both[:, :, :shapes], both[:, :, border : border + expressions]


def _parents(model: dict[str, Doubles]) -> list[int]:
    joints = len(model["J_regressor"])
    return [int(parent) if 0 <= parent < joints else -1 for parent in model["kintree_table"][0]]


def _names(joints: int) -> list[str]:
    return _NAMES.get(joints, [f"joint_{i}" for i in range(joints)])


def nearest_rows(points: AnyArray, table: AnyArray) -> AnyArray:
    """For each point (N,3), the index of the nearest row of a table (V,3)."""
    table = np.asarray(table, np.float64)
    squares = (table**2).sum(1)
    parts = [
        np.argmin(squares - 2 * (np.asarray(points[i : i + 512], np.float64) @ table.T), 1)
        for i in range(0, len(points), 512)
    ]
    return np.concatenate(parts)


def _directions(both: Doubles, shapes: int, expressions: int) -> tuple[Doubles, Doubles]:
    """The first directions (V,3,B) of the body's shape, and of its expressions if the model has them."""
    count = int(both.shape[2])
    border = _SHAPES_BEFORE_EXPRESSIONS.get(count, count)
    return both[:, :, : min(shapes, border)], both[:, :, border : border + expressions]


def _resting(cloud: Cloud) -> dict[str, Floats]:
    return {
        "positions": cloud.positions,
        "scales": _floats(np.exp(np.float64(cloud.log_scales))),
        "rotations": cloud.rotations,
        "opacities": _floats(1 / (1 + np.exp(-np.clip(np.float64(cloud.opacity_logits), -88, 88)))),
        "sh": cloud.sh,
    }


def _floats(values: AnyArray) -> Floats:
    return np.ascontiguousarray(values, np.float32)
