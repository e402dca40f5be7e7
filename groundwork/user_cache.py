"""Where what can be made again is kept for all runs of a user."""

import os
from pathlib import Path

CACHE_VARIABLE = "FALSEWORK_CACHE"


def cache_folder(name: str) -> Path:
    """Name a folder in `$FALSEWORK_CACHE`, else in the user's cache folder.

    Args:
        name: What is kept there.
    """
    own = os.environ.get(CACHE_VARIABLE)
    if own:
        return Path(own) / name
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "falsework" / name
