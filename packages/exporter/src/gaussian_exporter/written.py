"""Checks the outputs of a run against the contract's `outputs`: shapes, rows, numbers.

The rules are those of the checker of pages and shells, packages/core/src/contract (tensor-rules.ts,
check-outputs.ts, gaussian-values.ts): tests/fixtures/written.json tests both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np

from .arrays import AnyArray
from .errors import ExportError

# Codes of packages/core/src/errors.ts, without "contract/".
FaultCode = str
Rule = Sequence[int | str]

FIELDS = (
    *("gaussians", "positions", "covariances", "scales", "rotations", "colors", "sh", "opacities"),
    *("image", "count"),
)
_SHAPES: dict[str, list[Rule]] = {
    "positions": [("N", 3)],
    "covariances": [("N", 6), ("N", 3, 3)],
    "scales": [("N", 3), ("N", 1), ("N",)],
    "rotations": [("N", 4)],
    "colors": [("N", 3), ("N", 4)],
    "opacities": [("N",), ("N", 1)],
    "count": [(1,), ()],
    "image": [(1, 3, "H", "W"), (1, 4, "H", "W"), (3, "H", "W"), (4, "H", "W")],
}
_COEFFICIENTS = (1, 4, 9, 16)
# Columns of a packed row; colors take the remaining columns.
_WIDTHS = {"positions": 3, "covariances": 6, "scales": 3, "rotations": 4, "opacities": 1}
_HALF = 2.0**-11


@dataclass(frozen=True)
class Fault:
    """One fault, with the code of the checker of pages."""

    code: FaultCode
    tensor: str
    where: str
    expected: str
    found: str
    remedy: str

    def error(self, when: str = "") -> ExportError:
        """Converts to an error; `when` names the run."""
        where = self.where + when
        return ExportError(
            f"contract/{self.code}", where=where, expected=self.expected, found=self.found, remedy=self.remedy
        )


@dataclass(frozen=True)
class Attribute:
    """The valid rows of one attribute, and the activation of its numbers."""

    tensor: str
    rows: AnyArray
    activation: str = "linear"


Attributes = dict[str, Attribute]


def rules_of(outputs: Mapping[str, Any], field: str) -> list[Rule]:
    """Shapes that a field of a contract's `outputs` may have."""
    layout = outputs["layout"]
    if field == "gaussians":
        if layout == "visionary":
            return [("N", 10)]
        width = sum(_WIDTHS.get(each, 0) for each in outputs.get("columns", ("positions", "covariances", "opacities")))
        return [("N", width + 3 * n) for n in ((1,) if outputs["color"] == "rgb" else _COEFFICIENTS)]
    if field == "sh":
        shapes: list[Rule] = [
            ("N", 3, n) if outputs.get("shOrder") == "channel-major" else ("N", n, 3) for n in _COEFFICIENTS
        ]
        return [*(shapes if layout == "split" else []), *(("N", 3 * n) for n in _COEFFICIENTS)]
    return _SHAPES[field]


