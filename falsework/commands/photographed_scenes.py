"""Scenes with photographs for `falsework dataset demo`: made by the chain, then copied without its store."""

import shutil
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from groundwork.errors import RejectedSceneError
from groundwork.files import MANIFEST, read_json
from groundwork.progress import Progress

if TYPE_CHECKING:
    from falsework.scenario import Scenario

SCENES = "scenes"
_SCENARIO = "scenario.toml"
_RUN = "run"  # folder of the chain, removed when its results are copied
_COPIED = ("capture", "cloud")
_LEFT_OUT = shutil.ignore_patterns(MANIFEST, "cloud.ply", "sparse")
"""Of a cloud: what the store records, a second copy of its points, and the model in COLMAP's format."""


@dataclass(frozen=True)
class SceneCloud:
    """Facts of one cloud of a scene for the card.

    Attributes:
        name: Its folder in `cloud`.
        points: Number of points.
        uncertainty: Median of its uncertainty [m].
        classes: Class names with their points, the largest first.
    """

    name: str
    points: int
    uncertainty: float
    classes: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class SceneFacts:
    """Facts of one scene for the card.

    Attributes:
        name: Family and seed, the name of its folder.
        images: Number of photographs.
        registered: Number of those with a valid camera.
        clouds: Its clouds by name.
    """

    name: str
    images: int
    registered: int
    clouds: tuple[SceneCloud, ...]


def photographed_scenario() -> "Scenario":
    """Read the scenario of the scenes from the package."""
    from falsework.scenario import load_scenario

    with as_file(files("falsework").joinpath("scenarios/photographs.toml")) as path:
        return load_scenario(path)


def write_scenes(folder: Path, scenario: "Scenario", progress: Progress) -> list[SceneFacts]:
    """Run a scenario, and copy captures and clouds of its scenes to `scenes/<family>-<seed>`.

    Args:
        folder: Existing folder.
        scenario: Scenario whose scenes have different families.
        progress: Listener.

    Returns:
        Facts of the scenes, in their order.

    Raises:
        RejectedSceneError: A scene does not suffice for a cloud.
    """
    from falsework.pipeline import run_scenario

    run = folder / _RUN
    outcome = run_scenario(scenario.model_copy(update={"keep": _COPIED}), run, progress)
    for name, reason in {**outcome.rejected, **outcome.failed}.items():
        raise RejectedSceneError("incomplete", f"scene {name}: {reason}")
    facts = [
        _copy(run / SCENES / f"{number:04d}", folder / SCENES / name) for number, name in enumerate(_names(scenario))
    ]
    (folder / SCENES / _SCENARIO).write_text(scenario.as_toml(), encoding="utf-8")  # inside an atomic folder
    shutil.rmtree(run)
    return facts


def scene_lines(scenes: list[SceneFacts]) -> list[str]:
    """Write the part of the card about the scenes: their contents, their use, and a table.

    Args:
        scenes: The scenes, at least one.
    """
    first, cloud = f"{SCENES}/{scenes[0].name}", scenes[0].clouds[0].name
    return [
        "## Scenes with photographs",
        "",
        "Each is a small random bridge of another family, photographed on one flight of a drone, and rendered.",
        "The name says its family and its seed. All of them are made again, with their stages, by",
        f"`falsework run bridges/{SCENES}/{_SCENARIO} -o out`.",
        "",
        "- `capture/global`: photographs with EXIF and GPS, as a drone records them. In `truth` exact poses and",
        "  intrinsics, and class, instance and depth [m] of every pixel.",
        "- `cloud/global+sparse`, `cloud/global+dense`: structure from motion and dense matching, from one model.",
        "  Each point has color, normal, class, instance and `uncertainty`, the measured error of its depth [m];",
        "  `observations` has its pixels in the photographs.",
        "- `cameras.json` and `cloud.json` say what the files hold. The world is metric, z up.",
        "",
        "```python",
        "import json, numpy as np",
        f'cloud = "bridges/{first}/cloud/{cloud}"',
        'points, labels = np.load(f"{cloud}/coord.npy"), np.load(f"{cloud}/segment.npy")  # [m]; class ids',
        'names = {row["id"]: row["name"] for row in json.load(open(f"{cloud}/cloud.json"))["classes"]}',
        'sure = points[np.load(f"{cloud}/uncertainty.npy") < 0.05]  # [m]',
        "```",
        "",
        "```sh",
        f"falsework report bridges/{first} -o scene.html",
        f"falsework export bridges/{first}/capture/global --to colmap -o for_colmap",
        "```",
        "",
        "| scene | images | registered | cloud | points | median uncertainty [m] | points of each class |",
        "|---|---|---|---|---|---|---|",
        *(
            f"| {scene.name} | {scene.images} | {scene.registered} | {cloud.name} | {cloud.points:,} | "
            f"{cloud.uncertainty:.4f} | {', '.join(f'{name} {count:,}' for name, count in cloud.classes)} |"
            for scene in scenes
            for cloud in scene.clouds
        ),
        "",
        "Limits: these are enough to look at and to try code on, not to train on. World and light are the same in all.",
        "Photographs are small, so clouds have holes, and thin members few points. Labels and uncertainty come from",
        "the truth of the renderer; real photographs have none.",
        "",
    ]


def _names(scenario: "Scenario") -> list[str]:
    """Name each scene by its family and the seed of the scenario."""
    from authoring.families.bridge_settings import draw_layout
    from authoring.streams import stream
    from falsework.scenario import scene_seed

    seeds = [scene_seed(scenario.seed, number) for number in range(scenario.scenes)]
    return [f"{draw_layout(scenario.bridge, stream(seed, 'bridge'))[1].family}-{scenario.seed}" for seed in seeds]


def _copy(made: Path, scene: Path) -> SceneFacts:
    """Copy captures and clouds of a scene, and read its facts."""
    from recon.cloud import read_cloud

    clouds = []
    for kind in _COPIED:
        for source in sorted((made / kind).iterdir()):
            place = scene / kind / source.name
            shutil.copytree(source, place, ignore=_LEFT_OUT, copy_function=shutil.copyfile)  # inside an atomic folder
    for place in sorted((scene / "cloud").iterdir()):
        cloud = read_cloud(place)
        counts = np.bincount(cloud.columns["segment"], minlength=256)
        named = [(row.name, int(counts[row.id])) for row in cloud.classes if counts[row.id]]
        by_count = tuple(sorted(named, key=lambda pair: (-pair[1], pair[0])))
        clouds.append(SceneCloud(place.name, len(cloud), float(np.median(cloud.columns["uncertainty"])), by_count))
    statuses = [row["status"] for row in read_json(scene / "cloud" / clouds[0].name / "cloud.json")["cameras"]]
    return SceneFacts(scene.name, len(statuses), statuses.count("ok"), tuple(clouds))
