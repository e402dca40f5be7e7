"""The log of a training in the format of TensorBoard, written without that package.

Source: TensorFlow, `event.proto`, `summary.proto`, and the framing of its record files.
"""

import struct
from collections.abc import Mapping, Sequence

EVENTS = "log.tfevents"  # TensorBoard takes every file with `tfevents` in its name
_POLYNOMIAL = 0x82F63B78  # CRC-32C (Castagnoli), bits reversed
_MASK = 0xA282EAD8  # added to a rotated checksum, so that a checksum of checksums stays a good one
_WORD = 0xFFFFFFFF


def event_file(history: Sequence[Mapping[str, float | None]]) -> bytes:
    """Write a history as events: one for each epoch, with a number for each column.

    The time of an event is its epoch in seconds: no clock reaches an output, so that equal trainings have equal files.

    Args:
        history: Rows with `epoch` and any numbers [any unit]; None is left out.

    Returns:
        The whole file.
    """
    events = [_field(1, struct.pack("<d", 0.0), 1) + _field(3, b"brain.Event:2", 2)]
    for row in history:
        epoch = int(row["epoch"] or 0)
        values = {name: value for name, value in row.items() if name != "epoch" and value is not None}
        summary = b"".join(
            _field(1, _field(1, name.encode(), 2) + _field(2, struct.pack("<f", value), 5), 2)
            for name, value in values.items()
        )
        events.append(_field(1, struct.pack("<d", epoch), 1) + _field(2, _varint(epoch), 0) + _field(5, summary, 2))
    return b"".join(map(_record, events))


def crc32c(data: bytes) -> int:
    """Compute the checksum of some bytes: CRC-32C.

    Args:
        data: The bytes.

    Source: RFC 3720, appendix B.4.
    """
    crc = _WORD
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (_POLYNOMIAL if crc & 1 else 0)
    return crc ^ _WORD


def _record(data: bytes) -> bytes:
    """Frame an event: its length and its bytes, each with a masked checksum."""
    length = struct.pack("<Q", len(data))
    return length + _checksum(length) + data + _checksum(data)


def _checksum(data: bytes) -> bytes:
    crc = crc32c(data)
    return struct.pack("<I", ((crc >> 15 | crc << 17) + _MASK) & _WORD)


def _field(number: int, value: bytes, wire: int) -> bytes:
    """Write a field of a protocol buffer; wire types: 0 varint, 1 eight bytes, 2 with a length, 5 four bytes."""
    return _varint(number << 3 | wire) + (_varint(len(value)) if wire == 2 else b"") + value


def _varint(value: int) -> bytes:
    found = b""
    while value > 0x7F:
        found += bytes([value & 0x7F | 0x80])
        value >>= 7
    return found + bytes([value])
