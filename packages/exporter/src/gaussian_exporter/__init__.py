"""Trained Gaussian models, and PyTorch modules of your own, to ONNX Gaussian Generators."""

from .module import *  # noqa: F403
from .module import __all__ as __all__
