"""Choice of the scenes that one process makes, by arguments of the command line."""

from groundwork.errors import InputError


def check_parts(scenes: str | None, shard: str | None = None) -> None:
    """Refuse arguments that name no part of any scenario, before the scenario is read.

    Args:
        scenes: `first:end`, either side may be empty; None for all.
        shard: `i/n`; None for all.

    Raises:
        InputError: Not of this form.
    """
    if scenes is not None and not _bounds(scenes):
        raise InputError("no such scenes", field="--scenes", value=scenes, allowed="first:end, such as 0:10")
    shard_of(range(0), shard)


def scene_range(text: str | None, count: int) -> range:
    """Read a part of the scenes.

    Args:
        text: `first:end`, either side may be empty; None for all.
        count: Number of scenes of the scenario.

    Raises:
        InputError: Not of this form, or outside the scenario.
    """
    if text is None:
        return range(count)
    bounds = _bounds(text)
    part = range(bounds[0], count if bounds[1] is None else bounds[1]) if bounds else range(0)
    if not part or part.stop > count:
        raise InputError("no such scenes", field="--scenes", value=text, allowed=f"first:end within 0:{count}")
    return part


def _bounds(text: str) -> tuple[int, int | None] | None:
    """Read `first:end`; None where it is not of this form, or holds no scene."""
    first, colon, end = text.partition(":")
    if not colon or not all(word == "" or (word.isdecimal() and len(word) < 20) for word in (first, end)):
        return None
    bounds = int(first or 0), int(end) if end else None
    return None if bounds[1] is not None and bounds[1] <= bounds[0] else bounds


def shard_of(scenes: range, text: str | None) -> list[int]:
    """Choose one process's part of the scenes.

    Args:
        scenes: The scenes that all processes share.
        text: `i/n`: every n-th scene from the i-th on, counted from 0; None for all.

    Raises:
        InputError: Not of this form, or i is not below n.
    """
    if text is None:
        return list(scenes)
    part, slash, count = text.partition("/")
    if not (slash and part.isdecimal() and count.isdecimal() and len(text) < 20 and int(part) < int(count)):
        raise InputError("invalid shard", field="--shard", value=text, allowed="i/n with i from 0 to n - 1")
    return list(scenes)[int(part) :: int(count)]
