"""Sharing of textures between the scenes of a run: one file, `store/texture/<sha256>`, hard-linked into each scene."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from falsework.store.artefact import Hashes
from groundwork.canonical import file_digest

POOL = "texture"
STAGE = "stage"  # stage whose results hold textures
SUFFIXES = (".jpg", ".png", ".exr", ".hdr")
LEAST = 4096  # [bytes] smaller files fit into one block


def share_textures(root: Path, folder: Path, files: dict[str, dict[str, Any]]) -> None:
    """Replace the textures of a finished scene by links to shared ones, or share them.

    Args:
        root: Output folder of the run.
        folder: The finished scene, its files read-only.
        files: Size and SHA-256 of each, from its manifest.
    """
    pool = root / "store" / POOL
    for name, row in sorted(files.items()):
        if row["bytes"] < LEAST or not name.endswith(SUFFIXES):
            continue
        pool.mkdir(parents=True, exist_ok=True)
        try:
            _share(folder / name, pool / row["sha256"])
        except OSError:  # no hard links here, or too many of one file: it stays a copy
            continue


def _share(file: Path, shared: Path) -> None:
    try:
        os.link(file, shared)
    except FileExistsError:
        if shared.is_symlink() or not shared.is_file() or file_digest(shared) != shared.name:
            shared.unlink()  # it was changed
            os.link(file, shared)
            return
        fresh = file.with_name(f".{file.name}.shared")
        os.link(shared, fresh)
        fresh.replace(file)


def pool_faults(root: Path, hashes: Hashes) -> Iterator[tuple[Path, str]]:
    """Compare the shared textures with their names.

    Args:
        root: Output folder of a run.
        hashes: Cache of hashes.

    Yields:
        Path of each texture whose hash differs from its name, or of anything else there, and a line about it.
    """
    pool = root / "store" / POOL
    for path in sorted(pool.iterdir()) if pool.is_dir() else []:
        name = path.relative_to(root).as_posix()
        if path.is_symlink() or not path.is_file() or len(path.name) != 64:
            yield path, f"{name}: foreign"
        elif hashes.of(path) != path.name:
            yield path, f"{name}: changed"
