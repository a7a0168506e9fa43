"""Makes one scene of the studio from nothing, on a machine with an NVIDIA GPU: images, training, truth.

`python make.py apartment --data ../shared/data --out made` needs mitsuba 3.9.1, gsplat 1.5.3, torch, scipy, pillow.
"""

import argparse
import gzip
import importlib
import inspect
import json
import os
import re
import time
from pathlib import Path

import mitsuba as mi
import numpy as np

os.environ.setdefault("TORCH_CUDA_ARCH_LIST", "9.0")

# Cap of splats, and whether the scene is trained antialiased.
SCENES = {
    "apartment": (320_000, False),
    "product": (160_000, False),
    "garden": (450_000, False),
    "hall": (260_000, True),
    "walker": (90_000, False),
}
STRIDE = 4  # depth and ids are told at every fourth pixel


def main() -> None:
    """Reads the command line, makes the scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=SCENES)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--out", type=Path, default=Path("made"))
    parser.add_argument("--images", type=int, default=150)
    parser.add_argument("--held", type=int, default=48)
    parser.add_argument("--width", type=int, default=800)
    parser.add_argument("--samples", type=int, default=48)
    parser.add_argument("--held-samples", type=int, default=256, help="of a held-out image")
    parser.add_argument("--steps", type=int, default=15_000)
    parser.add_argument("--seconds", type=float, default=1e9, help="longest training")
    parser.add_argument("--until", type=float, default=1e12, help="time (seconds since 1970) by which all must be done")
    parser.add_argument("--reserve", type=float, default=110, help="seconds before --until that are kept for training")
    parser.add_argument("--frames", type=int, default=24, help="of a moving scene")
    parser.add_argument("--parts", type=Path, default=Path("/tmp/studio-parts"))
    parser.add_argument("--poses", choices=["true", "found"], default="true", help="found: by COLMAP (pycolmap 3.13.0)")
    parser.add_argument("--look", action="store_true", help="only writes the held-out images")
    options = parser.parse_args()
    mi.set_variant("cuda_ad_rgb")
    options.out.mkdir(parents=True, exist_ok=True)
    Making(options).run()


class Making:
    """One scene on its way."""

    def __init__(self, options):
        """Builds the stage and loads it."""
        import torch

        from render import Renderer

        self.options, self.torch, self.began = options, torch, time.time()
        self.scene = importlib.import_module(options.name)
        self.stage = (
            self.scene.build(options.data) if inspect.signature(self.scene.build).parameters else self.scene.build()
        )
        self.random = np.random.default_rng(options.width)
        self.width, self.height = options.width, options.width * 3 // 4
        self.focal = self.width / 2 / np.tan(np.radians(self.stage.field_of_view / 2))
        self.renderer = Renderer(self.stage, options.parts / options.name, torch, lambda a: torch.from_numpy(a).cuda())
        self.camera = None
        self.say(
            f"built: {len(self.stage.parts)} parts, "
            f"{sum(len(m[1]) for p in self.stage.parts.values() for m in p)} triangles"
        )

    def say(self, words: str) -> None:
        """Prints with the scene's name and the time."""
        print(f"{self.options.name} {time.time() - self.began:.0f} s: {words}", flush=True)

    def left(self, reserve: float) -> float:
        """Seconds that training may take."""
        return min(self.options.seconds, self.options.until - time.time() - reserve)

    def aim(self, eye, target):
        """The one camera, moved."""
        from render import aim, sensor

        if self.camera is None:
            self.camera = sensor(self.stage.field_of_view, self.width, self.height, eye, target)
        return aim(self.camera, eye, target)

    def draw(self, shape):
        """Normal numbers on the device."""
        return self.torch.randn(shape, device="cuda")

    def run(self) -> None:
        """Images, then training, then truth."""
        if hasattr(self.scene, "animate"):
            import moving

            return moving.make(self)
        views = self.scene.cameras(self.stage, self.random, self.options.images)
        held = self.picture_held(views)
        if self.options.look:
            return None
        images, poses, points, colors = self.picture_training(views)
        focal = self.focal
        if self.options.poses == "found":
            images, poses, points, colors, focal = self.as_found(images, poses)
        from train import Images, measure, train

        cap, antialiased = SCENES[self.options.name]
        splats = train(
            Images(images, poses, focal), points, colors, cap, self.options.steps, self.left(18), antialiased
        )
        figures = self.keep(
            splats, lambda s: measure(s, Images(held["pixels"], held["poses"], self.focal), antialiased)
        )
        self.tell(held, figures, cap, antialiased, len(images))
        return None

    def still(self, camera) -> np.ndarray:
        """A held-out image (H, W, 3) uint8: the phone's lens and film, a still hand, the mean exposure, no noise."""
        import phone

        light = phone.spread(self.renderer.light(camera, self.options.held_samples), phone.blur(0, 0), self.torch)
        image = phone.shown(light * self.stage.exposure, self.torch)
        return (image * 255 + 0.5).clamp(0, 255).cpu().numpy().astype(np.uint8)

    def picture_held(self, views) -> dict:
        """Held-out images, depth and ids of each."""
        import phone

        poses, pixels, coded, depths, ids = [], [], [], [], []
        for eye, target in phone.between(views, np.random.default_rng(7), self.options.held * 3 // 2):
            camera, pose = self.aim(eye, target), pose_of(eye, target)
            where, things = self.renderer.geometry(camera)
            if (
                len(pixels) == self.options.held
                or np.percentile(np.linalg.norm(where - eye, axis=2)[things < 255], 8) < 0.5
            ):
                continue
            image = self.still(camera)
            z = ((where - eye) @ (np.asarray(target) - eye)) / np.linalg.norm(np.asarray(target) - eye)
            depths.append(
                np.where(things < 255, np.clip(z * 500, 0, 65535), 0).astype(np.uint16)[
                    STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE
                ]
            )
            ids.append(things[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE])
            poses.append(pose)
            pixels.append(image)
            coded.append(phone.coded(image, "WEBP", 82))
        self.say(f"{len(pixels)} held-out images")
        folder = self.options.out / "held"
        folder.mkdir(exist_ok=True)
        for number, data in enumerate(coded):
            (folder / f"{number:02}.webp").write_bytes(data)
        return {"poses": poses, "pixels": pixels, "depths": np.stack(depths), "ids": np.stack(ids)}

    def picture_training(self, views):
        """Images as the phone takes them, poses, points as structure from motion would find them, their colors."""
        import phone

        images, poses, points, colors = [], [], [], []
        self.taken = []
        exposures = phone.drift(len(views), self.random)
        for k in self.random.permutation(len(views)):  # whenever time ends, all parts of the way have been seen
            (eye, target), exposure = views[k], exposures[k]
            camera = self.aim(eye, target)
            light = self.renderer.light(camera, self.options.samples)
            image = phone.take(light, self.stage.exposure * exposure, self.random, self.torch, self.draw)
            where, things = self.renderer.geometry(camera)
            found, color = self.found(where, things, image, np.asarray(eye), target)
            points.append(found)
            colors.append(color)
            images.append(image)
            self.taken.append(int(k))
            poses.append(pose_of(eye, target))
            if time.time() > self.options.until - self.options.reserve:
                break
            if len(images) % 50 == 0:
                self.say(f"{len(images)} images")
        return images, poses, np.concatenate(points), np.concatenate(colors)

    def as_found(self, images, poses):
        """Images that COLMAP finds a pose for, with this pose, and its points, their colors and its focal length."""
        import phone
        from poses import errors, find

        folder = self.options.out / "taken"
        folder.mkdir(exist_ok=True)
        order = np.argsort(self.taken)  # as they were taken on the way
        names = [f"{self.taken[k]:03}.png" for k in order]
        for name, k in zip(names, order, strict=True):
            (folder / name).write_bytes(phone.coded(images[k], "PNG", 100))
        true = np.stack([poses[k] for k in order])
        result = find(folder, names, true)
        own = errors(result["poses"], true[result["found"]])
        self.say(
            f"COLMAP: {len(result['found'])} of {len(images)} images, focal {result['focal'] / self.focal:.5f}, {own}"
        )
        chosen = [images[order[k]] for k in result["found"]]
        return chosen, list(result["poses"]), result["points"], result["colors"], result["focal"]

    def found(self, where, things, image, eye, target, count: int = 700):
        """Points on surfaces, off by about a pixel, one in fifty wild; the sky's at 60 m."""
        from stage import TRAINER

        v, u = self.random.integers(0, self.height, count), self.random.integers(0, self.width, count)
        points, seen = where[v, u].astype(float), things[v, u] < 255
        pose = pose_of(eye, target)
        rays = (
            np.stack(
                [(u + 0.5 - self.width / 2) / self.focal, (v + 0.5 - self.height / 2) / self.focal, np.ones(count)], 1
            )
            @ pose[:3, :3]
            * TRAINER
        )
        points = np.where(seen[:, None], points, eye + 60 * rays / np.linalg.norm(rays, axis=1, keepdims=True))
        distance = np.linalg.norm(points - eye, axis=1, keepdims=True)
        points = points + self.random.normal(size=points.shape) * distance * 0.003
        wild = self.random.random(count) < 0.02
        points[wild] = eye + (points[wild] - eye) * self.random.uniform(0.5, 1.5, (wild.sum(), 1))
        return points * TRAINER, image[v, u] / 255

    def keep(self, splats, check) -> dict:
        """Rounds, orders, measures and writes the splats; returns the figures."""
        import pack

        values = {k: v.detach().float().cpu().numpy().reshape(len(v), -1) for k, v in splats.items()}
        values["quats"] /= np.maximum(np.linalg.norm(values["quats"], axis=1, keepdims=True), 1e-9)
        values["opacities"] = values["opacities"][:, 0]
        values = pack.ordered(pack.rounded(values))
        for name, value in values.items():
            splats[name].data = self.torch.from_numpy(value).to(splats[name]).reshape(splats[name].shape)
        figures = check(splats)
        self.say(
            f"{len(values['means'])} splats: {figures['psnr']} dB (worst {figures['psnrWorst']}), "
            f"SSIM {figures['ssim']}, after a gain {figures['psnrAfterGain']} dB"
        )
        data = pack.archive(values)
        (self.options.out / "splats.xz").write_bytes(data)
        self.say(f"archive {len(data) / 1e6:.1f} MB")
        return figures | {"splats": len(values["means"])}

    def tell(self, held, figures, cap, antialiased, count, more=None) -> None:
        """Writes truth, cameras of images, depth and ids, the mesh."""
        out = self.options.out
        truth = self.stage.truth() | {
            "depth": {"everyPixel": STRIDE, "unit": 0.002, "shape": list(held["depths"].shape)},
            "training": {
                "images": count,
                "cap": cap,
                "antialiased": antialiased,
                "harmonics": 3,
                "near": 0.05,
                "trainer": "gsplat 1.5.3, MCMC",
            },
            "measured": figures,
            **(more or {}),
        }
        names = held.get("names") or [f"{number:02}" for number in range(len(held["poses"]))]
        views = [self.view(name, pose) for name, pose in zip(names, held["poses"], strict=True)]
        (out / "views.json").write_text(json.dumps({"views": views}))
        write_binary(out / "depth.bin.gz", held["depths"].astype("<u2"), held["ids"])
        mesh = self.stage.mesh()
        truth["mesh"] = {"points": len(mesh[0]), "triangles": len(mesh[1])}
        write_binary(out / "mesh.bin.gz", *mesh)
        lines = json.dumps(truth, indent=2)
        (out / "truth.json").write_text(
            re.sub(
                r"\[[^\[\]{}]*\]", lambda list: " ".join(list[0].split()).replace("[ ", "[").replace(" ]", "]"), lines
            )
            + "\n"
        )
        self.say("done")

    def view(self, name: str, pose) -> dict:
        """A image's camera, as the project's tools read it."""
        intrinsics = [[float(self.focal), 0, self.width / 2], [0, float(self.focal), self.height / 2], [0, 0, 1]]
        pose = [[round(float(x), 6) for x in row] for row in pose]
        return {
            "name": name,
            "image": f"{name}.webp",
            "width": self.width,
            "height": self.height,
            "K": intrinsics,
            "worldToCamera": pose,
        }


def write_binary(path: Path, *arrays) -> None:
    """Arrays one after the other, little-endian, gzip."""
    path.write_bytes(gzip.compress(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays), 9, mtime=0))


def pose_of(eye, target) -> np.ndarray:
    """World to camera (x right, y down, z forward) in the frame of the trained scene."""
    from stage import TRAINER

    forward = np.asarray(target, float) - np.asarray(eye, float)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward]) * TRAINER
    pose[:3, 3] = -pose[:3, :3] @ (np.asarray(eye) * TRAINER)
    return pose


if __name__ == "__main__":
    main()
