"""Settings as words of the command line: `--set key=value`."""

import json
from typing import Any

from groundwork.errors import InputError


def given_settings(words: tuple[str, ...]) -> dict[str, Any]:
    """Read `key=value` words; a value is JSON where it can be, else plain text.

    Args:
        words: What the user wrote.

    Returns:
        The settings; the last word for a key counts.

    Raises:
        InputError: A word without an equals sign.
    """
    settings: dict[str, Any] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals:
            raise InputError("not a setting", field="--set", value=word, allowed="key=value")
        try:
            settings[key] = json.loads(value)
        except json.JSONDecodeError:
            settings[key] = value
    return settings
