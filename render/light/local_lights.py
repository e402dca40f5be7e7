"""The SphereLights that shade a scene, at most `MOST`. They throw no shadow, and nothing bounces their light."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import FlatScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST = 8  # each is computed at every pixel


@dataclass(frozen=True)
class LocalLights:
    """Balls of light.

    Attributes:
        positions: Centres in the world [m], shape (N, 3), float64.
        radii: Radii [m], shape (N,), float64.
        intensities: Linear radiant intensities [m2], shape (N, 3), float64.
    """

    positions: F64
    radii: F64
    intensities: F64

    def features(self) -> tuple[str, ...]:
        """Name what the surface shader must be compiled with: nothing where there is no light."""
        return (f"LOCAL_LIGHTS {len(self.radii)}",) if len(self.radii) else ()

    def uniforms(self, anchor: F64) -> dict[str, object]:
        """List what the surface shader reads.

        Args:
            anchor: Point that shading counts positions from [m], shape (3,), float64.
        """
        if not len(self.radii):
            return {}
        places: F32 = np.column_stack([self.positions - anchor, self.radii]).astype(np.float32)
        return {"local_places": places.tobytes(), "local_intensities": self.intensities.astype(np.float32).tobytes()}


def choose_local_lights(scene: FlatScene, box: tuple[F64, F64]) -> tuple[LocalLights, list[str]]:
    """Take the SphereLights that give most light to what matters in a scene.

    Args:
        scene: A scene.
        box: Lower and upper corner of the region of interest [m], each of shape (3,), float64.

    Returns:
        At most `MOST` of them in the order of the stage, and a line where some are left out.
    """
    lights = scene.sphere_lights
    positions = np.array([light.position for light in lights], np.float64).reshape(-1, 3)
    intensities = np.array([light.intensity for light in lights], np.float64).reshape(-1, 3)
    away = np.linalg.norm(positions - (box[0] + box[1]) / 2, axis=1)
    reach = np.linalg.norm(box[1] - box[0]) / 2
    strength = intensities.sum(axis=1) / (away**2 + reach**2)
    kept = np.sort(np.argsort(-strength, kind="stable")[:MOST])
    left = len(lights) - len(kept)
    said = [f"{left} of {len(lights)} SphereLights are left out: the {MOST} that give most light shine"] if left else []
    return LocalLights(positions[kept], np.array([light.radius for light in lights])[kept], intensities[kept]), said
