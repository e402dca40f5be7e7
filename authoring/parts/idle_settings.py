"""Settings that another setting makes meaningless: the rules are data beside the settings that they speak of."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from authoring.parts.drawing import drawn_range
from groundwork.errors import InputError
from groundwork.settings import Settings

LEFT_OUT: tuple[object, ...] = ()  # the keys have an effect only where the choice is left out
POSITIVE: tuple[object, ...] = ("above 0",)  # ... only where it is above 0
SEVERAL: tuple[object, ...] = ("several spans",)  # ... only where it is a number above 1, or a list of several lengths


@dataclass(frozen=True)
class Use:
    """Keys that have an effect only with some options of a choice.

    Attributes:
        choice: Key of the choice, dotted, in the section that the rule belongs to.
        options: Options with which the keys have an effect, or LEFT_OUT, POSITIVE or SEVERAL.
        keys: The keys, dotted; a section's name stands for all its keys.
        plain: A value that the other options have anyway, which may be set.
        drawn: Whether the keys are refused also where the choice is left out and the profile draws no such option.
    """

    choice: str
    options: tuple[object, ...]
    keys: tuple[str, ...]
    plain: object = None
    drawn: bool = True


def refuse_idle(bridge: Settings, family: str | Mapping[Any, float], profile: str) -> None:
    """Refuse what the user set without effect, because of another choice that is set or that the family forces.

    A choice that is drawn refuses nothing: what is set applies to the bridges that have such an option. Nor does a
    rule refuse `false`: what does not exist anyway may be excluded.

    Args:
        bridge: The section `[bridge]`. The rules of a section are in its class attribute `uses`; those of a family for
            the other sections, in the `shared_uses` of the family's section: their choices are keys of the family's
            section, an empty one is the family itself, and their keys are those of `[bridge]`.
        family: Name of the family, or weights by which it is drawn [1]; then its rules for other sections do not
            apply.
        profile: `default` or `paper`.

    Raises:
        InputError: Such a value, its key, and the choice.
    """
    if isinstance(family, str):  # first: what a family lacks, no other choice of the section brings
        own = getattr(bridge, family)
        for use in getattr(own, "shared_uses", ()):
            at = (own, f"bridge.{family}") if use.choice else (bridge, "bridge")
            _refuse((bridge, "bridge"), at, use if use.choice else _of_family(use), profile)
    for path, section in _sections(bridge, "bridge"):
        for use in getattr(section, "uses", ()):
            _refuse((section, path), (section, path), use, profile)


def _of_family(use: Use) -> Use:
    return Use("family", use.options, use.keys, use.plain)


def _sections(settings: Settings, path: str) -> Iterator[tuple[str, Settings]]:
    yield path, settings
    for key in type(settings).model_fields:
        value = getattr(settings, key)
        if isinstance(value, Settings):
            yield from _sections(value, f"{path}.{key}")


def _refuse(keys: tuple[Settings, str], choice: tuple[Settings, str], use: Use, profile: str) -> None:
    """Apply one rule; `keys` and `choice`: the sections that these are in, and their paths."""
    (section, path), (owner, where) = keys, choice
    value, cause = _value(owner, use.choice), f"{where}.{use.choice}"
    shown, options = f"{cause} = {_toml(value)}", [value]
    if value in (None, ()):
        shown, options = f'bridge.profile = "{profile}"', _likely(owner, use.choice, profile) if use.drawn else []
    if not options or any(_has_effect(option, use.options) for option in options):
        return
    for key, found in _given(section, use.keys):
        if found is False or found == use.plain:
            continue
        name = key.rpartition(".")[2]
        raise InputError(
            f"has no effect with {shown}",
            field=f"{path}.{key}",
            value=found,
            allowed=_allowed(cause, use.options),
            hint=f"Change {cause}, or leave {name} out",
        )


def _value(settings: Settings, key: str) -> Any:
    for name in key.split("."):
        settings = getattr(settings, name)
    return settings


def _likely(settings: Settings, key: str, profile: str) -> list[Any]:
    """List the options that a choice is drawn as in a profile; empty if this depends on the bridge."""
    *names, last = key.split(".")
    owner = _value(settings, ".".join(names)) if names else settings
    extra: Any = type(owner).model_fields[last].json_schema_extra or {}
    weights = extra.get("paper", extra.get("cases", [])) if profile == "paper" else extra.get("chosen", [])
    if "drawn" in extra:  # a range
        low, high = drawn_range(type(owner), last, profile)
        return [low] if low == high else []
    return [option for option, weight in weights if weight > 0.0]


def _has_effect(value: Any, options: tuple[object, ...]) -> bool:
    if options is POSITIVE:
        return value > 0.0
    if options is SEVERAL:
        return (len(value) if isinstance(value, tuple) else value) > 1
    if isinstance(value, Mapping):  # weights of families
        return any(name in options for name, weight in value.items() if weight > 0.0)
    return value in options


def _given(settings: Settings, keys: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    """List the keys that the user set, dotted, with their values."""
    for key in keys:
        value = _value(settings, key)
        if isinstance(value, Settings):
            yield from _given(settings, tuple(f"{key}.{name}" for name in type(value).model_fields))
        elif value not in (None, ()):
            yield key, value


def _allowed(choice: str, options: tuple[object, ...]) -> str:
    if options is LEFT_OUT:
        return f"without {choice}"
    if options is SEVERAL:
        return "with several spans"
    if options is POSITIVE:
        return f"with {choice} above 0"
    *most, last = map(_toml, options)
    return f"with {choice} = {', '.join(most) + ' or ' if most else ''}{last}"


def _toml(value: object) -> str:
    """Write a value as in a scenario."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{name} = {weight:g}" for name, weight in value.items()) + " }"
    return f'"{value}"' if isinstance(value, str) else f"{value}"
