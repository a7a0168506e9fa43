"""Moments of a generator as PLY files and the manifest of a sequence, the input of `gaussian-splat sequence`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import numpy as np
import onnx

from .arrays import AnyArray, Doubles
from .conformance import clocks_at, default_feeds, running
from .contract import Json, of_metadata
from .errors import ExportError, require_package
from .written import Attributes, read

SH_C0 = 0.28209479177387814
# Logits of opacities 0 and 1 are infinite.
MIN_OPACITY = 1e-6
MIN_SCALE = 1e-9


def write_frames(model: onnx.ModelProto, path: Path, folder: Path, fps: float, duration: float | None) -> int:
    """Runs a generator at the times of all frames and writes one PLY file each, as INRIA's trainer does, and
    frames.json. A state goes from each frame to the next, and the first frame has its default. Returns the number of
    frames. Raises contract/... and argument/... errors; needs onnxruntime.
    """
    require_package("onnxruntime", "check")
    import onnxruntime as ort

    contract = of_metadata({prop.key: prop.value for prop in model.metadata_props}, str(path))
    inputs = cast("dict[str, Json]", contract["inputs"])
    seconds = duration or cast("float | None", contract.get("duration"))
    if not any(each["role"] in ("time", "frame") for each in inputs.values()):
        raise _wrong("an input of the role time or frame", "none", "export a model that moves")
    if not seconds:
        raise _wrong("a duration", "none in the contract", "give --duration")
    with running("loading"):
        session = ort.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    feeds = default_feeds(model, contract)
    states = {name: cast(str, each["output"]) for name, each in inputs.items() if each["role"] == "state"}
    comments = comments_of(contract)
    count = max(1, round(seconds * fps))
    folder.mkdir(parents=True, exist_ok=True)
    for frame in range(count):
        given = feeds | clocks_at(frame / fps, {**contract, "duration": seconds}, feeds)
        with running("running"):
            written = dict(zip(names, session.run(None, given), strict=True))
        faults, attributes = read(cast(Json, contract["outputs"]), written, cast("int | None", contract.get("nMax")))
        if faults:
            raise faults[0].error(f" (frame {frame})")
        feeds |= {name: written[output] for name, output in states.items()}
        columns = columns_of(attributes, cast(Json, contract["outputs"]))
        write_ply(folder / f"frame-{frame + 1:04}.ply", columns, comments)
    manifest = {"gaussianSplatSequence": 1, "framesPerSecond": fps, "frames": "frame-{0001}.ply", "count": count}
    (folder / "frames.json").write_text(json.dumps(manifest) + "\n")
    return count


def comments_of(contract: Json) -> list[str]:
    """Comments of a PLY file, as nerfstudio, Brush and the trainer of gsplat write them: the axis that points up, and
    the filter of the training.
    """
    up = cast("dict[str, str]", contract.get("coordinates", {})).get("up")
    comments = [] if up is None else [f"Vertical Axis: {up}"]
    if contract.get("filter") == "mip":
        comments.append("SplatRenderMode: mip")
    elif contract.get("antialiased"):
        comments.append("antialiased 1")
    return comments


def columns_of(attributes: Attributes, outputs: Json) -> dict[str, AnyArray]:
    """Properties of INRIA's PLY files. `outputs`: those of the contract, with orders of quaternions and harmonics."""
    wide = {name: np.asarray(each.rows, np.float64) for name, each in attributes.items()}
    if "rotations" in wide and outputs.get("rotationOrder") == "xyzw":
        wide["rotations"] = wide["rotations"][:, [3, 0, 1, 2]]
    if "scales" in wide:
        wide["scales"] = np.broadcast_to(wide["scales"], (len(wide["scales"]), 3))
    if "sh" in wide and outputs.get("shOrder") == "channel-major":
        wide["sh"] = wide["sh"].reshape(len(wide["sh"]), 3, -1).transpose(0, 2, 1)
    if "covariances" in wide and wide["covariances"].shape[1] == 9:
        wide["covariances"] = wide["covariances"][:, [0, 1, 2, 4, 5, 8]]
    kinds = {name: each.activation for name, each in attributes.items()}
    opacities = wide["opacities"]
    if kinds["opacities"] != "logit":
        kept = np.clip(opacities, MIN_OPACITY, 1 - MIN_OPACITY)
        opacities = np.log(kept / (1 - kept))
    if "covariances" in wide:
        log_scales, rotations = axes_of(wide["covariances"])
    else:
        scales, rotations = wide["scales"], wide["rotations"]
        log_scales = scales if kinds["scales"] == "log" else np.log(np.maximum(scales, MIN_SCALE))
    sh = wide["sh"] if "sh" in wide else (wide["colors"] - 0.5) / SH_C0
    # Rows of coefficients with three channels each; files have all red ones first.
    channels = sh.reshape(len(sh), -1, 3)
    rest = channels[:, 1:].transpose(0, 2, 1).reshape(len(sh), -1)
    groups = {"f_dc": channels[:, 0], "f_rest": rest, "opacity": opacities, "scale": log_scales, "rot": rotations}
    columns: dict[str, AnyArray] = dict(zip("xyz", wide["positions"].T, strict=True))
    for name, values in groups.items():
        for k, column in enumerate(values.T):
            columns["opacity" if name == "opacity" else f"{name}_{k}"] = column
    return columns


def axes_of(covariances: Doubles) -> tuple[Doubles, Doubles]:
    """Logarithms of standard deviations, and rotations (w, x, y, z), of upper triangles."""
    full = covariances[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    values, vectors = np.linalg.eigh(full)
    vectors[:, :, 0] *= np.sign(np.linalg.det(vectors))[:, None]
    m = vectors
    # Each row of this matrix is the quaternion, times one of its components: the largest is far from 0.
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    wx, wy, wz = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    xy, xz, yz = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    rows = [
        [1 + xx + yy + zz, wx, wy, wz],
        [wx, 1 + xx - yy - zz, xy, xz],
        [wy, xy, 1 - xx + yy - zz, yz],
        [wz, xz, yz, 1 - xx - yy + zz],
    ]
    table = np.array([[np.broadcast_to(each, xx.shape) for each in row] for row in rows]).transpose(2, 0, 1)
    largest = np.argmax(table[:, range(4), range(4)], 1)
    quaternions = table[np.arange(len(table)), largest]
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return 0.5 * np.log(np.maximum(values, MIN_SCALE**2)), quaternions


def write_ply(path: Path, columns: dict[str, AnyArray], comments: list[str]) -> None:
    """A binary PLY file with one float property for each name, and comments in its header."""
    count = len(next(iter(columns.values())))
    header = ["ply", "format binary_little_endian 1.0", *(f"comment {text}" for text in comments)]
    header += [f"element vertex {count}"]
    header += [f"property float {name}" for name in columns] + ["end_header", ""]
    rows: Any = np.stack([np.asarray(values, "<f4") for values in columns.values()], 1)
    path.write_bytes("\n".join(header).encode() + rows.tobytes())


def _wrong(expected: str, found: str, remedy: str) -> ExportError:
    return ExportError("argument/value", where="frames", expected=expected, found=found, remedy=remedy)