def degree_of(outputs: Mapping[str, Any], field: str, dims: Sequence[Any]) -> int | None:
    """Degree of the harmonics in a tensor of an allowed shape; None for a tensor that has none."""
    numbers = 0
    if field == "sh":
        numbers = int(np.prod(dims[1:]))
    elif field == "gaussians" and outputs.get("color") == "sh":
        others = outputs.get("columns", ("positions", "covariances", "opacities"))
        numbers = dims[1] - sum(_WIDTHS.get(each, 0) for each in others)
    return _COEFFICIENTS.index(numbers // 3) if numbers // 3 in _COEFFICIENTS else None


Shape = TypeVar("Shape", bound=tuple[Any, ...])


def bare(shape: Shape, rules: Sequence[Rule]) -> Shape | None:
    """The shape without leading ones, as few removed as necessary; None if no rule allows it."""
    for rule in rules:
        if len(rule) == len(shape) and all(_fits(b, a) for a, b in zip(rule, shape, strict=True)):
            return shape
    return bare(cast(Shape, shape[1:]), rules) if shape[:1] == (1,) else None


def _fits(dim: object, rule: int | str) -> bool:
    """N, H and W may be symbolic; other letters are sizes that a file must fix."""
    if isinstance(rule, int):
        return dim == rule
    return rule in ("N", "H", "W") or (isinstance(dim, int) and dim > 0)


def read(
    outputs: Mapping[str, Any], written: Mapping[str, AnyArray], n_max: int | None = None
) -> tuple[list[Fault], Attributes]:
    """Returns the faults of shapes and numbers of rows, and without faults the attributes of the valid rows. A
    post-processor has one attribute, its image."""
    faults: list[Fault] = []
    read: dict[str, AnyArray] = {}
    first: str | None = None
    for field in FIELDS:
        if field not in outputs:
            continue
        name = str(outputs[field])
        where = f"output {name}" if field == name else f"output {name} ({field})"
        if name not in written:
            remedy = "correct the name in the contract, or export the model with it"
            faults.append(Fault("missing-tensor", name, where, "this output", ", ".join(written) or "nothing", remedy))
            continue
        values = written[name]
        rules = rules_of(outputs, field)
        shape = bare(values.shape, rules)
        kinds = ("int32", "int64") if field == "count" else ("float32", "float16")
        if shape is None:
            expected = " or ".join(f"[{', '.join(map(str, rule))}]" for rule in rules)
            remedy = "is the order of the outputs the module's? If it is, write the tensor in this shape"
            faults.append(Fault("shape", name, where, expected, str(list(values.shape)), remedy))
        elif str(values.dtype) not in kinds:
            remedy = f"cast it to {kinds[0]}"
            faults.append(Fault("dtype", name, where, " or ".join(kinds), str(values.dtype), remedy))
        elif field in ("count", "image"):
            read[field] = values.reshape(1, -1)
        else:
            read[field] = values.reshape(shape[0], int(np.prod(shape[1:])))
            first = first or field
            rows, wanted = shape[0], len(read[first])
            if rows != wanted:
                expected = f"{wanted} rows, as {outputs[first]} has"
                remedy = "write the same number of rows for every attribute"
                faults.append(Fault("rows", name, where, expected, f"{rows} rows", remedy))
            elif n_max is not None and rows > n_max and "count" not in outputs:
                remedy = "raise nMax in the contract"
                faults.append(Fault("rows", name, where, f"at most nMax = {n_max} rows", f"{rows} rows", remedy))
    if faults or first is None:
        return faults, {"image": Attribute(outputs["image"], read["image"])} if "image" in read else {}
    live = maximum = min(len(read[first]), n_max or len(read[first]))
    if "count" in read:
        name, live = str(outputs["count"]), int(read["count"][0, 0])
        if not 0 <= live <= maximum:
            expected = f"a count of 0 to {maximum}, the number of rows (or nMax)"
            faults.append(Fault("count", name, f"output {name}", expected, str(live), "clamp the count in the model"))
            live = min(max(0, live), maximum)
    return faults, {each: part for each, part in _attributes(outputs, {k: v[:live] for k, v in read.items()})}


def _attributes(outputs: Mapping[str, Any], rows: Mapping[str, AnyArray]) -> Iterator[tuple[str, Attribute]]:
    activations = {"scales": outputs.get("scaleActivation"), "opacities": outputs.get("opacityActivation")}
    if "gaussians" in rows:
        color = "sh" if outputs.get("color") == "sh" else "colors"
        order = ["positions", "covariances", color, "opacities"]
        if outputs["layout"] == "visionary":
            order = ["positions", "opacities", "covariances"]
        order = outputs.get("columns", order)
        packed = rows["gaussians"]
        others, start = sum(_WIDTHS.get(each, 0) for each in order), 0
        for each in order:
            end = start + (_WIDTHS.get(each) or packed.shape[1] - others)
            yield each, Attribute(outputs["gaussians"], packed[:, start:end], activations.get(each) or "linear")
            start = end
    for each, values in rows.items():
        if each not in ("gaussians", "count"):
            # The alpha of colors with four columns is not read.
            part = values[:, :3] if each == "colors" else values
            yield each, Attribute(outputs[each], part, activations.get(each) or "linear")


def value_faults(attributes: Attributes) -> Iterator[Fault]:
    """Invalid numbers: for each kind and attribute the first row, and the number of rows."""
    for name, part in attributes.items():
        is_finite = np.isfinite(part.rows)
        # Infinite logits and the logarithm of a zero scale are opacities 0 and 1 and a flat disc.
        if part.activation == "logit":
            is_finite = ~np.isnan(part.rows)
        elif part.activation == "log":
            is_finite |= part.rows == -np.inf
        broken = cast(AnyArray, ~is_finite.all(1))
        if broken.any():
            value = part.rows[broken.argmax()][~is_finite[broken.argmax()]][0]
            remedy = "find what divides by zero, or overflows; pad unused rows with opacity 0, not with NaN"
            yield _fault("not-finite", name, part, broken, "finite numbers", str(value), remedy)
        rule = _RULES.get(name) if part.activation == "linear" else None
        if rule is not None:
            is_kept, code, expected, remedy = rule
            wrong: AnyArray = ~broken
            wrong[wrong] = ~is_kept(part.rows[~broken])
            if wrong.any():
                found = " ".join(f"{value:.4g}" for value in part.rows[wrong.argmax()])
                yield _fault(code, name, part, wrong, expected, found, remedy)


def _fault(
    code: FaultCode, name: str, part: Attribute, wrong: AnyArray, expected: str, found: str, remedy: str
) -> Fault:
    count = int(wrong.sum())
    more = f"; in {count:,} of {len(wrong):,} rows" if count > 1 else ""
    where = f"output {part.tensor}, {'' if name == part.tensor else f'{name} of '}row {int(wrong.argmax())}"
    return Fault(code, part.tensor, where, expected, found + more, remedy)


def _are_covariances(rows: AnyArray) -> AnyArray:
    full = rows.astype(np.float64)[:, [0, 1, 2, 1, 3, 4, 2, 4, 5] if rows.shape[1] == 6 else range(9)].reshape(-1, 3, 3)
    is_half = rows.dtype == np.float16
    # Rounding moves an eigenvalue by at most the norm of the errors, of about 16 roundings.
    slack = (2.0**-20 + is_half * _HALF) * np.abs(full.trace(axis1=1, axis2=2)) + is_half * 3 * 2.0**-25
    return cast(AnyArray, np.linalg.eigvalsh(full)[:, 0] >= -slack)


def _are_opacities(rows: AnyArray) -> AnyArray:
    slack = _HALF if rows.dtype == np.float16 else 1e-6
    return cast(AnyArray, (rows.astype(np.float64) >= -slack).all(1) & (rows.astype(np.float64) <= 1 + slack).all(1))


# The square of this limit is a covariance in float32.
_LARGEST = 1e18


_RULES: dict[str, tuple[Any, FaultCode, str, str]] = {
    "covariances": (
        _are_covariances,
        "covariance",
        "positive semi-definite covariances xx xy xz yy yz zz",
        "write R S S^T R^T, and check the order of the six numbers",
    ),
    "scales": (
        lambda rows: ((rows >= 0) & (rows.astype(np.float64) <= _LARGEST)).all(1),
        "covariance",
        "standard deviations of 0 to 1e18",
        'apply the exponential in the model, or declare logarithms: split(scales="log"), scaleActivation "log"',
    ),
    "rotations": (
        lambda rows: (rows != 0).any(1),
        "covariance",
        "a quaternion other than zero",
        "write the identity where there is no rotation; pad unused rows with it, too",
    ),
    "opacities": (
        _are_opacities,
        "opacity",
        "an opacity of 0 to 1",
        'apply the sigmoid in the model, or declare logits: split(opacities="logit"), opacityActivation "logit"',
    ),
}


# Opacities below this are not drawn: they change no pixel of 8 bits.
_MIN_OPACITY = 1 / 255


def box_of(attributes: Attributes) -> tuple[AnyArray, AnyArray] | None:
    """Corners around the finite centers of the drawn rows; None if there are none."""
    if "positions" not in attributes:
        return None
    centers = attributes["positions"].rows.astype(np.float64)
    shown = np.isfinite(centers).all(1)
    if "opacities" in attributes:
        opacities = attributes["opacities"]
        is_logit = opacities.activation == "logit"
        minimum = np.log(_MIN_OPACITY / (1 - _MIN_OPACITY)) if is_logit else _MIN_OPACITY
        shown &= ~(opacities.rows.reshape(-1).astype(np.float64) < minimum)
    centers = centers[shown]
    return (centers.min(0), centers.max(0)) if len(centers) else None


def bounds_faults(contract: Mapping[str, Any], attributes: Attributes) -> Iterator[Fault]:
    """Centers outside the contract's bounds, which hold at all times, with the other inputs at defaults."""
    box = box_of(attributes)
    if box is None or "bounds" not in contract:
        return
    low, high = (np.asarray(contract["bounds"][end], np.float64) for end in ("min", "max"))
    is_half = attributes["positions"].rows.dtype == np.float16
    rounding = float(np.abs([low, high]).max()) * (_HALF if is_half else 2.0**-23)
    slack = max(1e-3 * float((high - low).max()), rounding)
    if (box[0] < low - slack).any() or (box[1] > high + slack).any():
        declared, found = (
            " to ".join(" ".join(f"{x:.4g}" for x in end) for end in ends) for ends in ((low, high), box)
        )
        tensor = attributes["positions"].tensor
        expected = f"centers within the declared bounds, {declared}"
        yield Fault("conflict", tensor, f"output {tensor}, positions", expected, found, "widen bounds in the contract")
