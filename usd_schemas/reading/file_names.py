"""Names from a stage that become names of files and folders."""

from pxr import Usd

from groundwork.slug import slug
from usd_schemas.reading.labels import Warn

_SHOWN = 80  # characters of a name in a warning


def capture_name(prim: Usd.Prim, told: str, warn: Warn) -> str:
    """Return the name of a camera or product, which is the name of its capture's folder.

    Args:
        prim: The camera or product.
        told: Its survey id; if it is empty, the name of the prim is used.
        warn: Called with one line if the name had to be changed.

    Returns:
        A name that `groundwork.slug.slug` leaves unchanged.
    """
    wanted = told or prim.GetName()
    name = slug(wanted)
    if name != wanted:
        warn(f"{prim.GetPath()}: {wanted[:_SHOWN]!r} is not a plain file name: its capture is named {name}")
    return name
