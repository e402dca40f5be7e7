"""Files made by hand to do harm: each is refused in one exact line, soon, and nothing is written or read elsewhere."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from authoring.foreign.model_files import check_archive, unpack
from authoring.imported.skin import image_skin
from authoring.looks.user_maps import find_sets
from authoring.looks.user_sets import place_set
from falsework.commands.given_settings import given_settings
from falsework.report.flight import small_picture
from falsework.scenario import load_scenario
from falsework.store.artefact import read_manifest
from groundwork.errors import InputError
from groundwork.files import read_json
from groundwork.settings import read_toml
from recon.cloud import read_cloud, write_cloud
from recon.formats.scan import check_copy
from recon.photos.photos import open_photographs
from render.capture import Truth, load_image, read_capture, read_truth
from render.images.image_files import decode, encode_png
from tests.conftest import RecordProof
from tests.recon.conftest import poses_on_arc, write_capture
from tests.recon.test_scan import small_cloud

Attack = Callable[[Path], object]


def text(name: str, content: str | bytes, read: Attack) -> Attack:
    """Write a file and read it."""

    def attack(folder: Path) -> object:
        file = folder / name
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        return read(file)

    return attack


def pipe(name: str, read: Attack) -> Attack:
    """Put a pipe that nobody writes to where a file is read: to open it would wait for ever."""

    def attack(folder: Path) -> object:
        os.mkfifo(folder / name)
        return read(folder / name)

    return attack


def device(name: str, read: Attack) -> Attack:
    """Put a link to a device that never ends where a file is read."""

    def attack(folder: Path) -> object:
        (folder / name).symlink_to("/dev/zero")
        return read(folder / name)

    return attack


def beside(read: Callable[[Path], object]) -> Attack:
    """Read the folder that a file lies in."""
    return lambda file: read(file.parent)


def zipped(entries: dict[str, bytes], read: Attack) -> Attack:
    """Pack an archive and read it."""

    def attack(folder: Path) -> object:
        with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in entries.items():
                archive.writestr(name, data)
        return read(folder / "a.zip")

    return attack


def into(file: Path) -> object:
    """Unpack a model beside its archive."""
    (file.parent / "out").mkdir()
    return unpack(file, file.parent / "out", (".obj",))


DEEP = "[" * 100_000
PARSERS: dict[str, tuple[Attack, str]] = {
    "json deep": (text("a.json", DEEP, read_json), "a.json: not readable as JSON: nested too deeply"),
    "json deep objects": (text("a.json", '{"a":' * 50_000, read_json), "not readable as JSON: nested too deeply"),
    "json digits": (text("a.json", "9" * 5000, read_json), "not readable as JSON: a number of 5000 digits"),
    "json infinite": (text("a.json", '{"x": 1e999}', read_json), "1e999 is not a finite number"),
    "json NaN": (text("a.json", '{"x": NaN}', read_json), "NaN is not a JSON number"),
    "json NUL": (
        text("a.json", '{"name": "a\\u0000b"}', read_json),
        "a text with a null character or an unpaired surrogate",
    ),
    "json half a pair": (text("a.json", '{"name": "\\ud800"}', read_json), "an unpaired surrogate"),
    "json bytes": (text("a.json", b"\xff\xfe{", read_json), "not readable as JSON"),
    "json pipe": (pipe("a.json", read_json), "a.json: is a pipe, not a file; allowed: regular files"),
    "json device": (device("a.json", read_json), "a.json: is a device, not a file"),
    "json folder": (read_json, "is a folder, not a file"),
    "json NUL in its name": (lambda folder: read_json(folder / "a\0b"), "its name has a null character"),
    "json long name": (lambda folder: read_json(folder / ("a" * 5000)), "cannot be opened: File name too long"),
    "toml deep": (text("a.toml", f"x = {DEEP}", read_toml), "not readable as TOML: nested too deeply"),
    "toml digits": (text("a.toml", f"x = {'9' * 5000}", read_toml), "not readable as TOML: Exceeds the limit"),
    "toml hexadecimal": (text("a.toml", f"seed = 0x{'f' * 9000}", load_scenario), "an integer of more than 64 bits"),
    "toml pipe": (pipe("a.toml", load_scenario), "is a pipe, not a file"),
    "toml large": (text("a.toml", b"#" * 10_000_001, read_toml), "too large: 0.0 GB; allowed: up to 0.01 GB"),
    "scenario long path": (
        text("a.toml", f'[stage]\npath = "{"a" * 300}"\n', load_scenario),
        "a path that cannot exist: File name too",
    ),
    "manifest without files": (text("artefact.json", "[]", read_manifest), "artefact.json: changed"),
    "photograph pipe": (pipe("a.jpg", beside(open_photographs)), "a.jpg: is a pipe, not a file"),
    "scan pipe": (
        pipe("a.laz", lambda scan: check_copy(scan, scan.with_name("b.laz"))),
        "a.laz: is a pipe, not a file",
    ),
    "photograph device": (device("a.jpg", beside(open_photographs)), "a.jpg: is a device, not a file"),
    "zip of a file and a folder": (
        zipped({"a": b"x", "a/b.obj": b"v 0 0 0\n"}, into),
        "cannot be unpacked|one name",
    ),
    "zip without a name": (zipped({"../x.obj": b"x"}, check_archive), "an entry leads out of the archive"),
    "zip bomb of surfaces": (
        zipped({"albedo.png": b"\0" * 9_000_000}, find_sets),
        "times its size; allowed: up to 200",
    ),
}


@pytest.mark.faults
@pytest.mark.parametrize("name", PARSERS)
def test_a_bomb_is_one_line(name: str, tmp_path: Path) -> None:
    """Deep, endless, enormous or nameless: the line says what is wrong, and stays one short line."""
    attack, words = PARSERS[name]
    with pytest.raises(InputError, match=words) as caught:
        attack(tmp_path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 2000


def changed(path: Path, key: tuple[str | int, ...], value: object) -> None:
    """Change one value of a JSON file; NaN and infinity as `1e999` and `NaN` stand there."""
    document = json.loads(path.read_text())
    inner = document
    for part in key[:-1]:
        inner = inner[part]
    inner[key[-1]] = value
    path.write_text(json.dumps(document))


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a capture of the planes that nobody changed."""
    return write_capture(tmp_path_factory.mktemp("sound") / "capture", poses_on_arc(2))


