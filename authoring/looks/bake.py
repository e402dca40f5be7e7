"""Bake surfaces and looks into texture files: sheets, the shared fine detail, and the macro texture of a bridge."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from pydantic import Field

from authoring.looks.encode import U8, encode_raw, png
from authoring.looks.library import SheetFiles, SheetName, bake_sheets, copy_detail, copy_sheet
from authoring.looks.material import MaterialRecipe
from authoring.looks.noise import Floats
from authoring.looks.recipe import DETAIL_PERIODS, NO_SHINE, SMOOTH
from authoring.looks.recipes import RECIPES
from authoring.looks.roles import LOOKS, fill_roles, sheet_numbers
from authoring.looks.user_maps import MapSet
from authoring.looks.user_sets import place_set, read_sets
from authoring.looks.weathering import ground_patches, weather
from authoring.shapes.component import Component, Scatter
from groundwork.errors import InputError
from groundwork.files import write_bytes
from groundwork.settings import Settings
from usd_schemas.reading.shader_inputs import GLASS
from usd_schemas.tokens import ROLES

NO_FOLDERS: Mapping[str, Path] = MappingProxyType({})

_PATCHES_SEED = 20_532
_FEW_YEARS = 0.5  # weathering below which a coarse macro texture is enough


class LookSettings(Settings):
    """What a look is baked from."""

    name: str = Field(
        default="weathered",
        description="Look of the bridge: clean, weathered, aged, or random. random draws surface and age of each role "
        "from all that suit it",
    )
    texels: int = Field(
        default=2048, ge=256, le=4096, description="Side of a texture of the bridge, which covers 8.2 m [px]"
    )
    folders: tuple[str, ...] = Field(
        default=(),
        description="Folders or zips of your own surfaces, relative to the scenario: family/name/{albedo|color|"
        "diffuse, roughness, height, metallic}, or sets of ambientCG and Poly Haven. A role gets one of the "
        "surfaces of a family that suits it, drawn from the seed",
    )
    picture_side: float = Field(
        default=2.0,
        ge=0.1,
        le=100.0,
        description="Length on the bridge that the side of a picture in `folders` covers [m]",
    )


def bake_look(
    settings: LookSettings,
    name: str,
    folder: Path,
    components: Iterable[Component | Scatter],
    rng: np.random.Generator,
    *,
    given: Mapping[str, Path] = NO_FOLDERS,
    library: Path | None = None,
    waterline: float | None = None,
) -> dict[str, MaterialRecipe]:
    """Bake one look for the roles that a bridge uses.

    Args:
        settings: Texture size.
        name: Name of the look.
        folder: Folder of the look's layer; receives `textures/`.
        components: Parts of the bridge; their charts on `st1` are weathered.
        rng: Random stream of the look.
        given: Users' folders of surfaces by their names in the settings.
        library: Folder of the library of sheets; the user's cache folder when not given.
        waterline: Height of the river around piers [m]; None where none stands in it.

    Returns:
        One recipe for each role in use, in the order of `usd_schemas.tokens.ROLES`.

    Raises:
        InputError: There is no such look, or a user's surface cannot be read.
    """
    if name not in LOOKS:
        raise InputError("unknown look", field="look.name", value=name, allowed=", ".join(LOOKS))
    pieces = tuple(components)
    surfaces, years = fill_roles(name, rng)
    worn = worn_sheets(pieces)
    sets_of_role = read_sets(given[n] for n in settings.folders if n in given)
    chosen = {role: sets[int(rng.integers(len(sets)))] for role, sets in sets_of_role.items() if role in worn}
    wanted = {
        (role, number): SheetName(surface, number, settings.texels)
        for role, surface in surfaces.items()
        for number in sorted(worn.get(role, ()))
        if role not in chosen
    }
    kept = bake_sheets(wanted.values(), library)
    linked = {
        name: copy_sheet(place, folder / "textures", f"{name.surface}_{name.number + 1}")
        for name, place in kept.items()
    }
    macro = _bake_macro(settings, years, folder, pieces, rng, waterline)
    detail = copy_detail(folder / "textures", "detail", library, "grain")
    recipes = {
        role: _recipe(surface, detail, macro, {n: linked[wanted[role, n]] for n in sorted(worn[role])})
        for role, surface in surfaces.items()
        if role in worn and role not in chosen
    }
    for role, pictures in chosen.items():
        recipes[role] = _picture_recipe(pictures, settings, folder, detail, macro)
    return {role: recipes[role] for role in ROLES if role in recipes}


def bake_surface(
    sheet: SheetName, folder: Path, *, prefix: str = "", library: Path | None = None, patches: int = 0
) -> MaterialRecipe:
    """Bake one surface of a site or background.

    Args:
        sheet: Surface and number of the sheet.
        folder: Folder of the layer that will use it; receives `textures/`.
        prefix: Put before the names of its files: other programs collect those of all assets in one folder.
        library: Folder of the library of sheets; the user's cache folder when not given.
        patches: Number of the patches on open ground: the same for a site and its background.

    Raises:
        InputError: There is no such surface.
    """
    name = sheet.surface
    files = copy_sheet(bake_sheets([sheet], library)[sheet], folder / "textures", f"{prefix}{name}")
    macro = ""
    if RECIPES[name].patchy:
        file = folder / "textures" / f"{prefix}patches.png"
        if not file.exists():
            write_texture(folder, f"{prefix}patches", encode_raw(open_ground(sheet.texels, patches) / 2))
        macro = f"./textures/{file.name}"
    recipe = RECIPES[name]
    detail = (
        "" if recipe.cut_out else copy_detail(folder / "textures", f"{prefix}{recipe.picture}", library, recipe.picture)
    )
    return _recipe(name, detail, macro, {0: files})


def open_ground(texels: int, patches: int) -> Floats:
    """Draw the patches on open ground.

    Args:
        texels: Texels along a side of a bridge's sheets [px].
        patches: Their number.

    Returns:
        Factors with mean 1 [1], shape (texels / 4, texels / 4, 3), float32.
    """
    return ground_patches(texels // 4, np.random.default_rng([_PATCHES_SEED, patches]))


def _recipe(surface: str, detail: str, macro: str, sheets: dict[int, SheetFiles]) -> MaterialRecipe:
    recipe = RECIPES[surface]
    first = sheets[0]
    return MaterialRecipe(
        name=surface,
        albedo_file=first.albedo,
        color=first.color,
        roughness_file=first.roughness,
        roughness=first.mean_roughness,
        normal_file=first.normal,
        sheet=recipe.meters,
        detail_file=detail,
        periods=DETAIL_PERIODS if detail else (),
        amplitudes=recipe.detail if detail else (),
        macro_file=macro,
        cut_out=recipe.cut_out,
        ior=NO_SHINE if recipe.matt else GLASS,
        others={number: files for number, files in sheets.items() if number},
    )


def _picture_recipe(pictures: MapSet, settings: LookSettings, folder: Path, detail: str, macro: str) -> MaterialRecipe:
    """Write a user's own surface beside the layer."""
    files, metallic = place_set(pictures, folder, settings.picture_side, settings.texels)
    return MaterialRecipe(
        name=pictures.name,
        albedo_file=files.albedo,
        color=files.color,
        roughness_file=files.roughness,
        roughness=files.mean_roughness,
        normal_file=files.normal,
        metallic=metallic,
        sheet=settings.picture_side,
        detail_file=detail,
        periods=DETAIL_PERIODS,
        amplitudes=SMOOTH,
        macro_file=macro,
    )


