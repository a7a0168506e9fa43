"""The photographs' cameras and points as COLMAP wrote them, moved into the upright frame the scene ships in.

Cameras follow OpenCV: x right, y down, z forward, `x_camera = R @ x_world + t`. The upright frame has the same
handedness: the object's up is -y and its face looks towards -z, so a camera on the -z side sees it from the front.
Moving the cameras instead of the trained splats is exact: spherical harmonics never have to be rotated.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree

# The object stands on a post. Everything lower than this height (upright frame, in units of COLMAP's world, measured
# downwards from the point the cameras look at) is post, plate and table, and is not part of the scene.
CUT_HEIGHT = 0.42
# Longest half diagonal of the finished object. Renderers cull nearer than 0.2 units: orbit at 2 to 3.
OBJECT_RADIUS = 0.8
# The photograph taken most nearly from the front; only a start for the search for the plane of symmetry.
FRONT_VIEW = "17"


@dataclass(frozen=True)
class View:
    """One photograph's camera. `rotation` is 3x3 world to camera, `translation` has 3 entries."""

    name: str
    rotation: np.ndarray
    translation: np.ndarray

    @property
    def center(self) -> np.ndarray:
        return -self.rotation.T @ self.translation


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole without distortion, in pixels; pixel centres lie at half integers."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def matrix(self) -> np.ndarray:
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]])


@dataclass(frozen=True)
class Capture:
    """All views, the sparse points (N,3) with colours (N,3) in 0..255, and the height of the cut, in one frame."""

    intrinsics: Intrinsics
    views: list[View]
    points: np.ndarray
    colors: np.ndarray
    cut_height: float


def matrix_of_quaternion(wxyz: np.ndarray) -> np.ndarray:
    w, x, y, z = wxyz / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def read_colmap(sparse: Path) -> Capture:
    """Reads COLMAP's text model: cameras.txt (one PINHOLE), images.txt, points3D.txt."""
    fields = next(
        line for line in (sparse / "cameras.txt").read_text().splitlines() if not line.startswith("#")
    ).split()
    if fields[1] != "PINHOLE":
        raise ValueError(f"{sparse}/cameras.txt: expected PINHOLE, found {fields[1]}; undistort the images first")
    intrinsics = Intrinsics(int(fields[2]), int(fields[3]), *map(float, fields[4:8]))
    views = []
    for line in (sparse / "images.txt").read_text().splitlines():
        fields = line.split()
        if len(fields) == 10 and not line.startswith("#") and "." in fields[9]:
            pose = np.array(fields[1:8], float)
            views.append(View(Path(fields[9]).stem, matrix_of_quaternion(pose[:4]), pose[4:]))
    views.sort(key=lambda view: view.name)
    table = np.loadtxt(sparse / "points3D.txt", usecols=range(1, 7))
    return Capture(intrinsics, views, table[:, :3], table[:, 3:], np.inf)


def looked_at_point(views: list[View]) -> np.ndarray:
    """The point nearest to all optical axes (least squares)."""
    normals = [np.eye(3) - np.outer(view.rotation[2], view.rotation[2]) for view in views]
    return np.linalg.solve(sum(normals), sum(normal @ view.center for normal, view in zip(normals, views)))


def first_guess(views: list[View], center: np.ndarray) -> np.ndarray:
    """World to upright, rows x, y, z: up is the mean of what photographers held up, forward is FRONT_VIEW's."""
    down = np.mean([view.rotation[1] for view in views], axis=0)
    down /= np.linalg.norm(down)
    forward = center - next(view for view in views if view.name == FRONT_VIEW).center
    forward -= down * (forward @ down)
    forward /= np.linalg.norm(forward)
    return np.stack([np.cross(down, forward), down, forward])


def rotation_yaw_roll(yaw: float, roll: float) -> np.ndarray:
    cy, sy, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(roll), np.sin(roll)
    turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    lean = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    return lean @ turn


def asymmetry(parameters: np.ndarray, points: np.ndarray) -> float:
    """Mean distance of the points from the cloud mirrored in x = offset; far outliers count as 0.1."""
    yaw, roll, offset = parameters
    turned = points @ rotation_yaw_roll(yaw, roll).T
    mirrored = turned * [-1, 1, 1] + [2 * offset, 0, 0]
    return float(np.mean(np.minimum(cKDTree(turned).query(mirrored[::3])[0], 0.1)))


def to_upright(capture: Capture) -> Capture:
    """Moves cameras and points so that the mirror plane is x = 0, the box is centred and its half diagonal is
    OBJECT_RADIUS. Yaw and roll come from the object's own left-right symmetry."""
    center = looked_at_point(capture.views)
    base = first_guess(capture.views, center)
    points = (capture.points - center) @ base.T
    # The post is no part of the symmetry, and points far out are not on the object.
    symmetric = points[(points[:, 1] < 0.28) & (np.linalg.norm(points, axis=1) < 0.6)]
    found = minimize(
        asymmetry,
        np.array([np.radians(-3), np.radians(-2), 0.01]),
        args=(symmetric,),
        method="Nelder-Mead",
        options={"initial_simplex": np.radians([[-3, -2, 0.6], [3, -2, 0.6], [-3, 3, 0.6], [-3, -2, -1]])},
    )
    yaw, roll, offset = found.x
    rotation = rotation_yaw_roll(yaw, roll) @ base
    turned = (capture.points - center) @ rotation.T
    kept = turned[(turned[:, 1] < CUT_HEIGHT) & (np.linalg.norm(turned, axis=1) < 0.6)]
    low, high = np.percentile(kept, 0.3, axis=0), np.percentile(kept, 99.7, axis=0)
    high[1] = CUT_HEIGHT
    middle = (low + high) / 2
    middle[0] = offset
    scale = OBJECT_RADIUS / (np.linalg.norm(high - low) / 2)
    origin = center + rotation.T @ middle
    views = [
        View(view.name, view.rotation @ rotation.T, scale * (view.translation + view.rotation @ origin))
        for view in capture.views
    ]
    moved = scale * (turned - middle)
    turned_by = f"yaw {np.degrees(yaw):.2f}, roll {np.degrees(roll):.2f} degrees"
    print(f"upright: {turned_by}, asymmetry {found.fun:.4f}, scale {scale:.4f}")
    return Capture(capture.intrinsics, views, moved, capture.colors, float(scale * (CUT_HEIGHT - middle[1])))
