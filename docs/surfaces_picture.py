"""Compose the picture of all surfaces of a bridge: one sheet of each, new, after decades, and after many.

Usage: python -m docs.surfaces_picture [picture.jpg]
"""

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from authoring.looks.library import SheetName, draw_sheet
from authoring.looks.noise import Bank
from authoring.looks.structural import STRUCTURAL
from falsework.gallery.contact_sheet import contact_sheet
from groundwork.files import write_bytes

PICTURE = Path(__file__).resolve().parent / "images" / "looks" / "surfaces.jpg"
CELL, COLUMNS = 150, 12  # [px] side of a surface, and how many stand in a row
TEXELS = 512  # of a bridge's sheet, along a side
_LETTERS, _QUALITY = 0.28, 82

U8 = NDArray[np.uint8]


def main(picture: Path, names: tuple[str, ...] = tuple(STRUCTURAL)) -> None:
    """Draw the surfaces and write the picture.

    Args:
        picture: JPEG file to write.
        names: Rows of `authoring.looks.structural.STRUCTURAL`, in the order of the picture.
    """
    bank = Bank()
    cells = [named(name, surface(name, bank)) for name in names]
    cells += [np.full((CELL, CELL, 3), 255, np.uint8)] * (-len(cells) % COLUMNS)
    rows = [(names[first], cells[first : first + COLUMNS]) for first in range(0, len(cells), COLUMNS)]
    picture.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(picture, contact_sheet(rows, letters=_LETTERS, quality=_QUALITY))


def surface(name: str, bank: Bank) -> U8:
    """Draw the first sheet of a surface, shape (CELL, CELL, 3), uint8.

    Args:
        name: A row of `authoring.looks.structural.STRUCTURAL`.
        bank: Fields shared with other sheets.
    """
    files, _ = draw_sheet(SheetName(name, 0, TEXELS), bank)
    albedo = cv2.imdecode(np.frombuffer(files["albedo.jpg"], np.uint8), cv2.IMREAD_COLOR)
    assert albedo is not None
    return cv2.resize(albedo, (CELL, CELL), interpolation=cv2.INTER_AREA)[..., ::-1].astype(np.uint8)


def named(name: str, cell: U8) -> U8:
    """Write the name over the top of a cell.

    Args:
        name: What to write.
        cell: sRGB colors, shape (CELL, CELL, 3), uint8.
    """
    marked = cell.copy()
    marked[:14] //= 3
    cv2.putText(marked, name, (3, 10), cv2.FONT_HERSHEY_SIMPLEX, _LETTERS, (255, 255, 255), 1, cv2.LINE_AA)
    return marked


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
