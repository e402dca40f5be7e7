"""Read files of ground control: surveyed points, scale bars, and their marks in photographs.

Two formats are read. `gcp_list.txt` of OpenDroneMap has the coordinate system in its first line, then one line for each
mark: easting, northing, height, column, row, image, and optionally the point's name. The other is Metashape's text
export: tables with a header line each, of points (`#Label,X/Easting,Y/Northing,Z/Altitude,Accuracy_(m)`), of marks
(`#Camera,Label,x_px,y_px`) and of scale bars (`#Label,Distance_(m),Accuracy_(m)`, the label being two names with `_`
between them); a table of marks may hold the coordinates, too.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePath

from groundwork.errors import InputError
from groundwork.foreign_file import read_regular
from recon.placing.map_projection import MapSystem, read_system

Triple = tuple[float, float, float]

_SIGMA = 0.03  # [m] error of a point surveyed by satellite, where the file states none
_BAR_SIGMA = 0.001  # [m]
_MOST_EAST, _MOST_NORTH = 180.0, 90.0  # [deg]
_PICTURES = (
    "jpg jpeg png tif tiff dng heic heif webp bmp jp2 exr jxl arw cr2 cr3 nef orf raf rw2"  # some are converted first
)
_SUFFIXES = tuple(f".{kind}" for kind in _PICTURES.split())
_LONGEST = 5_000_000  # [bytes] files of marks are far shorter
_HEADS: Mapping[str, tuple[str, ...]] = {
    "camera": ("camera", "image", "photo", "camera_label", "image_name", "photo_name"),
    "label": ("label", "marker", "point", "gcp", "name", "marker_label", "gcp_name", "point_id"),
    "u": ("x_px", "u", "im_x", "px", "x_proj", "x_(px)", "x_(pix)", "column"),
    "v": ("y_px", "v", "im_y", "py", "y_proj", "y_(px)", "y_(pix)", "row"),
    "east": ("x/east", "x/easting", "x/longitude", "easting", "east", "longitude", "lon", "geo_x", "x_(m)"),
    "north": ("y/north", "y/northing", "y/latitude", "northing", "north", "latitude", "lat", "geo_y", "y_(m)"),
    "up": ("z/altitude", "z/height", "altitude", "height", "z", "geo_z", "z_(m)", "elevation"),
    "sigma": ("accuracy_(m)", "accuracy", "xy_accuracy_(m)", "xy_accuracy"),
    "sigma_up": ("z_accuracy_(m)", "z_accuracy"),
    "distance": ("distance_(m)", "distance", "length_(m)", "length"),
}


@dataclass(frozen=True)
class Mark:
    """The pixel of a point in a photograph.

    Attributes:
        image: Name of the photograph, or its file.
        uv: The pixel [px].
    """

    image: str
    uv: tuple[float, float]


def image_key(name: str) -> str:
    """Return what a photograph's file and its label in other programs have in common: the file name without suffix.

    Args:
        name: File or label; a label may have dots of its own.
    """
    file = PurePath(name)
    return file.stem if file.suffix.lower() in _SUFFIXES else file.name


@dataclass
class ControlPoint:
    """A ground control point.

    Attributes:
        name: Its name.
        position: Coordinates as in the file; None of a point that was not surveyed.
        sigma: Standard deviation east, north and up [m].
        marks: Photographs that show it.
    """

    name: str
    position: Triple | None = None
    sigma: Triple = (_SIGMA, _SIGMA, _SIGMA)
    marks: list[Mark] = field(default_factory=list)


@dataclass(frozen=True)
class ScaleBar:
    """A measured distance between two points.

    Attributes:
        ends: Names of the points.
        length: Distance [m].
        sigma: Its standard deviation [m].
    """

    ends: tuple[str, str]
    length: float
    sigma: float


@dataclass(frozen=True)
class GroundControl:
    """The content of a file: coordinate system, points in the order of the file, and scale bars."""

    file: Path
    system: MapSystem
    points: tuple[ControlPoint, ...]
    bars: tuple[ScaleBar, ...] = ()


def read_ground_control(path: Path) -> GroundControl:
    """Read a file of ground control points, in the format of OpenDroneMap or of Metashape.

    Args:
        path: The file.

    Raises:
        MissingError: There is no such file.
        InputError: It is in neither format, or one of its lines is wrong; names the line.
    """
    if path.is_file() and path.stat().st_size > _LONGEST:
        raise InputError("too long for a file of ground control points", where=path, hint="Name the text file")
    try:
        text = read_regular(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("not a text file", where=path, hint="Name a gcp_list.txt, or a CSV file of markers") from None
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise InputError("the file is empty", where=path, hint="Name a gcp_list.txt, or a CSV file of markers")
    control = _read_tables(path, lines) if any(_heads(line) for _, line in lines) else _read_list(path, lines)
    _refuse_degrees(control)
    return control


def _refuse_degrees(control: GroundControl) -> None:
    """Refuse coordinates that are not plausible in the plane system of the file, but as longitude and latitude.

    Those of UTM are hundreds of kilometers; a plane system of the user's own may have small ones.
    """
    places = [point.position for point in control.points if point.position is not None]
    large = bool(control.system.zone) or control.system.assumed or "utm" in control.system.name.lower()
    if large and places and all(abs(east) <= _MOST_EAST and abs(north) <= _MOST_NORTH for east, north, _ in places):
        raise InputError(
            "the coordinates look like longitude and latitude, but the file states another system",
            where=control.file,
            field=control.system.name[:60],
            value=places[0],
            hint="For longitude and latitude write EPSG:4326; for a plane system of your own, LOCAL",
        )


def _read_list(path: Path, lines: list[tuple[int, str]]) -> GroundControl:
    """Read the format of OpenDroneMap."""
    system = read_system(lines[0][1])
    if system is None:
        raise InputError(
            "the first line names no coordinate system",
            where=path,
            field="line 1",
            value=lines[0][1][:60],
            allowed="EPSG:…, WGS84 UTM …N, a PROJ string; or tables with a header as from Metashape",
        )
    points: dict[str, ControlPoint] = {}
    for number, line in lines[1:]:
        if line.startswith("#"):
            continue
        cells = line.split("\t") if line.count("\t") >= 5 else _joined(line.split())
        if len(cells) < 6:
            raise InputError(
                "too few columns",
                where=path,
                field=f"line {number}",
                value=line[:60],
                allowed="easting northing height column row image [name]",
            )
        east, north, up, u, v = (_number(path, number, cell) for cell in cells[:5])
        name = cells[6] if len(cells) > 6 else f"{cells[0]} {cells[1]} {cells[2]}"
        _place(path, number, points.setdefault(name, ControlPoint(name)), (east, north, up))
        _mark(path, number, points[name], cells[5], (u, v))
    return GroundControl(path, system, tuple(points.values()))


def _joined(cells: list[str]) -> list[str]:
    """Join the sixth cell with the following ones up to the end of a file name that has spaces."""
    last = next((at for at in range(5, len(cells)) if PurePath(cells[at]).suffix.lower() in _SUFFIXES), 5)
    return [*cells[:5], " ".join(cells[5 : last + 1]), *cells[last + 1 :]] if len(cells) > 5 else cells


def _read_tables(path: Path, lines: list[tuple[int, str]]) -> GroundControl:
    """Read the format of Metashape."""
    points: dict[str, ControlPoint] = {}
    bars: list[tuple[int, str, dict[str, float]]] = []
    heads: dict[str, int] = {}
    system: MapSystem | None = None
    for number, line in lines:
        found = _heads(line)
        if found:
            heads = found
            if system is None and re.search(r"longitude|latitude|\b(lon|lat)\b", line, re.IGNORECASE):
                system = MapSystem("longitude and latitude", 0)
            continue
        if line.startswith("#"):
            system = read_system(line.lstrip("# ").partition("CoordinateSystem:")[2].strip()) or system
            continue
        cells = _cells(line)
        given = {key: cells[at] for key, at in heads.items() if at < len(cells) and cells[at] not in ("", "-")}
        if not heads or "label" not in given:
            raise InputError("a row without a name", where=path, field=f"line {number}", value=line[:60])
        numbers = {key: _number(path, number, given[key]) for key in given if key not in ("camera", "label")}
        if "distance" in heads:
            bars.append((number, given["label"], numbers))
            continue
        point = points.setdefault(given["label"], ControlPoint(given["label"]))
        if {"east", "north", "up"} <= numbers.keys():
            _place(path, number, point, (numbers["east"], numbers["north"], numbers["up"]))
        if "sigma" in numbers:
            along = _positive(path, number, numbers["sigma"])
            point.sigma = (along, along, _positive(path, number, numbers.get("sigma_up", along)))
        if "camera" in given:
            if not {"u", "v"} <= numbers.keys():
                raise InputError(
                    "a mark without pixel coordinates", where=path, field=f"line {number}", value=line[:60]
                )
            _mark(path, number, point, given["camera"], (numbers["u"], numbers["v"]))
    measured = tuple(_bar(path, number, label, numbers, points) for number, label, numbers in bars)
    return GroundControl(path, system or MapSystem("local", None), tuple(points.values()), measured)


def _heads(line: str) -> dict[str, int]:
    """Read a header line: column of each kind of cell; empty if the line is not a header."""
    cells = [cell.strip() for cell in _cells(line.lstrip("#"))]
    plain = [cell.lower().replace(" ", "_") for cell in cells]
    found = {key: plain.index(name) for key, names in _HEADS.items() for name in names if name in plain}
    marks = "camera" in found and "u" not in found
    if marks and "x" in cells and "y" in cells:  # small letters are pixels, capital letters are meters
        found |= {"u": cells.index("x"), "v": cells.index("y")}
    if "X" in cells and "Y" in cells and "Z" in cells:
        found |= {"east": cells.index("X"), "north": cells.index("Y"), "up": cells.index("Z")}
    elif "camera" not in found and {"x", "y", "z"} <= set(plain):
        found |= {"east": plain.index("x"), "north": plain.index("y"), "up": plain.index("z")}
    whole = "label" in found and ({"east", "north", "up"} <= found.keys() or "distance" in found or "u" in found)
    return found if whole else {}


def _cells(line: str) -> list[str]:
    separator = next((mark for mark in ("\t", ";", ",") if mark in line), None)
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _number(path: Path, line: int, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError("not a number", where=path, field=f"line {line}", value=cell[:60])
    return value


def _positive(path: Path, line: int, value: float) -> float:
    if not value > 0.0:
        raise InputError("an accuracy must be above 0", where=path, field=f"line {line}", value=value)
    return value


def _place(path: Path, line: int, point: ControlPoint, position: Triple) -> None:
    if point.position is not None and point.position != position:
        raise InputError(
            "one point has two positions", where=path, field=f"line {line}", value=point.name, hint="Rename one"
        )
    point.position = position


def _mark(path: Path, line: int, point: ControlPoint, image: str, uv: tuple[float, float]) -> None:
    if any(image_key(mark.image) == image_key(image) for mark in point.marks):
        raise InputError(
            f"the point {point.name} is marked twice in one image", where=path, field=f"line {line}", value=image
        )
    point.marks.append(Mark(image, uv))


def _bar(
    path: Path, line: int, label: str, numbers: Mapping[str, float], points: Mapping[str, ControlPoint]
) -> ScaleBar:
    splits = [(label[:at], label[at + 1 :]) for at, letter in enumerate(label) if letter == "_"]
    ends = next(((one, other) for one, other in splits if one in points and other in points), None)
    if ends is None or "distance" not in numbers:
        raise InputError(
            "a scale bar needs the names of two points joined by '_', and a distance",
            where=path,
            field=f"line {line}",
            value=label,
        )
    sigma = numbers.get("sigma", _BAR_SIGMA)
    return ScaleBar(ends, _positive(path, line, numbers["distance"]), _positive(path, line, sigma))
