"""Files of ground control: both forms are read, systems are known by their names, bad files are one line."""

from pathlib import Path

import numpy as np
import pycolmap
import pytest

from groundwork.errors import InputError
from recon.placing.ground_control import ScaleBar, image_key, read_ground_control
from recon.placing.map_projection import MapSystem, read_system
from tests.recon.test_ground_control import CORNERS, flown, marked


def test_degrees_are_not_meters(tmp_path: Path) -> None:
    """Degrees under the name of a plane system are refused before anything is computed; short headers name degrees."""
    path = tmp_path / "gcp.txt"
    for name in ("EPSG:25832", "EPSG:32632", "WGS84 UTM 32N", "+proj=utm +zone=32 +ellps=GRS80 +units=m"):
        path.write_text(f"{name}\n11.5 48.1 500 3 4 a.jpg P\n", encoding="utf-8")
        with pytest.raises(InputError, match="look like longitude and latitude"):
            read_ground_control(path)
    assert [getattr(read_system(f"+proj=lcc {unit}"), "assumed", None) for unit in ("", "+units=ft", "+units=ch")] == [
        False,
        False,
        True,
    ]
    path.write_text("label,lon,lat,altitude\nP,11.5,48.1,500\n", encoding="utf-8")
    assert read_ground_control(path).system.zone == 0


def test_names_of_photographs_with_dots_and_spaces(tmp_path: Path) -> None:
    """Only the suffix of a picture is left out of a label, and a name may have spaces."""
    path = tmp_path / "gcp.txt"
    path.write_text("LOCAL\n1 2 3 4 5 DJI 0001.JPG P\n1 2 3 6 7 DJI 0002.JPG P\n", encoding="utf-8")
    (point,) = read_ground_control(path).points
    assert (point.name, [mark.image for mark in point.marks]) == ("P", ["DJI 0001.JPG", "DJI 0002.JPG"])
    path.write_text("#Camera,Label,x,y\nframe.000,P,4,5\nframe.011,P,6,7\n", encoding="utf-8")
    (point,) = read_ground_control(path).points
    assert len(point.marks) == 2
    assert {image_key(f"frame.000{suffix}") for suffix in ("", ".jpg", ".NEF", ".heic")} == {"frame.000"}


def test_both_forms_say_the_same(tmp_path: Path) -> None:
    """A gcp_list.txt and Metashape's tables of the same points give the same points, marks and coordinates."""
    _, _, _, true = flown()
    away = np.array([500_000.0, 5_000_000.0, 100.0])
    there = true.copy()
    there[:, :3, 3] += away
    points = marked(CORNERS + away, there)
    rows = [(point, mark) for point in points for mark in point.marks]
    listed = "\n".join(
        [
            "WGS84 UTM 32N",
            *(f"{' '.join(map(repr, p.position or ()))} {m.uv[0]!r} {m.uv[1]!r} {m.image} {p.name}" for p, m in rows),
        ]
    )
    (tmp_path / "gcp_list.txt").write_text(listed + "\n", encoding="utf-8")
    tables = "\n".join(
        [
            '# CoordinateSystem: PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84"]]',
            "#Label,X/Easting,Y/Northing,Z/Altitude,Accuracy_(m)",
            *(f'"{p.name}",{",".join(map(repr, p.position or ()))},0.03' for p in points),
            "#Camera,Label,x,y",
            *(f"{m.image[:-4]},{p.name},{m.uv[0]!r},{m.uv[1]!r}" for p, m in rows),
            "#Label,Distance_(m),Accuracy_(m)",
            "P0_P1,60.0083,0.002",
        ]
    )
    (tmp_path / "markers.csv").write_text(tables, encoding="utf-8")
    one, other = read_ground_control(tmp_path / "gcp_list.txt"), read_ground_control(tmp_path / "markers.csv")
    assert one.system.zone == other.system.zone == 32
    assert [(p.name, p.position, p.sigma) for p in one.points] == [(p.name, p.position, p.sigma) for p in other.points]
    assert [[mark.uv for mark in p.marks] for p in one.points] == [[mark.uv for mark in p.marks] for p in other.points]
    assert other.bars == (ScaleBar(("P0", "P1"), 60.0083, 0.002),)


