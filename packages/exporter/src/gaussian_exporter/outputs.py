"""From tensors of Gaussians to a finished generator: outputs, bounds and contract."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import onnx

from .arrays import AnyArray
from .contract import DType, Facts, GaussianOutputs, Input, Layout, Shape, gaussian_contract, metadata
from .errors import ExportError
from .graph import INSTANCES, Graph, Tensor, Weights
from .pieces.covariance import covariance_of_scale_and_rotation


@dataclass(frozen=True)
class Options:
    """How a generator is written. dtype float16 halves what it writes and needs the device feature shader-f16. The
    default layout is packed in float32, and split in float16: there scales and rotations take the place of covariances,
    since float16 makes those of needles and discs indefinite. Weights `compact` halve the file, and nothing else:
    tables are float32 again when the session is made. `instances`: the most that one run may compute, of a file with
    an axis for them; None for a file without. Families that have no such file refuse it."""

    layout: Layout | None = None
    dtype: DType = "float32"
    weights: Weights = "float32"
    instances: int | None = None

    @property
    def writes_axes(self) -> bool:
        """Whether scales and rotations are written, by families that have them."""
        return self.dtype == "float16" and self.layout != "packed"


@dataclass(frozen=True)
class Gaussians:
    """What every family makes. positions (N,3) world units; covariances (N,6) or scales (N,3) standard deviations
    with rotations (N,4) w x y z of any length; colors (N,3) 0..1 or sh (N,(d+1)^2,3); opacities (N,1) 0..1. Where a
    graph has instances, any of them may have their axis before these."""

    positions: Tensor
    opacities: Tensor
    covariances: Tensor | None = None
    scales: Tensor | None = None
    rotations: Tensor | None = None
    colors: Tensor | None = None
    sh: Tensor | None = None

    def covariance(self) -> Tensor:
        """The covariances (N,6), made from scales and rotations if they were not given."""
        if self.covariances is not None:
            return self.covariances
        if self.scales is None or self.rotations is None:
            raise ValueError("Gaussians need covariances, or scales and rotations")
        return covariance_of_scale_and_rotation(self.scales, self.rotations)

    def colour(self) -> Tensor:
        """Colours (N,3), or harmonics as rows of (d+1)^2 * 3, all channels of a coefficient together."""
        if self.sh is not None:
            return self.sh.reshape(*self.sh.shape[:-2], self.sh.shape[-2] * 3)
        if self.colors is None:
            raise ValueError("Gaussians need colors or sh")
        return self.colors

    def has_axes(self) -> bool:
        """Whether there are scales and rotations, and not covariances alone."""
        return self.scales is not None and self.rotations is not None

    def sh_degree(self) -> int:
        """Degree of the harmonics; 0 with plain colours."""
        return 0 if self.sh is None else {1: 0, 4: 1, 9: 2, 16: 3}[self.sh.shape[-2]]

    def of_all_instances(self) -> Gaussians:
        """With every part once for each instance, if any part is: what does not move is written for all of them."""
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
    layout = options.layout or ("split" if options.writes_axes else "packed")
    shape: Shape = "axes" if options.writes_axes and gaussians.has_axes() else "covariances"
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
    )
    return graph.model(metadata(gaussian_contract(facts, inputs, outputs)))


def refuse_instances(options: Options, family: str) -> None:
    """Raises argument/value if a file with an axis for instances is asked of a family that has none."""
    if options.instances is not None:
        raise ExportError(
            "argument/value",
            where="instances",
            expected="a family whose files have an axis for instances: avatar or hexplane",
            found=family,
            remedy="leave out --instances; instances of this file run one after the other",
        )


def write_packed(graph: Graph, gaussians: Gaussians, options: Options) -> None:
    """One tensor: position 3, covariance 6, colour 3 or harmonics, opacity 1."""
    columns = [gaussians.positions, gaussians.covariance(), gaussians.colour(), gaussians.opacities]
    graph.output("gaussians", graph.concat(columns, -1), options.dtype == "float16")


def write_split(graph: Graph, gaussians: Gaussians, options: Options, shape: Shape) -> None:
    """A tensor for each attribute. Scales are linear, rotations w x y z."""
    colour = "colors" if gaussians.sh is None else "sh"
    tensors = {
        "positions": gaussians.positions,
        "covariances": gaussians.covariance() if shape == "covariances" else None,
        "scales": gaussians.scales if shape == "axes" else None,
        "rotations": gaussians.rotations if shape == "axes" else None,
        colour: gaussians.colors if gaussians.sh is None else gaussians.sh,
        "opacities": gaussians.opacities,
    }
    for name, tensor in tensors.items():
        if tensor is not None:
            graph.output(name, tensor, options.dtype == "float16")


def save(model: onnx.ModelProto, path: str) -> int:
    """Writes the file and returns its bytes. Protobuf ends at 2 GiB."""
    size = int(model.ByteSize())
    if size >= 2**31 - 1:
        raise ExportError(
            "argument/value",
            where=path,
            expected="a model of less than 2 GiB",
            found=f"{size / 2**30:.1f} GiB",
            remedy="export fewer Gaussians, or a lower degree of harmonics",
        )
    with open(path, "wb") as file:
        file.write(model.SerializeToString())
    return size
