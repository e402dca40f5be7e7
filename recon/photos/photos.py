"""A folder of photographs as a capture: one of ours with its `cameras.json`, or any other with its EXIF."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError, MissingError
from groundwork.output.reading import reading
from recon.photos.photo_header import PhotoHeader, read_header
from render.capture import CAMERAS, CalibrationPrior, Capture, CaptureImage, Triple, read_capture

F64 = NDArray[np.float64]

PHOTOGRAPHS = "photographs"  # the survey id of a folder without cameras.json
FOCAL_GUESSED, FOCAL_FROM_EXIF = "guessed", "exif"
_SUFFIXES = (".jpg", ".jpeg", ".png")
_GUESS = 1.2  # focal length over the longer side: 55 degrees; COLMAP's own guess, too
_SIGMA = (2.0, 2.0, 3.0)  # [m] if the receiver states none: within one flight, and the offset of the whole flight
_UPWARDS = 1.5  # ratio of a receiver's vertical to its horizontal error
_UNKNOWN = (None, None, None)
Place = tuple[float, float, float | None]
_SAME_LENS = 0.1  # greatest relative difference of focal lengths that share one calibration
_EARTH_A, _EARTH_E2 = 6_378_137.0, 6.694_379_990_14e-3  # WGS 84


def open_photographs(folder: Path) -> Capture:
    """Open a capture, or a folder of plain photographs.

    Only the photographs in the folder itself are used; if there are none, those in its folder `images`. Positions
    become meters east, north and up of the first photograph that has one; `facts` keeps that origin. A position without
    height gets the median height of the others, and null as its deviation up in `gps_sigmas`.

    Args:
        folder: With `cameras.json`, or with JPEG or PNG files.

    Raises:
        MissingError: The folder holds neither.
        InputError: Photographs of different sizes or lenses, two of one name, or one that is cut off in its header.
    """
    with reading(folder):
        return _open_photographs(folder)


def _open_photographs(folder: Path) -> Capture:
    if (folder / CAMERAS).is_file():
        return read_capture(folder)
    paths = _photographs(folder) or _photographs(folder / "images")
    if not paths:
        raise MissingError(
            "neither a capture nor photographs: no cameras.json, no .jpg, .jpeg or .png",
            where=folder,
            hint="Name the folder that holds the photographs",
        )
    headers = [read_header(path) for path in paths]
    size = _common_size(folder, paths, headers)
    prior, source = _prior(folder, paths, headers, size)
    facts: dict[str, object] = {"kind": PHOTOGRAPHS, "focal": source}
    places, origin = _local_places(headers)
    if any(header.quarter_turns for header in headers):
        facts["quarter_turns"] = {path.stem: header.quarter_turns for path, header in zip(paths, headers, strict=True)}
    if any(header.drone.up for header in headers):
        facts["gimbal"] = {path.stem: header.drone.up or _UNKNOWN for path, header in zip(paths, headers, strict=True)}
    sigmas = [_sigma(header) for header in headers]
    sigma = _usual([told for told in sigmas if told is not None])
    if origin is not None:
        facts["gps_sigmas"] = {
            path.stem: _without_height(told or sigma) if header.place and header.place[2] is None else told or sigma
            for path, header, told in zip(paths, headers, sigmas, strict=True)
        }
        facts["gps_bias"] = sigma  # the shared error is as large, and cannot be estimated from the positions
        facts["origin"] = {"latitude": origin[0], "longitude": origin[1], "height": origin[2]}
    images = tuple(
        CaptureImage(name=path.stem, file=path.relative_to(folder).as_posix(), gps=place)
        for path, place in zip(paths, places, strict=True)
    )
    return Capture(folder, PHOTOGRAPHS, size, prior, sigma, facts, images)


def fix_sigmas(capture: Capture) -> F64:
    """List the stated standard deviation of each position.

    Args:
        capture: Photographs.

    Returns:
        East, north and up [m], shape (N, 3), float64, one row per image; infinite where no height was measured.
    """
    told = capture.facts.get("gps_sigmas")
    if not isinstance(told, dict):
        return np.tile(np.array(capture.gps_sigma), (len(capture.images), 1))
    sigmas = np.array([np.array(told[image.name], np.float64) for image in capture.images], np.float64)
    return np.where(np.isnan(sigmas), np.inf, sigmas)


def local_position(place: tuple[float, float, float], origin: tuple[float, float, float]) -> tuple[float, float, float]:
    """Turn a position on the earth into meters east, north and up of an origin.

    Source: the rotation between geocentric and topocentric axes, EPSG Guidance Note 7-2, 4.1.2.

    Args:
        place: Latitude [deg], longitude [deg], height above the ellipsoid [m].
        origin: Latitude [deg], longitude [deg], height above the ellipsoid [m] of the local origin.

    Returns:
        East, north, up [m].
    """
    latitude, longitude = np.deg2rad(origin[:2])
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    axes = np.array(
        [
            [-sin_lon, cos_lon, 0.0],
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
        ]
    )
    east, north, up = axes @ (_geocentric(place) - _geocentric(origin))
    return float(east), float(north), float(up)


def _geocentric(place: tuple[float, float, float]) -> F64:
    latitude, longitude = np.deg2rad(place[:2])
    radius = _EARTH_A / np.sqrt(1.0 - _EARTH_E2 * np.sin(latitude) ** 2)
    flat = (radius + place[2]) * np.cos(latitude)
    return np.array(
        [
            flat * np.cos(longitude),
            flat * np.sin(longitude),
            (radius * (1.0 - _EARTH_E2) + place[2]) * np.sin(latitude),
        ]
    )


def _photographs(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    found = sorted(p for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES and not p.name.startswith("."))
    stems = [path.stem for path in found]
    for stem, path in zip(stems, found, strict=True):
        if stems.count(stem) > 1:
            raise InputError(
                "two photographs with the same name", where=folder, value=path.name, hint="Rename one of them"
            )
    return found


def _common_size(folder: Path, paths: list[Path], headers: list[PhotoHeader]) -> tuple[int, int]:
    sizes = [header.size for header in headers]
    usual = max(sorted(set(sizes)), key=sizes.count)
    for path, size in zip(paths, sizes, strict=True):
        if size != usual:
            raise InputError(
                f"{len(sizes) - sizes.count(usual)} of {len(sizes)} photographs are not {usual[0]} x {usual[1]} pixels",
                where=folder,
                field=path.name,
                value=size,
                hint="Put the photographs of each camera into a separate folder",
            )
    return usual


def _prior(
    folder: Path, paths: list[Path], headers: list[PhotoHeader], size: tuple[int, int]
) -> tuple[CalibrationPrior, str]:
    told = [header.focal_px for header in headers if header.focal_px is not None]
    focal = float(np.median(told)) if told else _GUESS * max(size)
    for path, header in zip(paths, headers, strict=True):
        if header.focal_px is not None and abs(header.focal_px / focal - 1.0) > _SAME_LENS:
            raise InputError(
                "photographs of different focal lengths",
                where=folder,
                field=path.name,
                value=f"{header.focal_px:.0f} px",
                allowed=f"{focal:.0f} px like most of the others, within 10 %",
                hint="Put the photographs of each focal length into a separate folder",
            )
    prior = CalibrationPrior(focal_px=focal, cx=size[0] / 2.0, cy=size[1] / 2.0)
    return prior, FOCAL_FROM_EXIF if told else FOCAL_GUESSED


def _local_places(headers: list[PhotoHeader]) -> tuple[list[Triple | None], Triple | None]:
    told = [header.place[2] for header in headers if header.place is not None and header.place[2] is not None]
    usual = float(np.median(told)) if told else 0.0
    places = [None if header.place is None else _with_height(header.place, usual) for header in headers]
    origin = next((place for place in places if place is not None), None)
    if origin is None:
        return [None] * len(headers), None
    return [local_position(place, origin) if place else None for place in places], origin


def _with_height(place: Place, usual: float) -> Triple:
    latitude, longitude, height = place
    return latitude, longitude, usual if height is None else height


def _without_height(sigma: Triple) -> tuple[float, float, None]:
    return sigma[0], sigma[1], None


def _sigma(header: PhotoHeader) -> tuple[float, float, float] | None:
    """Take the error that the receiver stated: per axis, else horizontal."""
    along = header.place_sigma
    return header.drone.sigmas or (None if along is None else (along, along, _UPWARDS * along))


def _usual(told: list[tuple[float, float, float]]) -> tuple[float, float, float]:
    if not told:
        return _SIGMA
    east, north, up = np.median(np.array(told), axis=0)
    return float(east), float(north), float(up)
