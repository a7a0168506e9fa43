"""The command `gaussian-export FAMILY CHECKPOINT OUT.onnx`; `gaussian-export check` and `cost` of a file."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from shlex import quote
from typing import cast, get_args

import onnx
from google.protobuf.message import DecodeError

from .checkpoints.avatar_file import read_avatar
from .checkpoints.body_model import is_bound, read_bound, read_skinned
from .checkpoints.clouds import read_cloud
from .checkpoints.files import existing
from .checkpoints.hexplane_folder import read_hexplane
from .checkpoints.moving import read_deformable, read_gaussian4d, read_spacetime
from .checkpoints.networks import read_feed_forward, read_image_filter
from .checkpoints.scaffold_folder import read_scaffold
from .conformance import check_outputs, difference
from .contract import METADATA_KEY, Coordinates, DType, Facts, Filter, Json, Layout, Up, metadata, of_metadata
from .cost import cost_of, report
from .errors import ExportError
from .families.avatar import PoseFormat, export_avatar
from .families.bound_avatar import export_bound
from .families.classic import Colors, export_classic
from .families.deformable import export_deformable
from .families.feed_forward import export_feed_forward
from .families.gaussian4d import Rotation4D, export_gaussian4d
from .families.hexplane import export_hexplane
from .families.image_filter import export_image_filter
from .families.scaffold import export_scaffold
from .families.spacetime import export_spacetime
from .frames import write_frames
from .graph import Weights
from .header import contract_faults, header_faults
from .infer import infer
from .outputs import Options, refuse_instances, refuse_place, save
from .parts import LIMIT, in_parts, large_tensors
from .placement import finding_lines, gpu_findings
from .written import Fault

Command = argparse.ArgumentParser
Export = Callable[[argparse.Namespace, Facts, Options], onnx.ModelProto]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command. Returns 0 on success, 1 after an error message, 2 for wrong options."""
    given = parser().parse_args(arguments)
    try:
        {"check": check, "cost": cost, "frames": frames, "parts": parts}.get(given.family, export)(given)
    except (ExportError, OSError) as error:
        # The message of the system names the file.
        print(f"gaussian-export: {error}", file=sys.stderr)
        return 1
    return 0


def parser() -> Command:
    """All families and their options."""
    root = Command(prog="gaussian-export", description="Trained Gaussian models to ONNX Gaussian Generators.")
    families = root.add_subparsers(dest="family", required=True, metavar="FAMILY")
    for name, (describe, what, _) in FAMILIES.items():
        family = families.add_parser(name, help=what, description=what)
        family.add_argument("checkpoint", type=Path, help="what the trainer wrote: a file or a folder")
        family.add_argument("out", type=Path, help="the .onnx file to write")
        add_common(family)
        describe(family)
    checker = families.add_parser("check", help="run a file on the CPU, and say what would leave the GPU")
    checker.add_argument("file", type=Path)
    divider = families.add_parser("parts", help="write an .onnx file again, without tensors above a limit of bytes")
    divider.add_argument("file", type=Path)
    divider.add_argument("out", type=Path)
    for command in (checker, divider):
        command.add_argument(
            "--limit",
            type=positive,
            default=LIMIT,
            help="bytes of one buffer on the devices of visitors; default 134217728, which WebGPU guarantees",
        )
    counter = families.add_parser("cost", help="where a run's time goes: dispatches, bytes, an estimate, for any file")
    counter.add_argument("file", type=Path)
    counter.add_argument("--instances", type=positive, default=1, help="instances in one run, if the file has an axis")
    counter.add_argument("--rows", type=positive, default=12, help="nodes to list, the dearest first; default 12")
    player = families.add_parser("frames", help="moments of a generator as PLY files, to make a clip of")
    player.add_argument("file", type=Path, help="an .onnx file that an export wrote")
    player.add_argument("folder", type=Path, help="where frames.json and the frames are written")
    player.add_argument("--fps", type=float, default=30.0, help="frames a second; default 30")
    player.add_argument("--duration", type=float, help="seconds; default: the contract's")
    return root