@pytest.mark.parametrize(
    ("name", "zone"),
    [
        ("EPSG:32633", 33),
        ("epsg:32733", -33),
        ("WGS84 UTM 10N", 10),
        ("WGS84 UTM 17S", -17),
        ("EPSG:4326", 0),
        ("urn:ogc:def:crs:EPSG::32633", 33),
        ("ETRS89 / UTM zone 32N [EPSG:25832]", None),
        ("+proj=utm +zone=15 +ellps=WGS84 +datum=WGS84 +units=m +no_defs", 15),
        ("EPSG:25832", None),
        ("EPSG:4258", 0),
        ('COMPD_CS["WGS 84 + EGM96",GEOGCS["WGS 84",UNIT["degree",0.0174]],VERT_CS["EGM96",UNIT["metre",1]]]', 0),
        ("+proj=utm +zone=55 +south +datum=WGS84", -55),
        ("+proj=longlat +datum=WGS84", 0),
        ("LOCAL", None),
    ],
)
def test_systems_by_their_names(name: str, zone: int | None) -> None:
    """EPSG codes, PROJ strings and OpenDroneMap's own names; a plane system of another kind is taken as it is."""
    found = read_system(name)
    assert found is not None
    assert found.zone == zone
    assert read_system("481367 5782936 100 3 4 a.jpg") is None


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("+proj=tmerc +to_meter=1200/3937 +vto_meter=1e-2", (1200.0 / 3937.0, 0.01, False)),
        ("+proj=tmerc +to_meter=1/0", (1.0, 1.0, True)),
        ("+proj=utm +zone=32 +datum=WGS84 +units=us-in", (1.0, 1.0, True)),
        ("+proj=longlat +datum=WGS84 +vunits=ft", (1.0, 0.3048, False)),
        ('COMPD_CS["a",PROJCS["x",UNIT["foot",0.3048]],VERT_CS["h",UNIT["bad",e]]]', (0.3048, 0.3048, False)),
        ('PROJCS["x",UNIT["metre",-1]]', (1.0, 1.0, True)),
    ],
)
def test_units_by_their_lengths(name: str, units: tuple[float, float, bool]) -> None:
    """Fractions and powers as PROJ allows them; what is no length is none, and meters are assumed."""
    found = read_system(name)
    assert found is not None
    assert (found.unit, found.up_unit, found.assumed) == units


def test_utm_against_colmap() -> None:
    """Latitude and longitude of UTM coordinates in both halves of the earth, against COLMAP's, to a millimeter."""
    rng = np.random.default_rng(0)
    for zone in (1, 17, 33, 60, -4, -55):
        low, high = (1.0, 80.0) if zone > 0 else (-75.0, -1.0)
        places = np.column_stack(
            [rng.uniform(low, high, 40), 6.0 * abs(zone) - 183.0 + rng.uniform(-2.9, 2.9, 40), rng.uniform(0, 900, 40)]
        )
        there, number = pycolmap.GPSTransform().ellipsoid_to_utm(places)
        assert abs(number) == abs(zone)
        found = MapSystem("", zone).geographic(np.asarray(there, np.float64))
        np.testing.assert_allclose(found[:, :2], places[:, :2], atol=1e-8)


BAD = {
    "": "the file is empty",
    "hello\n1 2 3 4 5 a.jpg": "the first line names no coordinate system",
    "EPSG:32633\n1 2 3 4 a.jpg": "line 2: too few columns",
    "EPSG:32633\n1 2 x 4 5 a.jpg": "line 2: not a number",
    "EPSG:32633\n1 2 nan 4 5 a.jpg": "line 2: not a number",
    "EPSG:32633\n1 2 3 4 5 a.jpg P\n1 2 4 4 5 b.jpg P": "line 3: one point has two positions",
    "EPSG:32633\n1 2 3 4 5 a.jpg P\n1 2 3 4 5 a.jpg P": "line 3: the point P is marked twice",
    "#Label,X,Y,Z,Accuracy\nP,1,2,3,0": "line 2: an accuracy must be above 0",
    "#Label,X,Y,Z\n,1,2,3": "line 2: a row without a name",
    "#Camera,Label,x,y\na,P,3": "line 2: a mark without pixel coordinates",
    "#Label,Distance\nP_Q,3": "line 2: a scale bar needs the names of two points",
}


@pytest.mark.parametrize("text", BAD)
def test_a_bad_file_is_one_line(text: str, tmp_path: Path) -> None:
    """Whatever is wrong with a file, one line names the file, the line and the mend."""
    path = tmp_path / "gcp.txt"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_ground_control(path)
    assert str(path) in str(caught.value)
    assert BAD[text] in str(caught.value)
    assert "\n" not in str(caught.value)
