"""Poses as structure from motion finds them: COLMAP (pycolmap 3.13.0), from nothing but the images and their order."""

import tempfile
from pathlib import Path

import numpy as np

OVERLAP = 10  # images before and after which each image is matched with


def find(folder: Path, names, true, threads: int = -1) -> dict:
    """Poses, focal length and points of images, moved to the true world by a similarity.

    `true` is [N, 4, 4], world to camera. The result has `found`, indices of the images with a pose; `poses` of these,
    [n, 4, 4]; `focal` in pixels; `points` [m, 3]; `colors` [m, 3], 0 to 1.
    """
    import pycolmap

    with tempfile.TemporaryDirectory() as work:
        database = Path(work) / "database.db"
        extraction = pycolmap.FeatureExtractionOptions(use_gpu=False, num_threads=threads)
        pycolmap.extract_features(
            database,
            folder,
            image_names=list(names),
            camera_mode=pycolmap.CameraMode.SINGLE,
            camera_model="SIMPLE_PINHOLE",
            extraction_options=extraction,
        )
        pycolmap.match_sequential(
            database,
            matching_options=pycolmap.FeatureMatchingOptions(use_gpu=False, num_threads=threads),
            pairing_options=pycolmap.SequentialPairingOptions(overlap=OVERLAP, quadratic_overlap=True),
        )
        options = pycolmap.IncrementalPipelineOptions(num_threads=threads)
        models = pycolmap.incremental_mapping(database, folder, work, options)
    if not models:
        raise RuntimeError(f"{folder}: expected a model of {len(names)} images, COLMAP found none")
    model = max(models.values(), key=lambda each: each.num_reg_images())
    images = sorted((image.name, image) for image in model.images.values() if image.has_pose)
    found = [list(names).index(name) for name, _ in images]
    rigid = np.stack([np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]]) for _, image in images])
    points = [(point.xyz, point.color) for point in model.points3D.values()]
    scale, turn, shift = similarity(centers(rigid), centers(true[found]))
    return {
        "found": found,
        "poses": moved(rigid, scale, turn, shift),
        "focal": float(next(iter(model.cameras.values())).params[0]),
        "points": scale * np.stack([xyz for xyz, _ in points]) @ turn.T + shift,
        "colors": np.stack([color for _, color in points]) / 255,
    }


def centers(poses) -> np.ndarray:
    """Places [N, 3] of cameras."""
    return -np.einsum("nji,nj->ni", poses[:, :3, :3], poses[:, :3, 3])


def similarity(a, b):
    """Scale, rotation and shift that take points a to b with the least squares, by Umeyama 1991."""
    low, high = a.mean(0), b.mean(0)
    u, d, v = np.linalg.svd((b - high).T @ (a - low) / len(a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(v))])
    turn = u @ sign @ v
    scale = (d * np.diag(sign)).sum() / (a - low).var(0).sum()
    return scale, turn, high - scale * turn @ low


def moved(poses, scale, turn, shift) -> np.ndarray:
    """World to camera after the world is moved by a similarity. Cameras keep their scale."""
    result = poses.copy()
    result[:, :3, :3] = poses[:, :3, :3] @ turn.T
    places = scale * centers(poses) @ turn.T + shift
    result[:, :3, 3] = -np.einsum("nij,nj->ni", result[:, :3, :3], places)
    return result


def errors(poses, true) -> dict:
    """Errors of places in the unit of the world, and of rotations in degrees: median, 90 % within, the worst."""
    places = np.linalg.norm(centers(poses) - centers(true), axis=1)
    turns = np.einsum("nij,nkj->nik", poses[:, :3, :3], true[:, :3, :3])
    half = np.linalg.norm(np.stack([turns[:, i, j] - turns[:, j, i] for i, j in [(0, 1), (0, 2), (1, 2)]]), axis=0) / 2
    angles = np.degrees(np.arctan2(half, (np.trace(turns, axis1=1, axis2=2) - 1) / 2))
    ends = lambda values: [float(np.quantile(values, share)) for share in (0.5, 0.9, 1)]  # noqa: E731
    return {"places": ends(places), "degrees": ends(angles)}
