"""Path traced images of a stage: linear light, denoised."""

import drjit as dr
import mitsuba as mi
import numpy as np
from pyoidn import denoise


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
        kinds = "albedo:albedo,normal:sh_normal"
        self.features = mi.load_dict({"type": "aov", "aovs": kinds})
        self.seed, self.things = 0, None

    def light(self, camera, samples: int):
        """Denoised linear light (H, W, 3), as xp's array. Open Image Denoise reads albedo and normals beside the color."""
        self.seed += 2
        color = self._take(camera, samples, None, self.seed)
        guide = self._take(camera, 16, self.features, self.seed + 1)
        return denoise(color, guide[..., :3], guide[..., 3:6], hdr=True)

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
