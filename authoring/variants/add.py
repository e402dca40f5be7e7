"""More choices for an existing scene: looks, backgrounds and lights authored on request from its recipe."""

import difflib
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from pxr import Sdf, Tf, Usd

from authoring.backgrounds.registry import BACKGROUNDS
from authoring.families.bridge_settings import draw_layout
from authoring.families.registry import build_bridge
from authoring.imported.asset import is_city, world_name
from authoring.layers.assets import Pieces
from authoring.layers.change import check_editable
from authoring.layers.geometry import BRIDGE, SITE
from authoring.layers.selection import AXES, choose, offered, unknown_choice
from authoring.layers.variant import variant_layer
from authoring.layers.variant_settings import BASE_LIGHT
from authoring.light.daylight import read_date
from authoring.light.panorama import PANORAMAS
from authoring.looks.roles import LOOKS
from authoring.scenes.labels import write_taxonomy_layer
from authoring.scenes.manifest import SceneRecipe, read_recipe, refresh_manifest
from authoring.site.site import Site, draw_site
from authoring.streams import stream
from authoring.variants.arcs import add_background, add_light, add_look
from authoring.variants.foreign_background import stage_background
from authoring.variants.foreign_look import stage_look
from authoring.variants.foreign_place import HERE, Point
from authoring.variants.redrawn import check_redrawn
from authoring.variants.staging import Staged
from authoring.variants.write import write_background, write_light, write_look
from groundwork.errors import InputError, MissingError
from groundwork.files import space_errors, sweep_folders, write_text
from groundwork.locks import hold_lock
from groundwork.marks import TEMPORARY
from usd_schemas.guard.layer_walk import Warn
from usd_schemas.taxonomies import taxonomy

TAXONOMY = "taxonomy"
LOCK = f"{TEMPORARY}edit"  # not part of the scene
USD_FILES = (".usd", ".usda", ".usdc", ".usdz")
_ALSO = {  # allowed values besides a name
    "look": ("a USD file", "a folder or zip of surfaces"),
    "background": ("a USD file", "a folder that falsework background import made"),
    "light": ("a date and hour such as 2024-12-21T10:00", "a photographed sky (.hdr, .exr)"),
}


def set_choices(scene: Path, choices: dict[str, str], warn: Warn, origin: Point | None = None) -> dict[str, str]:
    """Choose a look, a background, a light, a table of classes; missing choices are added to the scene first.

    Args:
        scene: Root layer of a scene.
        choices: Axis to the name of a choice; to the path of the user's own USD file; for a look, to a folder or zip of
            the user's surfaces; or, for a light, to a date and
            hour such as 2024-12-21T10:00, or to a photographed sky (.exr, .hdr).
            `taxonomy` to the name of a table, which is a layer and no variant.
        warn: Called with one line for each thing of a user's file that is lost.
        origin: Point of the user's own background that becomes the scene's origin [m], z up.

    Returns:
        Axis to the name selected.

    Raises:
        InputError: A stored scene, an unknown axis or choice, or an unusable file.
    """
    check_editable(scene)
    with _sole_editor(scene):
        return _set_choices(scene, choices, warn, origin)


def _set_choices(scene: Path, choices: dict[str, str], warn: Warn, origin: Point | None) -> dict[str, str]:
    tables = {axis: taxonomy(name).name for axis, name in choices.items() if axis == TAXONOMY}
    _check_axes(scene, choices, (*AXES, TAXONOMY))
    _check_origin(choices, origin)
    names = _ensure(scene, {axis: value for axis, value in choices.items() if axis in AXES}, warn, origin)
    choose(scene, names)
    for name in tables.values():
        write_taxonomy_layer(scene.parent, name)
    refresh_manifest(scene.parent)
    return {**names, **tables}


def write_variant(scene: Path, name: str, choices: dict[str, str], warn: Warn, origin: Point | None = None) -> Path:
    """Write a scene variant beside a scene, whose own selections are unchanged.

    Args:
        scene: Root layer of a scene.
        name: Name of the variant.
        choices: As for `set_choices`.
        warn: As for `set_choices`.
        origin: As for `set_choices`.

    Returns:
        `variant_<name>.usda`.

    Raises:
        InputError: As for `set_choices`.
    """
    check_editable(scene)
    _check_axes(scene, choices, tuple(AXES))
    _check_origin(choices, origin)
    path = scene.with_name(f"variant_{name}.usda")
    with _sole_editor(scene):
        names = _ensure(scene, choices, warn, origin)
        layer = variant_layer(Sdf.Layer.OpenAsAnonymous(str(scene), metadataOnly=False), scene.name, names)
        write_text(path, layer.ExportToString())
        refresh_manifest(scene.parent)
    return path