@pytest.fixture
def capture(sound: Path, tmp_path: Path) -> Path:
    """Give a copy of it to change."""
    copy = tmp_path / "capture"
    for path in sorted(sound.rglob("*")):
        target = copy / path.relative_to(sound)
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file():
            target.write_bytes(path.read_bytes())
    return copy


def truth_of(capture: Path) -> Truth:
    """Open the truth of a capture."""
    found = read_truth(read_capture(capture))
    assert found is not None
    return found


POSE = ("poses", 0, "camera_to_world")
TRUTHS: dict[str, tuple[str, tuple[str | int, ...], object, str]] = {
    "version": ("cameras.json", ("format_version",), 99, "format_version: Input should be 1"),
    "size": ("cameras.json", ("size",), [10**9, 10**9], "an image needs a width and a height"),
    "prior": ("cameras.json", ("prior", "focal_px"), -3.0, "prior.focal_px"),
    "path": ("cameras.json", ("images", 0, "file"), "../../etc/hostname", "a path that leads out of the capture"),
    "stem": ("cameras.json", ("images", 0, "name"), "../../x", "not a valid name of an image"),
    "long file": ("cameras.json", ("images", 0, "file"), "a" * 5000, "no such image"),
    "pose is NaN": ("truth/poses.json", (*POSE, 0, 0), float("nan"), "NaN is not a JSON number"),
    "pose scales": ("truth/poses.json", (*POSE, 0, 0), 7.0, "a pose that is not a rigid motion"),
    "pose mirrors": ("truth/poses.json", POSE, np.diag([1.0, 1.0, -1.0, 1.0]).tolist(), "not a rigid motion"),
    "pose is flat": ("truth/poses.json", POSE, [[1.0, 0.0], [0.0, 1.0]], "not the truth of a capture"),
    "focal": ("truth/poses.json", ("pinhole", "fx"), -420.0, "a focal length that is not positive"),
    "focal of text": ("truth/poses.json", ("pinhole", "fx"), "x", "a number that is not finite"),
    "width": ("truth/poses.json", ("pinhole", "width"), 481, "not the size that cameras.json states"),
    "id": ("truth/instances.json", ("instances", 0, "id"), -1, "an invalid row, or a duplicate id"),
    "id twice": ("truth/instances.json", ("instances", 0, "id"), 12, "a duplicate id"),
    "colour": ("truth/instances.json", ("classes", 0, "color"), [300, 0, 0], "classes: an invalid row"),
    "no list": ("truth/instances.json", ("instances",), 3, "not the truth of a capture"),
}


