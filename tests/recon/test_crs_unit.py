"""The unit of a LAS file is that of its projected system, whatever other units its records name."""

import struct

import pytest

from groundwork.length_units import METERS
from recon.formats.crs_unit import meters_per_height_unit, meters_per_unit

US_FOOT = 0.304800609601219
GEOGRAPHIC = 'GEOGCS["NAD83",DATUM["d",SPHEROID["GRS 1980",6378137,298.257]],UNIT["degree",0.0174532925199433]]'
FEET = (
    f'PROJCS["x",{GEOGRAPHIC},PROJECTION["p"],PARAMETER["false_easting",2000000],'
    'UNIT["US survey foot",0.304800609601219],AXIS["X",EAST]]'
)
WKT2 = (
    'PROJCRS["x",BASEGEOGCRS["b",DATUM["d",ELLIPSOID["e",6378137,298.2,LENGTHUNIT["metre",1.0]]]],'
    'CONVERSION["c",PARAMETER["False easting",5e5,LENGTHUNIT["metre",1]]],CS[Cartesian,2],AXIS["(E)",east,ORDER[1],'
    'LENGTHUNIT["foot",0.3048]],AXIS["(N)",north,ORDER[2],LENGTHUNIT["foot",0.3048]]]'
)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        (FEET, 0.304800609601219),
        (f'COMPD_CS["both",{FEET},VERT_CS["v",VERT_DATUM["d",2005],UNIT["metre",1.0]]]', 0.304800609601219),
        ('PROJCS["RD",GEOGCS["g",UNIT["degree",0.017]],UNIT["metre",1]]', 1.0),
        (WKT2, 0.3048),
        ('PROJCRS["x",CS[Cartesian,2],AXIS["e",east],AXIS["n",north],LENGTHUNIT["metre",1]]', 1.0),
        (GEOGRAPHIC, 0.0),
        ("nonsense [[[ ]", None),
        ('PROJCS["no unit"]', None),
        ("", None),
    ],
)
def test_well_known_text(text: str, unit: float | None) -> None:
    """Units of angles, ellipsoids, parameters and heights are not those of the map."""
    assert meters_per_unit({("LASF_Projection", 2112): text.encode() + b"\0"}) == unit


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        (f'COMPD_CS["both",{FEET},VERT_CS["v",VERT_DATUM["d",2005],UNIT["metre",1.0],AXIS["Up",UP]]]', 1.0),
        (
            f'COMPD_CS["both",PROJCS["p",UNIT["metre",1]],VERT_CS["v",VERT_DATUM["d",2005],UNIT["ft",{US_FOOT}]]]',
            US_FOOT,
        ),
        (f'COMPOUNDCRS["both",{WKT2},VERTCRS["v",VDATUM["d"],CS[vertical,1],AXIS["h",up,LENGTHUNIT["m",1]]]]', 1.0),
        (f'COMPOUNDCRS["both",{WKT2},VERTCRS["v",VDATUM["d"],CS[vertical,1],AXIS["h",up],LENGTHUNIT["m",1]]]', 1.0),
        (f'{FEET},VERTCS["NAVD88_height_ftUS",VDATUM["d"],PARAMETER["p",0.0],UNIT["Foot_US",{US_FOOT}]]', US_FOOT),
        (FEET, None),
        ("", None),
    ],
)
def test_heights_may_have_a_unit_of_their_own(text: str, unit: float | None) -> None:
    """The unit in the vertical system, whatever that of the map is."""
    assert meters_per_height_unit({("LASF_Projection", 2112): text.encode() + b"\0"}) == unit


def keys(*rows: tuple[int, int]) -> dict[tuple[str, int], bytes]:
    """Make the record of GeoTIFF keys with whole numbers as values."""
    table = b"".join(struct.pack("<4H", key, 0, 1, value) for key, value in rows)
    return {("LASF_Projection", 34735): struct.pack("<4H", 1, 1, 0, len(rows)) + table}


def test_geokeys() -> None:
    """Key 3076 says meter or foot; a geographic model has no length; a torn record says nothing."""
    assert meters_per_height_unit(keys((1024, 1), (3076, 9001), (4099, 9003))) == METERS["us-ft"]
    assert meters_per_height_unit(keys((1024, 1), (3076, 9001))) is None
    assert meters_per_unit(keys((1024, 1), (3076, 9001))) == 1.0
    assert meters_per_unit(keys((1024, 1), (3076, 9003))) == METERS["us-ft"]
    assert meters_per_unit(keys((1024, 2))) == 0.0
    assert meters_per_unit(keys((1024, 1))) is None
    torn = {place: data[:-5] for place, data in keys((1024, 1), (3076, 9001)).items()}
    assert meters_per_unit(torn) is None
    assert meters_per_unit({}) is None
