"""`falsework preview`: one picture of a scenario, without flights."""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from falsework.commands.answers import AsJson, tell
from falsework.commands.console import ConsoleProgress
from falsework.commands.given_files import need_scenario
from groundwork.errors import InputError
from groundwork.progress import Progress

if TYPE_CHECKING:
    from falsework.scenario import Scenario

Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
File = tyro.conf.Positional[Path]

_SIDES = (64, 8192)  # [px] of a picture


def preview(
    scenario: File,
    output: Output,
    *,
    view: Literal["auto", "air", "ground", "side"] = "auto",
    width: int = 1600,
    height: int = 900,
    quality: Literal["fast", "standard", "fine"] = "fine",
    scene: int = 0,
    as_json: AsJson = False,
) -> int:
    """Preview a scenario: author one of its scenes temporarily and render one picture of the whole bridge.

    Only the picture is kept.

    Args:
        scenario: TOML file.
        output: PNG file to write.
        view: air: from beside and above, as a drone; ground: standing on the ground; side: perpendicular to the bridge;
            auto: air or ground, whichever shows more of the bridge in better light.
        width: Width of the picture [px].
        height: Its height [px].
        quality: Quality of the shading.
        scene: Number of the scene.
        as_json: Print one JSON object instead of a line.
    """
    for field, side in (("--width", width), ("--height", height)):
        if not _SIDES[0] <= side <= _SIDES[1]:
            raise InputError(
                "picture size out of range", field=field, value=side, allowed=f"{_SIDES[0]} to {_SIDES[1]} px"
            )
    if output.suffix.lower() != ".png":
        raise InputError("not a PNG", field="--output", value=str(output), allowed="a name that ends in .png")
    need_scenario(scenario)
    from falsework.scenario import given_files, load_scenario, values_of
    from groundwork.output.file import check_output_file, write_fresh_file
    from groundwork.output.reading import reading

    loaded = load_scenario(scenario)
    if not 0 <= scene < loaded.scenes:
        raise InputError("no such scene", field="--scene", value=scene, allowed=f"0 to {loaded.scenes - 1}")
    inputs = [scenario, *given_files(loaded).values()]
    check_output_file(output, inputs)
    asked = {"view": view, "width": width, "height": height, "render": _shading(loaded, quality)}
    with reading(*inputs), values_of(scenario), ConsoleProgress() as progress:
        data = _picture(loaded, scene, asked, progress)
    write_fresh_file(output, data, inputs)
    return tell({"picture": str(output)}, [f"picture {output}"], as_json)


def _shading(scenario: "Scenario", quality: str) -> dict[str, Any]:
    """Use the scenario's render settings, with the changes for a single picture."""
    told = scenario.rendering()
    metering = told["sensor"]["metering"].replace("auto", "surfaces")  # as for the scene's surveys
    sensor = {**told["sensor"], "metering": metering, "noise": False, "image_format": "png", "auto_exposure": 1.0}
    return {**told, "quality": quality, "normals": False, "workers": 1, "sensor": sensor}


def _picture(scenario: "Scenario", scene: int, asked: dict[str, Any], progress: Progress) -> bytes:
    """Author the scene without flights and variants, unless it starts from a stage, and render its picture."""
    from falsework.gallery.preview import photograph_stage
    from falsework.scenario import given_files, scene_seed
    from falsework.stages import STAGES, root_layer

    if scenario.stage is not None:
        return photograph_stage(
            root_layer(Path(scenario.stage.path)), {**asked, "allow_roots": list(scenario.stage.allow_root)}, progress
        )
    authoring = {**scenario.authoring(), "survey": [], "variants": {}}
    with tempfile.TemporaryDirectory(prefix="falsework_preview_") as scratch:
        stage = Path(scratch)
        request = {"seed": scene_seed(scenario.seed, scene), "authoring": authoring}
        STAGES["stage"].run(request, given_files(scenario), stage, progress)
        return photograph_stage(stage / "scene.usda", asked, progress)
