"""Scaling of very bright or dark stages to the range of 16-bit codes.

UsdLux has no fixed unit of brightness, and the exposure is metered anyway. Factors are powers of two, which cause no
rounding.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from render.light.daylight import Daylight
from usd_schemas.flat_scene import FlatScene, Material

F64 = NDArray[np.float64]
Triple = tuple[float, float, float]

_DARKEST, _BRIGHTEST = 1 / 64, 8.0  # range of the radiance of a white surface that is drawn without scaling [1]
_NEAR = 2.0  # [m] surfaces closer to a lamp may be overexposed


def exposure_stops(scene: FlatScene, daylight: Daylight, box: tuple[F64, F64]) -> int:
    """Compute how many times to halve the light of a scene; negative: to double it. Ordinary daylight gives 0.

    Args:
        scene: A scene.
        daylight: Its sun and sky.
        box: Lower and upper corner of the region of interest [m], each of shape (3,), float64.
    """
    middle, reach = (box[0] + box[1]) / 2, float(np.linalg.norm(box[1] - box[0])) / 2
    common = daylight.sun_irradiance + np.maximum(daylight.open_sky[0], 0.0)
    most = common.max()
    for light in scene.sphere_lights:
        away, intensity = np.array(light.position) - middle, np.array(light.intensity)
        common = common + intensity / (away @ away + reach**2)
        most = max(most, intensity.max() / max(light.radius, _NEAR) ** 2)
    usual, brightest = float(common.max() / np.pi), float(most / np.pi)  # radiance of a white surface there [1]
    if usual > _BRIGHTEST:
        return round(float(np.log2(usual)))
    return round(float(np.log2(brightest))) if 0.0 < brightest < _DARKEST else 0


def dimmed(scene: FlatScene, times: int) -> FlatScene:
    """Halve the intensity of all lights and emission.

    Args:
        scene: A scene.
        times: How many times; if negative, it is doubled.
    """
    share = 2.0**-times

    def scaled(color: Triple) -> Triple:
        return color[0] * share, color[1] * share, color[2] * share

    def surface(material: Material) -> Material:
        glow = material.emissive_texture
        glow = glow and replace(glow, gain=scaled(glow.gain), bias=scaled(glow.bias))
        return replace(material, emissive=scaled(material.emissive), emissive_texture=glow)

    return replace(
        scene,
        sun=scene.sun and replace(scene.sun, radiance=scaled(scene.sun.radiance)),
        dome=scene.dome and replace(scene.dome, radiance=scaled(scene.dome.radiance)),
        sphere_lights=tuple(replace(light, intensity=scaled(light.intensity)) for light in scene.sphere_lights),
        materials=tuple(map(surface, scene.materials)),
    )
