"""Runs the module itself, before any exporter, with values of its inputs, and refuses unsuitable outputs."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..arrays import AnyArray
from ..errors import ExportError
from ..written import read, value_faults
from .layouts import Layout, fitted, tensors_of
from .roles import Role, control, pose, time

Values = Mapping[str, AnyArray]


def wrapped_module(module: Any, inputs: Mapping[str, Role], layout: Layout, batched: bool, torch: Any) -> Any:
    """The module with outputs in the contract's form, and with a batch axis before its inputs if it takes one."""
    stays = [role.binding["role"] in ("image", "depth", "state") or not batched for role in inputs.values()]

    class Named(torch.nn.Module):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.module = module

        def forward(self, *given: Any) -> Any:
            taken = [x if stay else x[None] for x, stay in zip(given, stays, strict=True)]
            tensors = tensors_of(self.module(*taken), layout)
            return tuple(fitted(n, t, layout, torch) for n, t in zip(layout.outputs, tensors, strict=True))

    return Named().eval()


def in_torch(wrapped: Any, values: Values, torch: Any) -> list[AnyArray]:
    """Runs the module in PyTorch and returns its outputs."""
    with torch.no_grad():
        return [tensor.cpu().numpy() for tensor in wrapped(*(torch.from_numpy(np.array(x)) for x in values.values()))]


def weights_of(module: Any) -> Iterator[tuple[str, str, Any]]:
    """Whether a parameter or a buffer, its name, and the tensor."""
    for kind, weights in (("parameter", module.named_parameters()), ("buffer", module.named_buffers())):
        yield from ((kind, name, tensor) for name, tensor in weights)


def tries_of(inputs: Mapping[str, Role]) -> list[dict[str, AnyArray]]:
    """Sets of inputs: all defaults; all other values together, as many sets as the input with the most values; and
    every input at its zero, alone and all together, which reveals a small addend that an exporter drops.
    """
    maximum = max((len(role.samples) for role in inputs.values()), default=1)
    tries = [{name: role.samples[i % len(role.samples)] for name, role in inputs.items()} for i in range(maximum)]
    zeros = {name: role.zero for name, role in inputs.items() if role.zero is not None}
    return [*tries, *({**tries[0], name: zero} for name, zero in zeros.items()), {**tries[0], **zeros}]


def said(values: Values, tries: Sequence[Values]) -> str:
    """Index of the set."""
    if values is tries[0]:
        return "at its inputs' defaults"
    shown = (
        f"{name} = {' '.join(f'{x:.3g}' for x in x.reshape(-1)[:3])}{' ...' * (x.size > 3)}"
        for name, x in values.items()
    )
    return f"with {', '.join(shown)}"


def tried(
    module: Any, inputs: Mapping[str, Role], layout: Layout, batched: bool, n_max: int | None, torch: Any
) -> tuple[list[dict[str, AnyArray]], list[list[AnyArray]]]:
    """Values of the inputs, and the module's outputs for each. Raises argument/value if it rejects them or is not
    deterministic, contract/violation if no file of it could conform to the contract.
    """
    wrapped, tries = wrapped_module(module, inputs, layout, batched, torch), tries_of(inputs)
    written: list[list[AnyArray]] = []
    for values in [*tries, tries[0]]:
        try:
            written.append(in_torch(wrapped, values, torch))
        except ExportError:
            raise
        except Exception as error:  # whatever the module says of what it is given
            if values is tries[0]:
                remedy = next(_remedies(module, inputs, layout, batched, torch))
            else:
                remedy = "narrow the ranges of its inputs, or fix the cause in this message"
            shapes = ", ".join(f"{n} {[1, *r.shape] if batched else list(r.shape)}" for n, r in inputs.items())
            raise ExportError(
                "argument/value",
                where=f"module {type(module).__name__}, given {shapes}, {said(values, tries)}",
                expected="tensors",
                found=f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}",
                remedy=remedy,
            ) from error
    expected, again = written[:-1], written[-1]
    for values, tensors in zip(tries, expected, strict=True):
        faults, attributes = read(layout.json(), dict(zip(layout.outputs, tensors, strict=True)), n_max)
        for fault in [*faults, *value_faults(attributes)]:
            # Invalid numbers at other values than defaults are checked in the file, because visitors can set these.
            if values is tries[0] or fault.code == "not-finite":
                raise fault.error(f" of the module, {said(values, tries)}")
    for name, tensor, other in zip(layout.outputs, expected[0], again, strict=True):
        if (apart := difference(other, tensor)) > 1e-5:
            raise ExportError(
                "argument/value",
                where=f"output {name} of the module, run twice at its inputs' defaults",
                expected="the same numbers for equal inputs",
                found=f"a difference of {apart:.1e}: random numbers (torch.randn, dropout), or something that it keeps",
                remedy="make random numbers once, in __init__, and keep them with register_buffer",
            )
    rows = [len(tensors[0]) for tensors in expected]
    if layout.kind != "image" and n_max is None and len(set(rows)) > 1:
        at = next(i for i, count in enumerate(rows) if count != rows[0])
        raise ExportError(
            "argument/value",
            where=f"output {layout.outputs[0]} of the module",
            expected="the same number of rows for every input",
            found=f"{rows[0]} {said(tries[0], tries)}, {rows[at]} {said(tries[at], tries)}",
            remedy="keep every row, and write opacity 0 into the unused ones, which is faster; or give the most that"
            f" there can be, such as n_max={2 * max(rows)}",
        )
    return tries, expected


