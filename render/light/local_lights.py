"""The local lights of a scene, at most `MOST`. They cast no shadows, and have no indirect light."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import FlatScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST = 8  # each is computed at every pixel


@dataclass(frozen=True)
class LocalLights:
    """Spherical and flat lamps.

    Attributes:
        positions: Centers in the world [m], shape (N, 3), float64.
        radii: Radii [m], shape (N,), float64.
        intensities: Linear radiant intensities [m2], shape (N, 3), float64.
        sides: From the center of each panel to two of its edges [m], shape (N, 2, 3), float64; zeros for a sphere.
    """

    positions: F64
    radii: F64
    intensities: F64
    sides: F64

    def features(self) -> tuple[str, ...]:
        """List the features of the surface shader: none if there is no lamp."""
        panels = ("LOCAL_PANELS",) if self.sides.any() else ()
        return (f"LOCAL_LIGHTS {len(self.radii)}", *panels) if len(self.radii) else ()

    def uniforms(self, anchor: F64) -> dict[str, object]:
        """List the uniforms of the surface shader.

        Args:
            anchor: Origin of positions in the shading [m], shape (3,), float64.
        """
        if not len(self.radii):
            return {}
        places: F32 = np.column_stack([self.positions - anchor, self.radii]).astype(np.float32)
        return {
            "local_places": places.tobytes(),
            "local_intensities": self.intensities.astype(np.float32).tobytes(),
            "local_sides": self.sides.astype(np.float32).tobytes(),
        }


def choose_local_lights(scene: FlatScene, box: tuple[F64, F64]) -> tuple[LocalLights, list[str]]:
    """Choose the lamps that contribute the most light to the region of interest.

    Args:
        scene: A scene.
        box: Lower and upper corner of the region of interest [m], each of shape (3,), float64.

    Returns:
        At most `MOST` of them in the order of the stage, and a line if some are left out.
    """
    lights = scene.sphere_lights
    positions = np.array([light.position for light in lights], np.float64).reshape(-1, 3)
    intensities = np.array([light.intensity for light in lights], np.float64).reshape(-1, 3)
    away = np.linalg.norm(positions - (box[0] + box[1]) / 2, axis=1)
    reach = np.linalg.norm(box[1] - box[0]) / 2
    strength = intensities.sum(axis=1) / (away**2 + reach**2)
    kept = np.sort(np.argsort(-strength, kind="stable")[:MOST])
    left = len(lights) - len(kept)
    kinds = "lamps" if any(light.sides for light in lights) else "SphereLights"
    said = [f"{left} of {len(lights)} {kinds} are left out: only the {MOST} brightest are drawn"] if left else []
    radii = np.array([light.radius for light in lights])
    sides = np.array([light.sides or np.zeros((2, 3)) for light in lights], np.float64).reshape(-1, 2, 3)
    return LocalLights(positions[kept], radii[kept], intensities[kept], sides[kept]), said
