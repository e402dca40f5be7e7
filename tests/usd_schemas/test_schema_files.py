"""The generated schema files are those that usdGenSchema makes from the source, and the plugin registers."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pxr
import pytest
from pxr import Plug, Usd

from usd_schemas.registration import register_schemas

ROOM = Path(__file__).resolve().parents[2] / "usd_schemas"
GENERATOR = Path(pxr.__file__).parent / "Usd/usdGenSchema.py"


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the generator of the installed USD on a copy of the source."""
    folder = tmp_path_factory.mktemp("schema")
    (folder / "schema.usda").write_bytes((ROOM / "schema.usda").read_bytes())  # not atomic: a test's own file
    command = [sys.executable, str(GENERATOR), "schema.usda", "."]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_schema_has_not_drifted(generated: Path) -> None:
    """The committed layer is the generated one, to the byte."""
    assert (generated / "generatedSchema.usda").read_text() == (ROOM / "generatedSchema.usda").read_text()


def test_plugin_has_not_drifted(generated: Path) -> None:
    """The committed plugin lists the generated types; only the placeholders of a build system differ."""

    def types(path: Path) -> object:
        return json.loads(re.sub(r"(?m)^#.*$", "", path.read_text()))["Plugins"][0]["Info"]

    assert types(generated / "plugInfo.json") == types(ROOM / "plugInfo.json")


def test_plugin_is_registered_from_the_room() -> None:
    """The folder is the plugin's own, and every schema of the source is known to USD."""
    assert Path(register_schemas()) == ROOM
    assert Plug.Registry().GetPluginWithName("falsework").isLoaded
    names = re.findall(r'(?m)^class "(\w+)"', (ROOM / "schema.usda").read_text())
    assert len(names) == 8
    registry = Usd.SchemaRegistry()
    assert [name for name in names if not registry.FindAppliedAPIPrimDefinition(name)] == []
