"""From a PyTorch module to a generator in one call."""

from .export import ExportReport, export_module, generator
from .layouts import image_output, packed, split
from .roles import (
    camera,
    control,
    frame,
    image,
    pose,
    projection,
    seed,
    shape,
    time,
    view,
    view_projection,
    viewport,
)

__all__ = [
    "ExportReport",
    "camera",
    "control",
    "export_module",
    "frame",
    "generator",
    "image",
    "image_output",
    "packed",
    "pose",
    "projection",
    "seed",
    "shape",
    "split",
    "time",
    "view",
    "view_projection",
    "viewport",
]
