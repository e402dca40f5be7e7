"""Reads damaged files of every format in one process, and says what came of each: `python -m … FOLDER COUNT SEED`.

One line of JSON for each input: format, kind of damage, number of the draw, outcome, seconds of processor time.
"""

from __future__ import annotations

import faulthandler
import json
import os
import re
import resource
import sys
import time
import traceback
from pathlib import Path
from typing import Any

import numpy as np

from groundwork.errors import FalseworkError
from tests.faults.samples import Sample, make_samples

PATIENCE = 120.0  # [s] of wall time for one input, on a box that many tests share; then the stack is printed
ADDRESSES = 24_000_000_000  # [bytes] an allocation that claims more fails
REFUSED, SAME, OTHER, WRONG, CRASHED, DIED = "refused", "same", "other", "silently wrong", "crashed", "died"
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?")
_GROWN = (b"-1", b"0", b"99999999999", b"1e999", b"NaN", b"-0.0", b"9" * 5000, b"33000000000000", b'"x"', b"null")


def damage(data: bytes, draw: np.random.Generator) -> tuple[str, bytes]:
    """Damage a file in one of several ways.

    Args:
        data: A sound file.
        draw: Source of randomness.

    Returns:
        What was done, and the damaged file.
    """
    kind = str(draw.choice(["truncate", "flip", "bytes", "splice", "grow", "insert"]))
    place = int(draw.integers(len(data)))
    if draw.random() < 0.5:
        place = int(draw.integers(min(len(data), 400)))  # headers are short, and most is decided there
    if kind == "truncate":
        return kind, data[:place]
    if kind == "flip":
        return kind, data[:place] + bytes([data[place] ^ 1 << int(draw.integers(8))]) + data[place + 1 :]
    if kind == "bytes":
        word = [b"\xff" * 8, b"\xff\xff\xff\x7f", b"\0" * 8, b"\0\0\0\0\0\0\xf8\x7f", b"\xff" * 2][draw.integers(5)]
        return kind, data[:place] + word + data[place + len(word) :]
    if kind == "splice":
        start, length = int(draw.integers(len(data))), int(draw.integers(1, 200))
        return kind, data[:place] + data[start : start + length] + data[place:]
    numbers = list(_NUMBER.finditer(data[: 1 << 20]))
    if kind == "grow" and numbers:
        found = numbers[int(draw.integers(len(numbers)))]
        return kind, data[: found.start()] + _GROWN[draw.integers(len(_GROWN))] + data[found.end() :]
    filling = [b"\0", b"[" * 100_000, b"{" * 3000, b"../" * 50, b"\xed\xa0\x80", b"\r\n"][draw.integers(6)]
    return "insert", data[:place] + filling + data[place:]


def spelled(value: Any) -> Any:
    """Turn what a reader gave into something that can be compared."""
    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if isinstance(value, dict):
        return {key: spelled(one) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [spelled(one) for one in value]
    return repr(value)


def outcome(sample: Sample, sound: Any) -> str:
    """Read a damaged sample and tell what came of it."""
    try:
        found = spelled(sample.read())
    except FalseworkError as error:
        return REFUSED if "\n" not in str(error) and len(str(error)) < 5000 else f"{CRASHED}: not one line"
    except BaseException:
        return f"{CRASHED}: {traceback.format_exc()}"
    if found == sound:
        return SAME
    return WRONG if sample.sealed else OTHER


def apart(sample: Sample, sound: Any) -> str:
    """Do the same in a child of its own, as the product does where a library may crash."""
    here, there = os.pipe()
    child = os.fork()
    if child == 0:
        faulthandler.disable()
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.close(here)
        said = outcome(sample, sound).encode()
        while said:
            said = said[os.write(there, said) :]
        os._exit(0)
    os.close(there)
    with os.fdopen(here, "rb") as pipe:
        said = pipe.read().decode()
    _, status = os.waitpid(child, 0)
    return DIED if status else said


def main(folder: Path, count: int, seed: int) -> None:
    """Damage and read so many files, one format after another.

    Args:
        folder: Empty folder.
        count: Number of damaged files.
        seed: Of all draws.
    """
    samples = make_samples(folder)
    whole = {name: sample.file.read_bytes() for name, sample in samples.items()}
    sound = {name: None if sample.native else spelled(sample.read()) for name, sample in samples.items()}
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    names = sorted(samples)
    for number in range(count):
        name = names[number % len(names)]
        sample = samples[name]
        kind, data = damage(whole[name], np.random.default_rng([seed, number]))
        sample.file.write_bytes(data)
        faulthandler.dump_traceback_later(PATIENCE, exit=True)
        begin = time.process_time() + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        said = (apart if sample.native else outcome)(sample, sound[name])
        seconds = time.process_time() + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - begin
        faulthandler.cancel_dump_traceback_later()
        sample.file.write_bytes(whole[name])
        row = {"format": name, "damage": kind, "number": number, "outcome": said, "seconds": round(seconds, 3)}
        sys.stdout.write("\x1e" + json.dumps(row) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
