"""Settings from the command line: `--set key=value`."""

import json
from typing import Any

from groundwork.errors import InputError


def given_settings(words: tuple[str, ...]) -> dict[str, Any]:
    """Parse `key=value` words; a value is JSON if possible, else plain text.

    Args:
        words: Words from the user.

    Returns:
        The settings; of several words for one key the last is used.

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
        except (ValueError, RecursionError):
            settings[key] = value
    return settings
