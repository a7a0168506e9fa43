"""3D Gaussian splats in notebooks: `Splats` shows a file, arrays, or a scene while it trains."""

from .messages import Arrays, message
from .widget import Splats

__all__ = ["Arrays", "Splats", "message"]
