"""A copy of a PLY file with labels as three more properties of its points."""

from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

import numpy as np

from groundwork.errors import InputError
from groundwork.files import whole_file
from recon.formats.labels import CLASS, CONFIDENCE, DTYPES, INSTANCE, Labels, refuse_labeled
from recon.formats.read_ply import Element, read_ply_header

_PROPERTIES = (f"property uchar {CLASS}", f"property float {CONFIDENCE}", f"property uint {INSTANCE}")
_BLOCK = 1 << 24  # [bytes] copied at once


def copy_ply(source: Path, out: Path, labels: Iterable[Labels]) -> None:
    """Copy a file; its header gains three lines, each of its points three numbers; nothing else changes.

    Args:
        source: PLY file.
        out: .ply file to write.
        labels: Labels of the points, in their order, in pieces of any size.

    Raises:
        InputError: It holds predictions already, or its text has not one point a line.
    """
    order, elements, start = read_ply_header(source)
    place = next((i for i, element in enumerate(elements) if element.name == "vertex"), 0)
    vertex = elements[place]
    refuse_labeled(source, tuple(name for name, _ in vertex.properties))
    # not atomic: renamed when it is whole
    with source.open("rb") as file, whole_file(out) as partial, partial.open("wb") as copy:
        copy.write(_header(file.read(start), vertex))
        if order == "":
            _copy_text(source, file, copy, sum(element.count for element in elements[:place]), vertex, labels)
        else:
            _copy_rows(file, copy, order, elements[:place], vertex, labels)
        while block := file.read(_BLOCK):
            copy.write(block)


def _header(head: bytes, vertex: Element) -> bytes:
    """Add the new properties behind the last property of the points."""
    lines = head.split(b"\n")
    end = b"\r" if lines[0].endswith(b"\r") else b""
    words = [line.split() for line in lines]
    begin = next(i for i, word in enumerate(words) if word[:2] == [b"element", vertex.name.encode()])
    last = begin
    while words[last + 1][:1] in ([b"property"], [b"comment"], [b"obj_info"]):
        last += 1
    return b"\n".join([*lines[: last + 1], *(line.encode() + end for line in _PROPERTIES), *lines[last + 1 :]])


def _copy_rows(
    file: IO[bytes], copy: IO[bytes], order: str, before: list[Element], vertex: Element, labels: Iterable[Labels]
) -> None:
    for element in before:
        left = (
            element.count * np.dtype([(name, f"{order}{kind}") for name, kind in element.properties if kind]).itemsize
        )
        while left:
            block = file.read(min(left, _BLOCK))
            copy.write(block)
            left -= len(block)
    size = _size(order, vertex)
    added = [(name, DTYPES[name].newbyteorder(order)) for name in (CLASS, CONFIDENCE, INSTANCE)]
    for part in labels:
        count = len(part.classes)
        table: Any = np.zeros(count, [("old", np.uint8, (size,)), *added])
        table["old"] = np.frombuffer(file.read(count * size), np.uint8).reshape(count, size)
        for name, values in part.columns.items():
            table[name] = values
        copy.write(table.tobytes())


def _size(order: str, element: Element) -> int:
    """Compute the bytes of a row; the reader has checked that it holds no list."""
    return np.dtype([(name, f"{order}{kind}") for name, kind in element.properties if kind]).itemsize


def _copy_text(
    source: Path, file: IO[bytes], copy: IO[bytes], before: int, vertex: Element, labels: Iterable[Labels]
) -> None:
    for _ in range(before):
        copy.write(file.readline())
    for part in labels:
        for label, sure, instance in zip(part.classes, part.confidence, part.instance, strict=True):
            line = file.readline()
            body = line.rstrip(b"\r\n")
            if len(body.split()) != len(vertex.properties):
                raise InputError("does not have one point per line", where=source, hint="Write it as binary PLY")
            copy.write(body.rstrip() + f" {label} {sure:.6g} {instance}".encode() + (line[len(body) :] or b"\n"))