def add_common(family: Command) -> None:
    """Options of every family: facts for the contract, and the form of the output."""
    facts = family.add_argument_group("facts for the contract")
    facts.add_argument("--name", help="name for people; default: the output's file name")
    facts.add_argument("--license", required=True, help="SPDX identifier, or a few words")
    facts.add_argument("--attribution", required=True, help="who is to be named")
    facts.add_argument("--antialiased", action="store_true", help="trained with opacity compensation (Mip-Splatting)")
    facts.add_argument(
        "--filter",
        choices=get_args(Filter),
        help="trained with 0.3 px², 0.3 with compensation, or 0.1 with compensation; default: by --antialiased",
    )
    facts.add_argument("--up", choices=get_args(Up), help="the axis that points up; default: by the settings, else -y")
    facts.add_argument("--left-handed", action="store_true")
    facts.add_argument("--meters-per-unit", type=float)
    facts.add_argument("--duration", type=float, help="seconds that time 0 to 1 plays")
    facts.add_argument("--fps", type=float)
    what = "tensors, properties and settings of the checkpoint that change nothing that is drawn, separated by commas"
    facts.add_argument("--ignore", type=lambda text: text.split(","), default=[], metavar="NAMES", help=what)
    written = family.add_argument_group("output")
    written.add_argument(
        "--layout", choices=get_args(Layout), help="default: split; for classic packed, except with float16"
    )
    written.add_argument("--weights", choices=get_args(Weights), default="float32", help="compact: in 16 bits")
    written.add_argument(
        "--instances", type=positive, help="most instances in one run: gives the file an axis for them"
    )
    written.add_argument("--dtype", choices=get_args(DType), default="float32", help="float16 needs shader-f16")


def facts_of(given: argparse.Namespace) -> Facts:
    """Options that are facts for the contract."""
    handedness: Json = {"handedness": "left"} if given.left_handed else {}
    coordinates = Coordinates(up=given.up, meters_per_unit=given.meters_per_unit, **handedness)  # type: ignore[arg-type]
    return Facts(
        name=given.name or given.out.stem,
        license=given.license,
        attribution=given.attribution,
        antialiased=given.antialiased,
        filter=given.filter,
        coordinates=coordinates,
        duration=given.duration,
        fps=given.fps,
    )


def export(given: argparse.Namespace) -> None:
    """Reads the checkpoint, writes the file, and reports on it."""
    _, _, build = FAMILIES[given.family]
    refuse_place(given.out, given.checkpoint)
    model = build(given, facts_of(given), Options(given.layout, given.dtype, given.weights, given.instances))
    size = save(model, given.out)
    shapes = ", ".join(
        f"{o.name} {[d.dim_param or d.dim_value for d in o.type.tensor_type.shape.dim]}" for o in model.graph.output
    )
    print(f"{given.out}: {size:,} bytes, {len(model.graph.node)} nodes, writes {shapes}")
    report_findings(model)


def cost(given: argparse.Namespace) -> None:
    """Prints the estimated cost of a run, without running the file."""
    model = loaded(given.file)
    add_contract(model, given.file)
    for line in report(cost_of(model, given.instances), given.rows):
        print(line)


def frames(given: argparse.Namespace) -> None:
    """Writes moments of a generator as PLY files, and prints the command that makes a clip from them."""
    if not given.fps > 0:
        raise ExportError(
            "argument/value", where="--fps", expected="more than 0", found=str(given.fps), remedy="take 30"
        )
    model = loaded(given.file)
    raise_faults(add_contract(model, given.file) or [])
    count = write_frames(model, given.file, given.folder, given.fps, given.duration)
    manifest, clip = given.folder / "frames.json", f"{given.file.stem}.gsv"
    print(f"{manifest}: {count} frames")
    command = f"npm run gaussian-splat -- sequence {quote(str(manifest))} --out {quote(clip)}"
    print(f"a clip, by a command of this repository: {command}")


def check(given: argparse.Namespace) -> None:
    """Checks a file against its contract, and reports the nodes that would leave the GPU."""
    path = given.file
    model = loaded(path)
    inferred = add_contract(model, path)
    # Faults and nodes that leave the GPU can be found without a contract.
    if inferred:
        report_findings(model)
        raise_faults([*inferred, *header_faults(model, None, path.parent)])
    try:
        contract = of_metadata({prop.key: prop.value for prop in model.metadata_props}, str(path))
    except ExportError:
        report_findings(model)
        print_faults(header_faults(model, None, path.parent))
        raise
    wrong = list(contract_faults(contract)) if inferred is None else []
    raise_faults([*wrong, *header_faults(model, None if wrong else contract, path.parent)])
    print(f"{path}: contract version {contract['version']}, {contract.get('name', 'without a name')}")
    if find_spec("onnxruntime") is None:
        print("not run: install onnxruntime (pip install 'gaussian-splat-exporter[check]')")
    else:
        for name, values in check_outputs(model, path=path).items():
            print(f"ran on the CPU: {name} {list(values.shape)} {values.dtype}, all checks passed")
    report_findings(model)
    if large := large_tensors(model, given.limit):
        sizes = ", ".join(f"{name} of {size:,} bytes" for name, size in list(large.items())[:3])
        print(f"{len(large)} above {given.limit:,} bytes, for which some devices have no buffer: {sizes}")
        print("computed in parts: gaussian-export parts FILE OUT")


