"""The readers of the Python API: stages, captures, clouds and scenarios as records.

Every path may be a `str` or a `pathlib.Path`.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

from falsework.arguments import check, check_text, of_python, path_of

if TYPE_CHECKING:
    from falsework.scenario import Scenario
    from recon.cloud import Cloud
    from render.capture import Capture, Truth
    from usd_schemas.flat_scene import FlatScene
    from usd_schemas.reading.choices import StageChoices


@of_python
def read_stage(
    path: str | PathLike[str], *, survey: str | None = None, choices: StageChoices | None = None
) -> FlatScene:
    """Read a stage as arrays: geometry, materials, lights, cameras and labels.

    Args:
        path: A USD file (usda, usdc, usd or usdz).
        survey: Name of the only product to read, with its camera; None: all.
        choices: Camera, frames, purposes, variants and the like, to override those of the stage.

    Returns:
        The stage in meters with z up; moving objects at the time of each image.

    Raises:
        InputError: There is no such file, it is not a USD file, it contains nothing to draw, it has no such product, or
            a choice is impossible.

    Example:
        >>> flat = falsework.read_stage(scene)
    """
    from usd_schemas.reading.choices import AS_AUTHORED, StageChoices, checked_choices
    from usd_schemas.reading.stage_reader import read_stage

    check_text(survey, "survey")
    chosen = AS_AUTHORED if choices is None else choices
    check(chosen, "choices", StageChoices, "StageChoices")
    chosen = checked_choices(chosen)
    return read_stage(path_of(path, "path"), survey=survey, choices=chosen)


@of_python
def read_capture(folder: str | PathLike[str]) -> Capture:
    """Read a capture without its `truth/`; images are decoded later.

    Args:
        folder: A capture.

    Raises:
        InputError: Not a capture, a wrong value, a duplicate name, a missing image, or a path that leaves the folder.

    Example:
        >>> flight = falsework.read_capture("captures/global")
    """
    from render.capture import read_capture

    return read_capture(path_of(folder, "folder"))


@of_python
def read_truth(capture: Capture | str | PathLike[str]) -> Truth | None:
    """Open the truth of a capture.

    Args:
        capture: A capture, or its folder.

    Returns:
        The truth; None for real photographs.

    Raises:
        InputError: The truth does not belong to these images.

    Example:
        >>> truth = falsework.read_truth(flight)
    """
    from render.capture import Capture, read_truth

    return read_truth(capture if isinstance(capture, Capture) else path_of(capture, "capture"))


@of_python
def read_cloud(folder: str | PathLike[str]) -> Cloud:
    """Read a cloud and check that it is complete.

    Args:
        folder: A cloud.

    Raises:
        InputError: Not a cloud, or a column is missing, damaged, of a wrong type or length, or a coordinate is not
            finite.

    Example:
        >>> cloud = falsework.read_cloud("cloud")
    """
    from recon.cloud import read_cloud

    return read_cloud(path_of(folder, "folder"))


@of_python
def load_scenario(path: str | PathLike[str]) -> Scenario:
    """Read a scenario file.

    Args:
        path: TOML file; relative paths in it are relative to its folder.

    Returns:
        The scenario, with absolute paths, which are valid in every process of a run.

    Raises:
        InputError: Missing, not TOML, or a key or value that is not allowed.

    Example:
        >>> scenario = falsework.load_scenario("bridges.toml")
    """
    from falsework.scenario import load_scenario

    return load_scenario(path_of(path, "path"))


@of_python
def scenario_of(values: Mapping[str, Any], path: str | PathLike[str] = "scenario") -> Scenario:
    """Validate a scenario given as a dict of sections and keys.

    Args:
        values: Sections and keys, as in a TOML file.
        path: Name of the scenario in errors; relative paths are relative to its folder, by default the current one.

    Returns:
        The scenario, with absolute paths.

    Raises:
        InputError: A key or value that is not allowed.

    Example:
        >>> scenario = falsework.scenario_of({"bridge": {"family": "girder"}})
    """
    from falsework.scenario import scenario_of

    return scenario_of(values, path_of(path, "path"))
