"""`python -m tests.falsework.tiny_chain …` is `falsework …` with five stages that take a millisecond each.

What goes wrong is said in `TINY_FAULTS`: JSON of `<stage>:<scene>` to `reject`, `input`, `child`, `abort`, `kill`,
`internal`, `space`, `full` or `hang`, and to what happens in a child;
`TINY_WAIT` is how long each step of a capture takes [s].
"""

import errno
import hashlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from falsework.execution import chain
from falsework.scenario import Scenario, scene_seed
from falsework.stages import STAGES, Run, Stage
from groundwork.canonical import folder_digest
from groundwork.child import run_child
from groundwork.errors import ChildError, InputError, OutOfSpaceError, RejectedSceneError
from groundwork.progress import Progress
from groundwork.settings import parse_settings

ROOT = Path(__file__).resolve().parents[2]
SEED, FRAMES = 5, 4
CHILD = "tests.groundwork.child_work"
TEXTURE = bytes(range(256)) * 400


def tiny_scenario(scenes: int = 1, **more: Any) -> Scenario:
    """Give a scenario with one survey and so many scenes, sparse where nothing else is said."""
    recon = {"mode": "sparse", **more.pop("recon", {})}
    values = {"seed": SEED, "scenes": scenes, "survey": [{"kind": "global"}], "recon": recon, **more}
    return parse_settings(Scenario, values, "tiny")