def parts(given: argparse.Namespace) -> None:
    """Writes the file without tensors above the limit, and compares its results with those of the original."""
    refuse_place(given.out, given.file)
    whole = onnx.load(existing(given.file, "an .onnx file"))
    raise_faults(add_contract(whole, given.file) or [])
    divided = in_parts(whole, given.limit)
    if find_spec("onnxruntime") is None:
        print("not compared: install onnxruntime (pip install 'gaussian-splat-exporter[check]')")
    else:
        print(f"largest difference on the CPU: {difference(whole, divided):.1e} of the largest number of a tensor")
    size = save(divided, given.out)
    print(f"{given.out}: {size:,} bytes, {len(divided.graph.node)} nodes instead of {len(whole.graph.node)}")


def add_contract(model: onnx.ModelProto, path: Path) -> list[Fault] | None:
    """Gives the model the contract beside its file, or else one inferred from names. Returns None if the file or its
    neighbor has one, else the faults of the inference.
    """
    if METADATA_KEY in {prop.key for prop in model.metadata_props}:
        return None
    beside = path.with_suffix(".contract.json")
    if beside.exists():
        model.metadata_props.add(key=METADATA_KEY, value=beside.read_text(encoding="utf-8", errors="replace"))
        return None
    contract, faults = infer(model)
    if not faults:
        print(f"note: {path} has no contract; it was inferred from names. Write one to be sure")
        model.metadata_props.add(key=METADATA_KEY, value=metadata(contract)[METADATA_KEY])
    return faults


def loaded(path: Path) -> onnx.ModelProto:
    """The file without its external data."""
    try:
        return onnx.load(existing(path, "an .onnx file"), load_external_data=False)
    except DecodeError as error:
        with path.open("rb") as file:
            head = file.read(512)
        code, found = next((kind for start, kind in _FOREIGN.items() if re.match(start, head)), (None, str(error)))
        raise ExportError(
            code or "graph/invalid",
            where=str(path),
            expected="an ONNX file",
            found=found,
            remedy="check that it was downloaded or written completely",
        ) from error


# Beginnings of files of other kinds, with the codes of the checker of pages and shells.
_FOREIGN: dict[bytes, tuple[str, str]] = {
    rb"(?i)\s*(<!--.*?-->\s*)*<(!doctype\s+html|html|head|body|script|title)\b": ("decode/html", "a web page (HTML)"),
    rb"version https://git-lfs": ("decode/lfs-pointer", "a git-LFS pointer, which only names the real file"),
    rb"....ORTM": ("decode/unsupported", "a model in the format ORT"),
    rb"PK|....TFL3|GGUF|ply\r?\n|\x1f\x8b|\s*[{<]|$": ("decode/unknown-format", "a file of another kind"),
}


def raise_faults(faults: Sequence[Fault]) -> None:
    """Prints all findings except the first, and raises the first."""
    print_faults(faults[1:])
    if faults:
        raise faults[0].error()


def print_faults(faults: Sequence[Fault]) -> None:
    """Prints findings as errors."""
    for fault in faults:
        print(f"gaussian-export: {fault.error()}", file=sys.stderr)


def report_findings(model: onnx.ModelProto) -> None:
    """Prints the nodes that would leave the GPU, or a message that there are none."""
    findings = gpu_findings(model)
    for line in finding_lines(findings):
        print(line)
    if all(finding.kind == "inexact" for finding in findings):
        print("WebGPU: every node has a kernel, shapes are fixed, the graph can be captured")


def _classic_options(family: Command) -> None:
    family.add_argument("--colors", choices=get_args(Colors), default="sh", help="view: harmonics in the graph")


def _scaffold_options(family: Command) -> None:
    family.add_argument("--appearance", type=int, default=0, help="training image whose appearance is baked in")


def _avatar_options(family: Command) -> None:
    family.add_argument("--pose", choices=get_args(PoseFormat), default="axis-angle")
    what = "body model of SMPL, SMPL-H, SMPL-X or FLAME, for Gaussians in its rest pose or of GaussianAvatars"
    family.add_argument("--smplx", type=Path, metavar="MODEL.npz", help=what)
    family.add_argument("--shapes", type=positive, default=10, help="with --smplx: coefficients of the body's shape")
    what = "with --smplx: coefficients of expressions; default 10, with GaussianAvatars all"
    family.add_argument("--expressions", type=positive, help=what)


def _no_options(family: Command) -> None:
    pass


