"""Compose the picture of a bridge before an imported city: from eye height, under the deck, at a pier, from the air.

Usage: python -m docs.imported_picture WORLD [picture.jpg]

WORLD is what `falsework background import` wrote.
"""

import sys
from pathlib import Path

from authoring.scene import GivenFiles
from falsework.gallery.contact_sheet import contact_sheet
from falsework.gallery.worlds import photograph_world
from groundwork.files import write_bytes

PICTURE = Path(__file__).resolve().parent / "images" / "worlds" / "imported.jpg"
SEED = 7


def main(world: Path, picture: Path) -> None:
    """Author the bridge in the world, take the pictures, and write them as one.

    Args:
        world: Folder of an imported world.
        picture: JPEG file to write.
    """
    given = GivenFiles(worlds={world.name: world.absolute() / f"{world.name}.usda"})
    shots = photograph_world(world.name, SEED, given)
    rows = [(shots.caption, shots.pictures[:2]), ("", shots.pictures[2:])]
    write_bytes(picture, contact_sheet(rows, letters=0.45, quality=85))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else PICTURE)