@pytest.mark.faults
@pytest.mark.parametrize("name", TRUTHS)
def test_a_truth_that_cannot_be_is_refused(name: str, capture: Path) -> None:
    """Poses, intrinsics, tables and names are checked when they are read, not when something comes out wrong."""
    file, key, value, words = TRUTHS[name]
    changed(capture / file, key, value)
    with pytest.raises(InputError, match=words):
        truth_of(capture)


SURFACES: dict[str, tuple[dict[str, object], str]] = {
    "index": ({"triangles": np.full((6, 3), 12, np.uint32)}, "triangles: values out of range"),
    "negative count": ({"part_count": np.array([-2, 2, 2], np.int32)}, "part_first: values out of range"),
    "part": ({"draw_part": np.array([0, 1, 3], np.int32)}, "draw_part: values out of range"),
    "NaN": ({"draw_transform": np.full((3, 4, 4), np.nan)}, "draw_transform: values out of range"),
    "type": ({"draw_label": np.zeros(3, np.float64)}, "draw_label is float64"),
    "objects": ({"draw_label": np.array([{}, {}, {}])}, "draw_label is object"),
}


@pytest.mark.faults
@pytest.mark.parametrize("name", SURFACES)
def test_a_surface_that_cannot_be_is_refused(name: str, capture: Path) -> None:
    """Indices, counts and types are compared with what is there before one of them is followed."""
    arrays, words = SURFACES[name]
    path = capture / "truth/surface.npz"
    with np.load(path) as stored:
        whole = {key: stored[key] for key in stored.files}
    np.savez_compressed(path, **{**whole, **arrays})
    with pytest.raises(InputError, match=words):
        truth_of(capture).surface()


@pytest.mark.proof_only
@pytest.mark.faults
def test_all_bombs(sound: Path, tmp_path: Path, record_proof: RecordProof) -> None:
    """How many of the files above are refused in one line, and how long the longest of these lines is."""
    lines: list[str] = []
    for number, (attack, words) in enumerate(PARSERS.values()):
        (tmp_path / f"{number}").mkdir()
        with pytest.raises(InputError, match=words) as caught:
            attack(tmp_path / f"{number}")
        lines.append(str(caught.value))
    for number, (file, key, value, words) in enumerate(TRUTHS.values()):
        copy = Path(shutil.copytree(sound, tmp_path / f"truth{number}", copy_function=shutil.copyfile))
        changed(copy / file, key, value)
        with pytest.raises(InputError, match=words) as caught:
            truth_of(copy)
        lines.append(str(caught.value))
    for number, (arrays, words) in enumerate(SURFACES.values()):
        copy = Path(shutil.copytree(sound, tmp_path / f"surface{number}", copy_function=shutil.copyfile))
        path = copy / "truth/surface.npz"
        with np.load(path) as stored:
            whole = {name: stored[name] for name in stored.files}
        np.savez_compressed(path, **{**whole, **arrays})
        with pytest.raises(InputError, match=words) as caught:
            truth_of(copy).surface()
        lines.append(str(caught.value))
    single = sum("\n" not in line for line in lines)
    assert single == len(lines)
    bombs = len(PARSERS) + len(TRUTHS) + len(SURFACES)
    record_proof("faults: bombs made by hand", bombs, 0, {"single_lines": single, "longest_line": max(map(len, lines))})


