"""The unit of a coordinate reference system's well-known text.

Source: OGC 01-009 and 18-010 (WKT).
"""

import re

_TOKEN = re.compile(r'"[^"]*"|[A-Za-z_]\w*\s*[\[(]|[\])]|[-+\d.][-+\d.eE]*|,')
_LINEAR = ("UNIT", "LENGTHUNIT")
_PROJECTED = ("PROJCS", "PROJCRS", "PROJECTEDCRS", "LOCAL_CS", "ENGCRS")
_GEOGRAPHIC = ("GEOGCS", "GEOGCRS", "GEODCRS", "GEODETICCRS")
_COMPOUND = ("COMPD_CS", "COMPOUNDCRS")
_ROOT = re.compile(r"\s*(PROJ|GEO[CDG]|LOCAL_|COMP|ENG|BOUND)\w*\s*[\[(]", re.IGNORECASE)


def is_wkt(text: str) -> bool:
    """Tell whether a text is well-known text, and not a name with something in brackets.

    Args:
        text: Description of a coordinate reference system.
    """
    return _ROOT.match(text) is not None


def unit_of_wkt(text: str) -> float | None:
    """Find the unit stated directly in the projected system, or in its axes.

    Args:
        text: The text.

    Returns:
        Length of one unit of the horizontal coordinates [m]; None if the text does not state it; 0 where the
        coordinates are angles.
    """
    open_words: list[str] = []
    geographic = False
    wanted = False
    for token in _TOKEN.findall(text[:100_000]):
        if token[-1] in "[(" and token[0] != '"':
            word = token[:-1].strip().upper()
            above = [name for name in open_words if name != "AXIS"]
            wanted = word in _LINEAR and bool(above) and above[-1] in _PROJECTED
            geographic |= word in _GEOGRAPHIC and all(name in _COMPOUND for name in open_words)
            open_words.append(word)
        elif token in ("]", ")"):
            if open_words:
                open_words.pop()
            wanted = False
        elif wanted and token[0] not in '",':
            try:
                return float(token)
            except ValueError:
                return None
    return 0.0 if geographic else None
