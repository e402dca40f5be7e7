"""`python -m benchmarks.falsework.fake_run …` is `falsework …` with stages that wait or compute: the engine alone.

`FAKE_SECONDS` is how long a scene takes [s], shared out over its stages. `FAKE_KIND` says how: `wait` sleeps; `work`
multiplies matrices on one thread, so many times as take `FAKE_SECONDS` where `FAKE_RATE` of them take a second.
"""

import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from falsework.execution import chain
from falsework.stages import STAGES, Run, Stage
from groundwork.progress import Progress

SHARES = {"stage": 0.1, "capture": 0.2, "model": 0.4, "cloud": 0.2, "sample": 0.0, "report": 0.1}  # of a scene's time
FILES = 20  # of each result
SIDE = 256


def work(times: int) -> None:
    """Multiply matrices, on one thread.

    Args:
        times: How often.
    """
    matrix = np.random.default_rng(0).random((SIDE, SIDE))
    for _ in range(times):
        matrix = matrix @ matrix
        matrix /= np.abs(matrix).max()


def fake(stage: str) -> Run:
    """Make a stage that takes its share of a scene's time, and leaves some small files.

    Args:
        stage: Its name.
    """

    def run(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
        seconds = SHARES[stage] * float(os.environ["FAKE_SECONDS"])
        if os.environ["FAKE_KIND"] == "wait":
            time.sleep(seconds)
        else:
            work(round(seconds * float(os.environ["FAKE_RATE"])))
        for number in range(FILES):
            (folder / f"{number:06d}.txt").write_text(f"{stage} {number}\n")  # inside an atomic folder
        name = {"stage": "scene.usda", "report": "report.html"}.get(stage)
        if name:
            (folder / name).write_text(f"{settings.get('seed', '')}\n")  # inside an atomic folder

    return run


def use_fake_stages() -> None:
    """Replace the stages of this process."""
    STAGES.update({name: Stage(stage.version, fake(name), stage.resumes) for name, stage in STAGES.items()})
    chain.render_platform = lambda device="auto": {"gl_renderer": "none"}
    chain.recon_platform = lambda: {"cpu": "none"}
    chain.sample_platform = lambda: {"cpu": "none"}


if __name__ in ("__main__", "__mp_main__"):  # the second one in the worker processes of a cluster
    use_fake_stages()

if __name__ == "__main__":
    from falsework.cli import main

    main()
