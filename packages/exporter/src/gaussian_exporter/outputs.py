"""Converts tensors of Gaussians to a finished generator: outputs, bounds and contract."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import onnx

from .arrays import AnyArray
from .contract import (
    DType,
    Facts,
    GaussianOutputs,
    Input,
    Layout,
    OpacityActivation,
    ScaleActivation,
    Shape,
    gaussian_contract,
    metadata,
    of_metadata,
)
from .errors import ExportError
from .graph import INSTANCES, Graph, Tensor, Weights
from .header import contract_faults
from .pieces.covariance import covariance_of_scale_and_rotation


@dataclass(frozen=True)
class Options:
    """Options of a generator. dtype float16 halves the output and needs the device feature shader-f16. If a family has
    scales and rotations the split layout writes them instead of covariances, which cost a graph more than the rest
    of it and in float16 lose the short axes of needles. The default layout is split, which copies nothing together
    and writes constant parts once; packed for files without inputs, which run once. Weights `compact` halve the
    file, and nothing else: tables are float32 again when the session is created. `instances`: the maximum of one
    run, for a file with an axis for them; None for a file without. Families without such a file refuse it.
    """

    layout: Layout | None = None
    dtype: DType = "float32"
    weights: Weights = "float32"
    instances: int | None = None

    @property
    def wants_axes(self) -> bool:
        """Whether scales and rotations are written by families that could also bake covariances."""
        return self.layout == "split" or (self.dtype == "float16" and self.layout is None)


@dataclass(frozen=True)
class Gaussians:
    """Outputs of every family. positions (N,3) world units; covariances (N,6) or scales (N,3) standard deviations, or
    their logarithms, with rotations (N,4) w x y z of any length; colors (N,3) 0..1 or sh (N,(d+1)^2,3); opacities (N,1)
    0..1, or their logits. If a graph has instances, any tensor may have their axis before these."""

    positions: Tensor
    opacities: Tensor | None = None
    opacity_logits: Tensor | None = None
    covariances: Tensor | None = None
    scales: Tensor | None = None
    log_scales: Tensor | None = None
    rotations: Tensor | None = None
    colors: Tensor | None = None
    sh: Tensor | None = None

    def covariance(self) -> Tensor:
        """The covariances (N,6), computed from scales and rotations if they were not given."""
        if self.covariances is not None:
            return self.covariances
        if self.rotations is None:
            raise ValueError("Gaussians need covariances, or scales and rotations")
        return covariance_of_scale_and_rotation(self.scale(), self.rotations)

    def scale(self) -> Tensor:
        """Standard deviations (N,3), computed from their logarithms if those were given."""
        if self.scales is not None:
            return self.scales
        if self.log_scales is None:
            raise ValueError("Gaussians need scales with their rotations")
        return self.log_scales.unary("Exp")

    def opacity(self) -> Tensor:
        """Opacities (N,1), computed from their logits if those were given."""
        if self.opacities is not None:
            return self.opacities
        if self.opacity_logits is None:
            raise ValueError("Gaussians need opacities")
        return self.opacity_logits.unary("Sigmoid")

    def color(self) -> Tensor:
        """Colors (N,3), or harmonics as rows of (d+1)^2 * 3, all channels of a coefficient together."""
        if self.sh is not None:
            return self.sh.reshape(*self.sh.shape[:-2], self.sh.shape[-2] * 3)
        if self.colors is None:
            raise ValueError("Gaussians need colors or sh")
        return self.colors

    def has_axes(self) -> bool:
        """Whether there are scales and rotations, and not covariances alone."""
        return self.rotations is not None

    def sh_degree(self) -> int:
        """Degree of the harmonics; 0 with plain colors."""
        return 0 if self.sh is None else {1: 0, 4: 1, 9: 2, 16: 3}[self.sh.shape[-2]]

    def of_all_instances(self) -> Gaussians:
        """Repeats constant tensors for each instance, if any tensor has an axis of instances."""
        parts = [part for field in fields(self) if (part := getattr(self, field.name)) is not None]
        like = next((part for part in parts if part.shape[0] == INSTANCES), None)
        if like is None:
            return self
        each = {field.name: part.alongside(like) for field in fields(self) if (part := getattr(self, field.name))}
        return replace(self, **each)


def finish(
    graph: Graph,
    gaussians: Gaussians,
    inputs: Sequence[Input],
    bounds: tuple[AnyArray, AnyArray],
    facts: Facts,
    options: Options,
) -> onnx.ModelProto:
    """Adds the outputs and returns the generator. `bounds`: corners around every position at the inputs' defaults."""
    if not graph.lead:
        refuse_instances(options, graph.name)
    gaussians = gaussians.of_all_instances()
    layout = options.layout or ("split" if options.wants_axes or inputs else "packed")
    shape: Shape = "axes" if layout == "split" and gaussians.has_axes() else "covariances"
    # Float16 keeps the digits of a scale better than those of its logarithm.
    raw = layout == "split" and options.dtype == "float32"
    scale_activation: ScaleActivation = "log" if raw and gaussians.log_scales is not None else "linear"
    opacity_activation: OpacityActivation = "logit" if raw and gaussians.opacity_logits is not None else "linear"
    if layout == "packed":
        write_packed(graph, gaussians, options)
    else:
        write_split(graph, gaussians, options, shape)
    outputs = GaussianOutputs(
        layout=layout,
        shape=shape,
        n_max=gaussians.positions.shape[-2],
        dtype=options.dtype,
        sh_degree=None if gaussians.sh is None else gaussians.sh_degree(),
        bounds=([float(x) for x in bounds[0]], [float(x) for x in bounds[1]]),
        instances=options.instances,
        scale_activation=scale_activation,
        opacity_activation=opacity_activation,
    )
    return graph.model(metadata(gaussian_contract(facts, inputs, outputs)))


