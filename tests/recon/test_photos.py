"""Plain photographs become a capture: what their EXIF says, what is guessed, and what does not go together."""

import contextlib
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.recon.photographs import control_errors, figures_of, photographs_page
from falsework.commands.verbs import reconstruct_folder
from groundwork.errors import InputError, MissingError, RejectedSceneError
from groundwork.progress import SILENT, Silent
from recon.cloud import read_cloud
from recon.photos.photo_header import read_header
from recon.photos.photos import local_position, open_photographs
from recon.placing.similarity import turn_upright
from recon.reconstruct import reconstruct
from recon.settings import ReconSettings, SparseSettings
from recon.truth.statistics import verdict_in_words
from render.capture import load_image
from render.images.exif import Shot, geodetic, insert_exif

ORIGIN = (46.2, -7.5, 420.0)
LARGER = 20.0  # photographs do not tell the size of what they show: GPS says that the planes are 200 m long
Place = tuple[float, float, float]


def jpeg(width: int = 64, height: int = 48) -> bytes:
    """Encode a grey JPEG without EXIF."""
    return cv2.imencode(".jpg", np.full((height, width, 3), 90, np.uint8))[1].tobytes()


def tagged(gps: Place | None, focal: float = 0.024, data: bytes | None = None) -> bytes:
    """Put our own EXIF into a JPEG of 64 x 48."""
    shot = Shot(focal, 0.036, 0.001, 0.0, gps, ORIGIN)
    return insert_exif(jpeg() if data is None else data, shot, 64, 48)


def tiff(lens: dict[int, tuple[int, bytes, int]], order: str = ">") -> bytes:
    """Write a TIFF structure of one exposure directory: tag to (type, value bytes, count)."""
    offset = 8 + 2 + 12 + 4
    head = struct.pack(order + "H", 1) + struct.pack(order + "HHII", 0x8769, 4, 1, offset) + struct.pack(order + "I", 0)
    rows, tail, at = b"", b"", offset + 2 + 12 * len(lens) + 4
    for tag, (kind, value, count) in sorted(lens.items()):
        rows += struct.pack(order + "HHI", tag, kind, count)
        if len(value) <= 4:
            rows += value.ljust(4, b"\x00")
        else:
            rows += struct.pack(order + "I", at + len(tail))
            tail += value
    mark = b"MM\x00*" if order == ">" else b"II*\x00"
    body = struct.pack(order + "H", len(lens)) + rows + struct.pack(order + "I", 0) + tail
    return mark + struct.pack(order + "I", 8) + head + body


def with_exif(data: bytes, exif: bytes) -> bytes:
    """Put a TIFF structure into a JPEG behind its first segment, as many cameras do."""
    end = 4 + struct.unpack(">H", data[4:6])[0]
    segment = b"Exif\x00\x00" + exif
    return data[:end] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + data[end:]


def test_our_own_exif_comes_back(tmp_path: Path) -> None:
    """Size, focal length from the equivalent of 35 mm, and a place that is right to a millimeter."""
    (tmp_path / "a.JPG").write_bytes(tagged((30.0, -20.0, 5.0)))
    header = read_header(tmp_path / "a.JPG")
    assert header.size == (64, 48)
    assert header.focal_px == pytest.approx(24.0 * 80.0 / 43.266615)
    assert header.place is not None
    np.testing.assert_allclose(np.array(header.place, np.float64), geodetic((30.0, -20.0, 5.0), ORIGIN), atol=1e-8)


@pytest.mark.parametrize(("order", "width", "focal"), [("<", 128, 8.8 * 12.8 / 2), (">", 64, 30.0 * 80.0 / 43.266615)])
def test_focal_length_from_the_sensor(tmp_path: Path, order: str, width: int, focal: float) -> None:
    """The pitch goes before the rounded equivalent in a shrunk photograph, unless the width at its taking was lost."""
    lens = {
        0x920A: (5, struct.pack(order + "II", 88, 10), 1),  # 8.8 mm
        0xA20E: (5, struct.pack(order + "II", 128, 1), 1),  # 128 pixels a centimeter
        0xA210: (3, struct.pack(order + "H", 3), 1),
        0xA002: (4, struct.pack(order + "I", width), 1),  # taken at twice the size
        0xA405: (3, struct.pack(order + "H", 30), 1),
    }
    (tmp_path / "a.jpg").write_bytes(with_exif(jpeg(), tiff(lens, order)))
    assert read_header(tmp_path / "a.jpg").focal_px == pytest.approx(focal)


