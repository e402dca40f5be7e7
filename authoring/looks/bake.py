"""Bake surfaces and looks into texture files: sheets, the shared fine detail, and the macro texture of a bridge."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from authoring.component import Component, Scatter
from authoring.looks.material import MaterialRecipe
from authoring.looks.noise import Floats, Tile, fractal, snap
from authoring.looks.recipes import DETAIL_PERIODS, RECIPES
from authoring.looks.roles import AGES, LOOKS
from authoring.looks.weathering import ground_patches, weather
from groundwork.errors import InputError
from groundwork.files import write_bytes
from groundwork.settings import Settings

U8 = NDArray[np.uint8]

_DETAIL_PIXELS = 512
_DETAIL_SEED = 20_531  # one detail for all surfaces, so that its file is the same wherever it lies
_CODES = 1 << 14  # steps of linear light in the table that codes sRGB


class LookSettings(Settings):
    """What a look is baked from."""

    name: str = Field(default="weathered", description="Look of the bridge: weathered or clean")
    texels: int = Field(default=1024, ge=256, le=4096, description="Texels along a side of a sheet of 4 to 6 m [px]")


def bake_look(
    settings: LookSettings,
    name: str,
    folder: Path,
    components: Iterable[Component | Scatter],
    rng: np.random.Generator,
) -> dict[str, MaterialRecipe]:
    """Bake one look for the roles that a bridge uses.

    Args:
        settings: Texture size.
        name: Name of the look.
        folder: Folder of the look's layer; receives `textures/`.
        components: Parts of the bridge; their charts on `st1` are weathered.
        rng: Random stream of the look.

    Returns:
        One recipe for each role in use, in the order of `usd_schemas.tokens.ROLES`.

    Raises:
        InputError: There is no such look.
    """
    if name not in LOOKS:
        raise InputError("unknown look", field="look.name", value=name, allowed=", ".join(LOOKS))
    seed = int(rng.integers(1 << 62))
    used = set(_roles(components))
    baked: dict[str, MaterialRecipe] = {}
    for surface in dict.fromkeys(s for role, s in LOOKS[name].items() if role in used):
        word = int.from_bytes(surface.encode(), "little")
        baked[surface] = bake_surface(surface, folder, np.random.default_rng([seed, word]), settings.texels)
    macro = _bake_macro(settings, name, folder, components, np.random.default_rng([seed, 0]))
    return {role: replace(baked[s], macro_file=macro) for role, s in LOOKS[name].items() if role in used}


def bake_surface(
    name: str, folder: Path, rng: np.random.Generator, texels: int = 1024, prefix: str = ""
) -> MaterialRecipe:
    """Bake one surface.

    Args:
        name: A row of `authoring.looks.recipes.RECIPES`.
        folder: Folder of the layer that will use it; receives `textures/`.
        rng: Random stream of the surface.
        texels: Texels along a side [px].
        prefix: Put before the names of its files: a DCC gathers those of all assets in one folder.

    Raises:
        InputError: There is no such surface.
    """
    if name not in RECIPES:
        raise InputError("unknown surface", field="role", value=name, allowed=", ".join(RECIPES))
    recipe = RECIPES[name]
    sheet = recipe.draw(Tile(recipe.finer * texels, recipe.metres, rng))
    normals = encode_normals(sheet.height, recipe.metres) if recipe.relief and sheet.height is not None else None
    patches = ground_patches(texels // 2, rng) if recipe.patchy else None
    red, green, blue = (round(float(np.mean(sheet.albedo[..., k], dtype=np.float64)), 4) for k in range(3))
    return MaterialRecipe(
        name=name,
        albedo_file=_write(folder, f"{prefix}{name}_albedo", encode_srgb(sheet.albedo)),
        color=(red, green, blue),
        roughness_file=_write(folder, f"{prefix}{name}_roughness", encode_raw(_halved(sheet.roughness))),
        roughness=round(float(np.mean(sheet.roughness, dtype=np.float64)), 3),
        normal_file="" if normals is None else _write(folder, f"{prefix}{name}_normal", normals),
        sheet=recipe.metres,
        detail_file=_write(folder, f"{prefix}detail", detail_texture()),
        periods=DETAIL_PERIODS,
        amplitudes=recipe.detail,
        macro_file="" if patches is None else _write(folder, f"{prefix}{name}_macro", encode_raw(patches / 2)),
    )


def _bake_macro(
    settings: LookSettings,
    name: str,
    folder: Path,
    components: Iterable[Component | Scatter],
    rng: np.random.Generator,
) -> str:
    charted = [item for item in components if isinstance(item, Component) and len(item.mesh.st1)]
    if not charted:
        return ""
    age = AGES[name]
    # What is nearly even needs no finer texture than its tones.
    pixels = 2 * settings.texels if age > 0.5 else settings.texels
    return _write(folder, "macro", encode_raw(weather(charted, pixels, age, rng) / 2))


def _write(folder: Path, name: str, image: U8) -> str:
    textures = folder / "textures"
    textures.mkdir(parents=True, exist_ok=True)
    write_bytes(textures / f"{name}.png", png(image))
    return f"./textures/{name}.png"


def _halved(field: Floats) -> Floats:
    return (field[::2, ::2] + field[1::2, ::2] + field[::2, 1::2] + field[1::2, 1::2]) * np.float32(0.25)


def detail_texture() -> U8:
    """Draw the tileable grey detail: noise in every octave, mean 0.5, so that 2 g - 1 has mean 0.

    Returns:
        Grey values, shape (512, 512), uint8.
    """
    tile = Tile(_DETAIL_PIXELS, 1.0, np.random.default_rng(_DETAIL_SEED))
    field = np.clip(fractal(tile, 0.5, slope=0.75), -2.6, 2.6)
    return encode_raw(0.5 + field * np.float32(0.36 / 2))


def encode_srgb(albedo: Floats) -> U8:
    """Code linear colours as sRGB.

    Args:
        albedo: Linear values [1], any shape, float32.

    Returns:
        The same shape, uint8.
    """
    light = np.arange(_CODES, dtype=np.float64) / (_CODES - 1)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    table = np.round(snap(curve) * np.float32(255)).astype(np.uint8)
    return table[np.clip(albedo * np.float32(_CODES - 1) + np.float32(0.5), 0, _CODES - 1).astype(np.int32)]


def encode_raw(values: Floats) -> U8:
    """Code numbers from 0 to 1 in 8 bits.

    Args:
        values: Numbers [1], any shape, float32.

    Returns:
        The same shape, uint8.
    """
    return np.clip(values * np.float32(255) + np.float32(0.5), 0, 255).astype(np.uint8)


def encode_normals(height: Floats, metres: float) -> U8:
    """Turn relief into tangent-space normals at half the resolution: red along u, green along v (up the image).

    Args:
        height: Relief [m], shape (H, W), float32.
        metres: Length of the sheet's sides [m].

    Returns:
        (n + 1) / 2, shape (H / 2, W / 2, 3), uint8.
    """
    half = _halved(height)
    run = np.float32(2 * metres / len(half))
    along = (np.roll(half, 1, 1) - np.roll(half, -1, 1)) / run
    up = (np.roll(half, -1, 0) - np.roll(half, 1, 0)) / run
    length = np.sqrt(along * along + up * up + 1)
    return encode_raw(np.stack([along / length, up / length, 1 / length], axis=-1) * np.float32(0.5) + np.float32(0.5))


def png(image: U8) -> bytes:
    """Compress an image as PNG with fixed parameters.

    Args:
        image: Grey or RGB values, shape (H, W) or (H, W, 3), uint8.
    """
    import cv2

    picture = image if image.ndim == 2 else np.ascontiguousarray(image[..., ::-1])
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
    _, data = cv2.imencode(".png", picture, options)
    return data.tobytes()


def _roles(components: Iterable[Component | Scatter]) -> Iterable[str]:
    for item in components:
        if isinstance(item, Component):
            yield item.role
        else:
            yield from (role for pieces in item.prototypes for role, _ in pieces)
