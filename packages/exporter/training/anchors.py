"""Rows of parameters that grow and shrink while an Adam optimizer trains them, and Scaffold-GS's rule for anchors."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from common import Optimizers


def replace_rows(module: nn.Module, names: list[str], kept: Tensor, added: dict[str, Tensor], all_: Optimizers) -> None:
    """Keeps the rows whose indices are given, appends others, and moves the optimizers' moments along (new rows begin
    without any)."""
    for name in names:
        old: nn.Parameter = getattr(module, name)
        new = nn.Parameter(torch.cat([old.detach()[kept], added[name]]))
        setattr(module, name, new)
        for optimizer in all_:
            for group in optimizer.param_groups:
                group["params"] = [new if p is old else p for p in group["params"]]
            state = optimizer.state.pop(old, None)
            if state is not None:
                blank = torch.zeros_like(added[name])
                rows = ("exp_avg", "exp_avg_sq")
                optimizer.state[new] = {
                    key: torch.cat([value[kept], blank]) if key in rows else value for key, value in state.items()
                }


class Watch:
    """Sums, over some steps, how strongly Gaussians are pulled and how opaque their anchors are."""

    def __init__(self, anchors: int, offsets: int, device: torch.device):
        """Begins with nothing seen."""
        self.pull = torch.zeros(anchors * offsets, device=device)
        self.seen = torch.zeros(anchors * offsets, device=device)
        self.opacity = torch.zeros(anchors, device=device)
        self.steps = 0

    @torch.no_grad()
    def note(self, gradients: Tensor, opacities: Tensor) -> None:
        """After a backward pass: gradients of positions (N,3), opacities (N)."""
        strength = gradients.norm(dim=1)
        self.pull += strength
        self.seen += strength > 0
        self.opacity += opacities.detach().reshape(len(self.opacity), -1).amax(1)
        self.steps += 1

    def wanted(self) -> Tensor:
        """Indices of Gaussians, those most strongly pulled first; only such as were seen often enough."""
        mean = torch.where(
            self.seen > 0.2 * self.steps, self.pull / self.seen.clamp(min=1), torch.zeros_like(self.pull)
        )
        order = torch.argsort(mean, descending=True)
        return order[: int((mean > 0).sum())]

    def alive(self, minimum: float) -> Tensor:
        """Which anchors (M) were opaque enough, on average."""
        return self.opacity / max(self.steps, 1) >= minimum


def free_cells(candidates: Tensor, taken: Tensor, width: float, maximum: int) -> Tensor:
    """Indices of at most `most` candidates (C,3), in order, one for each voxel that no taken point (M,3) lies in."""
    low = torch.cat([candidates, taken]).amin(0)

    def cell(points: Tensor) -> Tensor:
        x, y, z = torch.floor((points - low) / width).long().unbind(1)
        return (x * 1_000_000 + y) * 1_000_000 + z

    cells = cell(candidates)
    free = torch.nonzero(~torch.isin(cells, cell(taken)))[:, 0]
    _, group = torch.unique(cells[free], return_inverse=True)
    first = torch.full((int(group.max()) + 1 if len(group) else 0,), len(free), device=free.device)
    first.scatter_reduce_(0, group, torch.arange(len(free), device=free.device), "amin")
    return free[torch.sort(first).values[:maximum]]