@contextmanager
def _sole_editor(scene: Path) -> Iterator[None]:
    """Lock a scene, so that no other process edits its layers meanwhile."""
    lock = scene.with_name(LOCK)
    with hold_lock(lock) as held:
        if held:
            for folder in ("bridge/looks", "background"):
                sweep_folders(scene.parent / folder)
        try:
            yield
        finally:
            if held:
                lock.unlink(missing_ok=True)


@dataclass(frozen=True)
class _Drawn:
    """A scene's bridge and site, drawn again."""

    recipe: SceneRecipe
    bridge: Pieces
    site: Site


def _check_axes(scene: Path, choices: dict[str, str], known: tuple[str, ...]) -> None:
    for axis in choices:
        if axis not in known:
            near = difflib.get_close_matches(axis, known, n=1, cutoff=0.5)
            raise InputError(
                "no such choice",
                where=scene,
                value=axis,
                allowed=", ".join(known),
                hint=f"Did you mean {near[0]!r}?" if near else None,
            )


def _check_origin(choices: dict[str, str], origin: Point | None) -> None:
    """Refuse an origin except for a user's background: our own worlds and imported ones have theirs."""
    file = Path(choices.get("background", ""))
    if origin is not None and (file.suffix not in USD_FILES or is_city(file)):
        raise InputError(
            "only a background from a USD file has an origin to move",
            field="--re-origin",
            value=origin,
            hint="Leave it out: an imported world has an origin of its own",
        )


def _ensure(scene: Path, choices: dict[str, str], warn: Warn, origin: Point | None) -> dict[str, str]:
    """Add missing choices to a scene, and return their names; if one is refused, nothing is changed."""
    offer = offered(Usd.Stage.Open(str(scene), Usd.Stage.LoadNone))
    with ExitStack() as staged, space_errors(scene.parent):
        makers: dict[str, Callable[[], str]] = {}
        for axis, value in choices.items():
            if value in offer.get(axis, ()):
                makers[axis] = partial(str, value)
            elif Path(value).suffix in USD_FILES and axis != "light" and not _is_world(axis, value):
                asset = _stage(scene, axis, Path(value), warn, origin)
                staged.callback(asset.discard)
                makers[axis] = partial(_commit, asset)
            else:
                makers[axis] = _maker(scene, axis, value, offer.get(axis, ()))
        return {axis: make() for axis, make in makers.items()}


def _stage(scene: Path, axis: str, file: Path, warn: Warn, origin: Point | None) -> Staged:
    if axis == "look":
        return stage_look(scene, file, warn)
    return stage_background(scene, file, warn, HERE if origin is None else origin)


def _commit(asset: Staged) -> str:
    asset.commit()
    return asset.name


def _is_world(axis: str, value: str) -> bool:
    return axis == "background" and is_city(Path(value))


def _maker(scene: Path, axis: str, value: str, known: tuple[str, ...]) -> Callable[[], str]:
    """Return the function that adds a choice to a scene: nothing is written before it is called."""
    if _is_world(axis, value):
        _check_own_name(axis, world_name(Path(value)), value)
        return partial(_settle, scene, _drawn_alike(scene, axis), Path(value))
    if axis == "light" and Path(value).suffix.lower() in PANORAMAS:
        _check_own_name(axis, Tf.MakeValidIdentifier(Path(value).stem), value)
        return partial(_author_sky, scene, Path(value))
    if axis == "look" and (Path(value).is_dir() or Path(value).suffix.lower() == ".zip"):
        _check_own_name(axis, Tf.MakeValidIdentifier(Path(value).stem), value)
        return partial(_wear, scene, _drawn_alike(scene, axis), Path(value))
    makeable = {"look": tuple(LOOKS), "background": tuple(BACKGROUNDS), "light": ()}[axis]
    date = _date(value) if axis == "light" else None
    if value not in makeable and date is None:
        _check_file(axis, Path(value))
        raise unknown_choice(scene, axis, value, (*sorted({*known, *makeable}), *_ALSO[axis]))
    if date is not None:
        return partial(_author_light, scene, date)
    return partial(_author, scene, _drawn_alike(scene, axis), axis, value)


