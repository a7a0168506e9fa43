"""Gaussians at rest and a body model of the SMPL family (SMPL, SMPL-H, SMPL-X, FLAME as .npz): one skinned avatar."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import AnyArray, Doubles, Floats
from ..errors import ExportError, listed
from ..families.avatar import Avatar
from ..families.classic import Cloud, usable
from .clouds import read_cloud
from .untrusted import read_arrays

# Arrays of a model that place its vertices. Files of SMPL-X also hold pickled objects, which are not opened.
_NEEDED = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table")
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
    parents = [int(parent) if 0 <= parent < len(regressor) else -1 for parent in model["kintree_table"][0]]
    weights = model["weights"][nearest]
    return Avatar(
        **_resting(cloud),
        weights=_floats(weights / weights.sum(1, keepdims=True)),
        joints=_floats(regressor @ template),
        parents=parents,
        joint_names=_NAMES.get(len(parents), [f"joint_{i}" for i in range(len(parents))]),
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
    J_regressor (J,V), weights (V,J), kintree_table (2,J).
    """
    remedy = "take the .npz of the model's site; a .pkl is converted by smplx/tools/clean_ch.py and numpy.savez"
    arrays = read_arrays(path, "a body model (.npz)", remedy, _NEEDED)
    found = {name: np.asarray(array, np.float64) for name, array in arrays.items()}
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