def _classic(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    cloud = read_cloud(given.checkpoint, given.ignore)
    if cloud.note is not None:
        print(f"note: {cloud.note}")
    return export_classic(cloud, facts, options, cast(Colors, given.colors))


def _scaffold(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    return export_scaffold(read_scaffold(given.checkpoint, given.appearance, given.ignore), facts, options)


def _hexplane(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    return export_hexplane(*read_hexplane(given.checkpoint, given.ignore), facts, options)


def _spacetime(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    return export_spacetime(read_spacetime(given.checkpoint, given.ignore), facts, options)


def _deformable(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    return export_deformable(*read_deformable(given.checkpoint, given.ignore), facts, options)


def _gaussian4d_options(family: Command) -> None:
    what = "first and last second that play: time_duration of the configuration, which the trainer does not save"
    family.add_argument("--time-duration", type=float, nargs=2, metavar=("START", "END"), help=what)
    what = "straight: for what was trained by the code of before 2024-09-15; default reversed, as its code is now"
    family.add_argument("--rotation", choices=get_args(Rotation4D), help=what)


def _gaussian4d(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    if given.rotation is None:
        print("4dgs: rotations as its code has them since 2024-09-15; --rotation straight is for older trainings")
        given.rotation = "reversed"
    model = read_gaussian4d(given.checkpoint, given.ignore, given.time_duration, given.rotation)
    # The file gives the duration that a page plays: the seconds of the training.
    return export_gaussian4d(model, replace(facts, duration=facts.duration or model.end - model.start), options)


def _avatar(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    pose_format = cast(PoseFormat, given.pose)
    if given.smplx is None:
        return export_avatar(read_avatar(given.checkpoint, given.ignore), facts, options, pose_format)
    if is_bound(given.checkpoint):
        bound = read_bound(given.checkpoint, given.smplx, given.ignore, given.expressions)
        return export_bound(bound, facts, options, pose_format)
    avatar = read_skinned(given.checkpoint, given.smplx, given.ignore, given.shapes, given.expressions or 10)
    return export_avatar(avatar, facts, options, pose_format)


def _feed_forward(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    return export_feed_forward(
        replace(read_feed_forward(given.checkpoint, given.ignore), widened=given.widen), facts, options
    )


def _feed_forward_options(family: Command) -> None:
    what = "squared pixels added to every Gaussian, against gaps in views larger than the training images; default 0"
    family.add_argument("--widen", type=float, default=0.0, help=what)


def positive(text: str) -> int:
    """A whole number, 1 or more."""
    if (value := int(text)) < 1:
        raise ValueError(text)
    return value


def _image_filter_options(family: Command) -> None:
    family.add_argument("--size", type=size, help="WIDTHxHEIGHT in pixels; default: as in config.json")


def size(text: str) -> tuple[int, int]:
    """Parses width and height of an image in pixels, written as 640x480."""
    width, height = text.split("x")
    return int(width), int(height)


def _image_filter(given: argparse.Namespace, facts: Facts, options: Options) -> onnx.ModelProto:
    refuse_instances(options, "image_filter")
    if options != Options():
        raise ExportError(
            "argument/value",
            where="image-filter",
            expected="a command without --layout, --dtype and --weights, which are options of generators",
            found="one of them",
            remedy="leave it out; a post-processor is written in float32",
        )
    model, config = read_image_filter(given.checkpoint, given.ignore)
    width, height = given.size or (int(config["width"]), int(config["height"]))
    return export_image_filter(model, width, height, facts)


FAMILIES: dict[str, tuple[Callable[[Command], None], str, Export]] = {
    "classic": (
        _classic_options,
        "3DGS: a PLY file; a checkpoint of gsplat, nerfstudio or INRIA's trainer; or the trainer's folder",
        _classic,
    ),
    "scaffold": (_scaffold_options, "Scaffold-GS or Octree-GS: the trainer's folder", _scaffold),
    "hexplane": (_no_options, "4DGS: the folder of 4DGaussians", _hexplane),
    "spacetime": (_no_options, "SpacetimeGaussians, lite: the trainer's folder, or its PLY file", _spacetime),
    "deformable": (_no_options, "Deformable-3D-Gaussians: the trainer's folder", _deformable),
    "4dgs": (
        _gaussian4d_options,
        "4D Gaussian Splatting (4D covariances): chkpnt*.pth, cfg_args beside it",
        _gaussian4d,
    ),
    "avatar": (_avatar_options, "a skinned avatar: one .npz file, or Gaussians and --smplx", _avatar),
    "feed-forward": (
        _feed_forward_options,
        "images to Gaussians: a folder of config.json and model.pth",
        _feed_forward,
    ),
    "image-filter": (_image_filter_options, "style or denoising: a folder of config.json and model.pth", _image_filter),
}
