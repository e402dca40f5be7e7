"""Units of length: one table for scans and for ground control."""

from __future__ import annotations

from fractions import Fraction
from typing import get_args

from groundwork.length_units import METERS
from learn.datasets.scan_units import UNITS, Unit
from tests.house.house import ROOT


def test_the_two_feet_are_stated_once() -> None:
    """They differ by 2 parts in a million, by definition: 1200/3937 m and 0.3048 m; every room takes them from here."""
    assert METERS["us-ft"] == float(Fraction(1200, 3937))
    assert METERS["ft"] == float(Fraction(3048, 10_000))
    assert {name: METERS[name] for name in get_args(Unit)} == UNITS
    rooms = ("groundwork", "usd_schemas", "authoring", "render", "recon", "learn", "falsework")
    stated = [
        path.relative_to(ROOT).as_posix()
        for room in rooms
        for path in sorted((ROOT / room).rglob("*.py"))
        if any(number in path.read_text(encoding="utf-8") for number in ("3937.0", "0.3048"))
    ]
    assert stated == ["groundwork/length_units.py"]
