"""Path traced images of a stage: linear light, denoised with what the geometry knows."""

import drjit as dr
import mitsuba as mi
import numpy as np


def sensor(field_of_view: float, width: int, height: int, eye, target):
    """A pinhole camera that looks from `eye` to `target`, both in the world of the stage."""
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    return mi.load_dict(
        {
            "type": "perspective",
            "fov": field_of_view,
            "fov_axis": "x",
            "near_clip": 0.01,
            "to_world": toward(eye, target),
            "film": film,
        }
    )


def toward(eye, target):
    """The place of a camera; the same camera can be moved there with `aim`."""
    return mi.ScalarTransform4f().look_at(
        origin=[float(v) for v in eye], target=[float(v) for v in target], up=[0, 1, 0]
    )


def aim(camera, eye, target):
    """Moves a camera; its compiled kernels are used again."""
    values = mi.traverse(camera)
    values["to_world"] = mi.Transform4f(toward(eye, target).matrix)
    values.update()
    return camera


def display(light: np.ndarray) -> np.ndarray:
    """Linear light to a image in 0 to 1: a film curve, then sRGB."""
    light = np.maximum(light, 0)
    film = np.clip(light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14), 0, 1)
    return np.where(film <= 0.0031308, 12.92 * film, 1.055 * np.maximum(film, 1e-8) ** (1 / 2.4) - 0.055)


class Renderer:
    """A loaded stage: images, depths and object ids from any camera. `xp` is torch (on its device) or numpy."""

    def __init__(self, stage, folder, xp=np, move=lambda a: a):
        """Writes the meshes of a stage into `folder` and loads them."""
        self.stage, self.xp, self.move = stage, xp, move
        self.scene = mi.load_dict(
            {**stage.write(folder), "integrator": {"type": "path", "max_depth": stage.depth}}, optimize=False
        )
        kinds = "albedo:albedo,normal:sh_normal,depth:depth,shape:shape_index"
        self.features = mi.load_dict({"type": "aov", "aovs": kinds})
        self.seed, self.things = 0, None

    def light(self, camera, samples: int):
        """Denoised linear light (H, W, 3), as xp's array."""
        self.seed += 3
        halves = [self._take(camera, samples // 2, None, self.seed + k) for k in (0, 1)]
        guide = self._take(camera, 8, self.features, self.seed + 2)
        return denoised(self.xp, halves, guide[..., :3], guide[..., 3:6], guide[..., 6])

    def _take(self, camera, samples, integrator, seed):
        image = mi.render(
            self.scene, sensor=camera, spp=samples, seed=seed, **({"integrator": integrator} if integrator else {})
        )
        return self.move(np.nan_to_num(np.array(image), nan=0.0, posinf=0.0, neginf=0.0))

    def geometry(self, camera):
        """Ends of the rays through the middles of pixels: points (H, W, 3) float32, object ids (H, W) uint8.

        The id is 255 where there is nothing.
        """
        width, height = camera.film().size()
        x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        ray, _ = camera.sample_ray(
            0.0, 0.5, mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32)), mi.Point2f(0.5)
        )
        hit = self.scene.ray_intersect(ray)
        number = np.array(dr.reinterpret_array(mi.UInt32, hit.shape))
        if self.things is None:
            self.things = self._things()
        table = np.concatenate([self.things, np.full(max(0, int(number.max()) + 1 - len(self.things)), 255)])
        ids = np.where(np.array(hit.is_valid()), table[number], 255)
        points = np.array(hit.p).T.reshape(height, width, 3)
        return points.astype(np.float32), ids.reshape(height, width).astype(np.uint8)

    def _things(self) -> np.ndarray:
        """Object ids by the numbers that shapes have in kernels."""
        ids, table = self.stage.ids(), np.full(4096, 255)
        for shape in self.scene.shapes():
            number = int(np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))).ravel()[0])
            table[number] = ids[int(shape.id().removeprefix("part"))]
        return table


def denoised(xp, halves, albedo, normal, depth, levels: int = 5):
    """An edge-stopping wavelet filter of two independent halves: noise is known by how they differ."""
    base = xp.clip(albedo, 0.03, None) if xp is np else albedo.clamp(min=0.03)
    a, b = (half / base for half in halves)
    mean = (a + b) / 2
    noise = (((a - b) / 2) ** 2).sum(-1)
    for _ in range(2):
        noise = _blur(xp, noise)
    mean = _without_fireflies(xp, mean)
    slope = _blur(xp, xp.abs(depth - xp.roll(depth, (1, 1), (0, 1)))) + 0.002 * depth + 1e-4
    for level in range(levels):
        step = 1 << level
        total, weights, spread = mean * 0, noise * 0, noise * 0
        scale = 6.0 * xp.sqrt(_blur(xp, noise)) + 1e-4
        for dy in (-2, -1, 0, 1, 2):
            for dx in (-2, -1, 0, 1, 2):
                by = lambda v: xp.roll(v, (dy * step, dx * step), (0, 1))  # noqa: B023, E731
                kernel = (6, 4, 1)[abs(dy)] * (6, 4, 1)[abs(dx)]
                near = ((by(normal) - normal) ** 2).sum(-1) * 24 + xp.abs(by(depth) - depth) / (slope * step * 4)
                near = near + ((by(albedo) - albedo) ** 2).sum(-1) * 60
                w = kernel * xp.exp(-near - xp.abs(by(mean) - mean).sum(-1) / scale)
                total, weights, spread = total + w[..., None] * by(mean), weights + w, spread + w * w * by(noise)
        mean, noise = total / weights[..., None], spread / weights**2
    return mean * base


def _blur(xp, image):
    return (
        sum((2 - abs(y)) * (2 - abs(x)) * xp.roll(image, (y, x), (0, 1)) for y in (-1, 0, 1) for x in (-1, 0, 1)) / 16
    )


def _without_fireflies(xp, image):
    """Cuts a pixel to twice the largest of the means of its neighbors on four sides."""
    around = [
        xp.roll(image, shift, (0, 1)) for shift in ((0, 1), (0, -1), (1, 0), (-1, 0), (2, 0), (0, 2), (-2, 0), (0, -2))
    ]
    limit = 2.5 * sum(around) / len(around) + 0.02
    return xp.minimum(image, limit)
