"""Reads any composed stage into a `FlatScene`: meters, z up, triangles, plain numbers."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom, UsdUtils

from groundwork.canonical import digest, file_digest
from groundwork.errors import InputError, MissingError
from usd_schemas import tokens
from usd_schemas.apis import read_visibility
from usd_schemas.flat_scene import CameraTrack, Dome, Draws, FlatScene, Material, Product
from usd_schemas.reading.cameras import framing_camera, read_cameras, read_products, sized
from usd_schemas.reading.choices import AS_AUTHORED, StageChoices
from usd_schemas.reading.flat_geometry import Flattened, world_bounds
from usd_schemas.reading.labels import Warn, read_taxonomy
from usd_schemas.reading.lights import read_lights
from usd_schemas.reading.moments import Moving, flatten_moments
from usd_schemas.reading.mtlx import Adopted
from usd_schemas.reading.parse_errors import reason_of
from usd_schemas.reading.skinning import bake_skins
from usd_schemas.reading.unread import note_far, note_unread
from usd_schemas.registration import register_schemas

F64 = NDArray[np.float64]

_LOST = ("not drawn", "left out")  # words in warnings about prims that are not drawn
_REASONS = 3  # warnings in one error
_LOOK_AT = "Check visibility, purpose, payloads and variant selections"

register_schemas()


@dataclass(frozen=True)
class ComposedStage:
    """Result of one composition of a stage.

    Attributes:
        scene: The stage, its `origin` still empty.
        layers: Hash of the content of each layer that took part, sorted.
        files: Resolved path of each layer file, or package of layers, that took part.
    """

    scene: FlatScene
    layers: tuple[str, ...]
    files: tuple[Path, ...]


def read_stage(path: Path | str, *, survey: str | None = None, choices: StageChoices = AS_AUTHORED) -> FlatScene:
    """Read a stage as arrays: geometry, materials, lights, cameras and labels.

    Args:
        path: A USD file (usda, usdc, usd or usdz).
        survey: Name of the only product to keep, with its camera; None: all.
        choices: Camera, frames, purposes, variants and the like, to override those of the stage.

    Returns:
        The stage in meters with z up; moving objects at the time of each image.

    Raises:
        MissingError: There is no such file.
        InputError: It is not a USD file, it contains nothing to draw, or it has no such product.
    """
    place = Path(path)
    composed = compose_stage(place, choices)
    scene = choose_survey(composed.scene, survey, place)
    return with_origin(scene, composed.layers)


def compose_stage(path: Path, choices: StageChoices = AS_AUTHORED) -> ComposedStage:
    """Compose a stage and read it.

    Args:
        path: A USD file (usda, usdc, usd or usdz).
        choices: What the user chose to read.

    Raises:
        MissingError: There is no such file.
        InputError: It is not a USD file, or shows nothing.
    """
    warnings: dict[str, None] = {}
    folder = f"{path.resolve().parent}/"

    def warn(line: str) -> None:
        warnings[" ".join(line.replace(folder, "./").split())] = None

    # Suppresses USD's own output; relevant messages are reported through `warn`.
    quiet = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        documents, stage = _open(path)
        for note in documents.notes:
            warn(note)
        choose_variants(stage, choices.variants)
        for error in stage.GetCompositionErrors():
            warn(str(error))
        layers = stage.GetUsedLayers()
        bake_skins(stage, warn)
        scene = _flatten_stage(stage, stage_to_world(stage, path), choices, warn)
        if scene is None:
            raise InputError("the stage shows no geometry", where=path, hint=_why_empty(list(warnings)))
        layers = [layer for layer in layers if layer != stage.GetSessionLayer()]
        files = [Path(layer.realPath.partition("[")[0]).resolve() for layer in layers if layer.realPath]
        adopted = [documents.files[layer.identifier] for layer in layers if layer.identifier in documents.files]
        digests = [_layer_digest(layer) for layer in layers if layer.identifier not in documents.files]
        return ComposedStage(
            replace(scene, warnings=tuple(warnings)),
            tuple(sorted([*digests, *map(file_digest, adopted)])),
            (*files, *adopted),
        )
    finally:
        del quiet


def choose_variants(stage: Usd.Stage, variants: tuple[tuple[str, str, str], ...]) -> None:
    """Select variants on a stage, without touching its files.

    Args:
        stage: Composed stage.
        variants: Prim path, set and name of each.

    Raises:
        InputError: There is no such prim, set or variant.
    """
    if not variants:
        return
    stage.SetEditTarget(stage.GetSessionLayer())
    for path, name, chosen in variants:
        told = f"{path}:{name}={chosen}"
        prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
        if not prim:
            raise InputError("no such prim on the stage", field="--variant", value=told)
        sets = prim.GetVariantSets()
        if name not in sets.GetNames():
            known = ", ".join(sets.GetNames()) or "none"
            raise InputError("the prim has no variant set of this name", field="--variant", value=told, allowed=known)
        known = sets.GetVariantSet(name).GetVariantNames()
        if chosen not in known:
            raise InputError("no such variant", field="--variant", value=told, allowed=", ".join(known))
        sets.SetSelection(name, chosen)


def choose_survey(scene: FlatScene, survey: str | None, path: Path) -> FlatScene:
    """Keep one product of a scene, with its camera.

    Args:
        scene: A scene.
        survey: Name of the product; all stay when None.
        path: File of the stage, for the error.

    Raises:
        InputError: There is no such product.
    """
    if survey is None:
        return scene
    for product in scene.products:
        if product.name == survey:
            camera: CameraTrack = scene.cameras[product.camera]
            kept: Product = replace(product, camera=0)
            return replace(scene, cameras=(camera,), products=(kept,))
    names = ", ".join(product.name for product in scene.products)
    raise InputError("no such survey on the stage", where=path, field="survey", value=survey, allowed=names)


def with_origin(scene: FlatScene, layers: tuple[str, ...]) -> FlatScene:
    """Set the origin of a scene: a hash of the content of all its layers and textures, independent of their paths.

    Args:
        scene: A scene.
        layers: Hash of each of its layers, sorted.
    """
    textures = {file: file_digest(Path(file)) for file in texture_files(scene)}
    return replace(scene, origin=digest({"layers": list(layers), "textures": sorted(textures.values())}))


def texture_files(scene: FlatScene) -> set[str]:
    """List the texture files of a scene.

    Args:
        scene: A scene.
    """
    dome: tuple[Dome, ...] = (scene.dome,) if scene.dome else ()
    return {file for material in scene.materials for file in _files(material)} | {d.file for d in dome if d.file}


def stage_to_world(stage: Usd.Stage, where: Path | None = None) -> F64:
    """Find the transform from stage units and the stage's up axis to meters with z up.

    Args:
        stage: Any stage.
        where: Its file, for the error.

    Returns:
        For column vectors [m per stage unit], shape (4, 4), float64.

    Raises:
        InputError: The stage's unit is invalid.
    """
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    if not 0.0 < unit < np.inf:  # also false for NaN
        hint = "Write 1 for meters, 0.01 for centimeters"
        raise InputError(
            "the stage's unit is not a length",
            where=where,
            field="metersPerUnit",
            value=unit,
            allowed="a finite number above 0",
            hint=hint,
        )
    transform = np.eye(4)
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y:
        transform[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    transform[:3, :3] *= unit
    return transform


def _open(path: Path) -> tuple[Adopted, Usd.Stage]:
    if not path.exists():
        raise MissingError("no such file", where=path, hint="Check the path")
    if path.is_dir():
        raise InputError("is a folder, not a USD file", where=path, hint="Name the stage inside it, e.g. scene.usda")
    try:
        documents = Adopted(path)
        return documents, Usd.Stage.Open(str(path.resolve()), Usd.Stage.LoadAll)
    except Tf.ErrorException as error:
        what = f"not readable as USD: {reason_of(error)}"
        raise InputError(what, where=path, allowed="usda, usdc, usd, usdz") from None


def _why_empty(warnings: list[str]) -> str:
    """Choose the warnings that explain why nothing is drawn, else the last ones."""
    lost = [line for line in warnings if any(words in line for words in _LOST)]
    return "; ".join(lost[:_REASONS] or warnings[-_REASONS:]) or _LOOK_AT


def _flatten_stage(stage: Usd.Stage, transform: F64, choices: StageChoices, warn: Warn) -> FlatScene | None:
    """Read everything except warnings and origin; None if nothing is drawn."""
    table = read_taxonomy(stage, warn)
    cameras = read_cameras(stage, transform, warn, choices.frames)
    moving = flatten_moments(stage, cameras or (_anywhere(choices),), choices, table, transform, warn)
    if moving is None:
        return None
    flat = moving.flat
    products = read_products(stage, cameras, warn, choices)
    if cameras:
        cameras = moving.cameras
        note_far(stage, cameras, flat, float(np.linalg.norm(transform[:3, 0])), warn)
    else:
        low, high = zip(*(world_bounds(_at(moving, number)) for number in range(len(moving.moments) or 1)), strict=True)
        track, product = framing_camera(np.min(low, axis=0), np.max(high, axis=0), max(len(choices.frames), 1))
        cameras = (replace(track, moments=moving.cameras[0].moments),)
        products = read_products(stage, cameras, warn, choices) if choices.camera else (sized(product, choices),)
    lights = read_lights(stage, transform, warn)
    note_unread(stage, warn)
    visibility = read_visibility(stage.GetPrimAtPath(tokens.ENVIRONMENT))
    return FlatScene(
        flat.geometry,
        flat.draws,
        flat.materials,
        lights.sun,
        lights.dome,
        cameras,
        products,
        flat.instances,
        table.rows,
        (),
        "",
        visibility,
        lights.spheres,
        moving.moments,
    )


def _anywhere(choices: StageChoices) -> CameraTrack:
    """Make a camera that is not on the stage, with an image at each requested frame."""
    return framing_camera(np.zeros(3), np.ones(3), max(len(choices.frames), 1))[0]


def _at(moving: Moving, number: int) -> Flattened:
    """Return what is drawn at one moment."""
    if not moving.moments:
        return moving.flat
    still, moved = len(moving.flat.draws.part) - len(moving.moments[0].part), moving.moments[number]
    whole = {
        name: np.concatenate([rows[:still], getattr(moved, name)]) for name, rows in vars(moving.flat.draws).items()
    }
    return replace(moving.flat, draws=Draws(**whole))


def _layer_digest(layer: Sdf.Layer) -> str:
    file = Path(layer.realPath) if layer.realPath else None
    return file_digest(file) if file and file.is_file() else digest(layer.ExportToString())


def _files(material: Material) -> list[str]:
    maps = material.textures()
    files = [file for texture in maps for file in (texture.file, texture.alpha)]
    files += [material.detail.file, material.detail.macro_file]
    return [file for file in files if file]
