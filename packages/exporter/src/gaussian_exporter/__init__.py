"""Converts trained Gaussian models, and your own PyTorch modules, to ONNX Gaussian generators."""

from .module import *  # noqa: F403
from .module import __all__ as __all__