@pytest.mark.parametrize(
    "exif",
    [
        b"",
        b"II*\x00",
        b"XX*\x00" + bytes(20),
        b"II*\x00\xff\xff\xff\x7f",
        tiff({0x920A: (5, struct.pack(">II", 8, 0), 1)}),
    ],
)
def test_damaged_exif_counts_as_none(tmp_path: Path, exif: bytes) -> None:
    """A photograph whose EXIF is cut, foreign or senseless still has a size."""
    (tmp_path / "a.jpg").write_bytes(with_exif(jpeg(), exif))
    header = read_header(tmp_path / "a.jpg")
    assert (header.size, header.focal_px, header.place) == ((64, 48), None, None)


def test_a_cut_header_is_an_error_or_a_header(tmp_path: Path) -> None:
    """Wherever a file is cut, reading its header gives its size or says so; nothing else is raised."""
    data = tagged((1.0, 2.0, 3.0))
    for end in range(0, len(data), 7):
        (tmp_path / "cut.jpg").write_bytes(data[:end])
        size = (64, 48)
        with contextlib.suppress(InputError):
            size = read_header(tmp_path / "cut.jpg").size
        assert size == (64, 48)


@pytest.mark.parametrize(("name", "at"), [("a.png", 16), ("a.png", 20), ("a.jpg", 163), ("a.jpg", 165)])
def test_a_photograph_without_pixels_is_named(name: str, at: int, tmp_path: Path) -> None:
    """A header that states no width or no height would otherwise give a camera without a center."""
    data = cv2.imencode(".png", np.zeros((48, 64, 3), np.uint8))[1].tobytes() if name == "a.png" else jpeg()
    width = 4 if name == "a.png" else 2
    (tmp_path / name).write_bytes(data[:at] + bytes(width) + data[at + width :])
    with pytest.raises(InputError, match=rf"{name}: states a width or height of 0 pixels \(found '(0 x|64 x 0)"):
        read_header(tmp_path / name)


def test_png_with_exif(tmp_path: Path) -> None:
    """PNG keeps its EXIF in a chunk of its own."""
    data = cv2.imencode(".png", np.zeros((48, 64, 3), np.uint8))[1].tobytes()
    exif = tiff({0xA405: (3, struct.pack(">H", 36), 1)})
    chunk = struct.pack(">I", len(exif)) + b"eXIf" + exif + struct.pack(">I", zlib.crc32(b"eXIf" + exif))
    (tmp_path / "a.png").write_bytes(data[:33] + chunk + data[33:])
    header = read_header(tmp_path / "a.png")
    assert header.size == (64, 48)
    assert header.focal_px == pytest.approx(36.0 * 80.0 / 43.266615)


def test_places_become_meters(tmp_path: Path) -> None:
    """East, north, up of the first that has a place, to a centimeter over hundreds of meters; the origin is kept."""
    places: list[Place] = [(0.0, 0.0, 0.0), (300.0, -150.0, 40.0), (-80.0, 220.0, -12.0)]
    for number, place in enumerate(places):
        (tmp_path / f"{number}.jpg").write_bytes(tagged(place))
    (tmp_path / "3.jpg").write_bytes(tagged(None))
    capture = open_photographs(tmp_path)
    found = np.array([image.gps for image in capture.images[:3]])
    np.testing.assert_allclose(found, places, atol=0.02)  # the curve of the earth makes 1 cm of it
    assert capture.images[3].gps is None
    assert capture.facts["origin"] == pytest.approx(
        {"latitude": ORIGIN[0], "longitude": ORIGIN[1], "height": ORIGIN[2]}
    )
    assert local_position(ORIGIN, ORIGIN) == (0.0, 0.0, 0.0)
    degree = local_position((ORIGIN[0] + 1e-3, ORIGIN[1], ORIGIN[2]), ORIGIN)
    assert degree[1] == pytest.approx(111.15, abs=0.03)  # a thousandth of a degree of latitude at 46 north
    assert degree[0] == pytest.approx(0.0, abs=1e-6)


