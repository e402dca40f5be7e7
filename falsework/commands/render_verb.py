"""`falsework render`: render any USD stage into captures; options are checked before the stage is read."""

from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from falsework.commands.answers import AsJson, capture_facts, tell
from falsework.commands.console import ConsoleProgress
from groundwork.errors import InputError

Output = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
File = tyro.conf.Positional[Path]
Several = tyro.conf.UseAppendAction[tuple[str, ...]]


def render(
    stage: File,
    output: Output,
    *,
    survey: str | None = None,
    camera: str = "",
    frame: Several = (),
    width: int = 0,
    height: int = 0,
    exposure: str = "auto",
    purpose: Several = (),
    variant: Several = (),
    quality: Literal["fast", "standard", "fine"] = "standard",
    subdivision: int = 1,
    noise: Annotated[bool, tyro.conf.arg(help_behavior_hint="(default: with noise)")] = True,
    seed: int = 7,
    workers: int = 1,
    allow_root: tuple[Path, ...] = (),
    as_json: AsJson = False,
) -> int:
    """Render any USD stage into captures: one folder for each RenderProduct or, if there is none, for each camera.

    An interrupted command can be repeated and continues where it stopped.

    Args:
        stage: USD file.
        output: Folder to write.
        survey: Only this product or camera.
        camera: Only this camera, by its name or prim path, instead of the products.
        frame: Time code of an image, or FIRST:LAST or FIRST:LAST:STEP; may be given more than once. Default: those of
            the camera.
        width: Image width [px]; without a height the aspect ratio is kept.
        height: Image height [px].
        exposure: `light` (metered on the incident light: dark things stay dark), `surfaces` (metered on the picture:
            the middle tone becomes gray), a number of stops relative to gain 1, or `auto`: surfaces for our own
            flights, else light.
        purpose: A purpose to draw beside `default`: render, proxy or guide; default: render.
        variant: /PRIM/PATH:SET=NAME; may be given more than once.
        quality: Quality of the shading.
        subdivision: Number of refinements of subdivision surfaces; 0 draws their control meshes.
        noise: The images have the sensor's noise; with `--no-noise` they have none.
        seed: Seed of the sensor's noise.
        workers: Number of processes that share the frames of a survey; it does not change the result.
        allow_root: Further folders from which the stage may load layers and textures.
        as_json: Print one JSON object instead of lines.
    """
    from falsework.commands.verbs import render_file

    sensor = {"noise": noise, **_exposure(exposure)}
    settings = {"quality": quality, "sensor": sensor, "workers": workers, "subdivision": subdivision}
    choices = _choices(settings, camera, frame, purpose, variant, (width, height))
    with ConsoleProgress() as progress:
        names = render_file(stage, output, survey, settings, seed, progress, allow_roots=allow_root, choices=choices)
    captures = [output / name for name in names]
    facts = {"captures": [capture_facts(capture) for capture in captures]} if as_json else {}
    return tell(facts, [f"capture {capture}" for capture in captures], as_json)


def _choices(
    settings: dict[str, Any],
    camera: str,
    frame: tuple[str, ...],
    purpose: tuple[str, ...],
    variant: tuple[str, ...],
    size: tuple[int, int],
) -> dict[str, Any] | None:
    """Check settings and choices; return the choices as JSON, None if nothing is overridden."""
    from groundwork.settings import parse_settings
    from render.settings import RenderSettings
    from usd_schemas.reading.choices import AS_AUTHORED, StageChoices, checked_choices, frames_of, variants_of

    options = settings.keys() - {"sensor"}
    level = parse_settings(RenderSettings, settings, "render", options).subdivision
    purposes = ("default", *(purpose or ("render",)))
    choices = checked_choices(StageChoices(camera, frames_of(frame), purposes, variants_of(variant), *size, level))
    return None if choices == AS_AUTHORED else choices.as_json()


def _exposure(word: str) -> dict[str, Any]:
    """Convert the option to settings of the sensor."""
    if word in ("auto", "light", "surfaces"):
        return {"metering": word}
    try:
        return {"exposure": float(word)}
    except ValueError:
        allowed = "auto, light, surfaces, or a number [EV]"
        raise InputError("not an exposure", field="--exposure", value=word, allowed=allowed) from None