def sensitivity(
    wrapped: Any, tries: Sequence[Values], expected: Sequence[Sequence[AnyArray]], torch: Any
) -> list[list[float]]:
    """How far each output of the module itself moves, for each set, when its inputs change by a millionth: what float32
    cannot hold, so that no file can be compared more closely.
    """
    found = []
    for values, wanted in zip(tries, expected, strict=True):
        near = {n: x * np.float32(1 + 1e-6) if x.dtype == np.float32 else x for n, x in values.items()}
        found.append([difference(a, b) for a, b in zip(in_torch(wrapped, near, torch), wanted, strict=True)])
    return found


def difference(mine: AnyArray, theirs: AnyArray) -> float:
    """The largest difference, as a fraction of the largest finite number in `theirs`; inf if shapes differ."""
    mine, theirs = np.asarray(mine, np.float64), np.asarray(theirs, np.float64)
    if mine.shape != theirs.shape:
        return float("inf")
    both = ~(np.isfinite(mine) | np.isfinite(theirs))
    apart = np.where(both, 0, np.abs(mine - theirs))
    scale = max(float(np.abs(theirs[np.isfinite(theirs)]).max(initial=0)), 1e-12)
    # A value that only one of them has.
    return float(np.nan_to_num(apart, nan=np.inf, posinf=np.inf).max(initial=0)) / scale


def describe_difference(mine: AnyArray, theirs: AnyArray) -> str:
    """Describes a difference that is too large, as the predicate of an error's sentence."""
    if mine.shape != theirs.shape:
        found = f"is {list(mine.shape)} where the module writes {list(theirs.shape)}"
        return f"{found}: a number of rows was baked in, by .item() or int(); keep every row, and write opacity 0"
    lost = int((np.isfinite(theirs) & ~np.isfinite(mine)).sum())
    if lost:
        return f"has {lost:,} of {mine.size:,} numbers that are not finite, where the module's are"
    return f"differs by {difference(mine, theirs):.1e} of its largest number"


def _remedies(module: Any, inputs: Mapping[str, Role], layout: Layout, batched: bool, torch: Any) -> Iterator[str]:
    """Remedies: forms of the inputs that the module accepts, the smallest change first, and faults of its weights."""
    forms: list[tuple[str, bool] | None] = [None]
    if any(role.binding["role"] == "pose" for role in inputs.values()):
        forms += itertools.product(("matrix", "quaternion", "axis-angle"), (False, True))
    options = itertools.product((not batched, batched), (False, True), forms)
    for batch, scalar, form in sorted(options, key=lambda o: (o[0] != batched) + o[1] + (o[2] is not None)):
        if (batch, scalar, form) == (batched, False, None):
            continue
        changed = {name: _changed(role, scalar, form) for name, role in inputs.items()}
        wrapped = wrapped_module(module, changed, layout, batch, torch)
        try:
            tensors = in_torch(wrapped, tries_of(changed)[0], torch)
        except Exception:  # it does not take these either
            continue
        if read(layout.json(), dict(zip(layout.outputs, tensors, strict=True)))[0]:
            continue
        said = [f"batched={batch}"] if batch != batched else []
        said += ["shape=() for each time and control"] if scalar else []
        said += [f'pose(..., format="{form[0]}"{", flat=True" * form[1]})'] if form else []
        yield f"give {' and '.join(said)}: it runs with that"
    for kind, name, tensor in weights_of(module):
        if tensor.is_floating_point() and tensor.dtype != torch.float32:
            yield f"its {kind} {name} is {str(tensor.dtype).removeprefix('torch.')}: call module.float()"
    yield "make forward take these shapes; time(shape=...), control(shape=...) and pose(format=...) say others"


def _changed(role: Role, scalar: bool, form: Any) -> Role:
    binding: Any = role.binding
    if scalar and binding["role"] == "time":
        return time(binding["_duration"], binding["unit"] == "normalized", ())
    if scalar and binding["role"] == "control" and role.default.size == 1:
        return control(*binding["range"], shape=())
    if form is None or binding["role"] != "pose" or binding["format"] == "parameters":
        return role
    numbers = {"axis-angle": 3, "quaternion": 4, "matrix": 9}[binding["format"]]
    return pose(role.default.size // numbers, format=form[0], flat=form[1])