def test_without_exif_the_focal_length_is_a_guess(tmp_path: Path) -> None:
    """1.2 times the longer side, said to be a guess; photographs may lie in `images`, other files do not count."""
    (tmp_path / "images").mkdir()
    for name in ("b.jpg", "a.JPEG", ".hidden.jpg", "notes.txt"):
        (tmp_path / "images" / name).write_bytes(jpeg(48, 64))
    capture = open_photographs(tmp_path)
    assert [image.file for image in capture.images] == ["images/a.JPEG", "images/b.jpg"]
    assert (capture.prior.focal_px, capture.prior.cx, capture.prior.cy) == (1.2 * 64, 24.0, 32.0)
    assert capture.facts["focal"] == "guessed"


def test_how_a_photograph_was_held(tmp_path: Path) -> None:
    """Orientation becomes quarter turns clockwise that make it upright; what a turned picture shows up, is up."""
    for name, orientation in (("a", 1), ("b", 6), ("c", 3), ("d", 8)):
        root = struct.pack("<H", 1) + struct.pack("<HHIHH", 0x0112, 3, 1, orientation, 0) + struct.pack("<I", 0)
        (tmp_path / f"{name}.jpg").write_bytes(with_exif(jpeg(), b"II*\x00" + struct.pack("<I", 8) + root))
    assert open_photographs(tmp_path).facts["quarter_turns"] == {"a": 0, "b": 1, "c": 2, "d": 3}
    stored = cv2.imread(str(tmp_path / "b.jpg"), cv2.IMREAD_IGNORE_ORIENTATION | cv2.IMREAD_COLOR)
    shown = cv2.imread(str(tmp_path / "b.jpg"))
    assert stored is not None
    assert shown is not None
    assert (stored.shape, shown.shape) == ((48, 64, 3), (64, 48, 3))
    # Turned clockwise by 90 degrees, the left side of the stored picture is on top: up is -x, and right is -y.
    upright = turn_upright(np.eye(3)[None], np.array([1]))[0]
    np.testing.assert_array_equal(upright[:, 0], [0.0, -1.0, 0.0])
    np.testing.assert_array_equal(-upright[:, 1], [-1.0, 0.0, 0.0])
    assert np.linalg.det(upright) == pytest.approx(1.0)


def test_a_rejected_folder_leaves_nothing(tmp_path: Path) -> None:
    """Two photographs are too few: the reason is raised, and no half of a cloud stays beside the output."""
    photographs = tmp_path / "photographs"
    photographs.mkdir()
    for name in ("a.jpg", "b.jpg"):
        (photographs / name).write_bytes(jpeg())
    with pytest.raises(RejectedSceneError) as rejected:
        reconstruct_folder(photographs, tmp_path / "cloud", ReconSettings(mode="sparse"), SILENT)
    assert rejected.value.reason == "too_few_images"
    assert [path.name for path in tmp_path.iterdir()] == ["photographs"]


def test_what_does_not_go_together(tmp_path: Path) -> None:
    """No photographs, two sizes, two lenses, one name twice, an empty file: one line that names the odd one."""
    with pytest.raises(MissingError, match="neither a capture nor photographs"):
        open_photographs(tmp_path)
    for name in ("a.jpg", "b.jpg"):
        (tmp_path / name).write_bytes(tagged(None))
    (tmp_path / "c.jpg").write_bytes(jpeg(32, 48))
    with pytest.raises(InputError, match=r"c\.jpg: 1 of 3 photographs are not 64 x 48 pixels"):
        open_photographs(tmp_path)
    (tmp_path / "c.jpg").write_bytes(tagged(None, 0.05))
    with pytest.raises(InputError, match=r"c\.jpg: photographs of different focal lengths"):
        open_photographs(tmp_path)
    (tmp_path / "c.jpg").write_bytes(b"")
    with pytest.raises(InputError, match=r"c\.jpg: the image is cut off"):
        open_photographs(tmp_path)
    (tmp_path / "c.jpg").unlink()
    (tmp_path / "a.png").write_bytes(b"")
    with pytest.raises(InputError, match="two photographs with the same name"):
        open_photographs(tmp_path)


def textured() -> NDArray[np.uint8]:
    """Make a picture that needs some bytes, shape (48, 64, 3), uint8."""
    return np.random.default_rng(0).integers(0, 256, (48, 64, 3)).astype(np.uint8)


