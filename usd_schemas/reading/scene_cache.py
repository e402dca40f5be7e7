"""Cache of flat scenes: a stage is composed once, and later found by the content of its layers.

Other processes, later runs, and the same stage in another folder use the cached scene. A file of the cache is used only
if its hash is right; the cache may be deleted at any time.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path

from pxr import Usd

from groundwork.canonical import digest, file_digest, source_digest
from groundwork.errors import FalseworkError, InputError
from groundwork.files import write_bytes
from groundwork.locks import hold_lock
from groundwork.user_cache import cache_folder
from usd_schemas.flat_scene import FlatScene, Material, Texture
from usd_schemas.reading.choices import AS_AUTHORED, StageChoices
from usd_schemas.reading.layer_contents import layer_contents, name_from
from usd_schemas.reading.packages import unpacked_folder
from usd_schemas.reading.scene_file import pack_scene, unpack_scene
from usd_schemas.reading.stage_reader import choose_survey, compose_stage, read_stage, texture_files, with_origin

MOST_BYTES = 2_000_000_000  # size of the cache; the least recently used files are removed first
_SUFFIX = ".scene"

Rename = Callable[[str], str]


def load_scene(
    path: Path, *, survey: str | None = None, folder: Path | None = None, choices: StageChoices = AS_AUTHORED
) -> FlatScene:
    """Load a stage from the cache, or read and cache it; the scene is the same as that of `read_stage`.

    Args:
        path: A USD file (usda, usdc, usd or usdz).
        survey: Name of the one product to keep, with its camera; all when None.
        folder: The cache; that of the user when None.
        choices: As for `read_stage`.

    Raises:
        MissingError: There is no such file.
        InputError: It is not a USD file, shows nothing, or has no such product.
    """
    contents = layer_contents(path)
    if contents is None:
        return read_stage(path, survey=survey, choices=choices)
    root, home = cache_folder("scenes") if folder is None else folder, path.resolve().parent
    place = root / f"{digest([_code(), path.resolve().name, contents, choices.as_json()])}{_SUFFIX}"
    scene = _kept(place, home)
    if scene is None:
        with _turn(place):  # the first process composes it, the others wait
            scene = _kept(place, home) or _compose(path, contents, place, choices)
    return choose_survey(scene, survey, path)


@contextmanager
def _turn(place: Path) -> Iterator[None]:
    with ExitStack() as held:
        with suppress(OSError, InputError):  # if the folder is not writable, nothing is cached and no process waits
            place.parent.mkdir(parents=True, exist_ok=True)
            held.enter_context(hold_lock(place.with_suffix(".lock")))
        yield


def _kept(place: Path, home: Path) -> FlatScene | None:
    try:
        scene, layers = unpack_scene(place.read_bytes())
        os.utime(place)
        return with_origin(_renamed(scene, lambda file: str(home / file)), layers)
    except (OSError, ValueError):
        return None


def _compose(path: Path, contents: dict[str, str], place: Path, choices: StageChoices) -> FlatScene:
    composed, home = compose_stage(path, choices), path.resolve().parent
    pictures = [Path(file) for file in texture_files(composed.scene)]
    own = [file for file in pictures if file.parent != unpacked_folder().resolve()]  # others: in a hashed package
    used = {name_from(home, file) for file in (*composed.files, *own)}
    # Cached only if its key depends on all files that were read, and they did not change meanwhile.
    if used <= contents.keys() and layer_contents(path) == contents:
        _keep(pack_scene(_renamed(composed.scene, lambda file: name_from(home, Path(file))), composed.layers), place)
    return with_origin(composed.scene, composed.layers)


def _keep(data: bytes, place: Path) -> None:
    try:
        write_bytes(place, data, durable=False)
        kept = sorted(place.parent.glob(f"*{_SUFFIX}"), key=lambda file: file.stat().st_mtime, reverse=True)
        total = 0
        for file in kept:
            total += file.stat().st_size
            if total > MOST_BYTES:
                file.unlink(missing_ok=True)
                file.with_suffix(".lock").unlink(missing_ok=True)
    except (OSError, FalseworkError):
        return  # a full disk, or another process removes files too


def _renamed(scene: FlatScene, rename: Rename) -> FlatScene:
    """Replace the paths of a scene's textures."""

    def texture(one: Texture | None) -> Texture | None:
        return one and replace(one, file=rename(one.file), alpha=one.alpha and rename(one.alpha))

    def material(one: Material) -> Material:
        fine = one.detail
        return replace(
            one,
            base_texture=texture(one.base_texture),
            roughness_texture=texture(one.roughness_texture),
            metallic_texture=texture(one.metallic_texture),
            normal_texture=texture(one.normal_texture),
            emissive_texture=texture(one.emissive_texture),
            specular_texture=texture(one.specular_texture),
            detail=replace(
                fine, file=fine.file and rename(fine.file), macro_file=fine.macro_file and rename(fine.macro_file)
            ),
        )

    dome = scene.dome and replace(scene.dome, file=scene.dome.file and rename(scene.dome.file))
    return replace(scene, materials=tuple(map(material, scene.materials)), dome=dome)


@cache
def _code() -> str:
    """Hash the code that reads a stage: this room with its tables and schemas, and the version of USD."""
    room = Path(str(files("usd_schemas")))
    tables = sorted(file for file in room.rglob("*") if file.suffix in (".toml", ".usda", ".json"))
    facts = {file.relative_to(room).as_posix(): file_digest(file) for file in tables}
    return digest([Usd.GetVersion(), facts, source_digest([*room.rglob("*.py")])])
