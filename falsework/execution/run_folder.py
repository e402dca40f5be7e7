"""What the output folder of a run is known by."""

from pathlib import Path


def is_run(root: Path) -> bool:
    """Tell whether a folder is that of a run.

    Args:
        root: A folder.
    """
    return (root / "scenario.toml").is_file() and ((root / "store").is_dir() or (root / "scenes").is_dir())
