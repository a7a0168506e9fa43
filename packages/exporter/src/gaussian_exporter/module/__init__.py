"""From a PyTorch module to a generator in one call."""

from ..contract import Coordinates
from .export import ExportReport, export_module, generator
from .layouts import image_output, packed, split
from .roles import (
    camera,
    camera_to_world,
    control,
    depth,
    frame,
    gaussians,
    image,
    intrinsics,
    pose,
    projection,
    seed,
    shape,
    state,
    time,
    view,
    view_projection,
    viewport,
)

__all__ = [
    "Coordinates",
    "ExportReport",
    "camera",
    "camera_to_world",
    "control",
    "depth",
    "export_module",
    "frame",
    "gaussians",
    "generator",
    "image",
    "image_output",
    "intrinsics",
    "packed",
    "pose",
    "projection",
    "seed",
    "shape",
    "split",
    "state",
    "time",
    "view",
    "view_projection",
    "viewport",
]
