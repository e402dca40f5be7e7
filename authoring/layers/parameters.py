"""The drawn parameters of a bridge as typed attributes, one each: the content of the JSON, for other programs."""

from collections.abc import Iterator, Mapping

from pxr import Sdf, Vt

from usd_schemas.apis import Opinion

NAMESPACE = "falsework:parameters"
_TYPES = Sdf.ValueTypeNames
_SCALARS: tuple[tuple[type, Sdf.ValueTypeName], ...] = (  # a bool is an int: it comes first
    (bool, _TYPES.Bool),
    (int, _TYPES.Int),
    (float, _TYPES.Double),
    (str, _TYPES.Token),
)


def parameter_opinions(drawn: Mapping[str, object], above: str = NAMESPACE) -> Iterator[Opinion]:
    """List the parameters as attributes, e.g. `falsework:parameters:record:top:parapets:height`.

    Numbers, words, booleans and lists of numbers have an attribute; unset values and lists of tables are only in the
    JSON.

    Args:
        drawn: Parameters by name, in tables of any depth.
        above: Namespace of the names.
    """
    for name, value in sorted(drawn.items()):
        path = f"{above}:{name}"
        if isinstance(value, Mapping):
            yield from parameter_opinions(value, path)
        elif isinstance(value, list | tuple):
            if value and all(isinstance(one, int | float) and not isinstance(one, bool) for one in value):
                yield Opinion(path, _TYPES.DoubleArray, Vt.DoubleArray([float(one) for one in value]), uniform=True)
        else:
            for kind, type_name in _SCALARS:
                if isinstance(value, kind):
                    yield Opinion(path, type_name, kind(value), uniform=True)
                    break
