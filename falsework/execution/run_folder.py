"""Recognition of a run's output folder."""

from pathlib import Path


def is_run(root: Path) -> bool:
    """Tell whether a folder is the output of a run.

    Args:
        root: A folder.
    """
    return (root / "scenario.toml").is_file() and ((root / "store").is_dir() or (root / "scenes").is_dir())
