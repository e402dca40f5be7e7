"""Names from a stage that become names of files and folders."""

from collections.abc import Callable, Sequence
from itertools import chain, count

from pxr import Usd

from groundwork.slug import slug
from usd_schemas.reading.labels import Warn

_SHOWN = 80  # characters of a name in a warning


def capture_name(prim: Usd.Prim, survey_id: str, warn: Warn) -> str:
    """Return the name of a camera or product, which is the name of its capture's folder.

    Args:
        prim: The camera or product.
        survey_id: Its survey id; if it is empty, the name of the prim is used.
        warn: Called with one line if the name had to be changed.

    Returns:
        A name that `groundwork.slug.slug` leaves unchanged.
    """
    wanted = survey_id or prim.GetName()
    name = slug(wanted)
    if name != wanted:
        warn(f"{prim.GetPath()}: {wanted[:_SHOWN]!r} is not a plain file name: its capture is named {name}")
    return name


def distinct_names(wanted: Sequence[str], instead: Callable[[int], str]) -> list[str]:
    """Make names of captures different, also on file systems that ignore the case.

    The first that wants a name has it. Each of the others has another name, which no other one wants.

    Args:
        wanted: Name that each product should have.
        instead: Returns the name that a row has if its own is taken; a number follows where that one is taken, too.

    Returns:
        A name for each row.
    """
    claimed = {name.casefold() for name in wanted}
    given: set[str] = set()
    names = []
    for row, name in enumerate(wanted):
        if name.casefold() in given:
            other = instead(row)
            numbered = (f"{other}_{number}" for number in count(2))
            name = next(one for one in chain((other,), numbered) if one.casefold() not in claimed)
            claimed.add(name.casefold())
        given.add(name.casefold())
        names.append(name)
    return names


def image_names(prim: Usd.Prim, stated: tuple[str, ...], count: int, warn: Warn) -> tuple[str, ...]:
    """Return the names of a camera's images, which are the stems of their files.

    Args:
        prim: The camera.
        stated: Names that the stage states; they are not used if there are more or fewer than images.
        count: Number of images.
        warn: Called with one line if they are no names of files.

    Returns:
        `count` different names that `groundwork.slug.slug` leaves unchanged; `000000` … where the stage states none.
    """
    if len(stated) == count:
        wrong = next((name for name in stated if slug(name) != name), None)
        if wrong is None and len({name.casefold() for name in stated}) == count:  # some file systems ignore the case
            return stated
        reason = "one occurs twice" if wrong is None else f"{wrong[:_SHOWN]!r} is not a plain file name"
        warn(f"{prim.GetPath()}: its falsework:survey:imageNames are not used, because {reason}: numbers are")
    return tuple(f"{row:06d}" for row in range(count))
