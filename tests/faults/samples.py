"""A sound sample of every format in `readers.FORMATS`, and who reads it: what the fault suite damages."""

from __future__ import annotations

import json
import shutil
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from authoring.imported.cityjson import read_cityjson
from authoring.light.daylight import encode_exr
from authoring.light.panorama import read_panorama
from authoring.looks.user_maps import find_sets
from authoring.scenes.manifest import FORMAT as SCENE_FORMAT
from authoring.scenes.manifest import changed_files, read_recipe
from falsework.scenario import load_scenario
from falsework.store.artefact import read_manifest, seal
from groundwork.files import write_json
from learn.models.forest import forest_probabilities, grow_forest
from learn.models.registry import build_network
from learn.trained import FACTS, FOREST, WEIGHTS, ModelFacts, TrainedForest, write_model
from learn.trained import read_model as read_trained
from learn.training.checkpoint import read_checkpoint
from recon.cloud import read_cloud, write_cloud
from recon.formats.laz import write_laz
from recon.formats.ply import write_ply
from recon.formats.scan import read_scan
from recon.photos.photos import open_photographs
from recon.sfm.colmap_model import read_model
from render.capture import load_image, read_capture, read_truth
from render.images.image_files import encode_png
from render.images.tga import decode_tga
from render.light.daylight import _decode_panorama
from tests.authoring import mesh_files
from tests.authoring.test_imported_city import document
from tests.recon.conftest import poses_on_arc, write_capture
from tests.recon.test_scan import small_cloud
from usd_schemas.guard.guard import check_stage
from usd_schemas.reading.mtlx import read_document, translate
from usd_schemas.reading.stage_reader import read_stage


@dataclass(frozen=True)
class Sample:
    """One sound file.

    Attributes:
        file: What is damaged; what it needs lies beside it.
        read: Reads it as the product does.
        sealed: Whether the format holds check sums, so that damage is refused or harmless.
        native: Whether the product reads it in a child with limits only, because a library may crash.
    """

    file: Path
    read: Callable[[], Any]
    sealed: bool = False
    native: bool = False


def make_samples(home: Path) -> dict[str, Sample]:
    """Write a sample of every format.

    Args:
        home: Empty folder.
    """
    return {**_captures(home), **_clouds(home), **_tables(home), **_models(home), **_worlds(home), **_plain(home)}


def _captures(home: Path) -> dict[str, Sample]:
    shot = write_capture(home / "capture", poses_on_arc(2))
    truth = shot / "truth"
    for name in ("semantic", "instance"):
        file = truth / name / "000000.png"
        pixels = np.asarray(cv2.imread(str(file), cv2.IMREAD_UNCHANGED))
        file.write_bytes(encode_png(pixels.astype(np.uint16) if name == "instance" else pixels.astype(np.uint8)))

    def opened() -> Any:
        found = read_truth(read_capture(shot))
        assert found is not None
        return found

    plain = home / "plain"
    plain.mkdir()
    shutil.copyfile(shot / "images/000000.jpg", plain / "a.jpg")
    return {
        "capture": Sample(shot / "cameras.json", lambda: read_capture(shot).images),
        "poses": Sample(truth / "poses.json", lambda: opened().poses),
        "instances": Sample(truth / "instances.json", lambda: opened().instances),
        "surface": Sample(truth / "surface.npz", lambda: opened().surface(), sealed=True),
        "depth": Sample(truth / "depth/000000.tiff", lambda: opened().depth(0)),
        "semantic": Sample(truth / "semantic/000000.png", lambda: opened().semantic(0), sealed=True),
        "instance": Sample(truth / "instance/000000.png", lambda: opened().instance(0), sealed=True),
        "photograph": Sample(shot / "images/000000.jpg", lambda: load_image(read_capture(shot), 0)),
        "header": Sample(plain / "a.jpg", lambda: open_photographs(plain).images),
    }


