"""Registration of our codeless schemas in USD, before USD is first used in the process."""

from functools import cache
from importlib.resources import files

from pxr import Plug


@cache
def register_schemas() -> str:
    """Register the folder that holds `plugInfo.json`; further calls do nothing.

    USD builds its schema registry once, at the first use of a stage, so `falsework` and every module that applies or
    reads a schema call this on import.

    Returns:
        The folder, for `PXR_PLUGINPATH_NAME` of other USD hosts.
    """
    folder = str(files("usd_schemas"))
    Plug.Registry().RegisterPlugins(folder)
    return folder