def refuse_instances(options: Options, family: str) -> None:
    """Raises argument/value if a file with an axis for instances is requested from a family without one."""
    if options.instances is not None:
        raise ExportError(
            "argument/value",
            where="instances",
            expected="a family whose files have an axis for instances: avatar, hexplane or spacetime",
            found=family,
            remedy="leave out --instances; instances of this file run one after the other",
        )


def write_packed(graph: Graph, gaussians: Gaussians, options: Options) -> None:
    """One tensor: position 3, covariance 6, color 3 or harmonics, opacity 1."""
    columns = [gaussians.positions, gaussians.covariance(), gaussians.color(), gaussians.opacity()]
    graph.output("gaussians", graph.concat(columns, -1), options.dtype == "float16")


def write_split(graph: Graph, gaussians: Gaussians, options: Options, shape: Shape) -> None:
    """A tensor for each attribute. Float32 scales and opacities are unchanged, before their activation or after it;
    rotations w x y z.
    """
    raw = options.dtype == "float32"
    tensors = {"positions": gaussians.positions}
    if shape == "covariances":
        tensors["covariances"] = gaussians.covariance()
    elif gaussians.rotations is not None:
        logarithms = gaussians.log_scales if raw else None
        tensors["scales"] = logarithms if logarithms is not None else gaussians.scale()
        tensors["rotations"] = gaussians.rotations
    if gaussians.sh is not None:
        tensors["sh"] = gaussians.sh
    elif gaussians.colors is not None:
        tensors["colors"] = gaussians.colors
    logits = gaussians.opacity_logits if raw else None
    tensors["opacities"] = logits if logits is not None else gaussians.opacity()
    for name, tensor in tensors.items():
        graph.output(name, graph.written_again(tensor), not raw)


def refuse_place(path: Path, *read: Path) -> None:
    """Raises argument/value, before the work, if a path is not writable, or is one of the inputs."""
    found = None
    if path.is_dir():
        found = "a folder"
    elif not path.absolute().parent.is_dir():
        found = f"no folder {path.parent}"
    elif any(each.exists() and path.exists() and path.samefile(each) for each in read):
        found = "the file that is read"
    if found is not None:
        raise ExportError(
            "argument/value",
            where=str(path),
            expected="a place for a file",
            found=found,
            remedy="name the .onnx file to write, in a folder that is there",
        )


def save(model: onnx.ModelProto, path: Path) -> int:
    """Writes the file, complete or not at all, and returns its size in bytes. Raises contract/... if pages refuse its
    contract, and argument/value above 2 GiB, the limit of protobuf.
    """
    contract = of_metadata({prop.key: prop.value for prop in model.metadata_props}, str(path))
    for fault in contract_faults(contract):
        raise fault.error()
    size = int(model.ByteSize())
    if size >= 2**31 - 1:
        raise ExportError(
            "argument/value",
            where=str(path),
            expected="a model of less than 2 GiB",
            found=f"{size / 2**30:.1f} GiB",
            remedy="export fewer Gaussians, or a lower degree of harmonics",
        )
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(model.SerializeToString())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    return size
