"""Where the camera is, seen from each point."""

from ..graph import Tensor


def direction_and_distance(points: Tensor, camera_position: Tensor) -> tuple[Tensor, Tensor]:
    """Unit vectors (...,N,3) from the camera (3) to the points (...,N,3), and distances (...,N,1), never 0."""
    offset = points - camera_position
    distance = ((offset * offset).sum(-1, keep=True) + 1e-20).unary("Sqrt")
    return offset / distance, distance
