"""One baked surface in numbers, and the few color operations that recipes are made of."""

from dataclasses import dataclass

import numpy as np

from authoring.looks.noise import Floats

Color = tuple[float, float, float]

_STEPS = 1024  # of a palette, far finer than 8 bits show


@dataclass(frozen=True)
class Sheet:
    """One tileable surface.

    Attributes:
        albedo: Linear base color [1], shape (H, W, 3), float32.
        roughness: Roughness [1], shape (H, W), float32.
        height: Relief [m], shape (H, W), float32, or None where it is too flat to matter.
        opacity: Opacity [1], shape (H, W), float32, of what is cut out; None for what is whole.
    """

    albedo: Floats
    roughness: Floats
    height: Floats | None = None
    opacity: Floats | None = None


def paint(color: Color, tone: Floats) -> Floats:
    """Color a gray field.

    Args:
        color: Linear color [1].
        tone: Factor of it [1], shape (H, W), float32; negative values count as 0.

    Returns:
        Linear color [1], shape (H, W, 3), float32.
    """
    return np.maximum(tone, 0)[..., None] * np.asarray(color, np.float32)


def cover(below: Floats, mask: Floats, above: Color | Floats) -> Floats:
    """Lay a color over another.

    Args:
        below: Linear color [1], shape (H, W, 3), float32.
        mask: Opacity of what lies above [1], shape (H, W), float32.
        above: Linear color [1], one for all or shape (H, W, 3), float32.

    Returns:
        Linear color [1], shape (H, W, 3), float32.
    """
    return below + mask[..., None] * (np.asarray(above, np.float32) - below)


def palette(tone: Floats, colors: tuple[Color, ...]) -> Floats:
    """Map a field from 0 to 1 onto a line of colors at even steps.

    Args:
        tone: Place on the line [1], shape (H, W), float32; clipped to 0 and 1.
        colors: At least two linear colors [1].

    Returns:
        Linear color [1], shape (H, W, 3), float32.
    """
    stops = np.asarray(colors, np.float32)
    place = np.arange(_STEPS, dtype=np.float32) * np.float32((len(colors) - 1) / (_STEPS - 1))
    index = np.minimum(place.astype(np.int32), len(colors) - 2)
    part = (place - index)[:, None]
    table = stops[index] * (1 - part) + stops[index + 1] * part
    return np.take(table, (np.clip(tone, 0, 1) * np.float32(_STEPS - 1)).astype(np.int32), axis=0)


def soften(albedo: Floats, contrast: float) -> Floats:
    """Bring the darks and lights of a picture closer to its mean, which stays.

    Args:
        albedo: Linear color [1], shape (H, W, 3), float32.
        contrast: Exponent of each channel over its mean [1]; 1 changes nothing.

    Returns:
        Linear color [1], shape (H, W, 3), float32.
    """
    if contrast == 1:
        return albedo
    mean = np.mean(albedo, axis=(0, 1), dtype=np.float64).astype(np.float32)
    closer = np.power(np.maximum(albedo, 0) / mean, np.float32(contrast))
    return closer * (mean / np.mean(closer, axis=(0, 1), dtype=np.float64).astype(np.float32))