def _clouds(home: Path) -> dict[str, Sample]:
    cloud, folder = small_cloud(), home / "cloud"
    folder.mkdir()
    write_cloud(folder, cloud)
    write_laz(home / "a.las", cloud, compress=False)
    write_laz(home / "a.laz", cloud)
    write_ply(home / "a.ply", cloud)
    model = home / "model"
    model.mkdir()
    (model / "cameras.bin").write_bytes(struct.pack("<QIiQQ4d", 1, 1, 2, 640, 480, 500.0, 320.0, 240.0, 0.0))
    image = struct.pack("<I7dI", 1, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1) + b"a.jpg\0" + struct.pack("<Q", 2)
    points = struct.pack("<2dQ2dQ", 1.0, 2.0, 7, 3.0, 4.0, 2**64 - 1)
    (model / "images.bin").write_bytes(struct.pack("<Q", 1) + image + points)
    row = struct.pack("<Q3d3BdQ2I", 7, 0.0, 1.0, 2.0, 9, 9, 9, 0.5, 1, 1, 0)
    (model / "points3D.bin").write_bytes(struct.pack("<Q", 1) + row)
    return {
        "cloud": Sample(folder / "cloud.json", lambda: read_cloud(folder).columns),
        "column": Sample(folder / "coord.npy", lambda: read_cloud(folder).columns),
        "las": Sample(home / "a.las", lambda: read_scan(home / "a.las").coord),
        "laz": Sample(home / "a.laz", lambda: read_scan(home / "a.laz").coord),
        "ply scan": Sample(home / "a.ply", lambda: read_scan(home / "a.ply").coord),
        "colmap": Sample(model / "images.bin", lambda: read_model(model).poses),
    }


def _tables(home: Path) -> dict[str, Sample]:
    """Scans without a format of their own for labels, and E57 where its package is installed."""
    rng = np.random.default_rng(5)
    place, color = rng.uniform(0.0, 20.0, (60, 3)).round(3), rng.integers(0, 256, (60, 3))
    table = np.column_stack([place, color, rng.integers(0, 9, 60)])
    np.save(home / "a.npy", table)
    records = np.zeros(60, [("x", "f8"), ("y", "f8"), ("z", "f8"), ("label", "u1")])
    records["x"], records["y"], records["z"] = place.T
    np.save(home / "b.npy", records)
    np.savetxt(home / "a.txt", table, "%.3f %.3f %.3f %d %d %d %d")

    def read(name: str) -> Any:
        return vars(read_scan(home / name))

    found = {
        "array": Sample(home / "a.npy", lambda: read("a.npy")),
        "records": Sample(home / "b.npy", lambda: read("b.npy")),
        "text": Sample(home / "a.txt", lambda: read("a.txt")),
    }
    if not find_spec("pye57"):
        return found
    file = import_module("pye57").E57(str(home / "a.e57"), mode="w")
    columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), place.T, strict=True))
    columns |= dict(zip(("colorRed", "colorGreen", "colorBlue"), color.T.astype(np.uint8), strict=True))
    file.write_scan_raw(columns)
    file.close()
    return {**found, "e57": Sample(home / "a.e57", lambda: read("a.e57"), sealed=True)}


def _models(home: Path) -> dict[str, Sample]:
    """A network, a forest, and the checkpoint of a training."""
    settings = {"widths": [8, 16], "ratios": [4, 4]}
    network: Any = build_network("randlanet", settings, 3, 4)
    facts = ModelFacts("randlanet", settings, ("a", "b", "c", "d"), ("x", "y", "z"), {})
    write_model(home / "network", facts, network.state_dict())
    rng = np.random.default_rng(6)
    features = rng.random((80, 8)).astype(np.float32)
    arrays = grow_forest(features, np.arange(80) % 4, 4, trees=3, depth=4, seed=0)
    trees = ModelFacts(FOREST, {"scales": [10]}, ("a", "b", "c", "d"), ("x", "y", "z"), {})
    write_model(home / "forest", trees, {name: torch.from_numpy(rows) for name, rows in arrays.items()})
    checkpoint = home / "last.ckpt"
    torch.save({"epoch": 3, "state_dict": network.state_dict()}, checkpoint)

    def read(folder: Path) -> Any:
        model = read_trained(folder)
        if isinstance(model, TrainedForest):
            return vars(model.facts), forest_probabilities(model.arrays, features)
        return vars(model.facts), _arrays(model.module.state_dict())

    return {
        "model": Sample(home / "network" / FACTS, lambda: read(home / "network")),
        "weights": Sample(home / "network" / WEIGHTS, lambda: read(home / "network")),
        "forest": Sample(home / "forest" / WEIGHTS, lambda: read(home / "forest")),
        "checkpoint": Sample(checkpoint, lambda: _arrays(read_checkpoint(checkpoint)), sealed=True),
    }