@pytest.mark.faults
def test_a_surface_that_claims_terabytes_allocates_nothing(capture: Path) -> None:
    """A header of 33 TiB in a file of some kilobytes, and parts drawn a hundred thousand million times."""
    path = capture / "truth/surface.npz"
    with np.load(path) as stored:
        whole = {key: stored[key] for key in stored.files}
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (3023656976384, 3), }"
    header = header.ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in whole.items():
            with archive.open(f"{name}.npy", "w") as member:
                if name == "positions":
                    member.write(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + b"\0" * 48)
                else:
                    np.lib.format.write_array(member, values, allow_pickle=False)
    with pytest.raises(InputError, match=r"positions states the shape \(3023656976384, 3\), but has 1[0-9]+ bytes"):
        truth_of(capture).surface()
    count = 20_000
    part = np.zeros(count, np.int32)
    triangles = np.zeros((count, 3), np.uint32)
    many = {
        **whole,
        "triangles": triangles,
        "part_first": np.zeros(1, np.int32),
        "draw_part": part,
        "part_count": np.full(1, count, np.int32),
        "draw_transform": np.tile(np.eye(4), (count, 1, 1)),
        "draw_instance": part.astype(np.uint32),
        "draw_label": part.astype(np.uint8),
    }
    np.savez_compressed(path, **many)
    with pytest.raises(InputError, match="draws 400000000 triangles; allowed: 100000000"):
        truth_of(capture).surface()


@pytest.mark.faults
def test_images_of_the_truth_are_of_its_size_and_kind(capture: Path) -> None:
    """Depth of another shape, labels in color, a photograph that claims to be enormous: all are refused."""
    truth, labels = truth_of(capture), capture / "truth/semantic/000000.png"
    depth = capture / "truth/depth"
    (depth / "000000.tiff").write_bytes((capture / "truth/semantic/000001.png").read_bytes())
    with pytest.raises(
        InputError, match=r"not an image of this truth \(found 'uint8 \(240, 320\)'\); allowed: float32"
    ):
        truth.depth(0)
    labels.write_bytes(encode_png(np.zeros((240, 319), np.uint8)))
    with pytest.raises(InputError, match=r"not the size that cameras.json states \(found \(319, 240\)\)"):
        truth.semantic(0)
    labels.write_bytes(encode_png(np.zeros((240, 320, 3), np.uint8)))
    with pytest.raises(InputError, match="not an image of this truth"):
        truth.semantic(0)
    data = (capture / "truth/semantic/000001.png").read_bytes()
    photograph = capture / "images/000000.jpg"
    photograph.write_bytes(data[:16] + (10**6).to_bytes(4) * 2 + data[24:])
    with pytest.raises(InputError, match=r"not the size that cameras.json states \(found \(1000000, 1000000\)\)"):
        load_image(read_capture(capture), 0)


@pytest.mark.faults
def test_a_cloud_that_claims_more_than_it_holds_is_refused(tmp_path: Path) -> None:
    """Columns that are a pipe, or claim 33 TiB or less than nothing, and a class whose name is no line of text."""
    write_cloud(tmp_path, small_cloud())
    column = tmp_path / "coord.npy"
    data = column.read_bytes()
    for rows in (b"3023656976384", b"-30"):
        column.write_bytes(data.replace(b"(300, 3), }", b"(%s, 3), }" % rows, 1)[: len(data)])
        with pytest.raises(InputError, match="damaged"):
            read_cloud(tmp_path)
    column.unlink()
    os.mkfifo(column)
    with pytest.raises(InputError, match="is a pipe, not a file"):
        read_cloud(tmp_path)
    column.unlink()
    column.write_bytes(data)
    changed(tmp_path / "cloud.json", ("classes", 0, "name"), "a\nb")
    with pytest.raises(InputError, match="a key is missing or of a wrong kind: classes"):
        read_cloud(tmp_path)


def test_words_of_the_command_line_that_nest_too_deep_stay_text() -> None:
    """`--set` takes what is no JSON as it stands, a hundred thousand brackets among them."""
    assert given_settings((f"x={DEEP}", "y=3")) == {"x": DEEP, "y": 3}


def test_a_picture_that_states_too_long_a_chunk_is_not_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenCV would set aside and clear the 4 GB that one byte states: every reader of pictures looks first."""
    whole = encode_png(np.zeros((8, 8), np.uint8))
    data = whole[:33] + b"\xff" + whole[34:]  # the length of the second chunk
    file = tmp_path / "concrete" / "rough" / "albedo.png"
    file.parent.mkdir(parents=True)
    file.write_bytes(data)
    (found,) = find_sets(tmp_path)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    with pytest.raises(InputError, match="cut off or damaged"):
        decode(file)
    with pytest.raises(InputError, match="cannot be decoded"):
        image_skin(data, "a texture")
    with pytest.raises(InputError, match="cannot be read"):
        place_set(found, tmp_path / "out", 2.0, 64)
    assert small_picture(file, 8) is None
