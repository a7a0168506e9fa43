"""Trains splats on images as people do: gsplat, MCMC, harmonics of degree 3, the exposure of each image learned."""

import math
import time

import numpy as np
import torch
from gsplat import rasterization
from gsplat.strategy import MCMCStrategy
from torch.nn.functional import conv2d

DEVICE = "cuda"
RATES = {"means": 1.6e-4, "scales": 5e-3, "quats": 1e-3, "opacities": 5e-2, "sh0": 2.5e-3, "shN": 2.5e-3 / 20}
NEAR = 0.05
NEUTRAL = torch.tensor([1.0, 0.0], device=DEVICE)  # gain and offset of an exposure


class Images:
    """Images on the device (N, H, W, 3) uint8 with poses (N, 4, 4) world to camera and one pinhole."""

    def __init__(self, images, poses, focal: float):
        """Copies all images to the device."""
        self.pixels = torch.from_numpy(np.stack(images)).to(DEVICE)
        self.poses = torch.from_numpy(np.stack(poses).astype(np.float32)).to(DEVICE)
        self.height, self.width = self.pixels.shape[1:3]
        self.intrinsics = torch.tensor(
            [[focal, 0, self.width / 2], [0, focal, self.height / 2], [0, 0, 1]], device=DEVICE, dtype=torch.float32
        )[None]

    def __len__(self):
        """How many."""
        return len(self.pixels)

    def __getitem__(self, k: int):
        """Image k, float 0 to 1."""
        return self.pixels[k].float() / 255


def start(points, colors):
    """Parameters of a splat at each point, a tenth of the way to its neighbors in size.

    MCMC's noise grows with the square of the size: it scatters splats that begin as large as that way.
    """
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(points, 4, workers=8)
    size = np.log(np.clip(0.1 * distance[:, 1:].mean(1), 1e-4, None)).astype(np.float32)
    count = len(points)
    values = {
        "means": torch.from_numpy(points.astype(np.float32)),
        "scales": torch.from_numpy(size)[:, None].repeat(1, 3),
        "quats": torch.randn(count, 4),
        "opacities": torch.logit(torch.full((count,), 0.5)),
        "sh0": ((torch.from_numpy(colors.astype(np.float32)) - 0.5) / 0.28209479)[:, None, :],
        "shN": torch.zeros(count, 15, 3),
    }
    return torch.nn.ParameterDict({k: torch.nn.Parameter(v.to(DEVICE)) for k, v in values.items()})


def draw(splats, images: Images, k: int, degree: int, antialiased: bool):
    """The image that the splats give of pose k, and what the strategy needs."""
    harmonics = torch.cat([splats["sh0"], splats["shN"]], 1)
    image, _, info = rasterization(
        splats["means"], splats["quats"], splats["scales"].exp(), splats["opacities"].sigmoid(), harmonics,
        images.poses[k : k + 1], images.intrinsics, images.width, images.height,
        sh_degree=degree, packed=False, near_plane=NEAR, rasterize_mode="antialiased" if antialiased else "classic",
    )  # fmt: skip
    return image[0], info


_LINE = torch.exp(-((torch.arange(11) - 5.0) ** 2) / 4.5)
_LINE = (_LINE / _LINE.sum()).to(DEVICE)


def similarity(a, b):
    """SSIM of two images (H, W, 3)."""
    x = torch.stack([a, b, a * a, b * b, a * b]).permute(0, 3, 1, 2).reshape(15, 1, *a.shape[:2])
    x = conv2d(conv2d(x, _LINE.view(1, 1, 11, 1)), _LINE.view(1, 1, 1, 11)).view(5, 3, a.shape[0] - 10, -1)
    m, q, aa, bb, ab = x
    s, t, u = aa - m * m, bb - q * q, ab - m * q
    return (((2 * m * q + 1e-4) * (2 * u + 9e-4)) / ((m * m + q * q + 1e-4) * (s + t + 9e-4))).mean()