@pytest.mark.parametrize("options", [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 2]])
def test_what_lies_behind_a_photograph_is_no_damage(options: list[int], tmp_path: Path) -> None:
    """A film, a preview or a maker's notes after the picture are left alone; wherever the picture is cut, it is cut."""
    data = cv2.imencode(".jpg", textured(), options)[1].tobytes()
    path = tmp_path / "a.jpg"
    wanted = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB)
    for behind in (b"", bytes(99), data, b"SEFT and a film " * 40):
        path.write_bytes(data + behind)
        np.testing.assert_array_equal(load_image(open_photographs(tmp_path), 0), wanted)
    for end in range(len(data) - 1, 700, -41):
        path.write_bytes(data[:end])
        with pytest.raises(InputError, match="cut off"):
            load_image(open_photographs(tmp_path), 0)


def test_gray_and_transparent_pictures_are_photographs(tmp_path: Path) -> None:
    """Gray is three equal colors, opacity is left out; 16 bits are one line."""
    picture = textured()
    clear = np.dstack([picture, picture[:, :, 0]])
    for name, stored, wanted in (
        ("grey", picture[:, :, 0], np.dstack([picture[:, :, 0]] * 3)),
        ("clear", clear, picture[:, :, ::-1]),
    ):
        (tmp_path / name).mkdir()
        cv2.imwrite(str(tmp_path / name / "a.png"), stored)
        np.testing.assert_array_equal(load_image(open_photographs(tmp_path / name), 0), wanted)
    (tmp_path / "deep").mkdir()
    cv2.imwrite(str(tmp_path / "deep" / "a.png"), picture.astype(np.uint16))
    with pytest.raises(InputError, match=r"a\.png: not an image with 8 bits"):
        load_image(open_photographs(tmp_path / "deep"), 0)


