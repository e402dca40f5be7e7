"""The library of sheets: each surface is baked a few times, once for all scenes, and copied into those that use it."""

import fcntl
import os
import shutil
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from authoring.looks.detail import detail_texture
from authoring.looks.encode import U8, encode_normals, encode_raw, encode_srgb, halved, jpeg, png
from authoring.looks.grain import grain_texture
from authoring.looks.noise import Bank, Tile
from authoring.looks.recipe import FULL
from authoring.looks.recipes import RECIPES
from authoring.looks.scenery import SEASONAL
from authoring.looks.seasons import SUMMER, Season
from authoring.looks.sheet import soften
from groundwork import user_cache
from groundwork.canonical import digest, file_digest
from groundwork.errors import InputError
from groundwork.files import read_json, sweep_folders, whole_folder, write_bytes, write_json
from groundwork.locks import hold_lock
from groundwork.user_cache import CACHE_VARIABLE

SHEETS = 3  # independent sheets of each surface
_FACTS = "sheet.json"
_DETAILS: dict[str, Callable[[], U8]] = {"detail": detail_texture, "grain": grain_texture}
_CLONE = 0x40049409  # FICLONE of linux/fs.h
_SOURCES = (
    "coated",
    "detail",
    "encode",
    "grain",
    "leaves",
    "library",
    "mineral",
    "noise",
    "organic",
    "recipe",
    "scenery",
    "seasons",
    "sheet",
    "structural",
    "urban",
    "walls",
)


