"""The moving scene: cameras film all frames; the first is trained whole, each later one from the one before."""

import math
import time

import numpy as np

MOST = 1.75  # meters from the middle within which anything may move
PER_FRAME = 800  # steps


def make(making) -> None:
    """Images of all frames, training, truth."""
    import phone
    from make import pose_of

    options, stage, scene = making.options, making.stage, making.scene
    views = scene.cameras(stage, making.random, options.images)
    beside = scene.cameras(stage, np.random.default_rng(5), options.images)
    held = [
        ((beside[k][0] + beside[k + 1][0]) / 2, beside[k][1])
        for k in np.linspace(0, options.images - 2, options.held).astype(int)
    ]
    shots, truths, points, colors = [], [], [], []
    for frame in range(1 if options.look else options.frames):
        scene.animate(stage, making.renderer.scene, frame)
        row = []
        for eye, target in views[: 1 if options.look else None]:
            camera = making.aim(eye, target)
            light = making.renderer.light(camera, options.samples)
            image = phone.take(light, stage.exposure, making.random, making.torch, making.draw)
            row.append(image)
            if frame == 0:
                where, things = making.renderer.geometry(camera)
                found = making.found(where, things, image, np.asarray(eye), target, 3000)
                points.append(found[0])
                colors.append(found[1])
        shots.append(row)
        truths.append([making.still(making.aim(eye, target)) for eye, target in held])
        if frame % 6 == 0:
            making.say(f"frame {frame} filmed")
    folder = options.out / "held"
    folder.mkdir(exist_ok=True)
    for frame, row in enumerate(truths):
        for number, image in enumerate(row):
            (folder / f"{frame:02}-{number}.webp").write_bytes(phone.coded(image, "WEBP", 82))
    if options.look:
        return
    poses, held_poses = [pose_of(*v) for v in views], [pose_of(*v) for v in held]
    _train(making, shots, truths, poses, held_poses, np.concatenate(points), np.concatenate(colors), held)


def _train(making, shots, truths, poses, held_poses, points, colors, held) -> None:
    import pack
    from make import SCENES, STRIDE
    from train import Images, measure, train

    torch, options = making.torch, making.options
    cap, _ = SCENES[options.name]
    splats = train(Images(shots[0], poses, making.focal), points, colors, cap, options.steps, 0.5 * making.left(25))
    figures = making.keep(splats, lambda s: measure(s, Images(truths[0], held_poses, making.focal)))
    with torch.no_grad():
        near = (splats["means"][:, 0] ** 2 + splats["means"][:, 2] ** 2 < MOST**2) & (splats["means"][:, 1] > -2.1)
        chosen = torch.nonzero(near)[:, 0]
    names = ("means", "quats", "opacities", "sh0")
    kept = [{k: splats[k].detach()[chosen].cpu().numpy().reshape(len(chosen), -1) for k in names}]
    decibels, before, began = [figures["psnr"]], splats["means"].detach().clone(), time.time()
    for frame in range(1, len(shots)):
        with torch.no_grad():
            step = splats["means"] - before
            before = splats["means"].clone()
            if frame > 1:
                splats["means"].data[chosen] += (step * (step.norm(dim=1, keepdim=True) > 0.004))[chosen]
        _follow(
            torch,
            splats,
            Images(shots[frame], poses, making.focal),
            chosen,
            names,
            making.left(25) / (len(shots) - frame),
        )
        now = {k: splats[k].detach()[chosen].cpu().numpy().reshape(len(chosen), -1) for k in names}
        now["quats"] = now["quats"] / np.maximum(np.linalg.norm(now["quats"], axis=1, keepdims=True), 1e-9)
        still = (np.abs(now["means"] - kept[0]["means"]).max(1) < 0.0015) & (
            np.abs(now["sh0"] - kept[0]["sh0"]).max(1) < 0.04
        )
        for name in names:
            now[name][still] = kept[0][name][still]
        kept.append(now)
        decibels.append(measure(splats, Images(truths[frame], held_poses, making.focal))["psnr"])
        if frame % 4 == 0:
            making.say(
                f"frame {frame}: {decibels[-1]} dB, {int((~still).sum())} of {len(chosen)} move, "
                f"{time.time() - began:.0f} s"
            )
    data = pack.motion(kept)
    (options.out / "motion.xz").write_bytes(data)
    np.save(options.out / "chosen.npy", chosen.cpu().numpy().astype(np.uint32))
    making.say(
        f"motion {len(data) / 1e6:.1f} MB, dB PSNR, frames {min(decibels):.1f} to {max(decibels):.1f}, "
        f"mean {np.mean(decibels):.2f}"
    )
    depths, ids = [], []
    making.scene.animate(making.stage, making.renderer.scene, 0)
    for eye, target in held:
        where, things = making.renderer.geometry(making.aim(eye, target))
        z = ((where - eye) @ (np.asarray(target) - eye)) / np.linalg.norm(np.asarray(target) - eye)
        depths.append(
            np.where(things < 255, np.clip(z * 500, 0, 65535), 0).astype(np.uint16)[
                STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE
            ]
        )
        ids.append(things[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE])
    more = {"frames": len(shots), "framesPerSecond": making.scene.RATE, "psnrOfFrames": decibels}
    told = {
        "poses": held_poses,
        "depths": np.stack(depths),
        "ids": np.stack(ids),
        "names": [f"00-{k}" for k in range(len(held_poses))],
    }
    making.tell(told, figures, cap, False, len(shots) * len(poses), more)


def _follow(torch, splats, images, chosen, names, seconds: float) -> None:
    """Moves the chosen splats to the next frame; scales and harmonics stay."""
    from train import draw, similarity

    rates = {"means": 1.2e-3, "quats": 2e-3, "opacities": 1e-2, "sh0": 2.5e-3}
    frozen = torch.ones(len(splats["means"]), dtype=torch.bool, device="cuda")
    frozen[chosen] = False
    adams = {k: torch.optim.Adam([splats[k]], lr=rates[k], eps=1e-15, fused=True) for k in names}
    random = np.random.default_rng(3)
    order: list = []
    began = time.time()
    for step in range(PER_FRAME):
        part = max(step / PER_FRAME, (time.time() - began) / seconds)
        if part >= 1:
            break
        order = order or list(random.permutation(len(images)))
        k = int(order.pop())
        goal, image = images[k], draw(splats, images, k, 3, False)[0]
        loss = 0.8 * (image - goal).abs().mean() + 0.2 * (1 - similarity(image, goal))
        loss.backward()
        for name, adam in adams.items():
            splats[name].grad[frozen] = 0
            adam.param_groups[0]["lr"] = rates[name] * 0.12**part
            adam.step()
        for value in splats.values():
            value.grad = None
    assert math.isfinite(float(loss))
