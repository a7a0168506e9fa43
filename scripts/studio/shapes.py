"""Triangle meshes. Each maker returns (positions, triangles, uv, normals or None); lengths are meters, y is up."""

import numpy as np

UP = np.array([0.0, 1.0, 0.0])


def box(low, high, inset: float = 0.0):
    """An axis-aligned box whose uv are meters on each face; `inset` bevels the vertical and upper edges."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    quads = []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for side in (0, 1):
            corners = np.empty((4, 3))
            corners[:, axis] = (low, high)[side][axis]
            for k, (s, t) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
                corners[k, others[0]], corners[k, others[1]] = (low, high)[s][others[0]], (low, high)[t][others[1]]
            if (axis == 1) == bool(side):
                corners = corners[::-1]
            quads.append(corners)
    positions = np.concatenate(quads)
    positions[:, [0, 2]] += np.where(positions[:, [0, 2]] < (low + high)[[0, 2]] / 2, inset, -inset) * (
        positions[:, 1:2] == high[1]
    )
    triangles = np.concatenate([[[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]] for q in range(6)])
    uv = np.concatenate([positions[8 * 0 : 8][:, [2, 1]], positions[8:16][:, [0, 2]], positions[16:][:, [0, 1]]])
    return positions, triangles, uv, None


def quad(a, b, c, d, unit: bool = False):
    """A quadrilateral; its uv are meters along its first two sides, or 0 to 1 with `unit`."""
    corners = np.array([a, b, c, d], float)
    wide, high = np.linalg.norm(corners[1] - corners[0]), np.linalg.norm(corners[3] - corners[0])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * ([1, 1] if unit else [wide, high])
    return corners, np.array([[0, 1, 2], [0, 2, 3]]), uv, None


def grid(surface, rows: int, columns: int, size=(1.0, 1.0)):
    """The surface(u, v) -> points for u, v in 0 to 1, smooth; uv are multiplied by `size`."""
    v, u = np.mgrid[0 : 1 : (rows + 1) * 1j, 0 : 1 : (columns + 1) * 1j]
    points = np.stack(np.broadcast_arrays(*surface(u, v)), -1)
    across, along = np.gradient(points, axis=1), np.gradient(points, axis=0)
    normals = np.cross(across, along)
    size_of = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals /= np.maximum(size_of, 1e-12)
    inward = np.concatenate([normals[1:2], normals[:-1]])  # a pole has the normal of its neighbor
    normals = np.where(size_of > 1e-12, normals, inward)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    triangles = np.concatenate(
        [
            np.stack([first, first + 1, first + columns + 2], 1),
            np.stack([first, first + columns + 2, first + columns + 1], 1),
        ]
    )
    return (
        points.reshape(-1, 3),
        triangles,
        np.stack([u * size[0], v * size[1]], -1).reshape(-1, 2),
        normals.reshape(-1, 3),
    )


def lathe(profile, center=(0, 0, 0), steps: int = 48):
    """Turns a profile of (radius, height) about the vertical through `center`."""
    profile = np.asarray(profile, float)
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))]
    rows = max(len(profile) * 4, 16)
    at = np.linspace(0, length[-1], rows + 1)
    radius, height = np.interp(at, length, profile[:, 0]), np.interp(at, length, profile[:, 1])

    def surface(u, v):
        k = np.rint(v * rows).astype(int)
        return (
            center[0] + radius[k] * np.cos(-2 * np.pi * u),
            center[1] + height[k],
            center[2] + radius[k] * np.sin(-2 * np.pi * u),
        )

    return grid(surface, rows, steps, (2 * np.pi * max(radius.max(), 0.05), length[-1]))


def tube(path, radius, steps: int = 10):
    """A round tube along points; `radius` is a number or one for each point."""
    path = np.asarray(path, float)
    radius = np.broadcast_to(radius, len(path))
    ahead = np.gradient(path, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    side = np.cross(ahead, np.where(np.abs(ahead[:, 1:2]) > 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    over = np.cross(ahead, side)
    rows = len(path) - 1
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()

    def surface(u, v):
        k = np.rint(v * rows).astype(int)
        turn = (2 * np.pi * u)[..., None]
        return np.moveaxis(path[k] + radius[k][..., None] * (np.cos(turn) * side[k] + np.sin(turn) * over[k]), -1, 0)

    return grid(surface, rows, steps, (2 * np.pi * radius.max(), length))


def cushion(center, size, power: float = 0.5, turn: float = 0.0):
    """A superellipsoid: a sphere with power 1, a rounded box below."""

    def surface(u, v):
        a, b = 2 * np.pi * u, np.pi * (v - 0.5)
        bend = lambda x: np.sign(x) * np.abs(x) ** power  # noqa: E731
        x, y, z = (
            s / 2 * w
            for s, w in zip(
                size,
                (bend(np.cos(b)) * bend(np.cos(-a)), bend(np.sin(b)), bend(np.cos(b)) * bend(np.sin(-a))),
                strict=False,
            )
        )
        return (
            center[0] + x * np.cos(turn) + z * np.sin(turn),
            center[1] + y,
            center[2] - x * np.sin(turn) + z * np.cos(turn),
        )

    return grid(surface, 24, 40, (size[0] * 2, size[1] * 2))


def ball(center, radius: float):
    """A sphere."""
    return cushion(center, [2 * radius] * 3, 1.0)


def leaves(centers, directions, length, width: float, random, bend: float = 0.25):
    """Bent leaves of four triangles each, tips along `directions`; uv 0 to 1 on each leaf."""
    count = len(centers)
    ahead = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    side = np.cross(ahead, random.normal(size=(count, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    over = np.cross(side, ahead)
    size = np.broadcast_to(length, count)[:, None] * (0.7 + 0.6 * random.random((count, 1)))
    middle = centers + size * 0.5 * ahead + size * bend * 0.4 * over
    tip = centers + size * ahead - size * bend * 0.5 * over
    points = np.stack(
        [centers, middle - side * size * width, middle + size * 0.04 * over, middle + side * size * width, tip], 1
    )
    triangles = (
        np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2], [2, 4, 3]])[None] + 5 * np.arange(count)[:, None, None]
    ).reshape(-1, 3)
    uv = np.tile(np.array([[0.5, 0], [0, 0.5], [0.5, 0.5], [1, 0.5], [0.5, 1]]), (count, 1))
    return points.reshape(-1, 3), triangles, uv, None


def sphere_points(count: int, random) -> np.ndarray:
    """Random unit vectors."""
    points = random.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def moved(mesh, offset=(0, 0, 0), turn: float = 0.0, scale: float = 1.0):
    """A mesh scaled, turned about the vertical, then moved."""
    positions, triangles, uv, normals = mesh
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return positions @ matrix.T * scale + offset, triangles, uv, None if normals is None else normals @ matrix.T


def joined(meshes):
    """One mesh of several; normals are kept if all have them."""
    counts = np.cumsum([0] + [len(m[0]) for m in meshes])
    smooth = all(m[3] is not None for m in meshes)
    return (
        np.concatenate([m[0] for m in meshes]),
        np.concatenate([m[1] + c for m, c in zip(meshes, counts, strict=False)]),
        np.concatenate([m[2] for m in meshes]),
        np.concatenate([m[3] for m in meshes]) if smooth else None,
    )