@dataclass(frozen=True, order=True)
class SheetName:
    """One sheet of one surface.

    Attributes:
        surface: A row of `authoring.looks.recipes.RECIPES`.
        number: 0 to `SHEETS` - 1.
        texels: Texels along a side of a sheet of a bridge, as the settings say [px].
        season: Its season; other than summer only for surfaces of `authoring.looks.scenery.SEASONAL`.
    """

    surface: str
    number: int
    texels: int
    season: Season = SUMMER

    @property
    def pixels(self) -> int:
        """Texels along a side of this sheet [px]."""
        return max(16, RECIPES[self.surface].pixels * self.texels // FULL)

    @property
    def key(self) -> str:
        """Hash of all that its bytes depend on."""
        return digest([self.surface, self.number, self.pixels, self.season, _recipes_digest()])


@dataclass(frozen=True)
class SheetFiles:
    """A sheet that lies beside a layer; files are given as that layer names them.

    Attributes:
        albedo: Base color, sRGB.
        roughness: Roughness, gray.
        normal: Tangent-space normals; empty for none.
        color: Mean linear color [1].
        mean_roughness: Mean roughness [1].
    """

    albedo: str
    roughness: str
    normal: str
    color: tuple[float, float, float]
    mean_roughness: float


def cache_folder() -> Path:
    """Tell where sheets are kept for all scenes of a user: `$FALSEWORK_CACHE`, else the user's cache folder."""
    own = os.environ.get(CACHE_VARIABLE)
    return Path(own) if own else user_cache.cache_folder("sheets")


def bake_sheets(names: Iterable[SheetName], folder: Path | None = None) -> dict[SheetName, Path]:
    """Make sure that sheets are in the library, two at a time.

    Args:
        names: Sheets.
        folder: The library; that of the user when not given.

    Returns:
        Folder of each sheet, whose files are never to be written to.

    Raises:
        InputError: There is no such surface.
    """
    wanted = sorted(set(names))
    for name in wanted:
        if name.surface not in RECIPES:
            raise InputError("unknown surface", field="role", value=name.surface, allowed=", ".join(RECIPES))
    root = cache_folder() if folder is None else folder
    bank = Bank()
    with ThreadPoolExecutor(2) as pool:
        places = pool.map(lambda name: _ensure(root, name.key, lambda: draw_sheet(name, bank)), wanted)
        return dict(zip(wanted, places, strict=True))


def copy_sheet(sheet: Path, textures: Path, stem: str) -> SheetFiles:
    """Put copies of a sheet's files beside a layer: whoever paints there changes no other scene.

    Args:
        sheet: Its folder in the library.
        textures: The folder `textures` beside the layer.
        stem: What the names of its files begin with.
    """
    textures.mkdir(parents=True, exist_ok=True)
    facts = read_json(sheet / _FACTS)
    for file in sorted(facts["files"]):
        _copy(sheet / file, textures / f"{stem}_{file}")
    names = {Path(file).stem: f"./{textures.name}/{stem}_{file}" for file in facts["files"]}
    red, green, blue = facts["color"]
    return SheetFiles(
        names["albedo"], names["roughness"], names.get("normal", ""), (red, green, blue), facts["mean_roughness"]
    )


def draw_sheet(name: SheetName, bank: Bank | None) -> tuple[dict[str, bytes], dict[str, object]]:
    """Draw one sheet.

    Args:
        name: Which.
        bank: Fields shared with other sheets.

    Returns:
        Bytes of each of its files, and its means.
    """
    recipe = RECIPES[name.surface]
    rng = np.random.default_rng([int.from_bytes(name.surface.encode(), "little"), name.number])
    tile = Tile(name.pixels, recipe.meters, rng, bank)
    sheet = recipe.draw(tile) if name.season == SUMMER else SEASONAL[name.surface](tile, name.season)
    albedo = soften(sheet.albedo, recipe.contrast)
    color, name_of = encode_srgb(albedo), "albedo.jpg"
    if sheet.opacity is not None:
        color, name_of = np.dstack([color, encode_raw(sheet.opacity)]), "albedo.png"
    files = {
        name_of: jpeg(color) if sheet.opacity is None else png(color),
        "roughness.png": png(encode_raw(halved(sheet.roughness))),
    }
    if recipe.relief and sheet.height is not None:
        files["normal.png"] = png(encode_normals(sheet.height, recipe.meters))
    means = [round(float(np.mean(albedo[..., k], dtype=np.float64)), 4) for k in range(3)]
    roughness = round(float(np.mean(sheet.roughness, dtype=np.float64)), 3)
    return files, {**asdict(name), "color": means, "mean_roughness": roughness}


def copy_detail(textures: Path, stem: str, folder: Path | None = None, picture: str = "detail") -> str:
    """Put a copy of the fine detail beside a layer.

    Args:
        textures: The folder `textures` beside the layer.
        stem: Name of its file there, without the suffix.
        folder: The library; that of the user when not given.
        picture: Which fine detail: `detail` or `grain`.

    Returns:
        The file, as the layer names it.
    """
    root = cache_folder() if folder is None else folder
    key, draw = digest([picture, _recipes_digest()]), _DETAILS[picture]
    place = _ensure(root, key, lambda: ({"detail.png": png(draw())}, {}))
    textures.mkdir(parents=True, exist_ok=True)
    _copy(place / "detail.png", textures / f"{stem}.png")
    return f"./{textures.name}/{stem}.png"


def _ensure(root: Path, key: str, make: Callable[[], tuple[dict[str, bytes], dict[str, object]]]) -> Path:
    place = root / key
    if _whole(place):
        return place
    try:
        root.mkdir(parents=True, exist_ok=True)
        if not os.access(root, os.W_OK):
            raise PermissionError(root)
    except OSError as error:
        raise InputError(
            "the texture cache cannot be written here", where=root, hint=f"Set {CACHE_VARIABLE} to a writable folder"
        ) from error
    with hold_lock(root / f"{key}.lock") as held:  # who came first bakes; nobody removes what another one reads
        if held:
            sweep_folders(root, key)
        if not _whole(place):
            _bake(place, make)
    return place


def _bake(place: Path, make: Callable[[], tuple[dict[str, bytes], dict[str, object]]]) -> None:
    files, facts = make()
    with whole_folder(place) as fresh:  # in place of one that somebody painted over
        for file, data in files.items():
            write_bytes(fresh / file, data)
            (fresh / file).chmod(0o444)  # every scene copies it
        digests = {file: file_digest(fresh / file) for file in sorted(files)}
        write_json(fresh / _FACTS, {**facts, "files": digests})


def _whole(place: Path) -> bool:
    """Somebody may have painted over a file in place: then it is baked anew."""
    if not (place / _FACTS).is_file():
        return False
    try:
        files = {str(name): str(said) for name, said in read_json(place / _FACTS)["files"].items()}
    except (InputError, KeyError, TypeError, AttributeError):
        return False
    return all((place / file).is_file() and file_digest(place / file) == files[file] for file in files)


def _copy(source: Path, target: Path) -> None:
    """Copy a file; on a file system that can, the two share their blocks until one is written to."""
    target.unlink(missing_ok=True)
    with source.open("rb") as old, target.open("wb") as new:  # inside an atomic folder
        try:
            fcntl.ioctl(new.fileno(), _CLONE, old.fileno())
        except OSError:
            shutil.copyfileobj(old, new)


@cache
def _recipes_digest() -> str:
    """Hash of the recipes themselves and of what computes and codes their pictures."""
    sources = [Path(__file__).with_name(f"{name}.py") for name in _SOURCES]
    libraries = {name: version(name) for name in ("numpy", "scipy", "opencv-python-headless")}
    return digest([{file.name: file_digest(file) for file in sources}, libraries])
