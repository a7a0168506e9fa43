"""Direction and distance between the camera and each point."""

from ..graph import Tensor

# Keeps a camera on a point from dividing by 0.
_TINY = 1e-10


def direction_and_distance(points: Tensor, camera_position: Tensor) -> tuple[Tensor, Tensor]:
    """Unit vectors (...,N,3) from the camera (3) to the points (...,N,3), and distances (...,N,1), never 0."""
    offset = points - camera_position
    distance = offset.length(-1, keep=True) + _TINY
    return offset / distance, distance


def distance_to(points: Tensor, camera_position: Tensor) -> Tensor:
    """Distances (...,N,1) of points (...,N,3) from the camera (3), never 0."""
    return (points - camera_position).length(-1, keep=True) + _TINY
