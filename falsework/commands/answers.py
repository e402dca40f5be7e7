"""Standard output of the verbs: lines for people, or with --json one versioned object for scripts."""

import json
import math
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import tyro

JSON_VERSION = 1

AsJson = Annotated[bool, tyro.conf.arg(name="json")]


def answer(value: Mapping[str, Any]) -> int:
    """Print one JSON object, and nothing else.

    Args:
        value: The result.

    Returns:
        The exit code of a verb that is done: 0.
    """
    sys.stdout.write(json.dumps(_known({"version": JSON_VERSION, **value}), allow_nan=False) + "\n")
    return 0


def _known(value: Any) -> Any:
    """Replace numbers that are not finite by null, because JSON has none."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _known(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_known(inner) for inner in value]
    return value


def tell(value: Mapping[str, Any], lines: Iterable[str], as_json: bool) -> int:
    """Print a result for a script or for a person.

    Args:
        value: The JSON object.
        lines: The same as lines of text.
        as_json: Whether to print the JSON object.

    Returns:
        The exit code of a verb that is done: 0.
    """
    if as_json:
        return answer(value)
    for line in lines:
        sys.stdout.write(line + "\n")
    return 0


def cloud_facts(folder: Path) -> dict[str, Any]:
    """Describe a cloud as JSON: folder, source, points, and images by status.

    Args:
        folder: A cloud that was just written.
    """
    from groundwork.files import read_json

    stored = read_json(folder / "cloud.json")
    images = Counter(str(row["status"]) for row in stored["cameras"])
    return {"folder": str(folder), "source": stored["source"], "points": stored["count"], "images": dict(images)}


def capture_facts(folder: Path) -> dict[str, Any]:
    """Describe a capture as JSON: folder, survey, images, and their size [px].

    Args:
        folder: A capture that was just written.
    """
    from render.capture import read_capture

    capture = read_capture(folder)
    size = {"width": capture.size[0], "height": capture.size[1]}
    return {"folder": str(folder), "survey": capture.survey, "images": len(capture.images), **size}
