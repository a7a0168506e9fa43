"""Surfaces for Mitsuba: a texture with its size in meters, matt, glossy, metal, glass or shining."""

import mitsuba as mi
import numpy as np


def texture(image, meters: float = 1.0):
    """A repeated image, or a plain color."""
    if not isinstance(image, np.ndarray):
        return {"type": "rgb", "value": list(image)}
    scale = mi.ScalarTransform3f().scale([1 / meters, 1 / meters]) if hasattr(mi, "ScalarTransform3f") else None
    return {"type": "bitmap", "bitmap": mi.Bitmap(image.astype(np.float32)), "raw": True, "to_uv": scale}


def matt(image, meters: float = 1.0) -> dict:
    """Diffuse on both sides."""
    return {"bsdf": {"type": "twosided", "b": {"type": "diffuse", "reflectance": texture(image, meters)}}}


def glossy(image, meters: float = 1.0, roughness: float = 0.25, specular: float = 0.5, coat: float = 0.0) -> dict:
    """Paint, varnish, glazed tile, plastic."""
    surface = {
        "type": "principled",
        "base_color": texture(image, meters),
        "roughness": roughness,
        "specular": specular,
    }
    if coat:
        surface |= {"clearcoat": coat, "clearcoat_gloss": 0.9}
    return {"bsdf": {"type": "twosided", "b": surface}}


def metal(color, roughness: float = 0.2) -> dict:
    """Brushed metal."""
    return {
        "bsdf": {
            "type": "twosided",
            "b": {"type": "principled", "base_color": texture(color), "metallic": 1.0, "roughness": roughness},
        }
    }


def leaf(image) -> dict:
    """A leaf, seen from both sides."""
    return {
        "bsdf": {
            "type": "twosided",
            "b": {"type": "principled", "base_color": texture(image), "roughness": 0.5, "specular": 0.3},
        }
    }


def glass() -> dict:
    """Clear glass of closed bodies."""
    return {"bsdf": {"type": "dielectric", "int_ior": 1.5}}


def shining(color) -> dict:
    """A lamp: radiance in the units of the scene."""
    return {
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.6, 0.6]}},
        "emits": {"type": "area", "radiance": texture(color)},
    }


def y_up():
    """Turns the sky's own frame, z up, into that of stages."""
    return mi.ScalarTransform4f().rotate([1, 0, 0], -90)
