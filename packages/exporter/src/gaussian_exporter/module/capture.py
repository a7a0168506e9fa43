"""PyTorch's two exporters, with disabled steps that change numbers, and operators that ONNX lacks."""

from __future__ import annotations

import contextlib
import copy
import functools
import io
import logging
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar, cast

import onnx

from ..placement import RULES
from .roles import Role

Function = TypeVar("Function", bound=Callable[..., Any])

# Opset of each exporter: 17 suits TorchScript best; the opset of PyTorch's own exporter keeps all WebGPU kernels.
OPSETS = {"dynamo": RULES["exportOpset"], "TorchScript": 17}
# Pattern in the error of an exporter that lacks an operator, and a replacement for the module's author.
_INSTEAD = {
    "diag_embed": "write torch.diag_embed(s) as s[..., None] * torch.eye(n)",
    "linalg_inv|inverse": "matrices of up to 4 rows are inverted by torch.linalg.inv; larger ones need a closed form",
    "linalg_svd|_svd": "leave the decomposition away: write covariances instead of scales and rotations",
    "linalg_solve": "multiply by torch.linalg.inv of the matrix, of up to 4 rows",
    "nonzero|masked_select|index.Tensor": "choose by torch.gather; keep every row, with opacity 0 in unwanted ones",
    "aten_am(ax|in)": "write x.max() or x.min() in place of x.amax() and x.amin() without a dimension",
    "GuardOnDataDependent|data-dependent": "do not branch on numbers: use torch.where",
    "complex|fft": "write real and imaginary parts as tensors of their own",
}


def captured(
    wrapped: Any, inputs: Mapping[str, Role], outputs: Sequence[str], exporter: str, torch: Any
) -> onnx.ModelProto:
    """The module, written by one exporter."""
    args = tuple(torch.from_numpy(role.default.copy()) for role in inputs.values())
    names = {"input_names": list(inputs), "output_names": list(outputs), "opset_version": OPSETS[exporter]}
    with contextlib.ExitStack() as stack:
        # The raised errors contain the exporter's failures.
        stack.enter_context(silenced("torch"))
        stack.enter_context(warnings.catch_warnings())
        stack.enter_context(contextlib.redirect_stderr(io.StringIO()))
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        stack.enter_context(closed_inverses(torch))
        warnings.simplefilter("ignore")
        if exporter == "dynamo":
            # Its rewriter replaces constants of 1e-8 by zero, although this addend keeps rest poses finite.
            options = {"dynamo": True, "external_data": False, "verbose": False, "optimize": False}
            return folded(torch.onnx.export(wrapped, args, **options, **names).model)
        file = io.BytesIO()
        torch.onnx.export(wrapped, args, file, dynamo=False, **names)
        return onnx.load_from_string(file.getvalue())


def folded(model: Any) -> onnx.ModelProto:
    """A model of onnx_ir with constants folded and duplicates merged, without a change of numbers."""
    import onnx_ir as ir
    import onnx_ir.passes.common as passes
    from onnxscript import optimizer

    passes.InlinePass()(model)
    optimizer.fold_constants(model, onnx_shape_inference=True)
    with silenced("onnx_ir"):
        ir.passes.Sequential(
            passes.RemoveUnusedNodesPass(),
            passes.RemoveUnusedFunctionsPass(),  # type: ignore[no-untyped-call, unused-ignore]
            passes.RemoveUnusedOpsetsPass(),
            passes.LiftConstantsToInitializersPass(lift_all_constants=True, size_limit=0),
            passes.DeduplicateInitializersPass(),
            passes.CommonSubexpressionEliminationPass(),
            passes.OutputFixPass(),
            passes.NameFixPass(),
        )(model)
    return cast(onnx.ModelProto, onnx.ModelProto.FromString(ir.serde.serialize_model(model).SerializeToString()))


@contextlib.contextmanager
def silenced(name: str) -> Iterator[None]:
    """Disables the log of a package."""
    log = logging.getLogger(name)
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(level)


def keeping_modes(export: Function) -> Function:
    """Returns a function of a module that keeps each part in its mode, training or evaluation."""

    @functools.wraps(export)
    def keeping(module: Any, *given: Any, **named: Any) -> Any:
        modes = [(part, part.training) for part in module.modules()] if hasattr(module, "modules") else []
        try:
            return export(module, *given, **named)
        finally:
            for part, mode in modes:
                part.training = mode

    return cast(Function, keeping)


@contextlib.contextmanager
def closed_inverses(torch: Any) -> Iterator[None]:
    """Inverses of matrices of up to 4 rows in products and sums, because ONNX has no operator for them."""
    owners = ((torch, "inverse"), (torch.linalg, "inv"), (torch.Tensor, "inverse"))
    before = [getattr(owner, name) for owner, name in owners]
    try:
        for owner, name in owners:
            setattr(owner, name, lambda matrix, _=torch.linalg.inv: inverse(matrix, torch, _))
        yield
    finally:
        for (owner, name), own in zip(owners, before, strict=True):
            setattr(owner, name, own)


def inverse(matrix: Any, torch: Any, other: Any) -> Any:
    """The adjugate over the determinant (..., n, n), n up to 4, by cofactors."""
    size = matrix.shape[-1]
    if size > 4:
        return other(matrix)
    entries = [[matrix[..., row, column] for column in range(size)] for row in range(size)]
    cofactors = [[_minor(entries, row, column) for column in range(size)] for row in range(size)]
    determinant = sum(entries[0][i] * cofactors[0][i] for i in range(size))
    rows = [torch.stack([cofactors[column][row] for column in range(size)], -1) for row in range(size)]
    return torch.stack(rows, -2) / determinant[..., None, None]


def _minor(entries: list[list[Any]], row: int, column: int) -> Any:
    """The signed determinant without one row and one column."""
    rest = [[x for j, x in enumerate(line) if j != column] for i, line in enumerate(entries) if i != row]
    if not rest:
        return entries[0][0] * 0 + 1
    value = rest[0][0] if len(rest) == 1 else sum(rest[0][j] * _minor(rest, 0, j) for j in range(len(rest)))
    return -value if (row + column) % 2 else value


def widened(module: Any, torch: Any) -> tuple[Any, list[str]]:
    """The module in float32 on the CPU, a copy if it has weights in 16 bits or elsewhere, and the names of those in 16
    bits: pages have no kernels for bfloat16, and float16 only on some devices.
    """
    weights = [*module.named_parameters(), *module.named_buffers()]
    narrow = [name for name, tensor in weights if tensor.dtype in (torch.bfloat16, torch.float16)]
    if not narrow and all(tensor.device.type == "cpu" for _, tensor in weights):
        return module, narrow
    own = copy.deepcopy(module).cpu()
    return (own.float() if narrow else own), narrow


def cause(error: BaseException) -> str:
    """The cause of an exporter's failure in one line, without the advice and terminal colors of its own error."""
    whole = str(error)
    while error.__cause__ is not None:
        error = error.__cause__
        whole += str(error)
    lines = [line for line in re.sub(r"\x1b\[[0-9;]*m", "", str(error)).splitlines() if line.strip()]
    remedy = next((each for pattern, each in _INSTEAD.items() if re.search(pattern, whole)), "")
    line = lines[0].strip()[:300] if lines else ""
    return f"{type(error).__name__}: {line}{f' ({remedy})' * bool(remedy)}"
