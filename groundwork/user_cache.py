"""The user's cache folder."""

import os
from pathlib import Path

CACHE_VARIABLE = "FALSEWORK_CACHE"


def cache_folder(name: str) -> Path:
    """Return a folder in `$FALSEWORK_CACHE`, else in the user's cache folder.

    Args:
        name: Name of the cache.
    """
    own = os.environ.get(CACHE_VARIABLE)
    if own:
        return Path(own) / name
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "falsework" / name
