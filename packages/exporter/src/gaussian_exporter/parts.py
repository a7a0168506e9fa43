"""Rewrites a graph so that no tensor exceeds the buffers of a device: operators compute large tensors in parts.

A part is a range along one axis: rows of Gaussians, or channels of an image. Operators that keep the axis read and
write parts. Products also split the axis over which they sum, and large weights. Results within the limit are joined.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from math import ceil, gcd, prod
from typing import Any

import onnx
from onnx import helper, numpy_helper

from .errors import ExportError
from .graph import ALIASES, MAX_CONCAT_INPUTS
from .part_axes import SUMS, Axes, split_axes, summed_axes

# maxStorageBufferBindingSize of a WebGPU device with default limits, in bytes.
LIMIT = 128 << 20
Range = tuple[int, int]


@dataclass(frozen=True)
class Parts:
    """A tensor in parts along one axis: the range and the name of each."""

    axis: int
    pieces: list[tuple[Range, str]]


def large_tensors(model: onnx.ModelProto, limit: int = LIMIT) -> dict[str, int]:
    """Bytes of each weight and result of a known size above the limit."""
    return {name: size for name, (dims, kind) in _shapes(model).items() if (size := _bytes(dims, kind)) > limit}


def in_parts(model: onnx.ModelProto, limit: int = LIMIT) -> onnx.ModelProto:
    """Returns a model with the same inputs and outputs and no tensor above `limit` bytes. Raises graph/parts for an
    input or output above the limit, and for an operator on a larger tensor that cannot be split.
    """
    return _Splitter(model, limit).rewritten()


def _bytes(dims: Sequence[int], kind: int) -> int:
    return prod(dims) * int(helper.tensor_dtype_to_np_dtype(kind).itemsize) if kind and min(dims, default=0) >= 0 else 0


def _shapes(model: onnx.ModelProto) -> dict[str, tuple[tuple[int, ...], int]]:
    """Sizes and element types of all values; -1 for sizes that the file does not fix."""
    graph = onnx.shape_inference.infer_shapes(model, data_prop=True).graph
    found = {each.name: (tuple(each.dims), each.data_type) for each in graph.initializer}
    for value in [*graph.input, *graph.value_info, *graph.output]:
        tensor = value.type.tensor_type
        if tensor.HasField("shape"):
            dims = tuple(dim.dim_value if dim.HasField("dim_value") else -1 for dim in tensor.shape.dim)
            found.setdefault(value.name, (dims, tensor.elem_type))
    return found


def _cannot(where: str, expected: str, found: str) -> ExportError:
    remedy = "write fewer Gaussians or smaller images in one run, or raise the limit to that of your visitors' devices"
    return ExportError("graph/parts", where=where, expected=expected, found=found, remedy=remedy)


def _even(length: int, longest: int) -> list[Range]:
    step = ceil(length / ceil(length / longest))
    return [(start, min(start + step, length)) for start in range(0, length, step)]


class _Splitter:
    def __init__(self, model: onnx.ModelProto, limit: int):
        self.model, self.limit = onnx.ModelProto(), limit
        self.model.CopyFrom(model)
        self._store_constants()
        self.shapes = _shapes(self.model)
        self.stored = {each.name: each for each in self.model.graph.initializer}
        self.nodes: list[onnx.NodeProto] = []
        self.parted: dict[str, Parts] = {}
        self.slices: dict[tuple[str, int, Range], str] = {}
        # A beginning of names that the file does not use.
        taken = [*self.shapes, *(node.name for node in self.model.graph.node)]
        prefixes = (f"part{n}_" for n in count(1))
        self.prefix = next(each for each in prefixes if not any(name.startswith(each) for name in taken))

    def _store_constants(self) -> None:
        graph = self.model.graph
        for node in [node for node in graph.node if node.op_type == "Constant" and node.attribute[0].name == "value"]:
            graph.initializer.add().CopyFrom(node.attribute[0].t)
            graph.initializer[-1].name = node.output[0]
            graph.node.remove(node)

    def dims(self, name: str) -> tuple[int, ...]:
        return self.shapes[name][0]

    def size(self, name: str) -> int:
        return _bytes(*self.shapes[name]) if name in self.shapes else 0

    def rewritten(self) -> onnx.ModelProto:
        graph = self.model.graph
        for value in [*graph.input, *graph.output]:
            if self.size(value.name) > self.limit:
                expected = f"at most {self.limit:,} bytes in an input or output"
                raise _cannot(f"tensor {value.name}", expected, f"{self.size(value.name):,} bytes")
        for node in graph.node:
            names = [*node.input, *node.output]
            if not any(name in self.parted or self.size(name) > self.limit for name in names):
                self.nodes.append(node)
                continue
            for each in self._slices_of(node) if node.op_type == "Split" else [node]:
                self._finish(each.output[0], self._split(each))
        del graph.node[:], graph.value_info[:], graph.initializer[:]
        graph.node.extend(self.nodes)
        used = {name for node in self.nodes for name in node.input} | {value.name for value in graph.output}
        graph.initializer.extend(each for name, each in self.stored.items() if name in used)
        try:
            onnx.checker.check_model(self.model)
        except onnx.checker.ValidationError as error:
            # A subgraph may read a tensor that is in parts now.
            expected = "large tensors that no If, Loop or Scan reads"
            raise _cannot(f"graph {graph.name}", expected, str(error).splitlines()[0]) from error
        for name, size in large_tensors(self.model, self.limit).items():
            raise _cannot(f"tensor {name}", f"at most {self.limit:,} bytes", f"{size:,} bytes")
        return self.model

    def _finish(self, name: str, parts: Parts) -> None:
        """Joins a result within the limit."""
        if self.size(name) > self.limit:
            self.parted[name] = parts
        else:
            self._join([piece for _, piece in parts.pieces], parts.axis, name)

    def _join(self, names: Sequence[str], axis: int, to: str | None = None) -> str:
        if len(names) == 1 and to is None:
            return names[0]
        while len(names) > MAX_CONCAT_INPUTS:
            groups = [names[i : i + MAX_CONCAT_INPUTS] for i in range(0, len(names), MAX_CONCAT_INPUTS)]
            names = [self._join(group, axis) for group in groups]
        return self._add("Concat", names, to, axis=axis)

    def _add(self, operator: str, inputs: Sequence[str], to: str | None = None, **attributes: Any) -> str:
        name = to or f"{self.prefix}{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, inputs, [name], name=name, **attributes))
        return name

    def _again(self, node: onnx.NodeProto, inputs: Sequence[str], **attributes: Any) -> str:
        """The same operator on other inputs."""
        name = f"{self.prefix}{len(self.nodes)}"
        copy = helper.make_node(node.op_type, inputs, [name], name=name, domain=node.domain, **attributes)
        copy.attribute.extend(each for each in node.attribute if each.name not in attributes)
        self.nodes.append(copy)
        return name

    def _integers(self, values: Iterable[int]) -> str:
        numbers = list(values)
        name = f"{self.prefix}integers_{'_'.join(map(str, numbers))}"
        self.stored[name] = helper.make_tensor(name, onnx.TensorProto.INT64, [len(numbers)], numbers)
        self.shapes[name] = ((len(numbers),), onnx.TensorProto.INT64)
        return name

    def _range(self, name: str, axis: int, taken: Range) -> str:
        """A range of a tensor, which may be stored, whole or in parts."""
        start, end = taken
        if taken == (0, self.dims(name)[axis]) and (name not in self.parted or self.parted[name].axis != axis):
            return name
        key = (name, axis, taken)
        if key not in self.slices:
            if name in self.stored:
                part = numpy_helper.to_array(self.stored[name])[(slice(None),) * axis + (slice(start, end),)]
                self.slices[key] = f"{self.prefix}{name}_{axis}_{start}_{end}"
                self.stored[self.slices[key]] = numpy_helper.from_array(part.copy(), self.slices[key])
            elif name not in self.parted:
                self.slices[key] = self._slice(name, axis, taken)
            elif self.parted[name].axis == axis:
                inside = [
                    (max(a, start) - a, min(b, end) - a, b - a, piece) for (a, b), piece in self.parted[name].pieces
                ]
                self.slices[key] = self._join(
                    [
                        piece if (a, b) == (0, n) else self._slice(piece, axis, (a, b))
                        for a, b, n, piece in inside
                        if a < b
                    ],
                    axis,
                )
            else:
                parts = self.parted[name]
                raise _cannot(f"tensor {name}", f"parts along axis {axis}", f"parts along axis {parts.axis}")
            dims, kind = self.shapes[name]
            self.shapes[self.slices[key]] = ((*dims[:axis], end - start, *dims[axis + 1 :]), kind)
        return self.slices[key]

    def _slice(self, name: str, axis: int, taken: Range) -> str:
        return self._add("Slice", [name, *(self._integers([number]) for number in (*taken, axis))])

    def _split(self, node: onnx.NodeProto) -> Parts:
        [output, *others] = node.output
        names = [name for name in [*node.input, *node.output] if name]
        given = {each.name: helper.get_attribute_value(each) for each in node.attribute}
        if others or any(name not in self.shapes or min(self.dims(name), default=0) < 0 for name in names):
            raise self._unsplit(node, "one result, and fixed sizes")
        if node.op_type in ALIASES:
            return self._reshaped(node)
        if node.op_type == "Slice" and (parts := self._sliced(node)) is not None:
            return parts
        summed, axes, dims = summed_axes(node, given, self), split_axes(node, given, self), self.dims(output)
        parted = [(i, self.parted[name]) for i, name in enumerate(node.input) if name in self.parted]
        heavy = [i for i, name in enumerate(node.input) if name in self.stored and self.size(name) > self.limit]
        inner = next((parts for i, parts in parted if summed.get(i) == parts.axis), None)
        outer = [(k, parts) for i, parts in parted for k, each in axes.items() if each.get(i) == parts.axis]
        if parted and inner is None and not outer:
            raise self._unsplit(node, "an operator that keeps the axis of the parts")
        if outer:
            axis, ranges = outer[0][0], [taken for taken, _ in outer[0][1].pieces]
        elif self.size(output) > self.limit or (heavy and inner is None):
            # An axis along which all weights above the limit are split, if there is one; rows before columns.
            fit = [k for k, each in axes.items() if all(each.get(i, parts.axis) == parts.axis for i, parts in parted)]
            able = [k for k in fit if all(i in axes[k] for i in heavy)] or fit
            axis = next((k for k in able if self.size(output) <= self.limit * dims[k]), -1)
            if axis < 0:
                raise self._unsplit(node, "an axis to split")
            own = [(output, axis), *((node.input[i], axes[axis][i]) for i in heavy if i in axes[axis])]
            ranges = _even(dims[axis], min(self._longest(name, each) for name, each in own))
        else:
            axis, ranges = next(iter(axes), 0), [(0, dims[next(iter(axes), 0)] if dims else 1)]
        # Other weights are split along the sum.
        for i in heavy if inner is None else ():
            if i in summed and i not in axes[axis]:
                name = node.input[i]
                own_ranges = _even(self.dims(name)[summed[i]], self._longest(name, summed[i]))
                inner = Parts(summed[i], [(taken, "") for taken in own_ranges])
        ranges = self._finer(output, axis, ranges)
        if node.op_type == "Concat" and axis == int(given["axis"]) % len(dims):
            return self._appended(node, axis)
        pieces = []
        for taken in ranges:
            inputs = [
                self._range(name, axes[axis][i], taken) if i in axes.get(axis, {}) else name
                for i, name in enumerate(node.input)
            ]
            pieces.append((taken, self._piece(node, inputs, given, (axis, taken), summed, inner)))
        return Parts(axis, pieces)

    def _slices_of(self, node: onnx.NodeProto) -> list[onnx.NodeProto]:
        """A Split as one Slice for each result."""
        given = {each.name: helper.get_attribute_value(each) for each in node.attribute}
        axis = int(given.get("axis", 0)) % len(self.dims(node.input[0]))
        found, start = [], 0
        for name in node.output:
            end = start + self.dims(name)[axis]
            numbers = [self._integers([number]) for number in (start, end, axis)]
            found.append(helper.make_node("Slice", [node.input[0], *numbers], [name], name=name))
            start = end
        return found

    def _unsplit(self, node: onnx.NodeProto, expected: str) -> ExportError:
        name = max([*node.input, *node.output], key=self.size)
        found = f"{node.op_type} with {name} of {self.size(name):,} bytes"
        return _cannot(f"node {node.name or node.output[0]}", expected, found)

    def _longest(self, name: str, axis: int) -> int:
        """The longest range of an axis whose part keeps the limit."""
        length = self.dims(name)[axis] if self.dims(name) else 1
        return max(1, self.limit * length // max(1, self.size(name)))

    def _finer(self, name: str, axis: int, ranges: Sequence[Range]) -> list[Range]:
        """The ranges, divided so that each part of the result keeps the limit."""
        longest = self._longest(name, axis)
        return [(start + a, start + b) for start, end in ranges for a, b in _even(end - start, longest)]

    def _piece(
        self,
        node: onnx.NodeProto,
        inputs: Sequence[str],
        given: Mapping[str, Any],
        taken: tuple[int, Range],
        summed: Axes,
        inner: Parts | None,
    ) -> str:
        """One part of the result: the operator once, or for each range of the sum."""
        axis, (start, end) = taken
        changes: dict[str, Any] = {}
        if node.op_type == "Conv" and given.get("group", 1) > 1:
            changes["group"] = end - start
        if node.op_type == "Expand":
            shape = list(self.dims(node.output[0]))
            shape[axis] = end - start
            inputs = [inputs[0], self._integers(shape)]
        if inner is None:
            return self._again(node, inputs, **changes)
        terms = []
        for k, (each, _) in enumerate(inner.pieces):
            parts = [self._range(name, summed[i], each) if i in summed else name for i, name in enumerate(inputs)]
            # The bias is added once.
            terms.append(self._again(node, parts if k == 0 else parts[:2], **changes))
        total = terms[0]
        for term in terms[1:]:
            total = self._add(SUMS.get(node.op_type, "Add"), [total, term])
        return total

    def _appended(self, node: onnx.NodeProto, axis: int) -> Parts:
        """Inputs one after the other along the axis of the parts."""
        pieces: list[tuple[Range, str]] = []
        start = 0
        for name in node.input:
            length = self.dims(name)[axis]
            if name in self.parted and self.parted[name].axis != axis:
                raise self._unsplit(node, f"parts along axis {axis}")
            own = self.parted[name].pieces if name in self.parted else None
            ranges = self._finer(name, axis, [(0, length)]) if own is None else [taken for taken, _ in own]
            pieces += [((start + a, start + b), self._range(name, axis, (a, b))) for a, b in ranges]
            start += length
        return Parts(axis, pieces)

    def _sliced(self, node: onnx.NodeProto) -> Parts | None:
        """A range along the axis of the parts; None for a Slice of other axes."""
        [name, *given] = node.input
        numbers = [numpy_helper.to_array(self.stored[each]).tolist() for each in given if each in self.stored]
        if name not in self.parted or len(numbers) != len(given) or len(numbers) < 3 or len(numbers[2]) != 1:
            return None
        [first], [last], [axis], *steps = numbers
        parts, axis = self.parted[name], axis % len(self.dims(name))
        if axis != parts.axis or steps not in ([], [[1]]):
            return None
        start, end, _ = slice(first, last).indices(self.dims(name)[axis])
        inside = [(max(a, start), min(b, end)) for (a, b), _ in parts.pieces if max(a, start) < min(b, end)]
        return Parts(axis, [((a - start, b - start), self._range(name, axis, (a, b))) for a, b in inside])

    def _reshaped(self, node: onnx.NodeProto) -> Parts:
        """Parts along the first axis that is longer than one are contiguous, and stay so in another shape."""
        [name, *_], [output] = node.input, node.output
        old, new = (next((i for i, n in enumerate(self.dims(each)) if n > 1), 0) for each in (name, output))
        before, after = self.dims(name)[old], self.dims(output)[new]
        if name in self.parted:
            ranges = [taken for taken, _ in self.parted[name].pieces] if self.parted[name].axis == old else []
        else:
            ranges = _even(before, self._longest(name, old))
        if not ranges:
            raise self._unsplit(node, f"parts along axis {old}")
        if any(end * after % before for _, end in ranges):
            # Ranges of whole rows of the new shape.
            unit = before // gcd(before, after)
            longest = max(1, self._longest(name, old) // unit)
            ranges = [(start * unit, end * unit) for start, end in _even(before // unit, longest)]
        pieces = []
        for start, end in ranges:
            taken = (start * after // before, end * after // before)
            shape = self._integers([*self.dims(output)[:new], taken[1] - taken[0], *self.dims(output)[new + 1 :]])
            pieces.append((taken, self._add("Reshape", [self._range(name, old, (start, end)), shape])))
        return Parts(new, pieces)
