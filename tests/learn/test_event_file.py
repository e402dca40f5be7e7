"""What TensorBoard is given: every number of the log, framed and spelled as its format has it."""

from __future__ import annotations

import struct

import pytest

from learn.training.event_file import crc32c, event_file


@pytest.mark.parametrize(
    ("data", "sum_"),
    [
        (b"", 0),
        (b"123456789", 0xE3069283),
        (bytes(32), 0x8A9136AA),
        (b"\xff" * 32, 0x62A8AB43),
        (bytes(range(32)), 0x46DD794E),
        (bytes(reversed(range(32))), 0x113FDB5C),
    ],
)
def test_checksums_are_the_published_ones(data: bytes, sum_: int) -> None:
    """The examples of RFC 3720, appendix B.4, and the check value of the catalog of CRCs."""
    assert crc32c(data) == sum_


def masked(data: bytes) -> int:
    """Mask a checksum as the framing wants it: rotated right by 15 bits, plus a constant."""
    crc = crc32c(data)
    return (((crc >> 15) | (crc << 17) % 2**32) + 0xA282EAD8) % 2**32


def records(data: bytes) -> list[bytes]:
    """Take the frames off."""
    found = []
    while data:
        (size, check), body = struct.unpack("<QI", data[:12]), data[12:]
        assert check == masked(data[:8])
        assert struct.unpack("<I", body[size : size + 4]) == (masked(body[:size]),)
        found.append(body[:size])
        data = body[size + 4 :]
    return found


def message(data: bytes) -> list[tuple[int, bytes | int]]:
    """Take a protocol buffer apart: number and value of each field."""

    def varint() -> int:
        nonlocal data
        value = shift = 0
        while True:
            byte, data = data[0], data[1:]
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    found: list[tuple[int, bytes | int]] = []
    while data:
        key = varint()
        size = {1: 8, 5: 4}.get(key & 7, 0)
        if key & 7 == 2:
            size = varint()
        found.append((key >> 3, varint() if key & 7 == 0 else data[:size]))
        data = data[size:] if key & 7 else data
    return found


def test_every_number_of_the_log_is_an_event() -> None:
    """One event for each epoch, with step, time and numbers; a number that was not measured is left out."""
    history = [
        {"epoch": 0, "loss": 1.5, "miou": 0.25, "accuracy": None},
        {"epoch": 300, "loss": float("nan"), "miou": 0.5, "accuracy": 1.0},
    ]
    first, *events = records(event_file(history))
    assert dict(message(first)) == {1: struct.pack("<d", 0), 3: b"brain.Event:2"}
    assert len(events) == len(history)
    for row, event in zip(history, events, strict=True):
        fields = dict(message(event))
        assert fields[2] == row["epoch"]
        assert fields[1] == struct.pack("<d", row["epoch"])
        summary = fields[5]
        assert isinstance(summary, bytes)
        found = {}
        for _, value in message(summary):
            assert isinstance(value, bytes)
            named = dict(message(value))
            assert isinstance(named[1], bytes)
            assert isinstance(named[2], bytes)
            found[named[1].decode()] = named[2]
        wanted = {name: value for name, value in row.items() if name != "epoch" and value is not None}
        assert found == {name: struct.pack("<f", value) for name, value in wanted.items()}


def test_a_longer_log_begins_with_the_shorter_one() -> None:
    """A file that grows is appended to: what TensorBoard has read stays as it was."""
    history: list[dict[str, float | None]] = [{"epoch": n, "loss": 1.0 / (n + 1)} for n in range(3)]
    assert event_file(history).startswith(event_file(history[:2]))
