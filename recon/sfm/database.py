"""COLMAP's SQLite databases: counting, copying and merging their rows without COLMAP."""

import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from groundwork.errors import ChildError, OutOfSpaceError

DATABASE = "database.db"
"""Name of the database in the folder of a step."""

_SMALL = ("rigs", "rig_sensors", "cameras", "frames", "frame_data")  # tables that images refer to
_OF_IMAGES = ("keypoints", "descriptors")
_OF_PAIRS = ("matches", "two_view_geometries")
_BROKEN = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR)  # the last one: there is no such table


def count_rows(database: Path, table: str) -> int:
    """Count the rows of a table while another process writes it.

    Args:
        database: File that may not be there yet.
        table: Name of the table.

    Returns:
        Number of rows; 0 while there is no database, no such table, or the database is locked.
    """
    if not database.is_file():
        return 0
    try:
        with closing(sqlite3.connect(f"{database.absolute().as_uri()}?mode=ro", uri=True)) as connection:
            return int(connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()[0])
    except sqlite3.Error:
        return 0


def empty_journal(database: Path) -> None:
    """Write the journal into the database file, which the next step copies, and delete the journal.

    Args:
        database: A database that is no longer written to.

    Raises:
        OutOfSpaceError: The disk is full.
        ChildError: Another program has the database open.
    """
    try:
        with closing(sqlite3.connect(database)) as connection:
            _, pages, brought = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode & 0xFF in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR):
            raise OutOfSpaceError(
                f"{database.parent}: no space left on the disk. Free some space, then run the same command again"
            ) from None
        raise ChildError(
            f"{database}: {error}. Close the program that has it open, then run the same command again"
        ) from None
    if pages != brought:
        raise ChildError(f"{database}: another program reads it. Close that program, then run the same command again")


def copy_images(whole: Path, part: Path, images: Iterable[int]) -> None:
    """Copy the keypoints and descriptors of some images; in the copy an image's name is its id.

    Args:
        whole: Database that is no longer written to.
        part: Database with COLMAP's tables, all empty; unusable if the process is killed meanwhile.
        images: Ids of the images.
    """
    wanted = (json.dumps(sorted(set(images))),)
    with _attached(part, f"{whole.absolute().as_uri()}?immutable=1", journal=False) as connection:
        for table in _SMALL:
            connection.execute(f"INSERT INTO {table} SELECT * FROM other.{table}")
        connection.execute("INSERT INTO images SELECT image_id, image_id, camera_id FROM other.images")
        for table in _OF_IMAGES:
            connection.execute(
                f"INSERT INTO {table} SELECT * FROM other.{table} WHERE image_id IN (SELECT value FROM json_each(?))",
                wanted,
            )


def merge_pairs(part: Path, whole: Path) -> None:
    """Copy matches and geometries of image pairs in one transaction: all of them or, if the process is killed, none.

    Args:
        part: Database to copy from.
        whole: Database to copy into; rows of the same pairs are replaced.
    """
    with _attached(whole, part.absolute().as_uri()) as connection:
        for table in _OF_PAIRS:
            connection.execute(f"INSERT OR REPLACE INTO {table} SELECT * FROM other.{table}")


def paired(database: Path) -> set[int]:
    """List the pairs that have been matched and verified, including those without a common point.

    Args:
        database: Database of matches; it may have been damaged by a power cut.

    Returns:
        COLMAP's ids of the pairs; none if the database is missing or damaged.

    Raises:
        DatabaseError: It cannot be read at present: the disk is full, or another process has locked it. It may be
            intact.
    """
    if not database.is_file():
        return set()
    try:
        with closing(sqlite3.connect(database)) as connection:
            if connection.execute("PRAGMA quick_check").fetchone() != ("ok",):
                return set()
            return {number for (number,) in connection.execute("SELECT pair_id FROM two_view_geometries")}
    except sqlite3.DatabaseError as error:
        if error.sqlite_errorcode & 0xFF in _BROKEN:
            return set()
        raise


@contextmanager
def _attached(database: Path, other: str, *, journal: bool = True) -> Iterator[sqlite3.Connection]:
    """Open a database for one transaction, with another beside it as `other`."""
    with closing(sqlite3.connect(database.absolute().as_uri(), uri=True)) as connection:
        if not journal:
            connection.execute("PRAGMA journal_mode = OFF")
        connection.execute("ATTACH ? AS other", (other,))
        with connection:
            yield connection
        if not journal:
            connection.execute("DETACH other")
            connection.execute("PRAGMA journal_mode = WAL")  # as COLMAP wants it
