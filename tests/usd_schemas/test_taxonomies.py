"""The tables of classes: every component has a row in each, and a stage that carries one is read by it."""

import re
from pathlib import Path

import pytest
from pxr import Usd

from groundwork.errors import InputError
from tests.usd_schemas.stages import SQUARE, read_body
from usd_schemas import tokens
from usd_schemas.apis import apply_taxonomy
from usd_schemas.components import BACKGROUND, NOISY_POINT, UNLABELED, class_of, class_rows, component_classes
from usd_schemas.reading.labels import read_taxonomy
from usd_schemas.taxonomies import BASE, TAXONOMIES, Taxonomy, taxonomy

FOLDER = Path(__file__).parents[2] / "usd_schemas/tables/taxonomies"
KINDS = tuple(component_classes())
SEMANTIC_BRIDGE = (
    "unlabeled",
    "ground",
    "high_vegetation",
    "abutment",
    "superstructure",
    "top_surface",
    "railing",
    "traffic_sign",
    "pillar",
)

# The predefined types of the entities that the IFC table names, from the EXPRESS schema IFC4X3_ADD2. Each has
# USERDEFINED and NOTDEFINED too; IfcBuilding has no predefined type.
IFC_TYPES = {
    "IfcBeam": "BEAM CORNICE DIAPHRAGM EDGEBEAM GIRDER_SEGMENT HATSTONE HOLLOWCORE JOIST LINTEL PIERCAP SPANDREL "
    "T_BEAM",
    "IfcBearing": "CYLINDRICAL DISK ELASTOMERIC GUIDE POT ROCKER ROLLER SPHERICAL",
    "IfcBridgePart": "ABUTMENT DECK DECK_SEGMENT FOUNDATION PIER PIER_SEGMENT PYLON SUBSTRUCTURE SUPERSTRUCTURE "
    "SURFACESTRUCTURE",
    "IfcBuilding": "",
    "IfcDoor": "BOOM_BARRIER DOOR GATE TRAPDOOR TURNSTILE",
    "IfcBuildingElementProxy": "COMPLEX ELEMENT PARTIAL PROVISIONFORSPACE PROVISIONFORVOID",
    "IfcCableCarrierSegment": "CABLEBRACKET CABLELADDERSEGMENT CABLETRAYSEGMENT CABLETRUNKINGSEGMENT CATENARYWIRE "
    "CONDUITSEGMENT DROPPER",
    "IfcColumn": "COLUMN PIERSTEM PIERSTEM_SEGMENT PILASTER STANDCOLUMN",
    "IfcCourse": "ARMOUR BALLASTBED CORE FILTER PAVEMENT PROTECTION",
    "IfcCovering": "CEILING CLADDING COPING FLOORING INSULATION MEMBRANE MOLDING ROOFING SKIRTINGBOARD SLEEVING "
    "TOPPING WRAPPING",
    "IfcDiscreteAccessory": "ANCHORPLATE BIRDPROTECTION BRACKET CABLEARRANGER ELASTIC_CUSHION EXPANSION_JOINT_DEVICE "
    "FILLER FLASHING INSULATOR LOCK PANEL_STRENGTHENING POINTMACHINEMOUNTINGDEVICE POINT_MACHINE_LOCKING_DEVICE "
    "RAILBRACE RAILPAD RAIL_LUBRICATION RAIL_MECHANICAL_EQUIPMENT SHOE SLIDINGCHAIR SOUNDABSORPTION "
    "TENSIONINGEQUIPMENT",
    "IfcEarthworksFill": "BACKFILL COUNTERWEIGHT EMBANKMENT SLOPEFILL SUBGRADE SUBGRADEBED TRANSITIONSECTION",
    "IfcElementAssembly": "ABUTMENT ACCESSORY_ASSEMBLY ARCH BEAM_GRID BRACED_FRAME CROSS_BRACING DECK "
    "DILATATIONPANEL ENTRANCEWORKS GIRDER GRID MAST PIER PYLON RAIL_MECHANICAL_EQUIPMENT_ASSEMBLY REINFORCEMENT_UNIT "
    "RIGID_FRAME SHELTER SIGNALASSEMBLY SLAB_FIELD SUMPBUSTER SUPPORTINGASSEMBLY SUSPENSIONASSEMBLY TRACKPANEL "
    "TRACTION_SWITCHING_ASSEMBLY TRAFFIC_CALMING_DEVICE TRUSS TURNOUTPANEL",
    "IfcFooting": "CAISSON_FOUNDATION FOOTING_BEAM PAD_FOOTING PILE_CAP STRIP_FOOTING",
    "IfcGeographicElement": "SOIL_BORING_POINT TERRAIN VEGETATION",
    "IfcGeotechnicalStratum": "SOLID VOID WATER",
    "IfcKerb": "",
    "IfcLightFixture": "DIRECTIONSOURCE POINTSOURCE SECURITYLIGHTING",
    "IfcMember": "ARCH_SEGMENT BRACE CHORD COLLAR MEMBER MULLION PLATE POST PURLIN RAFTER STAY_CABLE STIFFENING_RIB "
    "STRINGER STRUCTURALCABLE STRUT STUD SUSPENDER SUSPENSION_CABLE TIEBAR",
    "IfcPavement": "FLEXIBLE RIGID",
    "IfcPipeSegment": "CULVERT FLEXIBLESEGMENT GUTTER RIGIDSEGMENT SPOOL",
    "IfcPlate": "BASE_PLATE COVER_PLATE CURTAIN_PANEL FLANGE_PLATE GUSSET_PLATE SHEET SPLICE_PLATE STIFFENER_PLATE "
    "WEB_PLATE",
    "IfcRail": "BLADE CHECKRAIL GUARDRAIL RACKRAIL RAIL STOCKRAIL",
    "IfcRailing": "BALUSTRADE FENCE GUARDRAIL HANDRAIL",
    "IfcRoof": "BARREL_ROOF BUTTERFLY_ROOF DOME_ROOF FLAT_ROOF FREEFORM GABLE_ROOF GAMBREL_ROOF HIPPED_GABLE_ROOF "
    "HIP_ROOF MANSARD_ROOF PAVILION_ROOF RAINBOW_ROOF SHED_ROOF",
    "IfcSign": "MARKER MIRROR PICTORAL",
    "IfcSlab": "APPROACH_SLAB BASESLAB FLOOR LANDING PAVING ROOF SIDEWALK TRACKSLAB WEARING",
    "IfcSurfaceFeature": "DEFECT HATCHMARKING LINEMARKING MARK NONSKIDSURFACING PAVEMENTSURFACEMARKING RUMBLESTRIP "
    "SYMBOLMARKING TAG TRANSVERSERUMBLESTRIP TREATMENT",
    "IfcTendonAnchor": "COUPLER FIXED_END TENSIONING_END",
    "IfcTrackElement": "BLOCKINGDEVICE DERAILER FROG HALF_SET_OF_BLADES SLEEPER SPEEDREGULATOR TRACKENDOFALIGNMENT "
    "VEHICLESTOP",
    "IfcVehicle": "CARGO ROLLINGSTOCK VEHICLE VEHICLEAIR VEHICLEMARINE VEHICLETRACKED VEHICLEWHEELED",
    "IfcWall": "ELEMENTEDWALL MOVABLE PARAPET PARTITIONING PLUMBINGWALL POLYGONAL RETAININGWALL SHEAR SOLIDWALL "
    "STANDARD WAVEWALL",
    "IfcWasteTerminal": "FLOORTRAP FLOORWASTE GULLYSUMP GULLYTRAP ROOFDRAIN WASTEDISPOSALUNIT WASTETRAP",
    "IfcWindow": "LIGHTDOME SKYLIGHT WINDOW",
}


