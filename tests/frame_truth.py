"""The exact images of a frame, written as the renderer writes them."""

from pathlib import Path

from render.writing.capture_writer import FrameTruth, encode_frame_truth


def write_frame_truth(folder: Path, name: str, frame: FrameTruth, *, wide_ids: bool) -> None:
    """Write the exact images of one frame.

    Args:
        folder: The capture's folder, with its sub-folders.
        name: Name of the image.
        frame: Its exact images.
        wide_ids: Whether any instance id of the scene is above 65,535.
    """
    for file, data in encode_frame_truth(name, frame, wide_ids=wide_ids).items():
        (folder / file).write_bytes(data)