def _arrays(value: Any) -> Any:
    """Turn the tensors of nested tables into arrays."""
    if isinstance(value, dict):
        return {key: _arrays(one) for key, one in value.items()}
    return value.numpy() if isinstance(value, torch.Tensor) else value


def _worlds(home: Path) -> dict[str, Sample]:
    folders = {name: home / name for name in ("obj", "plymesh", "gltf", "usd", "zip", "city")}
    for folder in folders.values():
        folder.mkdir()
    obj, ply = mesh_files.obj(folders["obj"]), mesh_files.ply(folders["plymesh"])
    gltf, usd, packed = mesh_files.gltf(folders["gltf"]), mesh_files.usd(folders["usd"]), home / "tile.usdz"
    shutil.copyfile(mesh_files.usdz(folders["usd"]), packed)
    archive, city = mesh_files.zipped(folders["zip"]), folders["city"] / "city.json"
    city.write_text(json.dumps(document()), encoding="utf-8")

    def stage(file: Path) -> Any:
        check_stage(file, (), mesh_files.quiet)
        return read_stage(file).geometry.positions

    return {
        "obj": Sample(obj, lambda: mesh_files.read(obj).textured),
        "ply": Sample(ply, lambda: mesh_files.read(ply).textured),
        "gltf": Sample(gltf, lambda: mesh_files.read(gltf).textured),
        "usd world": Sample(usd, lambda: mesh_files.read(usd).textured, native=True),
        "zip": Sample(archive, lambda: mesh_files.read(archive).textured),
        "cityjson": Sample(city, lambda: read_cityjson(city, mesh_files.quiet).buildings),
        "stage": Sample(usd, lambda: stage(usd), native=True),
        "package": Sample(packed, lambda: stage(packed), native=True),
    }


_LOOK = """<?xml version="1.0"?>
<materialx version="1.38">
  <standard_surface name="S" type="surfaceshader"><input name="base" type="float" value="0.5"/></standard_surface>
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S"/>
  </surfacematerial>
</materialx>
"""


def _plain(home: Path) -> dict[str, Sample]:
    scenario = home / "scenario.toml"
    scenario.write_text('seed = 7\nscenes = 2\n\n[bridge]\nfamily = "slab"\n\n[[survey]]\nkind = "global"\n')
    sky = np.linspace(0.1, 1.0, 32 * 64 * 3, dtype=np.float32).reshape(32, 64, 3)
    (home / "dome.exr").write_bytes(encode_exr(sky))
    cv2.imwrite(str(home / "sky.hdr"), sky)
    (home / "wood.tga").write_bytes(struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, 8, 8, 24, 0x20) + bytes(192))
    (home / "look.mtlx").write_text(_LOOK, encoding="utf-8")
    with zipfile.ZipFile(home / "brick.zip", "w") as archive:
        archive.writestr("brick/albedo.png", encode_png(np.zeros((16, 16, 3), np.uint8)))
    scene, folder = home / "scene", home / "artefact"
    for place in (scene, folder):
        place.mkdir()
        (place / "x.txt").write_text("x")
    write_json(
        scene / "manifest.json",
        {"format": SCENE_FORMAT, "format_version": 1, "seed": 3, "settings": {}, "files": {"x.txt": "0"}},
    )
    seal(folder, {"stage": "cloud", "version": 1, "settings": {}, "inputs": {}})

    def surfaces() -> list[bytes]:
        return [picture.read() for one in find_sets(home / "brick.zip") for picture in one.maps.values()]

    return {
        "scenario": Sample(scenario, lambda: load_scenario(scenario).seed),
        "dome": Sample(home / "dome.exr", lambda: _decode_panorama(home / "dome.exr")),
        "tga": Sample(home / "wood.tga", lambda: decode_tga(home / "wood.tga")),
        "mtlx": Sample(
            home / "look.mtlx", lambda: translate(read_document(home / "look.mtlx")).ExportToString(), native=True
        ),
        "sky": Sample(home / "sky.hdr", lambda: read_panorama(home / "sky.hdr")),
        "surfaces": Sample(home / "brick.zip", surfaces, sealed=True),
        "manifest": Sample(scene / "manifest.json", lambda: (read_recipe(scene).seed, changed_files(scene))),
        "artefact": Sample(folder / "artefact.json", lambda: read_manifest(folder / "artefact.json"), sealed=True),
    }
