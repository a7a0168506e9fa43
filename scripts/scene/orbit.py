"""The position of a camera on an orbit, in the syntax of the element's camera-orbit attribute."""

import numpy as np


def orbit_matrix(theta: float, phi: float, radius: float) -> np.ndarray:
    """World to camera (4,4, OpenCV) of a camera that looks at the origin from `radius` away. Degrees; at theta 0 it
    stands on the -z side, theta grows towards +x, phi is measured from up, which is -y. phi must not be 0 or 180."""
    t, p = np.radians([theta, phi])
    eye = radius * np.array([np.sin(t) * np.sin(p), -np.cos(p), -np.cos(t) * np.sin(p)])
    forward = -eye / radius
    right = np.array([np.cos(t), 0, np.sin(t)])
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    matrix[:3, 3] = -matrix[:3, :3] @ eye
    return matrix
