"""Settings that another one leaves without effect are refused by name, and those alone."""

from dataclasses import replace
from typing import Any

import pytest
from pydantic import TypeAdapter

from authoring.settings import AuthoringSettings
from authoring.streams import stream
from authoring.surveys.registry import SURVEYS
from authoring.surveys.settings import AnySurvey, LegSettings
from authoring.surveys.subject import Subject, make_subject
from groundwork.canonical import digest
from groundwork.errors import InputError
from groundwork.settings import parse_settings
from tests.authoring.boxes import box_bridge, flat_site

IDLE: dict[str, tuple[dict[str, Any], str, Any, dict[str, Any]]] = {
    "distance of rings": ({"kind": "global", "tour": "rings"}, "stand_off", (3.0, 4.0), {"tour": "loop"}),
    "height of rings": ({"kind": "global", "tour": "rings"}, "over_deck", (8.0, 9.0), {"tour": "loop"}),
    "turn of rings": ({"kind": "global", "tour": "rings"}, "turn", 6.0, {"tour": "loop"}),
    "margin of a loop": ({"kind": "global"}, "margin", 20.0, {"tour": "rings"}),
    "limit of a free gimbal": ({"kind": "local", "pitch": "free"}, "pitch_limit", -60.0, {"pitch": "limited"}),
    "chance beside a station": ({"kind": "local", "station": 0.0}, "at_support", 0.0, {"station": None}),
    "chance beside a target": ({"kind": "local", "target": 1}, "at_support", 0.0, {"target": None}),
    "oblique rows without a deck": ({"kind": "grid", "deck": False}, "oblique", 1, {"deck": True}),
    "pieces of members": ({"kind": "inspection", "cover": "members"}, "stretch", 2.0, {"cover": "surface"}),
    "worth of members": ({"kind": "inspection", "cover": "members"}, "worth", 900, {"cover": "surface"}),
}
COARSE: dict[str, dict[str, Any]] = {  # so that a flight takes a moment
    "global": {"images": 8, "spacing": 10.0},
    "local": {"cell": 1.0, "images": (2, 300), "spacing": 1.0},
    "grid": {"sampling": 0.02},
    "inspection": {"cell": 2.0, "views": 1, "pixels": 5.0},
}


@pytest.fixture(scope="module")
def subject() -> Subject:
    """Give a bridge of boxes with a bearing at its first end."""
    plain = make_subject(box_bridge(), flat_site())
    return replace(plain, seats=plain.bridge.reshape(-1, 3).min(axis=0)[None])


def fly(settings: Any, subject: Subject) -> str:
    """Hash the cameras of one flight."""
    return digest(SURVEYS[settings.kind].fly(settings, subject, stream(3, "survey/x")).tolist())


@pytest.mark.parametrize("name", IDLE)
def test_a_value_without_effect_is_refused_by_name(name: str, subject: Subject) -> None:
    """It moves no camera there, and some where the other value is right; at its default it passes, written out too."""
    values, idle, value, right = IDLE[name]
    target = {"target": int(subject.bridge_ids[0])} if "target" in values else {}
    with pytest.raises(InputError, match=rf"survey\.0: {idle} has no effect with .*; allowed: only with "):
        parse_settings(AuthoringSettings, {"survey": [{**values, **target, idle: value}]}, "x.toml")
    base = TypeAdapter(AnySurvey).validate_python({**COARSE[values["kind"]], **values, **target})
    assert TypeAdapter(LegSettings).validate_python(base.model_dump(mode="json")) == base
    assert fly(base, subject) == fly(base.model_copy(update={idle: value}), subject)
    base = base.model_copy(update=right)
    assert fly(base, subject) != fly(base.model_copy(update={idle: value}), subject)


def test_a_target_may_be_reached_from_a_station(subject: Subject) -> None:
    """The box lies at the station, not around the target."""
    near = {"kind": "local", "target": int(subject.bridge_ids[0]), **COARSE["local"]}
    alone, moved = (TypeAdapter(AnySurvey).validate_python({**near, **more}) for more in ({}, {"station": 5.0}))
    assert fly(alone, subject) != fly(moved, subject)


@pytest.mark.parametrize(
    ("values", "wrong"),
    [
        ({"light": {"sky_turn": 90.0}}, "light: sky_turn"),
        ({"light": {"sky_turn": 90.0}, "variants": {"light": [{"name": "a", "sky": "s.hdr"}]}}, ""),
        ({"light": {"sky": "s.hdr"}, "variants": {"light": [{"name": "a", "sky_turn": 9.0}]}}, ""),
        ({"light": {"sky": "s.hdr", "sky_turn": 90.0}}, ""),
        ({"variants": {"light": [{"name": "a", "sky_turn": 9.0}]}}, "variants.light a: sky_turn"),
    ],
)
def test_only_a_photographed_sky_is_turned(values: dict[str, Any], wrong: str) -> None:
    """That of the section or, for a variant that names none, of the scene."""
    if not wrong:
        assert parse_settings(AuthoringSettings, values, "x.toml").survey
        return
    with pytest.raises(InputError, match=f"{wrong} has no effect without a photographed sky"):
        parse_settings(AuthoringSettings, values, "x.toml")


def test_a_light_that_was_written_out_still_follows_the_scene() -> None:
    """Values that a variant omits are those of `[light]` also for a child, which reads the settings again."""
    lights = [{"name": "morning", "date": "2024-06-21T07:00"}, {"name": "south", "latitude": 10.0}]
    told = parse_settings(AuthoringSettings, {"light": {"latitude": 60.0}, "variants": {"light": lights}}, "x.toml")
    again = parse_settings(AuthoringSettings, told.model_dump(mode="json"), "x.toml")
    assert again.variants.lights(again.light) == told.variants.lights(told.light)
    assert [light.latitude for light in again.variants.lights(again.light).values()] == [60.0, 60.0, 10.0]
