"""What the families draw: every option and every range is used, and fixing what was drawn anyway changes nothing."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest

from authoring.axis.alignment import Layout
from authoring.families.bridge_settings import BridgeSettings, draw_layout
from authoring.families.registry import FAMILIES, DrawnBridge
from authoring.parts.drawing import Draws, chosen, chosen_by, draw_option, option_at
from authoring.streams import stream
from groundwork.errors import InputError
from groundwork.settings import Settings, parse_settings
from tests.authoring.bridges.draws_seen import Path, look, merged, nested, options_of, sections
from tests.conftest import Count, RecordProof

PROFILES = ("default", "paper")
LEAST_SHARE = 0.02  # [1] of the draws, in one profile or the other, that every option takes
LEAST_COVER = 0.8  # [1] of a range that the draws reach
# What does not fit is taken back only where the user did not ask for it: a skew from the deck, a crest from the grade.
# A size that only some axes have also chooses such an axis.
_OVERRULED = {("alignment", key) for key in ("skew", "crest_radius", "amplitude", "wave")}
_STRAIGHT = ("arch", "suspension", "cable_stayed")  # they refuse all but one option of the alignment
_IDLE = "has no effect with"  # what refusals of a value say that another one, or the family, makes meaningless
_ENOUGH = 60  # draws of a key from which its range is judged


def open_settings(family: str, profile: str) -> dict[str, Any]:
    """Leave everything open."""
    own = {"spans": []} if "spans" in FAMILIES[family].settings.model_fields else {}
    return {"family": family, "profile": profile, family: own}


def option_fields(family: str) -> Iterator[tuple[Path, tuple[Any, ...]]]:
    """Every optional choice that concerns a family, and what it may be."""
    settings = parse_settings(BridgeSettings, {"family": family}, "test")
    for path, section in sections(settings, family):
        for key in type(section).model_fields:
            if options := options_of(type(section), key):
                yield (*path, key), options


def drawn_ranges(family: str, profile: str) -> dict[Path, tuple[float, float]]:
    """Every range that concerns a family."""
    settings = parse_settings(BridgeSettings, {"family": family}, "test")
    found = {}
    for path, section in sections(settings, family):
        for key, field in type(section).model_fields.items():
            extra = field.json_schema_extra
            if isinstance(extra, dict) and "drawn" in extra:
                low, high = extra["paper" if profile == "paper" else "drawn"]  # pyright: ignore
                found[(*path, key)] = (float(low), float(high))  # pyright: ignore[reportArgumentType]
    return found


ON_ROADS, ON_RAILWAYS = {"wall": 3, "railing": 1}, {"railing": 1}


class Options(Settings):
    """Options as families declare them."""

    bed: Literal["ballast", "slab", "sand"] | None = chosen(
        {"ballast": 3, "slab": 1}, "What lies there", among=" of all", paper={"sand": 1, "slab": 1}
    )
    lit: bool | None = chosen({True: 1, False: 3}, "Lamps", paper={False: 1})
    shape: Literal["wall", "railing"] | None = chosen_by(
        {"on roads": ON_ROADS, "on railways": ON_RAILWAYS}, "Parapet", paper={"wall": 1}
    )
    count: int | None = chosen({1: 1, 2: 4}, "How many", ge=1, le=9)


@pytest.mark.parametrize(
    ("profile", "shares"), [("default", {"ballast": 0.75, "slab": 0.25}), ("paper", {"sand": 0.5, "slab": 0.5})]
)
def test_options_are_drawn_by_the_shares_that_are_told(profile: str, shares: dict[str, float]) -> None:
    """Shares of 4000 draws (99.99 % lie within 0.03); a fixed option stays, and the stream advances all the same."""
    draws = Draws(np.random.default_rng(1), profile)
    seen = Counter(draw_option(Options(), "bed", draws) for _ in range(4000))
    assert {name: count / 4000 for name, count in seen.items()} == pytest.approx(shares, abs=0.03)
    free, fixed = (Draws(np.random.default_rng(2), profile) for _ in range(2))
    draw_option(Options(), "lit", free)
    assert draw_option(Options(lit=True), "lit", fixed) is True
    assert draw_option(Options(lit=False), "lit", fixed) is False
    draw_option(Options(), "lit", free)
    assert free.random() == fixed.random()


def test_the_shares_are_told_by_the_numbers() -> None:
    """A setting's description ends with what its options are drawn by."""
    told = {key: field.description for key, field in Options.model_fields.items()}
    bed = "What lies there; drawn ballast 75 %, slab 25 % of all; in profile paper sand and slab equally often"
    assert told == {
        "bed": bed,
        "lit": "Lamps; drawn true 25 %; in profile paper never",
        "shape": "Parapet; drawn on roads: wall 75 %, railing 25 %; on railways: always railing; in profile paper "
        "always wall",
        "count": "How many; drawn 1: 20 %, 2: 80 %",
    }


def test_shares_may_depend_on_the_bridge() -> None:
    """The caller says which options there are; what is fixed goes before it, and `paper` has its own shares of them."""
    for share in (0.0, 0.7, 0.8):
        assert option_at(Options(), "shape", share, "default", ON_ROADS) == ("wall" if share < 0.75 else "railing")
        assert option_at(Options(), "shape", share, "default", ON_RAILWAYS) == "railing"
        assert option_at(Options(), "shape", share, "paper", ON_ROADS) == "wall"
        assert option_at(Options(), "shape", share, "paper", ON_RAILWAYS) == "railing"  # the only one there
        assert option_at(Options(), "bed", share, "paper", {"sand": 0.0, "slab": 1.0}) == "slab"
        assert option_at(Options(), "bed", share, "paper", {"sand": 9.0, "slab": 1.0}) == (
            "sand" if share < 0.5 else "slab"
        )
        assert option_at(Options(shape="railing"), "shape", share, "paper", ON_ROADS) == "railing"
        assert option_at(Options(), "count", share, "paper") == (1 if share < 0.2 else 2)


