"""Users' surfaces: the layouts of the usual collections load as they are; what is unsafe is one clear line."""

import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from authoring.looks.bake import LookSettings, bake_look
from authoring.looks.user_maps import find_sets
from authoring.looks.user_sets import place_set, read_sets
from authoring.shapes.component import Component
from groundwork.errors import InputError
from tests.authoring.boxes import box

Maps = dict[str, tuple[float, ...]]

RED = (0.6, 0.1, 0.1)


def _image(color: tuple[float, ...], suffix: str, side: int = 64) -> bytes:
    pixels = np.broadcast_to(np.round(255 * np.array(color[::-1])), (side, side, 3)).astype(np.uint8)
    return cv2.imencode(suffix, pixels)[1].tobytes()


def _zip(path: Path, files: dict[str, bytes]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in files.items():
            packed.writestr(name, data)
    return path


def _ambient(path: Path) -> Path:
    stem = path.stem
    kinds: Maps = {
        "Color": RED,
        "NormalGL": (0.5, 0.5, 1),
        "NormalDX": (0.9, 0.9, 1),
        "Roughness": (0.4,) * 3,
        "Displacement": (0.5,) * 3,
        "Metalness": (1.0,) * 3,
        "AmbientOcclusion": (1,) * 3,
    }
    files = {f"{stem}_{kind}.jpg": _image(color, ".jpg") for kind, color in kinds.items()}
    return _zip(path, {**files, f"{stem.partition('_')[0]}.png": _image((0, 1, 0), ".png"), f"{stem}.usdc": b"PXR"})


def _haven(path: Path) -> Path:
    import OpenEXR

    scratch = path.with_suffix(".exr")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.full((64, 64, 3), (0.5, 0.5, 1), np.float16)}).write(str(scratch))
    files = {
        "wood_planks_02_1k.blend": b"BLENDER",
        "textures/wood_planks_02_diff_1k.jpg": _image(RED, ".jpg"),
        "textures/wood_planks_02_arm_1k.png": _image((1.0, 0.7, 0.0), ".png"),
        "textures/wood_planks_02_nor_gl_1k.exr": scratch.read_bytes(),
    }
    scratch.unlink()
    return _zip(path, files)


def _plain(folder: Path, albedo: str = "albedo.png") -> Path:
    place = folder / "concrete/rough"
    place.mkdir(parents=True)
    for name, color in ((albedo, RED), ("roughness.png", (0.5,) * 3), ("height.png", (0.2,) * 3)):
        (place / name).write_bytes(_image(color, Path(name).suffix))
    (place / "metallic.png").write_bytes(_image((0, 0, 0), ".png"))
    return folder


@pytest.mark.parametrize("albedo", ["albedo.png", "color.jpg", "Diffuse.png", "rough_01_BaseColor.png"])
def test_folders_of_the_random_bridge_generator(tmp_path: Path, albedo: str) -> None:
    """`family/name/{albedo|color|diffuse, roughness, height, metallic}`, also when the family or the set is named."""
    _plain(tmp_path / "mine", albedo)
    for root in (tmp_path / "mine", tmp_path / "mine/concrete", tmp_path / "mine/concrete/rough"):
        (one,) = find_sets(root)
        assert set(one.maps) == {"albedo", "roughness", "height", "metallic"}
        assert one.name == "rough"
    (one,) = find_sets(tmp_path / "mine")
    assert one.family == "concrete"
    files, metallic = place_set(one, tmp_path / "out", 2.0, 64)
    assert metallic == 0
    assert files.mean_roughness == pytest.approx(0.5, abs=0.01)
    assert files.color[0] == pytest.approx(((0.6 + 0.055) / 1.055) ** 2.4, abs=0.02)
    normal = cv2.imread(str(tmp_path / "out" / files.normal))
    assert normal is not None
    assert np.abs(normal.reshape(-1, 3).mean(axis=0) - [255, 128, 128]).max() < 1.5  # a flat height map


