"""Where the clouds of a run come from: the seed and the looks of their scenes."""

from pathlib import Path

from groundwork.canonical import digest
from groundwork.files import read_json


def origin_of(cloud: Path) -> tuple[int | None, str]:
    """Read the seed and the looks of a cloud of a run from the manifest of its scene; no other cloud states them.

    Args:
        cloud: Folder of a cloud, or any other source of a data set.

    Returns:
        Seed of the scene, None where it is unknown; hash of the files of its looks, empty where it is unknown.

    Raises:
        InputError: The manifest is damaged.
    """
    folder = cloud.absolute().parent
    path = folder.parent / "stage" / "manifest.json"
    if folder.name != "cloud" or not path.is_file():
        return None, ""
    from authoring.scenes.manifest import FORMAT

    record = read_json(path)
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        return None, ""
    seed, files = record.get("seed"), record.get("files")
    listed = files if isinstance(files, dict) else {}
    looks = {name: listed[name] for name in sorted(listed) if "looks" in Path(name).parts}
    return seed if type(seed) is int else None, digest(looks) if looks else ""
