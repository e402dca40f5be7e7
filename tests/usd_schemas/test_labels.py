"""Classes and instance ids: the nearest label wins, authored ids stay, the rest are numbered in path order."""

from pathlib import Path

import pytest

from tests.usd_schemas.stages import SQUARE, read_body
from usd_schemas.components import class_id, class_rows
from usd_schemas.flat_scene import FlatScene

LABELED = 'apiSchemas = ["SemanticsLabelsAPI:class", "SemanticsLabelsAPI:component"]'


def classes(scene: FlatScene) -> dict[str, str]:
    """Map instance paths to class names as the draws carry them."""
    names = {row.id: row.name for row in scene.classes}
    paths = {row.id: row.path for row in scene.instances}
    drawn = zip(scene.draws.instance.tolist(), scene.draws.label.tolist(), strict=True)
    return {paths[number]: names[label] for number, label in drawn}


def mesh(name: str, content: str = "", schemas: str = "") -> str:
    """Write a square with further lines."""
    return f'def Mesh "{name}" ({schemas}) {{\n{SQUARE}\n{content}\n}}\n'


def label(taxonomy: str, value: str) -> str:
    """Write a LabelsAPI label."""
    return f'token[] semantics:labels:{taxonomy} = ["{value}"]\n'


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (label("class", "deck"), "deck"),
        (label("component", "pier_cap"), "pier_cap"),
        (label("class", "girder") + label("component", "pier_cap"), "girder"),
        ('custom string userProperties:class = "cable"', "cable"),
        ('custom string userProperties:component = "abutment_wall"', "abutment"),
        ('uniform token falsework:component:kind = "bearing_pot"', "bearing"),
        ("", "column"),
    ],
)
def test_nearest_label_wins(content: str, expected: str, tmp_path: Path) -> None:
    """A prim's own label of any kind beats its parent's; without one the parent's counts."""
    body = f'def Xform "Group" ({LABELED}) {{\n{label("class", "column")}{mesh("M", content, LABELED)}}}\n'
    assert classes(read_body(tmp_path, body)) == {"/Group/M": expected}


def test_no_label_is_background(tmp_path: Path) -> None:
    """A stage without labels is background, numbered from 1 in path order."""
    scene = read_body(tmp_path, mesh("B") + mesh("A") + mesh("C"))
    assert classes(scene) == {"/A": "background", "/B": "background", "/C": "background"}
    assert [(row.id, row.path) for row in scene.instances] == [(1, "/B"), (2, "/A"), (3, "/C")]
    assert scene.classes == class_rows()


def test_unknown_class_is_background_with_a_warning(tmp_path: Path) -> None:
    """A class that the table lacks is named once."""
    scene = read_body(tmp_path, mesh("A", label("class", "zebra"), LABELED) + mesh("B", label("class", "zebra")))
    assert set(classes(scene).values()) == {"background"}
    assert sum("zebra" in line for line in scene.warnings) == 1


def test_authored_ids_stay_and_gaps_are_filled(tmp_path: Path) -> None:
    """Ids are never given twice, and a group's id covers what is below it."""
    group = f'def Xform "G" {{\nuniform int falsework:component:instanceId = 2\n{mesh("A")}{mesh("B")}}}\n'
    mirror = mesh("M", "custom int userProperties:instanceId = 9")
    scene = read_body(tmp_path, mesh("First") + group + mirror + mesh("Last"))
    assert [(row.id, row.path) for row in scene.instances] == [(1, "/First"), (2, "/G"), (3, "/Last"), (9, "/M")]
    assert scene.draws.instance.tolist() == [1, 2, 2, 9, 3]


def test_parameters_reach_the_instance_table(tmp_path: Path) -> None:
    """Dimensions written on a component are read back."""
    content = 'uniform int falsework:component:instanceId = 4\nuniform token falsework:component:kind = "pier_cap"\n'
    content += """uniform string falsework:component:parameters = '{"height": 1.5}'"""
    row = read_body(tmp_path, mesh("M", content)).instances[0]
    assert (row.id, row.component, row.class_name, row.parameters) == (4, "pier_cap", "pier_cap", {"height": 1.5})


def test_an_instance_with_an_id_outranks_its_prototype(tmp_path: Path) -> None:
    """Ids inside a shared prototype cannot tell instances apart; one on the instance does."""
    body = 'class "P" {\n' + mesh("M", "uniform int falsework:component:instanceId = 5") + "}\n"
    for number in (11, 12):
        body += f'def Xform "I{number}" (instanceable = true\n references = </P>) {{\n'
        body += f"uniform int falsework:component:instanceId = {number}\n}}\n"
    scene = read_body(tmp_path, body)
    assert scene.draws.instance.tolist() == [11, 12]
    assert not any("already" in line for line in scene.warnings)