class Notes(Silent):
    """Writes down what people are told."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.notes = list[str]()

    def note(self, message: str) -> None:
        """Write a line down."""
        self.notes.append(message)


def test_the_last_line_counts_the_reasons() -> None:
    """Whoever reads nothing but the last line knows how many photographs are missing, and why."""
    status = ("ok", "no_overlap", "ok", "no_texture", "no_overlap")
    assert verdict_in_words(status, 1234, 1234, "in metres", []) == (
        "2 of 5 photographs ok (2 no_overlap, 1 no_texture), 1,234 points; in metres"
    )
    all_but_a_few = verdict_in_words(("ok",), 12, 5678, "in metres", [])
    assert all_but_a_few == "1 of 1 photographs ok, 12 of 5,678 points; in metres"
    for lost, said in ((["abutment", "cable"], "abutment, cable"), (["unlabelled"], "the points")):
        hint = f" (more than half of {said} left out as too uncertain: raise [recon] max_deviation to keep more)"
        assert verdict_in_words(("ok",), 12, 5678, "in metres", lost) == all_but_a_few.replace(";", f"{hint};")


@pytest.mark.usefixtures("no_children")
def test_bare_photographs_become_a_cloud(
    make_capture: Callable[..., Path], arc: Callable[[int], np.ndarray], tmp_path: Path
) -> None:
    """Nothing but pixels: cameras but a blank one registered, units unknown, upright, no label; a cut file is named."""
    capture = make_capture(tmp_path / "capture", arc(14)[4:9])
    bare, folder = capture / "images", tmp_path / "cloud"
    folder.mkdir()
    cut = (bare / "000002.jpg").read_bytes()
    (bare / "000002.jpg").write_bytes(cut[:20_000])
    with pytest.raises(InputError, match=r"000002\.jpg: the image is cut off or damaged"):
        reconstruct(bare, folder, ReconSettings(mode="sparse"), SILENT)
    (bare / "000002.jpg").write_bytes(cut)
    cv2.imwrite(str(bare / "000001b.jpg"), np.full((240, 320, 3), 200, np.uint8))
    listener = Notes()
    few = SparseSettings(max_features=700)
    reconstruct(bare, folder, ReconSettings(mode="sparse", sparse=few, max_reprojection_error=1.0), listener)
    cloud = read_cloud(folder)
    (said,) = listener.notes
    assert said.startswith(f"5 of 6 photographs ok (1 no_texture), {len(cloud):,} of ")
    assert said.endswith(" points; no truth and no GPS that fits: in its own units, upright, without labels")
    assert [row["status"] for row in cloud.cameras] == ["ok"] * 2 + ["no_texture"] + ["ok"] * 3
    assert (cloud.alignment["target"], cloud.alignment["unit"]) == ("none", "unknown")
    assert "own units" in cloud.alignment["note"]
    assert set(cloud.columns["segment"]) == {255}
    assert cloud.statistics["center_error_median"] is None
    found = cloud.statistics["camera_params"][0]
    assert found == pytest.approx(280.0, rel=0.03)  # the guess was 384
    heights = cloud.columns["coord"][:, 2]
    wall = cloud.columns["coord"][heights > np.median(heights)]
    flat = np.linalg.svd(wall - wall.mean(axis=0), full_matrices=False)[2][2]
    assert abs(flat[2]) < 0.2  # what stands in the world stands in the cloud
    page = photographs_page([("the wall", figures_of(folder))])
    assert f"| the wall | sparse | 5 of 6 | {len(cloud):,} | " in page
    assert page.endswith(" | nothing |  |  |\n")
    three = np.mean(cloud.columns["n_views"] >= 3)
    merged = sum(row["dropped"]["duplicate"] for row in cloud.statistics["classes"].values())
    assert f"% | {merged:,} | {three:.0%} | " in page
    turn, tilt = np.deg2rad(10.0), np.deg2rad(3.0)
    about_z = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(tilt), -np.sin(tilt)], [0.0, np.sin(tilt), np.cos(tilt)]])
    told = {
        "translation": [5.0, -4.0, 90.0],
        "origin": dict(zip(("latitude", "longitude", "height"), ORIGIN, strict=True)),
    }
    on_points = replace(cloud, alignment={**cloud.alignment, **told, "scale": 2.0, "rotation": np.eye(3).tolist()})
    middle = cloud.columns["coord"].astype(np.float64).mean(axis=0)
    turned = {"scale": 2.5, "rotation": (about_z @ about_x).tolist(), "translation": [0.0, 0.0, 0.0]}
    on_gps = replace(cloud, alignment={**cloud.alignment, **told, **turned})
    off = control_errors(on_gps, on_points)
    assert (off.scale, off.tilt, off.heading) == pytest.approx((25.0, 3.0, 10.0))
    there = 2.0 * middle @ (about_z @ about_x) / 2.5 + (5.0, -4.0, 90.0)
    assert off.place == pytest.approx(np.hypot(*(there - middle)[:2]))
    dense = {**figures_of(folder), "mode": "dense", "mean_reprojection_error": None}
    assert f"| the wall | dense | 5 of 6 | {len(cloud):,} |  |  | {three:.0%} | " in photographs_page(
        [("the wall", dense)]
    )


@pytest.mark.proof_only
def test_photographs_with_gps_become_a_cloud_in_meters(
    make_capture: Callable[..., Path], arc: Callable[[int], np.ndarray], tmp_path: Path
) -> None:
    """EXIF with places: scale, heading and place come from GPS, up from level photographs; no camera is judged out."""
    capture = make_capture(tmp_path / "capture", arc(10))
    rng = np.random.default_rng(3)
    poses = arc(10)
    bare, folder = tmp_path / "bare", tmp_path / "cloud"
    bare.mkdir()
    folder.mkdir()
    for row, pose in enumerate(poses):
        east, north, up = LARGER * pose[:3, 3] + rng.normal(0, 0.3, 3)
        shot = Shot(280.0 / 320 * 0.036, 0.036, 0.001, 0.0, (east, north, up), ORIGIN)
        data = (capture / "images" / f"{row:06d}.jpg").read_bytes()
        (bare / f"{row:06d}.jpg").write_bytes(insert_exif(data, shot, 320, 240))
    reconstruct(bare, folder, ReconSettings(mode="sparse", sparse=SparseSettings(max_features=1500)), SILENT)
    cloud = read_cloud(folder)
    assert cloud.alignment["target"] == "gps"
    assert cloud.alignment["unit"] == "m"
    assert cloud.alignment["origin"]["latitude"] == pytest.approx(ORIGIN[0], abs=1e-3)
    assert {row["status"] for row in cloud.cameras} == {"ok"}
    assert cloud.statistics["center_error_median"] < 0.6
    assert f" | {cloud.statistics['center_error_median']:.2f} | " in photographs_page([("x", figures_of(folder))])
    place = cloud.columns["coord"] / LARGER + poses[0, :3, 3]  # the origin is the first photograph's place
    assert np.mean((np.abs(place[:, 1] - 5.0) < 0.15) | (np.abs(place[:, 2]) < 0.15)) > 0.7