@pytest.mark.parametrize("family", FAMILIES)
def test_ranges_are_covered(
    family: str, monkeypatch: pytest.MonkeyPatch, proof_count: Count, record_proof: RecordProof
) -> None:
    """Every number stays in its range and its draws reach 80 % of it; no key of the family's own is left undrawn."""
    count = proof_count(60, 400)
    covers = []
    for profile in PROFILES:
        seen: dict[Path, list[float]] = defaultdict(list)
        for seed in range(count if profile == "default" else count // 4):
            for path, value in look(monkeypatch, family, seed, open_settings(family, profile)).values.items():
                seen[path].append(value)
        wrong = []
        for path, (low, high) in drawn_ranges(family, profile).items():
            values = seen.get(path, [])
            name = ".".join(path)
            if values and not low <= min(values) <= max(values) <= high:
                wrong.append(f"{name}: {min(values)} to {max(values)}, not within {low} to {high}")
            if len(values) >= 4 * _ENOUGH and high > low:
                covers.append((max(values) - min(values)) / (high - low))
                if covers[-1] < LEAST_COVER:
                    wrong.append(f"{name}: only {min(values)} to {max(values)} of {low} to {high}")
            if not values and path[0] == family and profile == "default":
                wrong.append(f"{name}: never drawn")
        assert not wrong, f"{family}, {profile}: " + "; ".join(wrong)
    record_proof(f"bridges/{family}/ranges_are_covered", count, 0, {"least_cover": min(covers, default=0.0)})


@pytest.mark.parametrize("family", FAMILIES)
def test_options_are_drawn(family: str, proof_count: Count, record_proof: RecordProof) -> None:
    """An option was drawn where fixing it changes nothing: one always is, and each one is in 2 % of the draws."""
    count = proof_count(3, 400)
    taken: dict[tuple[Path, Any], dict[str, int]] = defaultdict(lambda: dict.fromkeys(PROFILES, 0))
    judged: dict[Path, dict[str, int]] = defaultdict(lambda: dict.fromkeys(PROFILES, 0))
    fields = list(option_fields(family))
    offered: set[tuple[Path, Any]] = set()  # options that not every bridge of the family refuses
    for profile in PROFILES:
        for seed in range(count if profile == "default" else count // 3):
            values = open_settings(family, profile)
            before = _drawn(values, seed)
            for path, options in fields:
                bridges = {o: _drawn(merged(values, nested(path, o)), seed) for o in options}
                offered |= {(path, o) for o, bridge in bridges.items() if bridge not in (None, _IDLE)}
                same = [o for o, bridge in bridges.items() if bridge is not None and bridge == before]
                refused = family in _STRAIGHT and path[0] == "alignment" and not any(bridges.values())
                refused |= _IDLE in bridges.values()  # then the others change nothing but the record
                name = ".".join(path)
                assert same or refused, f"{family} {seed} ({profile}): fixing {name} moves other draws, whatever it is"
                if len(same) == 1:
                    taken[path, same[0]][profile] += 1
                    judged[path][profile] += 1
    shares = {
        f"{'.'.join(path)} = {option!r}": max(taken[path, option][p] / max(judged[path][p], 1) for p in PROFILES)
        for path, options in fields
        for option in options
        if sum(judged[path].values()) >= _ENOUGH
        and (path, option) in offered  # no inverted T fits under the single row of bearings of a continuous deck
        and not (family in _STRAIGHT and path[0] == "alignment")
    }
    rare = [name for name, share in shares.items() if share < LEAST_SHARE]
    assert not rare, f"{family}: drawn in less than 2 % of {count} bridges: " + ", ".join(rare)
    record_proof(f"bridges/{family}/options_are_drawn", count, 0, {"least_share": min(shares.values(), default=1.0)})


def _drawn(values: dict[str, Any], seed: int) -> tuple[Layout, DrawnBridge] | str | None:
    """Draw a bridge; None where what is fixed does not go together, _IDLE where it has no effect on such a bridge."""
    try:
        return draw_layout(parse_settings(BridgeSettings, values, "test"), stream(seed, "bridge"))
    except InputError as error:
        return _IDLE if _IDLE in str(error) else None


@pytest.mark.parametrize("family", FAMILIES)
def test_fixing_a_drawn_number_changes_nothing(
    family: str, monkeypatch: pytest.MonkeyPatch, proof_count: Count
) -> None:
    """Each number alone, fixed to the value that was drawn, gives the same bridge: the stream advances all the same."""
    for seed in range(proof_count(1, 5)):
        values = open_settings(family, "default")
        before, wrong = _drawn(values, seed), []
        for path, value in look(monkeypatch, family, seed, values).values.items():
            fixed = merged(values, nested(path, value))
            refused = path in _OVERRULED or (family in _STRAIGHT and path[0] == "alignment")
            if path[0] != "?" and not refused and _drawn(fixed, seed) not in (before, _IDLE):
                wrong.append(".".join(path))
        assert not wrong, f"{family} {seed}: fixing one of these moves other draws: {', '.join(wrong)}"
