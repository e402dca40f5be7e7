"""Settings: unknown keys name their nearest neighbor, wrong values their field, in one line."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import Field, ValidationError

from groundwork.errors import InputError, MissingError
from groundwork.settings import Settings, parse_settings, read_toml


class Beam(Settings):
    """Parameters of a beam bridge."""

    spans: tuple[float, ...] = Field(default=(18.0, 22.0), description="Span lengths [m]")
    girder_depth: float = Field(default=1.2, ge=0.4, le=3.0, description="Depth of the girders [m]")


class Survey(Settings):
    """One survey."""

    spacing: float = Field(default=1.5, gt=0.0, description="Distance between images [m]")


class Scenario(Settings):
    """A small scenario."""

    seed: int = Field(default=7, ge=0, description="Seed")
    beam: Beam = Beam()
    survey: tuple[Survey, ...] = ()


def failure(values: dict[str, Any]) -> str:
    """Parse and give the error's text."""
    with pytest.raises(InputError) as caught:
        parse_settings(Scenario, values, "scenario.toml")
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2
    return str(caught.value)


def test_good_values() -> None:
    """Values arrive, defaults fill in, and nothing can be changed afterwards."""
    scenario = parse_settings(Scenario, {"beam": {"spans": [10]}, "survey": [{"spacing": 2}]}, "s")
    assert scenario.beam.spans == (10.0,)
    assert scenario.survey[0].spacing == 2.0
    assert scenario.seed == 7
    with pytest.raises(ValidationError, match="frozen"):
        scenario.seed = 8


@pytest.mark.parametrize(
    ("values", "field", "nearest"),
    [
        ({"sead": 1}, "sead", "seed"),
        ({"beam": {"span": [1.0]}}, "beam.span", "spans"),
        ({"beam": {"girder_dpeth": 1.0}}, "beam.girder_dpeth", "girder_depth"),
        ({"survey": [{"spacing": 1.0}, {"spaccing": 1.0}]}, "survey.1.spaccing", "spacing"),
    ],
)
def test_unknown_key_names_the_nearest(values: dict[str, Any], field: str, nearest: str) -> None:
    """The file, the whole path of the key, what is allowed there, and the likely meaning."""
    text = failure(values)
    assert text.startswith(f"scenario.toml: {field}: unknown key")
    assert f"Did you mean '{nearest}'?" in text


def test_keys_of_the_right_level_are_listed() -> None:
    """A key inside a section is compared with that section's keys only."""
    assert "allowed: girder_depth, spans" in failure({"beam": {"seed": 1}})
    assert "allowed: beam, seed, survey" in failure({"spans": 1})


@pytest.mark.parametrize(
    ("values", "field", "value"),
    [
        ({"seed": "many"}, "seed", "'many'"),
        ({"seed": -1}, "seed", "-1"),
        ({"beam": {"girder_depth": 9.0}}, "beam.girder_depth", "9.0"),
        ({"beam": {"girder_depth": float("nan")}}, "beam.girder_depth", "nan"),
        ({"beam": 3}, "beam", "3"),
    ],
)
def test_wrong_values_name_field_and_value(values: dict[str, Any], field: str, value: str) -> None:
    """Type and range errors say where and what was found."""
    text = failure(values)
    assert text.startswith(f"scenario.toml: {field}: ")
    assert f"(found {value})" in text


def test_toml_files(tmp_path: Path) -> None:
    """A good file is read; missing, a folder, broken or not text: one line each."""
    path = tmp_path / "s.toml"
    path.write_text("seed = 3\n[beam]\nspans = [1.5]\n")
    assert read_toml(path) == {"seed": 3, "beam": {"spans": [1.5]}}
    with pytest.raises(MissingError, match=r"gone\.toml: no such file"):
        read_toml(tmp_path / "gone.toml")
    with pytest.raises(InputError, match="is a folder"):
        read_toml(tmp_path)
    path.write_text("seed = = 3")
    with pytest.raises(InputError, match="line 1"):
        read_toml(path)
    path.write_bytes(b"seed = '\xff\xfe'")
    with pytest.raises(InputError, match="not readable as TOML"):
        read_toml(path)
