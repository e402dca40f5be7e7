"""Read any composed stage into a `FlatScene`: metres, z up, triangles, plain numbers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom, UsdUtils

from groundwork.canonical import digest, file_digest
from groundwork.errors import InputError, MissingError
from usd_schemas import tokens
from usd_schemas.apis import read_visibility
from usd_schemas.flat_geometry import flatten, world_bounds
from usd_schemas.flat_scene import CameraTrack, Dome, FlatScene, Material, Product
from usd_schemas.read_cameras import framing_camera, read_cameras, read_products
from usd_schemas.read_labels import Warn, read_taxonomy
from usd_schemas.read_lights import read_lights
from usd_schemas.read_placements import find_placements
from usd_schemas.registration import register_schemas

F64 = NDArray[np.float64]

register_schemas()


def read_stage(path: Path, *, survey: str | None = None) -> FlatScene:
    """Read a stage: everything that is drawn, its looks, lights, cameras and labels.

    Args:
        path: A USD file (usda, usdc, usd or usdz).
        survey: Name of the one product to keep, with its camera; all when None.

    Returns:
        The stage in metres with z up, at its earliest time; only cameras keep their time samples.

    Raises:
        MissingError: There is no such file.
        InputError: It is not a USD file, shows nothing, or has no such product.
    """
    warnings: dict[str, None] = {}
    folder = f"{path.resolve().parent}/"

    def warn(line: str) -> None:
        warnings[" ".join(line.replace(folder, "./").split())] = None

    # It holds back what USD would print; what matters comes back through `warn`.
    quiet = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        stage = _open(path)
        for error in stage.GetCompositionErrors():
            warn(str(error))
        scene = _flatten_stage(stage, warn)
        if scene is None:
            hint = next(iter(warnings), "Check visibility, purpose, payloads and variant selections")
            raise InputError("the stage shows no geometry", where=path, mend=hint)
        if survey is not None:
            scene = _only(scene, survey, path)
        return replace(scene, warnings=tuple(warnings), origin=_origin(stage, scene))
    finally:
        del quiet


def stage_to_world(stage: Usd.Stage) -> F64:
    """Find the transform from stage units and the stage's up axis to metres with z up.

    Args:
        stage: Any stage.

    Returns:
        For column vectors, shape (4, 4), float64.
    """
    transform = np.eye(4)
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y:
        transform[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    transform[:3, :3] *= UsdGeom.GetStageMetersPerUnit(stage)
    return transform


def _open(path: Path) -> Usd.Stage:
    if not path.exists():
        raise MissingError("no such file", where=path, mend="Check the path")
    if path.is_dir():
        raise InputError("is a folder, not a USD file", where=path, mend="Name the stage inside it, e.g. scene.usda")
    try:
        return Usd.Stage.Open(str(path.resolve()), Usd.Stage.LoadAll)
    except Tf.ErrorException as error:
        reasons = [part.commentary for part in error.args if hasattr(part, "commentary")]
        raise InputError(
            "not readable as USD" + (f": {reasons[0]}" if reasons else ""), where=path, allowed="usda, usdc, usd, usdz"
        ) from None


def _flatten_stage(stage: Usd.Stage, warn: Warn) -> FlatScene | None:
    """Everything but warnings and origin; None where nothing is drawn."""
    transform = stage_to_world(stage)
    table = read_taxonomy(stage, warn)
    placements = find_placements(stage, warn)
    flat = flatten(placements, transform, table, warn) if placements else None
    if flat is None or not len(flat.draws.part):
        return None
    cameras = read_cameras(stage, transform, warn)
    products = read_products(stage, cameras, warn)
    if not cameras:
        track, product = framing_camera(*world_bounds(flat))
        cameras, products = (track,), (product,)
    sun, dome = read_lights(stage, transform, warn)
    visibility = read_visibility(stage.GetPrimAtPath(tokens.ENVIRONMENT))
    return FlatScene(
        flat.geometry, flat.draws, flat.materials, sun, dome, cameras, products, flat.instances, table.rows, (), "",
        visibility,
    )  # fmt: skip


def _only(scene: FlatScene, survey: str, path: Path) -> FlatScene:
    for product in scene.products:
        if product.name == survey:
            camera: CameraTrack = scene.cameras[product.camera]
            kept: Product = replace(product, camera=0)
            return replace(scene, cameras=(camera,), products=(kept,))
    names = ", ".join(product.name for product in scene.products)
    raise InputError("no such survey on the stage", where=path, field="survey", value=survey, allowed=names)


def _origin(stage: Usd.Stage, scene: FlatScene) -> str:
    """Hash the content of every layer and texture that the scene was read from, wherever they lie."""
    layers = []
    session = stage.GetSessionLayer()
    for layer in stage.GetUsedLayers():
        if layer != session:
            file = Path(layer.realPath) if layer.realPath else None
            layers.append(file_digest(file) if file and file.is_file() else digest(layer.ExportToString()))
    textures = {file: file_digest(Path(file)) for file in _texture_files(scene)}
    return digest({"layers": sorted(layers), "textures": sorted(textures.values())})


def _texture_files(scene: FlatScene) -> set[str]:
    dome: tuple[Dome, ...] = (scene.dome,) if scene.dome else ()
    return {file for material in scene.materials for file in _files(material)} | {d.file for d in dome if d.file}


def _files(material: Material) -> list[str]:
    textures = (material.base_texture, material.roughness_texture, material.normal_texture)
    files = [texture.file for texture in textures if texture] + [material.detail.file, material.detail.macro_file]
    return [file for file in files if file]
