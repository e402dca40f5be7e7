"""Running a script inside Blender's own Python."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
VARIABLE = "FALSEWORK_BPY_PYTHON"


def run_in_blender(script: str, *arguments: str) -> None:
    """Run a script of this folder with the Python that has bpy.

    Args:
        script: File name.
        arguments: Its arguments.

    Raises:
        RuntimeError: It failed; the text is what it printed last.
    """
    command = [os.environ[VARIABLE], str(HERE / script), *arguments]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PXR_"))}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    if done.returncode:
        raise RuntimeError((done.stdout + done.stderr)[-2000:])


def export_scene(folder: Path, name: str, frames: int = 1, **options: object) -> tuple[Path, dict[str, Any]]:
    """Let Blender build and export its test scene.

    Args:
        folder: Where to write.
        name: Stem of the files.
        frames: Length of the animation.
        options: Options of Blender's exporter.

    Returns:
        The USD file, and Blender's own numbers.
    """
    file, facts = folder / f"{name}.usdc", folder / f"{name}.json"
    request = {"file": str(file), "facts": str(facts), "frames": frames, **options}
    run_in_blender("export_scene.py", json.dumps(request))
    return file, json.loads(facts.read_text(encoding="utf-8"))