@pytest.mark.parametrize("name", TAXONOMIES)
def test_every_component_has_a_row(name: str) -> None:
    """Each component leads to a class; LAS keeps the codes from 64 + id on for users, and they end at 127."""
    table = taxonomy(name)
    assert [kind for kind in KINDS if kind not in table.classes] == []
    ids = {table.row_of(kind).id for kind in KINDS}
    assert ids <= set(range(64)) - {NOISY_POINT}


@pytest.mark.parametrize("name", TAXONOMIES)
def test_rows_are_unique_and_fit_a_byte(name: str) -> None:
    """Ids, names and colors differ; 0 is what the sky shows, and 16 and 255 keep their meaning in every table."""
    rows = taxonomy(name).rows
    assert [row.id for row in rows] == sorted({row.id for row in rows})
    assert len({row.name for row in rows}) == len({row.color for row in rows}) == len(rows)
    assert all(0 <= value <= 255 for row in rows for value in (row.id, *row.color))
    reserved = {row.id: row.name for row in rows if row.id in (NOISY_POINT, UNLABELED)}
    assert reserved == {NOISY_POINT: "noisy_point", UNLABELED: "unlabelled"}
    assert rows[0].id == BACKGROUND
    assert taxonomy(name).row_of("sky") == rows[0]


@pytest.mark.parametrize("name", TAXONOMIES)
def test_labels_of_the_base_table_lead_on(name: str) -> None:
    """What says a class of the base table and no component has a class too; a name that is both means the same."""
    table = taxonomy(name)
    known = {row.name for row in class_rows()} - {"noisy_point", "unlabelled"}
    assert set(table.classes) == known | set(KINDS)
    for kind in known & set(KINDS):
        assert table.class_of(kind, class_of(kind)) == table.class_of("", kind)


