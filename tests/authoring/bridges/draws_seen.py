"""What a family draws, seen from outside: every value under its setting's path, and what fixing it does."""

import sys
import types
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args, get_origin

import pytest

from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import FAMILIES
from authoring.parts import drawing
from authoring.streams import stream
from groundwork.settings import Settings, parse_settings

Path = tuple[str, ...]


@dataclass
class Seen:
    """Values of one draw.

    Attributes:
        record: Everything that was drawn, as plain values.
        values: Every drawn number under its setting's path.
    """

    record: dict[str, Any]
    values: dict[Path, float] = field(default_factory=dict)


def sections(settings: Settings, family: str) -> Iterator[tuple[Path, Settings]]:
    """Walk a bridge's settings and every section in them that concerns its family.

    Args:
        settings: Settings of a bridge.
        family: Key of the registry; other families' sections are left out.
    """
    stack: list[tuple[Path, Settings]] = [((), settings)]
    while stack:
        path, section = stack.pop()
        yield path, section
        for key in type(section).model_fields:
            value = getattr(section, key)
            if isinstance(value, Settings) and (path or key == family or key not in FAMILIES):
                stack.append(((*path, key), value))


def options_of(model: type[Settings], key: str) -> tuple[Any, ...]:
    """List what an optional choice may be: the words of a Literal, or both truth values; empty for anything else.

    Args:
        model: Settings class.
        key: Name of its field.
    """
    kinds = get_args(model.model_fields[key].annotation)
    if types.NoneType not in kinds:
        return ()
    if bool in kinds:
        return (True, False)
    return next((get_args(kind) for kind in kinds if get_origin(kind) is Literal), ())


def look(monkeypatch: pytest.MonkeyPatch, family: str, seed: int, values: dict[str, Any]) -> Seen:
    """Draw one bridge and note every number that was drawn.

    Args:
        monkeypatch: Replaces the draws with watched ones, everywhere.
        family: Key of the registry.
        seed: Seed of the bridge.
        values: What a scenario fixes.
    """
    settings = parse_settings(BridgeSettings, values, "test")
    paths = {id(section): path for path, section in sections(settings, family)}
    seen: dict[Path, float] = {}

    def watched(draw: Any) -> Any:
        def wrapper(section: Settings, key: str, draws: drawing.Draws) -> Any:
            value = draw(section, key, draws)
            seen[(*paths.get(id(section), ("?",)), key)] = value
            return value

        return wrapper

    with monkeypatch.context() as patch:
        for original in (drawing.draw, drawing.draw_whole):
            wrapper = watched(original)
            for name in sorted(sys.modules):
                if name.startswith("authoring.") and getattr(sys.modules[name], original.__name__, None) is original:
                    patch.setattr(sys.modules[name], original.__name__, wrapper)
        layout, drawn = draw_layout(settings, stream(seed, "bridge"))
    return Seen({"layout": asdict(layout), **asdict(drawn)}, seen)


def leaves(record: Any, key: str) -> Iterator[Any]:
    """Find every value that a record keeps under one name, at any depth.

    Args:
        record: Plain values.
        key: Name.
    """
    if isinstance(record, dict):
        for name, value in record.items():
            if name == key:
                yield value
            yield from leaves(value, key)
    elif isinstance(record, list | tuple):
        for value in record:
            yield from leaves(value, key)


def nested(path: Path, value: Any) -> dict[str, Any]:
    """Wrap a value in the tables of its path.

    Args:
        path: Section names and the key.
        value: What the key is set to.
    """
    for name in reversed(path):
        value = {name: value}
    return value


def merged(one: dict[str, Any], two: dict[str, Any]) -> dict[str, Any]:
    """Lay one set of tables over another.

    Args:
        one: Below.
        two: Above.
    """
    both = dict(one)
    for key, value in two.items():
        both[key] = merged(both[key], value) if isinstance(value, dict) and isinstance(both.get(key), dict) else value
    return both
