"""Settings from the command line: `--set key=value`, and seeds."""

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


def check_seed(seed: int | None, field: str) -> None:
    """Refuse a negative seed, before anything is made from it.

    Args:
        seed: Seed from the user; None: none was given.
        field: The option or argument that named it.

    Raises:
        InputError: It is negative.
    """
    if seed is not None and seed < 0:
        raise InputError("seed out of range", field=field, value=seed, allowed="0 or more")
