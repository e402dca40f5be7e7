"""A flat scene as one block of bytes with a checksum."""

import hashlib
import json
from dataclasses import fields, is_dataclass
from io import BytesIO
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import FlatScene

Arrays = list[NDArray[Any]]

_HASH = 32  # bytes of a SHA-256, at the beginning


def pack_scene(scene: FlatScene, layers: tuple[str, ...]) -> bytes:
    """Pack a scene.

    Args:
        scene: A scene.
        layers: Hash of each layer that it was read from.

    Returns:
        The SHA-256 of what follows; then numpy's archive of the scene's arrays, and of everything else as JSON.

    Raises:
        TypeError: A fact of the scene has no JSON form.
    """
    arrays: Arrays = []
    facts = json.dumps({"scene": _plain(scene, arrays), "layers": layers})
    data = BytesIO()
    np.savez(data, np.frombuffer(facts.encode(), np.uint8), *arrays, allow_pickle=False)  # not atomic: into memory
    return hashlib.sha256(data.getvalue()).digest() + data.getvalue()


def unpack_scene(data: bytes) -> tuple[FlatScene, tuple[str, ...]]:
    """Unpack a scene.

    Args:
        data: What `pack_scene` returned.

    Returns:
        The scene, and the hash of each layer that it was read from.

    Raises:
        ValueError: The bytes are damaged.
    """
    if hashlib.sha256(data[_HASH:]).digest() != data[:_HASH]:
        raise ValueError("its hash is not that of its contents")
    try:
        with np.load(BytesIO(data[_HASH:]), allow_pickle=False) as archive:
            first, *arrays = (archive[f"arr_{number}"] for number in range(len(archive.files)))
        facts = json.loads(first.tobytes())
        return _revived(FlatScene, facts["scene"], arrays), tuple(facts["layers"])
    except (KeyError, TypeError, EOFError, BadZipFile) as error:
        raise ValueError("written in another format") from error


def _plain(value: Any, arrays: Arrays) -> Any:
    """Convert records to dicts of their fields, and arrays to their numbers in `arrays`."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return len(arrays) - 1
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name), arrays) for field in fields(value)}
    return [_plain(item, arrays) for item in value] if isinstance(value, tuple) else value


def _revived(kind: Any, value: Any, arrays: Arrays) -> Any:
    """Convert the result of `_plain` back to a value of a type."""
    if get_origin(kind) in (Union, UnionType):
        (kind,) = (one for one in get_args(kind) if one is not type(None))
    if value is None:
        return None
    if is_array(kind):
        return arrays[value]
    if hasattr(kind, "__dataclass_fields__"):
        return kind(**{name: _revived(hint, value[name], arrays) for name, hint in get_type_hints(kind).items()})
    if get_origin(kind) is tuple:
        kinds = get_args(kind)
        kinds = kinds[:1] * len(value) if kinds[-1] is Ellipsis else kinds
        return tuple(_revived(one, item, arrays) for one, item in zip(kinds, value, strict=True))
    return value


def is_array(kind: Any) -> bool:
    """Tell whether a type is an array: NumPy 2.5 on Python 3.12 hides that behind a type alias.

    Args:
        kind: A type, as type hints return it.
    """
    origin = get_origin(kind)
    return np.ndarray in (origin, get_origin(getattr(origin, "__value__", None)))
