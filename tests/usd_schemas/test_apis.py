"""Our schemas: known to USD, written and read back without loss, and readable where the plugin is missing."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSemantics

from groundwork.errors import InputError
from usd_schemas.apis import (
    ComponentFacts,
    SurveyFacts,
    apply_component,
    apply_labels,
    apply_survey,
    direct_label,
    read_component,
    read_survey,
)
from usd_schemas.distortion import Distortion
from usd_schemas.pinhole import Pinhole
from usd_schemas.registration import register_schemas

SCHEMAS = ("Bridge", "Component", "Survey", "Gps", "Calibration", "Detail")


@pytest.mark.parametrize("name", SCHEMAS)
def test_schemas_are_registered(name: str) -> None:
    """USD knows each schema as an applied one, with documented attributes in the project's namespace."""
    definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(f"Falsework{name}API")
    assert definition is not None
    properties = definition.GetPropertyNames()
    assert properties
    assert all(item.startswith("falsework:") for item in properties)
    assert all(definition.GetPropertyDocumentation(item) for item in properties)


def test_component_round_trip(tmp_path: Path) -> None:
    """Kind, ids and parameters come back from the file; empty ones stay out of it."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    full = ComponentFacts("pier_cap", 12, (), {"height": 1.25, "pier": 0})
    many = ComponentFacts("tree", 0, (4, 5, 6))
    for name, facts in (("A", full), ("B", many), ("C", ComponentFacts())):
        apply_component(stage.DefinePrim(f"/{name}", "Xform"), facts)
    stage.Save()
    again = Usd.Stage.Open(str(tmp_path / "a.usda"))
    assert read_component(again.GetPrimAtPath("/A")) == full
    assert read_component(again.GetPrimAtPath("/B")) == many
    assert read_component(again.GetPrimAtPath("/C")) == ComponentFacts()
    assert again.GetPrimAtPath("/A").HasAPI("FalseworkComponentAPI")


def test_labels_and_their_mirrors() -> None:
    """Both taxonomies are standard labels; the mirrors alone are enough to read them back."""
    stage = Usd.Stage.CreateInMemory()
    prim = stage.DefinePrim("/A", "Mesh")
    apply_labels(prim, "concrete_girder", 3)
    query = UsdSemantics.LabelsQuery("class", Usd.TimeCode.Default())
    assert list(query.ComputeUniqueDirectLabels(prim)) == ["girder"]
    assert (direct_label(prim, "component"), direct_label(prim, "class")) == ("concrete_girder", "girder")
    for taxonomy in ("component", "class"):
        prim.RemoveProperty(f"semantics:labels:{taxonomy}")
    assert (direct_label(prim, "component"), direct_label(prim, "class")) == ("concrete_girder", "girder")
    assert direct_label(prim, "colour") == ""
    with pytest.raises(InputError, match="unknown component"):
        apply_labels(prim, "zebra", 0)


def test_survey_round_trip(tmp_path: Path) -> None:
    """Everything about a survey comes back bit for bit."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usdc"))
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    rng = np.random.default_rng(1)
    facts = SurveyFacts(
        "grid",
        "north",
        42,
        1.25,
        ("000000", "000001", "000002"),
        Pinhole(1280, 960, 900.1, 901.2, 655.3, 470.7),
        0.024,
        rng.normal(size=(3, 3)),
        (1.5, 1.5, 3.0),
        rng.uniform(0, 9, 3),
        Distortion(-0.1, 0.02, 1e-4, -2e-4),
        0.02,
        "Falsework",
        "Test 24",
        rng.normal(size=(3, 3)),
        (0.5, 0.2, 0.1),
    )
    apply_survey(camera, facts)
    stage.Save()
    again = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    found = read_survey(again.GetPrimAtPath("/Camera"), 3)
    for name in SurveyFacts.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(found, name), getattr(facts, name), err_msg=name)
    assert again.GetPrimAtPath("/Camera").GetAttribute("falsework:cal:model").Get() == "OPENCV"


def test_an_ideal_camera_says_nothing_of_distortion() -> None:
    """Without distortion, read-out time and name the stage keeps quiet, and the schema's defaults stand."""
    stage = Usd.Stage.CreateInMemory()
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    apply_survey(camera, SurveyFacts("grid", "north", calibration=Pinhole(640, 480, 500.0, 500.0, 320.0, 240.0)))
    prim = camera.GetPrim()
    assert prim.GetAttribute("falsework:cal:model").Get() == "SIMPLE_PINHOLE"
    for name in ("k1", "k2", "p1", "p2", "readoutTime"):
        assert not prim.GetAttribute(f"falsework:cal:{name}").HasAuthoredValue()
        assert prim.GetAttribute(f"falsework:cal:{name}").Get() == 0.0
    assert read_survey(prim, 0).distortion.is_identity


def test_a_camera_without_our_schemas() -> None:
    """Nothing is invented for a foreign camera."""
    stage = Usd.Stage.CreateInMemory()
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    assert read_survey(camera.GetPrim(), 1) == SurveyFacts()


WITHOUT_PLUGIN = """
import sys
from pxr import Usd
stage = Usd.Stage.Open(sys.argv[1])
prim = stage.GetPrimAtPath("/A")
assert prim.GetTypeName() == "Xform" and prim.IsValid()
print(prim.GetAttribute("falsework:component:kind").Get(), "FalseworkComponentAPI" in prim.GetAppliedSchemas())
"""


def test_files_are_readable_without_the_plugin(tmp_path: Path) -> None:
    """A program without our schemas still sees type and attributes; with USD's plugin path the schema too."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    apply_component(stage.DefinePrim("/A", "Xform"), ComponentFacts("pier_cap"))
    stage.Save()
    for folder, applied in (("", "False"), (register_schemas(), "True")):
        environment = {**os.environ, "PXR_PLUGINPATH_NAME": folder}
        command = [sys.executable, "-c", WITHOUT_PLUGIN, str(tmp_path / "a.usda")]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert done.stdout.split() == ["pier_cap", applied]