def test_zips_load_as_they_are(tmp_path: Path) -> None:
    """AmbientCG and Poly Haven: the right map of each kind, the preview and the DirectX normals left out."""
    _ambient(tmp_path / "mine/PaintedMetal004_1K-JPG.zip")
    _haven(tmp_path / "mine/wood_planks_02_1k.blend.zip")
    metal, wood = find_sets(tmp_path / "mine")
    assert {kind: picture.name.rpartition("_")[2] for kind, picture in metal.maps.items()} == {
        "albedo": "Color.jpg",
        "normal": "NormalGL.jpg",
        "roughness": "Roughness.jpg",
        "height": "Displacement.jpg",
        "metallic": "Metalness.jpg",
    }
    assert set(wood.maps) == {"albedo", "arm", "normal"}
    suits = read_sets([tmp_path / "mine"])
    assert suits["Role_GirderSteel"] == (metal,)
    assert suits["Role_SleeperTimber"] == (wood,)
    assert place_set(metal, tmp_path / "out", 2.0, 64)[1] == pytest.approx(1, abs=0.02)
    files, metallic = place_set(wood, tmp_path / "out", 2.0, 64)
    assert (files.mean_roughness, metallic) == (pytest.approx(0.7, abs=0.01), 0)
    normal = cv2.imread(str(tmp_path / "out" / files.normal))
    assert normal is not None
    assert np.abs(normal.reshape(-1, 3).mean(axis=0) - [255, 128, 128]).max() < 1.5


def test_a_role_wears_the_users_surface(tmp_path: Path) -> None:
    """A role that a family suits is filled from it, the others from the look; the same seed, the same bytes."""
    _plain(tmp_path / "mine")
    parts = tuple(
        Component(f"Part_{n}", "column", role, "Substructure", box((3 * n, 0, 0), (3 * n + 1, 1, 6)), n + 1)
        for n, role in enumerate(("Role_PierConcrete", "Role_GirderSteel"))
    )
    settings = LookSettings(texels=256, folders=("mine",), picture_side=3.0)
    given, library = {"mine": tmp_path / "mine"}, tmp_path / "library"
    one, two = (
        bake_look(settings, "weathered", tmp_path / name, parts, np.random.default_rng(4), given=given, library=library)
        for name in ("one", "two")
    )
    assert one == two
    assert (one["Role_PierConcrete"].name, one["Role_PierConcrete"].sheet) == ("rough", 3.0)
    assert one["Role_GirderSteel"].name == "painted_steel"
    files = sorted(path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*"))
    assert all((tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes() for file in files)


def _bomb_png() -> bytes:
    head = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", 13) + b"IHDR" + head + struct.pack(">I", zlib.crc32(b"IHDR" + head))
    return b"\x89PNG\r\n\x1a\n" + chunk


def _wear(folder: Path) -> None:
    for sets in read_sets([folder / "mine"]).values():
        place_set(sets[0], folder / "out", 2.0, 64)


FAULTS: dict[str, tuple[Callable[[Path], object], str]] = {
    "nothing": (lambda f: f.mkdir(), "has no surface"),
    "no such": (lambda f: None, "no such folder"),
    "unknown family": (lambda f: _zip(f / "Thing_1K.zip", {"Thing_Color.png": _image(RED, ".png")}), "no family"),
    "no zip": (lambda f: (f.mkdir(), (f / "concrete.zip").write_bytes(b"PK nonsense")), "not a valid archive"),
    "climbs": (lambda f: _zip(f / "concrete.zip", {"../../concrete_Color.png": _image(RED, ".png")}), "leads out"),
    "bomb": (lambda f: _zip(f / "concrete.zip", {"concrete_Color.png": bytes(30_000_000)}), "times its size"),
    "huge png": (lambda f: _zip(f / "concrete.zip", {"concrete_Color.png": _bomb_png()}), "100000 x 100000"),
    "cut jpg": (lambda f: _zip(f / "concrete.zip", {"concrete_Color.jpg": _image(RED, ".jpg", 256)[:700]}), "complete"),
    "cut png": (lambda f: _zip(f / "concrete.zip", {"concrete_Color.png": _image(RED, ".png", 256)[:150]}), "complete"),
    "no picture": (lambda f: _zip(f / "concrete.zip", {"concrete_Color.png": b"text"}), "complete"),
    "bad exr": (lambda f: _zip(f / "concrete.zip", {"concrete_diff.exr": b"v/1\x01" + bytes(99)}), "cannot be read"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_one_clear_line(tmp_path: Path, name: str) -> None:
    """Missing, unsafe, damaged: an error that names the file, and no file is written outside."""
    make, said = FAULTS[name]
    make(tmp_path / "mine")
    with pytest.raises(InputError, match=said) as caught:
        _wear(tmp_path)
    assert "\n" not in str(caught.value)
    assert "mine" in str(caught.value)
    assert not list(tmp_path.glob("*.png"))


def test_a_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    """A symbolic link may not bring in what lies elsewhere."""
    _plain(tmp_path / "mine")
    (tmp_path / "secret.png").write_bytes(_image(RED, ".png"))
    (tmp_path / "mine/concrete/rough/color.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(InputError, match="leads out"):
        find_sets(tmp_path / "mine")
