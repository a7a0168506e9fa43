"""Trains splats on images of a scene, on the CPU with NumPy alone, and shows them meanwhile.

In a notebook:

```python
scene = start(200)
widget = Splats(*arrays(scene).values(), camera_orbit="30deg 70deg 3m")
display(widget)
train(scene, lambda state: widget.update(**state))
```

The loss is the mean squared error of images of round splats, blended front to back as in gsplat.
Gradients are analytic.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

SIZE, FOCAL, DISTANCE = 24, 28.0, 3.0
#: Value of the constant spherical harmonic: color = 0.5 + SH_C0 * coefficient.
SH_C0 = 0.28209479177387814


def start(count: int, seed: int = 1) -> dict[str, Floats]:
    """Returns parameters of random gray splats: centers, logarithms of radii, logits of opacities, and colors."""
    random = np.random.default_rng(seed)
    return {
        "means": random.uniform(-0.8, 0.8, (count, 3)),
        "radii": np.full(count, np.log(0.12)),
        "logits": np.full(count, -1.0),
        "colors": np.full((count, 3), 0.5),
    }


def ring(count: int = 150) -> dict[str, Floats]:
    """Returns the scene to learn: a colored ring."""
    turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
    means = np.stack([0.6 * np.cos(turn), 0.15 * np.sin(3 * turn), 0.6 * np.sin(turn)], axis=1)
    colors = 0.5 + 0.5 * np.cos(turn[:, None] + np.array([0, 2, 4]))
    return {"means": means, "radii": np.full(count, np.log(0.08)), "logits": np.full(count, 2.0), "colors": colors}


def view(turn: float) -> Floats:
    """Returns the world-to-camera rotation [3, 3] of a camera that orbits the y axis."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def render(scene: dict[str, Floats], camera: Floats) -> tuple[Floats, Callable[[Floats], dict[str, Floats]]]:
    """Returns an image [P, 3], and a function from the gradient of the image to those of the parameters."""
    local = scene["means"] @ camera.T + np.array([0, 0, DISTANCE])
    order = np.argsort(local[:, 2])
    x, y, z = local[order].T
    pixels = np.indices((SIZE, SIZE)).reshape(2, -1).T - (SIZE - 1) / 2
    scale = FOCAL / z
    sigma = scale * np.exp(scene["radii"][order])
    du, dv = pixels[:, 1:] - scale * x, pixels[:, :1] - scale * y
    distance = (du**2 + dv**2) / (2 * sigma**2)
    opacity = 1 / (1 + np.exp(-scene["logits"][order]))
    alpha = np.minimum(0.99, opacity * np.exp(-distance))
    before = np.cumprod(1 - alpha, axis=1) / (1 - alpha)
    weight = alpha * before
    colors = scene["colors"][order]
    image = weight @ colors

    def backward(gradient: Floats) -> dict[str, Floats]:
        shade = gradient @ colors.T
        behind = np.cumsum((weight * shade)[:, ::-1], axis=1)[:, ::-1] - weight * shade
        d_alpha = before * shade - behind / (1 - alpha)
        d_power = d_alpha * alpha
        d_center = np.stack([(d_power * du).sum(0), (d_power * dv).sum(0)]) / sigma**2
        d_radii = (2 * d_power * distance).sum(0)
        d_depth = -(scale * (x * d_center[0] + y * d_center[1]) + d_radii) / z
        d_local = np.stack([scale * d_center[0], scale * d_center[1], d_depth])
        found = {
            "means": d_local.T @ camera,
            "radii": d_radii,
            "logits": d_power.sum(0) * (1 - opacity),
            "colors": weight.T @ gradient,
        }
        for name, value in found.items():
            value_of = np.empty_like(value)
            value_of[order] = value
            found[name] = value_of
        return found

    return image, backward


def arrays(scene: dict[str, Floats]) -> dict[str, Floats]:
    """Returns the arguments of `Splats.update`."""
    count = len(scene["means"])
    return {
        "means": scene["means"],
        "quats": np.tile([1.0, 0, 0, 0], (count, 1)),
        "scales": np.exp(np.repeat(scene["radii"][:, None], 3, axis=1)),
        "opacities": 1 / (1 + np.exp(-scene["logits"])),
        "sh": (scene["colors"][:, None] - 0.5) / SH_C0,
    }


def train(
    scene: dict[str, Floats], show: Callable[[dict[str, Floats]], object], iterations: int = 300, seed: int = 1
) -> float:
    """Optimizes a scene with Adam in place, and shows it after each iteration.

    Returns:
        Mean PSNR of the last eight images, dB.
    """
    random = np.random.default_rng(seed)
    target = ring()
    rates = {"means": 0.01, "radii": 0.02, "logits": 0.05, "colors": 0.02}
    first = {name: np.zeros_like(value) for name, value in scene.items()}
    second = {name: np.zeros_like(value) for name, value in scene.items()}
    errors: list[float] = []
    for step in range(1, iterations + 1):
        camera = view(random.uniform(0, 2 * np.pi))
        image, backward = render(scene, camera)
        difference = image - render(target, camera)[0]
        errors.append(float(np.mean(difference**2)))
        for name, gradient in backward(2 * difference / difference.size).items():
            first[name] = 0.9 * first[name] + 0.1 * gradient
            second[name] = 0.999 * second[name] + 0.001 * gradient**2
            rate = rates[name] * np.sqrt(1 - 0.999**step) / (1 - 0.9**step)
            scene[name] -= rate * first[name] / (np.sqrt(second[name]) + 1e-15)
        show(arrays(scene))
    return float(-10 * np.log10(np.mean(errors[-8:])))