def optimizers(splats, reach: float):
    """One Adam for each parameter; positions move in proportion to the scene's reach."""
    return {
        name: torch.optim.Adam(
            [{"params": splats[name], "lr": rate * (reach if name == "means" else 1), "name": name}],
            eps=1e-15,
            fused=True,
        )
        for name, rate in RATES.items()
    }


def train(
    images: Images, points, colors, cap: int, steps: int, seconds: float, antialiased: bool = False, seed: int = 1
):
    """Trained parameters. Ends after `steps` or `seconds`, whichever is first; rates follow whichever is further."""
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    splats = start(points, colors)
    eyes = torch.linalg.inv(images.poses)[:, :3, 3]
    reach = float((eyes - eyes.mean(0)).norm(dim=1).max()) * 1.1
    adams = optimizers(splats, reach)
    strategy = MCMCStrategy(
        # Noise moves a center by its covariance times a rate: for a scene of another size than 1 it has to be rescaled.
        cap_max=cap, noise_lr=5e5 / reach**2, refine_start_iter=500, refine_stop_iter=int(steps * 0.8),
        refine_every=100, verbose=False,
    )  # fmt: skip
    state = strategy.initialize_state()
    tone = torch.nn.Parameter(NEUTRAL.repeat(len(images), 3, 1))
    tones = torch.optim.Adam([tone], lr=2e-3, fused=True)
    began, order, rate = time.time(), [], adams["means"].param_groups[0]["lr"]
    for step in range(steps):
        part = max(step / steps, (time.time() - began) / seconds)
        if part >= 1:
            break
        if not order:
            order = list(random.permutation(len(images)))
        k = int(order.pop())
        goal = images[k]
        image, info = draw(splats, images, k, min(int(part * 8), 3), antialiased)
        exposure = tone[k] - tone.mean(0) + NEUTRAL  # the mean over all images is fixed, or splats and exposures drift apart
        image = (image * exposure[:, 0] + exposure[:, 1]).clamp(max=1)  # a sensor shows nothing brighter
        loss = 0.8 * (image - goal).abs().mean() + 0.2 * (1 - similarity(image, goal))
        loss = loss + 0.01 * splats["opacities"].sigmoid().mean() + 0.01 / reach * splats["scales"].exp().mean()
        loss.backward()
        for adam in [*adams.values(), tones]:
            adam.step()
            adam.zero_grad(set_to_none=True)
        now = rate * 0.01**part
        adams["means"].param_groups[0]["lr"] = now
        tones.param_groups[0]["lr"] = 2e-3 * 0.1**part
        if part < 0.8:
            strategy.step_post_backward(splats, adams, state, step, info, lr=now)
        if step % 1000 == 0:
            print(
                f"  step {step} loss {loss.item():.4f} splats {len(splats['means'])} {time.time() - began:.0f} s",
                flush=True,
            )
    print(f"  trained {step + 1} steps, {time.time() - began:.0f} s", flush=True)
    return splats


@torch.no_grad()
def measure(splats, images: Images, antialiased: bool = False) -> dict:
    """dB and SSIM on images that were not trained on; dB also after one gain a channel."""
    plain, gained, alike = [], [], []
    for k in range(len(images)):
        goal, image = images[k], draw(splats, images, k, 3, antialiased)[0].clamp(0, 1)
        gain = (image * goal).sum((0, 1)) / (image * image).sum((0, 1)).clamp(min=1e-6)
        decibels = lambda x: -10 * math.log10(float(((x - goal) ** 2).mean()))  # noqa: B023, E731
        plain.append(decibels(image))
        gained.append(decibels(image * gain))
        alike.append(float(similarity(image, goal)))
    return {
        "psnr": round(float(np.mean(plain)), 2),
        "psnrWorst": round(min(plain), 2),
        "psnrMedian": round(float(np.median(plain)), 2),
        "psnrAfterGain": round(float(np.mean(gained)), 2),
        "ssim": round(float(np.mean(alike)), 4),
        "lpips": None,
        "images": len(images),
        "each": [round(x, 2) for x in plain],
    }