def test_a_shared_id_is_named(tmp_path: Path) -> None:
    """Two prims with one id: a warning with both paths."""
    content = "uniform int falsework:component:instanceId = 5"
    scene = read_body(tmp_path, mesh("A", content) + mesh("B", content))
    assert "/B: instance id 5 is already that of /A" in scene.warnings


@pytest.mark.parametrize("number", [5_000_000_000, 4_294_967_296, -3])
def test_ids_out_of_range_are_ignored_by_name(number: int, tmp_path: Path) -> None:
    """An id below 0 or above 32 bits is said and gives way to another: of a prim, a subset, an instancer."""
    subset = f"""def GeomSubset "Crack" ({LABELED}) {{
        uniform token elementType = "face"
        int[] indices = [0]
        uniform int64 falsework:component:instanceId = {number}
        {label("class", "parapet")}
    }}"""
    body = mesh("A", f"custom int64 userProperties:instanceId = {number}")
    body += mesh("B", f"uniform int64 falsework:component:instanceId = {number}") + mesh("C", subset)
    body += 'def PointInstancer "D" {\nrel prototypes = </D/P>\npoint3f[] positions = [(0, 0, 0), (9, 0, 0)]\n'
    body += f"int[] protoIndices = [0, 0]\nint64[] falsework:component:instanceIds = [{number}, 7]\n{mesh('P')}}}\n"
    scene = read_body(tmp_path, body + mesh("Last", f"custom int64 userProperties:instanceId = {2**32 - 1}"))
    assert [row.id for row in scene.instances] == [1, 2, 3, 4, 2**32 - 1]
    said = [line.partition(":")[0] for line in scene.warnings if line.endswith(": ignored")]
    assert sorted(said) == ["/A", "/B", "/C/Crack", "/D"]


def test_labels_and_ids_of_subsets(tmp_path: Path) -> None:
    """A face subset of any family may carry its own label and id."""
    subset = f"""def GeomSubset "Crack" ({LABELED}) {{
        uniform token elementType = "face"
        uniform token familyName = "damage"
        int[] indices = [1]
        uniform int falsework:component:instanceId = 30
        {label("class", "parapet")}
    }}"""
    body = f"""def Mesh "M" ({LABELED}) {{
        point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (2,0,0), (2,1,0)]
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2]
        uniform int falsework:component:instanceId = 3
        {label("class", "deck")}
        {subset}
    }}"""
    scene = read_body(tmp_path, body, subdivision=0)
    assert classes(scene) == {"/M": "deck", "/M/Crack": "parapet"}
    assert scene.geometry.part_count.tolist() == [2, 2]


def test_a_broken_label_of_a_subset_costs_itself(tmp_path: Path) -> None:
    """Parameters of a subset that are no JSON leave its label out by name; its faces have that of the mesh."""
    subset = f"""def GeomSubset "Crack" ({LABELED}) {{
        uniform token elementType = "face"
        int[] indices = [0]
        uniform string falsework:component:parameters = "{{"
        {label("class", "parapet")}
    }}"""
    scene = read_body(tmp_path, mesh("M", label("class", "deck") + subset, LABELED))
    assert classes(scene) == {"/M": "deck"}
    (line,) = (line for line in scene.warnings if line.startswith("/M/Crack: "))
    assert line.endswith(": its label is left out")


TABLE = """
def Scope "Render" {
    def Scope "Vars" {
        def RenderVar "semantic" {
            %s
        }
    }
}
"""


def test_class_table_of_the_stage(tmp_path: Path) -> None:
    """A table on the stage rules over the project's own."""
    table = 'uniform token[] falsework:classNames = ["zebra", "deck"]\nuniform int[] falsework:classIds = [7, 3]'
    scene = read_body(tmp_path, TABLE % table + mesh("A", label("class", "zebra")) + mesh("B", label("class", "deck")))
    assert [(row.id, row.name) for row in scene.classes] == [(3, "deck"), (7, "zebra")]
    assert scene.draws.label.tolist() == [7, 3]
    assert scene.classes[0].color == class_rows()[[row.name for row in class_rows()].index("deck")].color


def test_broken_class_table(tmp_path: Path) -> None:
    """Names and ids that do not fit: a warning, and the project's own table."""
    table = 'uniform token[] falsework:classNames = ["a", "b"]\nuniform int[] falsework:classIds = [7]'
    scene = read_body(tmp_path, TABLE % table + mesh("A", label("class", "deck")))
    assert scene.draws.label.tolist() == [class_id("deck")]
    assert any("do not fit" in line for line in scene.warnings)