def worn_sheets(pieces: tuple[Component | Scatter, ...]) -> dict[str, set[int]]:
    """List the sheets that the parts of a bridge use.

    Args:
        pieces: Parts of a bridge.

    Returns:
        Numbers of the sheets of each role in use; always including 0.
    """
    numbers = sheet_numbers(pieces)
    worn: dict[str, set[int]] = {}
    for piece in pieces:
        if isinstance(piece, Component):
            worn.setdefault(piece.role, {0}).add(numbers[piece.instance_id])
        else:
            for role in (role for prototype in piece.prototypes for role, _ in prototype):
                worn.setdefault(role, {0})
    return worn


def _bake_macro(
    settings: LookSettings,
    years: float,
    folder: Path,
    pieces: tuple[Component | Scatter, ...],
    rng: np.random.Generator,
    waterline: float | None,
) -> str:
    if not any(isinstance(piece, Component) and len(piece.mesh.st1) for piece in pieces):
        return ""
    pixels = settings.texels if years > _FEW_YEARS else settings.texels // 2
    return write_texture(folder, "macro", encode_raw(weather(pieces, pixels, years, rng, waterline) / 2))


def write_texture(folder: Path, name: str, image: U8) -> str:
    """Write a texture that only this layer uses.

    Args:
        folder: Folder of the layer; receives `textures/`.
        name: Name of the file without its suffix.
        image: Gray or RGB values, shape (H, W) or (H, W, 3), uint8.

    Returns:
        The file, as the layer refers to it.
    """
    textures = folder / "textures"
    textures.mkdir(parents=True, exist_ok=True)
    write_bytes(textures / f"{name}.png", png(image))
    return f"./textures/{name}.png"