def test_a_label_stands_once_in_a_file() -> None:
    """No table sorts one label into two classes, and no file is left out of the list."""
    files = sorted(FOLDER.glob("*.toml"))
    assert {file.stem for file in files} == set(TAXONOMIES) - {BASE}
    for file in files:
        words = re.findall(r'"(\w+)"', "".join(re.findall(r"^components = \[(.*?)\]", file.read_text(), re.M | re.S)))
        assert sorted(words) == sorted(KINDS), file.name


def test_published_ids() -> None:
    """Tables of published data sets have the ids of their files."""
    rows = taxonomy("semanticbridge").rows
    assert tuple(row.name for row in rows if row.id <= 8) == SEMANTIC_BRIDGE
    assert {row.name for row in taxonomy("kim2023").rows if row.id <= 3} == {"background", "column", "pier_cap", "deck"}
    assert taxonomy(BASE).rows == class_rows()
    assert all(taxonomy(BASE).row_of(kind).name == name for kind, name in component_classes().items())


def test_ifc_names_stand_in_the_standard() -> None:
    """Each class but the first is an IFC 4.3 entity with, after a point, one of its predefined types."""
    names = [row.name for row in taxonomy("ifc43").rows if row.id not in (BACKGROUND, NOISY_POINT, UNLABELED)]
    entities = {name.partition(".")[0] for name in names}
    assert entities == set(IFC_TYPES)
    for name in names:
        entity, point, kind = name.partition(".")
        assert bool(point) == (entity != "IfcBuilding")
        assert not point or kind in {*IFC_TYPES[entity].split(), "NOTDEFINED"}, name


def test_unknown_names_are_bad_input() -> None:
    """Messages list what is allowed."""
    with pytest.raises(InputError, match=r"unknown taxonomy .*'kim'.*kim2023"):
        taxonomy("kim")
    with pytest.raises(InputError, match=r"no class in the taxonomy kim2023 .*'girdr'"):
        taxonomy("kim2023").row_of("girdr")


@pytest.mark.parametrize("name", TAXONOMIES)
def test_a_stage_carries_the_whole_table(name: str) -> None:
    """What is authored is read back: name, classes and the map, without a warning."""
    stage = Usd.Stage.CreateInMemory()
    apply_taxonomy(stage.DefinePrim(tokens.SEMANTIC_VAR), taxonomy(name))
    found = read_taxonomy(stage, pytest.fail)
    expected = taxonomy(name)
    assert found == Taxonomy(name, expected.rows, expected.classes)


def stage_with(table: str, *prims: tuple[str, str]) -> str:
    """Write a stage with a table on it and one square for each component and class."""
    squares = "".join(
        f'def Mesh "M{place}" {{\n{SQUARE}\n'
        + "".join(
            f'token[] semantics:labels:{kind} = ["{value}"]\n'
            for kind, value in (("component", c), ("class", k))
            if value
        )
        + "}\n"
        for place, (c, k) in enumerate(prims)
    )
    return f'def "Render" {{\ndef "Vars" {{\ndef RenderVar "semantic" {{\n{table}\n}}\n}}\n}}\n{squares}'


ZOO = """uniform token[] falsework:classNames = ["none", "animal", "plant", "column"]
uniform int[] falsework:classIds = [0, 3, 4, 8]
uniform token[] falsework:labelNames = ["zebra", "tree", "background", "pier_cap"]
uniform token[] falsework:labelClasses = ["animal", "plant", "none", "column"]"""


def test_a_table_of_ones_own(tmp_path: Path) -> None:
    """A map on the stage leads from components, also unknown ones, and from classes; a class of its own stands."""
    prims = [("zebra", ""), ("tree", "background"), ("", "background"), ("", "animal"), ("tree", "pier_cap")]
    scene = read_body(tmp_path, stage_with(ZOO, *prims))
    assert scene.draws.label.tolist() == [3, 4, 0, 3, 8]
    assert [row.class_name for row in scene.instances] == ["animal", "plant", "none", "animal", "column"]
    assert not any("class" in line for line in scene.warnings)


def test_a_broken_map_is_named(tmp_path: Path) -> None:
    """A map into classes that the table lacks is left out, and a reserved id with another name is spoken of."""
    table = ZOO.replace('"plant", "none", "column"', '"weed", "none", "column"').replace("4, 8", "4, 16")
    scene = read_body(tmp_path, stage_with(table, ("tree", "column")))
    assert scene.draws.label.tolist() == [16]
    assert any("labelNames and labelClasses" in line for line in scene.warnings)
    assert any("class id 16 is reserved for noisy_point: it is not 'column'" in line for line in scene.warnings)