def _check_own_name(axis: str, name: str, file: str) -> None:
    """Refuse a file that would take the place of one of our own choices, also where case does not count."""
    ours = {"look": LOOKS, "background": BACKGROUNDS, "light": (BASE_LIGHT,)}[axis]
    if name.lower() in ours:
        raise InputError(f"has the name of a {axis} of Falsework", where=file, field=axis, value=name, hint="Rename it")


def _check_file(axis: str, file: Path) -> None:
    """Refuse an unknown choice that is the path of a file that cannot be used directly, or does not exist."""
    if axis == "background" and file.is_file():
        hint = "Import it first with falsework background import FILE -o DIR, then choose background=DIR"
        raise InputError("is not a USD file", where=file, field=axis, hint=hint)
    if axis != "light" and file.suffix and not file.exists():
        raise MissingError("no such file", where=file, field=axis, hint="Check the path")


def _settle(scene: Path, drawn: _Drawn, world: Path) -> str:
    """Place a scene in an imported world."""
    name = world_name(world)
    files = write_background(drawn.recipe.settings, drawn.recipe.seed, name, drawn.site, scene.parent, world)
    add_background(scene, name, files)
    return name


def _wear(scene: Path, drawn: _Drawn, surfaces: Path) -> str:
    """Apply a user's folder of surfaces to the bridge; roles without a suitable one keep that of the scene's look."""
    name = Tf.MakeValidIdentifier(surfaces.stem)
    look = drawn.recipe.settings.look.model_copy(update={"folders": (surfaces.name,)})
    settings = drawn.recipe.settings.model_copy(update={"look": look})
    given, bridge = {surfaces.name: surfaces}, scene.parent / "bridge"
    recipe, waterline = replace(drawn.recipe, settings=settings), drawn.site.waterline
    file = write_look(recipe, name, drawn.bridge, bridge, given=given, base=look.name, waterline=waterline)
    add_look(bridge / "bridge.usda", name, file)
    return name


def _author_sky(scene: Path, picture: Path) -> str:
    """Add a photographed sky as a light."""
    recipe, name = read_recipe(scene.parent), Tf.MakeValidIdentifier(picture.stem)
    settings = recipe.settings.light.model_copy(update={"sky": picture.name})
    file = write_light(settings, recipe.seed, name, scene.parent, {picture.name: picture})
    add_light(scene.parent / "lighting.usda", name, file)
    return name


def _author_light(scene: Path, date: datetime) -> str:
    """Add the light of a date and hour."""
    folder, recipe = scene.parent, read_recipe(scene.parent)
    moment = date.astimezone(UTC) if date.tzinfo else date
    name = f"light_{moment:%Y%m%d_%H%M}" + (f"{moment:%S}" if moment.second else "")
    settings = recipe.settings.light.model_copy(update={"date": date, "sky": ""})
    add_light(folder / "lighting.usda", name, write_light(settings, recipe.seed, name, folder, {}))
    return name


def _author(scene: Path, drawn: _Drawn, axis: str, value: str) -> str:
    """Add one of our own looks or backgrounds."""
    folder, recipe = scene.parent, drawn.recipe
    if axis == "look":
        file = write_look(recipe, value, drawn.bridge, folder / "bridge", waterline=drawn.site.waterline)
        add_look(folder / "bridge/bridge.usda", value, file)
    else:
        add_background(scene, value, write_background(recipe.settings, recipe.seed, value, drawn.site, folder))
    return value


def _drawn_alike(scene: Path, axis: str) -> _Drawn:
    """Draw a scene's bridge and site again, and refuse what would not fit those that are stored."""
    drawn = _draw(read_recipe(scene.parent))
    if axis == "look":
        check_redrawn(scene, BRIDGE, "bridge", drawn.bridge)
    else:
        check_redrawn(scene, SITE, "site", drawn.site.pieces)
    return drawn


def _draw(recipe: SceneRecipe) -> _Drawn:
    settings, seed = recipe.settings, recipe.seed
    layout, drawn = draw_layout(settings.bridge, stream(seed, "bridge"))
    site = draw_site(settings.site, layout, stream(seed, "site"))
    return _Drawn(recipe, build_bridge(layout, drawn, site.ground), site)


def _date(text: str) -> datetime | None:
    """Read a date and hour; None for the name of a light, or a file."""
    if not re.match(r"\d{4}-\d", text):
        return None
    try:
        return read_date(text)
    except ValueError as error:
        raise InputError(str(error), field="light", value=text) from None