def author(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Write a layer that says the seed and the hash of each input, and a texture that all scenes have in common."""
    _go_wrong("stage", settings["seed"])
    given = "".join(f"# {name} {folder_digest(path)}\n" for name, path in sorted(inputs.items()))
    (folder / "scene.usda").write_text(f"#usda 1.0\n# {settings['seed']}\n{given}")
    (folder / "textures").mkdir()
    (folder / "textures" / "steel.png").write_bytes(TEXTURE)


def capture(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Write some frames from the stage; goes on where it was."""
    _go_wrong("capture", settings["seed"], folder)
    stage = inputs["stage"] if inputs["stage"].is_dir() else inputs["stage"].parent
    seen = folder_digest(stage)
    for frame in range(FRAMES):
        path = folder / f"{frame:06d}.jpg"
        if not path.is_file():
            partial = path.with_suffix(".partial")
            partial.write_text(f"{settings['seed']} {frame} {seen}")
            time.sleep(float(os.environ.get("TINY_WAIT", "0")))
            partial.rename(path)
    (folder / "seed.json").write_text(str(settings["seed"]))


def model(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Hash every frame into a camera; goes on where it was."""
    _go_wrong("model", int((inputs["capture"] / "seed.json").read_text()))
    parts = [hashlib.sha256(path.read_bytes()).digest() for path in sorted(inputs["capture"].glob("*.jpg"))]
    (folder / "model.json").write_text(json.dumps([settings["recon"], [part.hex() for part in parts]]))


def cloud(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Hash the model and every frame into points; goes on where it was."""
    _go_wrong("cloud", int((inputs["capture"] / "seed.json").read_text()))
    seen = [inputs["model"] / "model.json", *sorted(inputs["capture"].glob("*.jpg"))]
    parts = [hashlib.sha256(path.read_bytes()).digest() for path in seen]
    (folder / "coord.npy").write_bytes(json.dumps(settings["recon"], sort_keys=True).encode() + b"".join(parts))


def sample(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Hash the stage and the drawn seed into points."""
    seed = int((inputs["stage"] / "scene.usda").read_text().split()[-1])
    _go_wrong("sample", seed)
    text = f"{settings['kind']} {json.dumps(settings['sample'], sort_keys=True)} {folder_digest(inputs['stage'])}"
    (folder / "coord.npy").write_bytes(hashlib.sha256(text.encode()).digest())


def report(settings: dict[str, Any], inputs: dict[str, Path], folder: Path, progress: Progress) -> None:
    """Say the hash of each input."""
    _go_wrong("report", int((inputs["stage"] / "scene.usda").read_text().splitlines()[1].split()[-1]))
    lines = [f"{name} {folder_digest(path)}\n" for name, path in sorted(inputs.items()) if path.is_dir()]
    (folder / "report.html").write_text(settings["title"] + "\n" + "".join(lines))


TINY: dict[str, Run] = {
    "stage": author,
    "capture": capture,
    "model": model,
    "cloud": cloud,
    "sample": sample,
    "report": report,
}


def tiny_stages() -> dict[str, Stage]:
    """Give the table of stages, with the versions of the real ones."""
    return {name: Stage(STAGES[name].version, run, STAGES[name].resumes) for name, run in TINY.items()}


def command(*words: str | Path) -> list[str]:
    """Spell a command for a process of its own."""
    return [sys.executable, "-m", "tests.falsework.tiny_chain", *map(str, words)]


def start(
    *words: str | Path, cwd: Path = ROOT, stderr: int = subprocess.PIPE, **environment: str
) -> subprocess.Popen[str]:
    """Begin `falsework …` with the tiny stages, in a session of its own."""
    return subprocess.Popen(
        command(*words),
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        start_new_session=True,
    )


def contents(out: Path) -> dict[str, str]:
    """Describe the tree of a run outside `run/`: hash of each file, target of each link, folders."""
    found = {}
    for path in sorted(out.rglob("*")):
        name = path.relative_to(out).as_posix()
        if name.split("/")[0] == "run":
            continue
        if path.is_symlink():
            found[name] = f"-> {os.readlink(path)}"  # noqa: PTH115
        else:
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "folder"
    return found


def _go_wrong(stage: str, seed: int, folder: Path | None = None) -> None:
    faults = json.loads(os.environ.get("TINY_FAULTS", "{}"))
    seeds = {scene_seed(SEED, index): index for index in range(100)}
    match faults.get(f"{stage}:{seeds.get(seed)}"):
        case "reject":
            raise RejectedSceneError("no_texture", "nothing to match")
        case "input":
            raise InputError("may not be", field="bridge.spans", value=3)
        case "device in a child":
            run_child(CHILD, {"do": "device", "value": errno.EIO}, time_limit=240.0, memory_limit=4.0)
        case "child":
            raise ChildError("recon.child: failed with exit code 1: no", last_lines=("so it went", "no"))
        case "abort":
            raise ChildError("recon.child: died of SIGABRT: check failed", signal="SIGABRT", last_lines=("check",))
        case "outside":
            raise ChildError("recon.child: died of SIGTERM: it printed nothing", signal="SIGTERM")
        case "short":
            raise ChildError("recon.child: died of SIGKILL: it printed nothing", signal="SIGKILL")
        case "internal":
            raise ValueError("a mistake of ours")
        case "stopped in an import":
            raise ImportError("initialization failed") from KeyboardInterrupt()
        case "space":
            raise OutOfSpaceError("no space left on the disk")
        case "full":  # the disk has no room for anything but a few bytes
            resource.setrlimit(resource.RLIMIT_FSIZE, (5, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
        case "hangs in a child":
            run_child(CHILD, {"do": "sleep", "value": 600}, time_limit=0.2, memory_limit=4.0)
        case "eats in a child":
            run_child(CHILD, {"do": "eat", "value": 400_000_000}, time_limit=240.0, memory_limit=0.2)
        case "grows in a child":
            run_child(CHILD, {"do": "eat", "value": 400_000_000}, time_limit=240.0, memory_limit=4.0)
        case "aborts in a child":
            run_child(CHILD, {"do": "abort"}, time_limit=240.0, memory_limit=4.0)
        case "hang":
            time.sleep(600)
        case "stubborn":
            for count in range(100):
                try:
                    assert folder is not None
                    (folder / f"heard-{count}").touch()
                    time.sleep(600)
                except KeyboardInterrupt:
                    continue
        case "kill":
            once = Path(os.environ["TINY_ONCE"])
            if len(list(once.glob(f"{stage}-*"))) < int(os.environ.get("TINY_KILLS", "1")):
                (once / f"{stage}-{os.getpid()}").touch()
                os.kill(os.getpid(), signal.SIGKILL)


def use_tiny_stages() -> None:
    """Replace the stages of this process."""
    STAGES.update(tiny_stages())
    chain.render_platform = lambda device="auto": {"gl_renderer": "none"}
    chain.recon_platform = lambda: {"cpu": "none"}
    chain.sample_platform = lambda: {"cpu": "none"}


if __name__ in ("__main__", "__mp_main__"):  # the second one in the worker processes of a cluster
    use_tiny_stages()

if __name__ == "__main__":
    from falsework.cli import main
    from falsework.execution import cluster

    cluster.DEATHS = int(os.environ.get("TINY_DEATHS") or cluster.DEATHS)

    main()
