"""The reason why USD cannot read a file, in one line, with the position in the file."""

import re

_PLACE = re.compile(r"^.*?:(?P<line>\d+):(?P<column>\d+): *(?P<cause>.*)$", re.DOTALL)
_INNER = re.compile(r"^Error in '[^']*' at line \d+ in file \S+ : '(?P<cause>.*)'$", re.DOTALL)
_RULE = re.compile(r"parse error matching (?:\w+::)+(\w+)")  # names of its grammar
_LONGEST = 300  # characters of a reason


def reason_of(error: Exception) -> str:
    """Return the reason why USD could not read a file, with line and column where USD states them.

    Args:
        error: What opening it raised; its text may contain bytes of the file that are not text.
    """
    try:
        said = [str(part.commentary) for part in error.args if hasattr(part, "commentary")] or [str(error)]
        lines = [" ".join(text.split()) for text in said if text.strip()]
    except UnicodeDecodeError:
        return "it holds bytes that are not text"
    if not lines:
        return "USD gives no reason"
    found = next((match for line in lines if (match := _PLACE.match(line))), None)
    if found:
        cause = _RULE.sub(r"expected \1", found["cause"])
        return f"line {found['line']}, column {found['column']}: {cause}"[:_LONGEST]
    inner = _INNER.match(lines[0])
    return (inner["cause"] if inner else lines[0])[:_LONGEST]
