"""Falsework: bridges as USD stages, a virtual inspection flight around them, and annotated point clouds.

    import falsework

    scene = falsework.author({"bridge": {"family": "beam"}}, "scene")  # a layered USD stage
    flight = falsework.render(scene, "captures")["local"]  # photographs, cameras, truth
    cloud = falsework.reconstruct(flight, "cloud")  # labelled points, each with its uncertainty
    scan = falsework.sample(scene, "scan", falsework.TerrestrialSettings())  # the bridge as a laser sees it

Each writes one folder as a whole and gives back what lies in it; a folder that is there is read with `read_stage`,
`read_capture`, `read_truth` and `read_cloud`. `load_scenario` and `run` make many scenes, as `falsework run` does.
Whatever is wrong with a file, a folder or a scenario is an `InputError` of one line; a settings class that is given a
wrong value raises pydantic's `ValidationError`. docs/python.md shows all of it.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from usd_schemas.registration import register_schemas

if TYPE_CHECKING:
    from falsework.api import author, reconstruct, render, run, sample, save_cloud
    from falsework.commands.console import ConsoleProgress
    from falsework.pipeline import Outcome
    from falsework.scenario import Scenario, load_scenario, scenario_of
    from groundwork.errors import FalseworkError, InputError, RejectedSceneError
    from groundwork.progress import Progress
    from recon.cloud import Cloud, read_cloud
    from recon.sampling.sampler_settings import AirborneSettings, MeshSettings, MobileSettings, TerrestrialSettings
    from recon.settings import AlignmentSettings, DenseSettings, ReconSettings, SparseSettings
    from render.capture import Capture, Truth, read_capture, read_truth
    from render.settings import RenderSettings, SensorSettings
    from usd_schemas.components import ClassRow
    from usd_schemas.flat_scene import FlatScene
    from usd_schemas.reading.choices import StageChoices
    from usd_schemas.reading.stage_reader import read_stage

__all__ = [
    "AirborneSettings",
    "AlignmentSettings",
    "Capture",
    "ClassRow",
    "Cloud",
    "ConsoleProgress",
    "DenseSettings",
    "FalseworkError",
    "FlatScene",
    "InputError",
    "MeshSettings",
    "MobileSettings",
    "Outcome",
    "Progress",
    "ReconSettings",
    "RejectedSceneError",
    "RenderSettings",
    "Scenario",
    "SensorSettings",
    "SparseSettings",
    "StageChoices",
    "TerrestrialSettings",
    "Truth",
    "author",
    "load_scenario",
    "read_capture",
    "read_cloud",
    "read_stage",
    "read_truth",
    "reconstruct",
    "render",
    "run",
    "sample",
    "save_cloud",
    "scenario_of",
]

_HOMES = {
    "falsework.api": ("author", "reconstruct", "render", "run", "sample", "save_cloud"),
    "falsework.commands.console": ("ConsoleProgress",),
    "falsework.pipeline": ("Outcome",),
    "falsework.scenario": ("Scenario", "load_scenario", "scenario_of"),
    "groundwork.errors": ("FalseworkError", "InputError", "RejectedSceneError"),
    "groundwork.progress": ("Progress",),
    "recon.cloud": ("Cloud", "read_cloud"),
    "recon.sampling.sampler_settings": ("AirborneSettings", "MeshSettings", "MobileSettings", "TerrestrialSettings"),
    "recon.settings": ("AlignmentSettings", "DenseSettings", "ReconSettings", "SparseSettings"),
    "render.capture": ("Capture", "Truth", "read_capture", "read_truth"),
    "render.settings": ("RenderSettings", "SensorSettings"),
    "usd_schemas.components": ("ClassRow",),
    "usd_schemas.flat_scene": ("FlatScene",),
    "usd_schemas.reading.choices": ("StageChoices",),
    "usd_schemas.reading.stage_reader": ("read_stage",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

register_schemas()


def __getattr__(name: str) -> object:
    """Import a public name on first use, so that `import falsework` stays light.

    Args:
        name: A name of `__all__`.

    Raises:
        AttributeError: There is no such name.
    """
    if name not in _HOME:
        raise AttributeError(f"module 'falsework' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    """List the public names, for completion in a notebook."""
    return sorted(__all__)
