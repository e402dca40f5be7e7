"""Falsework: bridges as USD stages, a virtual inspection flight around them, and annotated point clouds.

    import falsework

    scene = falsework.author({"bridge": {"family": "beam"}}, "scene")  # a layered USD stage
    flight = falsework.render(scene, "captures")["global"]  # photographs, cameras, truth
    cloud = falsework.reconstruct(flight, "cloud")  # labeled points, each with its uncertainty
    scan = falsework.sample(scene, "scan", falsework.TerrestrialSettings())  # a simulated laser scan

    points, classes = cloud.columns["coord"], cloud.columns["segment"]  # [m], shape (N, 3); shape (N,)
    names = {row.id: row.name for row in cloud.classes}

Functions that make something; each writes one output folder:

    author(scenario, out)           a scenario, or its sections as a dict  ->  path of scene.usda
    swap(scene, out, look=…)        a copy of a scene with other layers    ->  path of its scene.usda
    render(stage, out)              any USD stage                          ->  {name: Capture}
    reconstruct(capture, out)       a capture, or your own photographs     ->  Cloud
    sample(stage, out, settings)    any USD stage, without photographs     ->  Cloud
    run(scenario, out)              many scenes, as `falsework run` does   ->  Outcome
    save_cloud(cloud, out)          a cloud of your own making             ->  None; every command reads the folder

Functions that read:

    read_stage(path)                USD file           ->  FlatScene: triangles, looks, lights, cameras, labels
    read_capture(folder)            folder of render   ->  Capture: photographs and their cameras
    load_image(capture, index)      one photograph     ->  sRGB, shape (H, W, 3), uint8
    read_truth(capture)             the same capture   ->  Truth: poses, depth, classes, instances; or None
    read_cloud(folder)              folder of a cloud  ->  Cloud
    segment_with_noise(cloud, 0.1)  a cloud            ->  classes, uncertain points as `noisy_point`
    load_scenario(path)             TOML file          ->  Scenario
    scenario_of(values)             dict               ->  Scenario

Settings: RenderSettings (SensorSettings) for render, ReconSettings (SparseSettings, DenseSettings, AlignmentSettings)
for reconstruct; MeshSettings, TerrestrialSettings, MobileSettings or AirborneSettings for sample; StageChoices for
read_stage. The other classes are those of the fields of a FlatScene, a Capture or a Truth. ConsoleProgress() as
`progress` draws a bar.

Errors: a wrong path, file, folder or scenario raises InputError with a message of one line. Photographs that do not
suffice for a cloud raise RejectedSceneError. A settings class with a wrong value raises pydantic's ValidationError.

`help(falsework.render)` describes the arguments of one function; docs/python.md has examples of all of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from usd_schemas.registration import register_schemas

if TYPE_CHECKING:
    from falsework.api import author, reconstruct, render, run, sample, save_cloud, swap
    from falsework.api_reading import load_scenario, read_capture, read_cloud, read_stage, read_truth, scenario_of
    from falsework.commands.console import ConsoleProgress
    from falsework.pipeline import Outcome
    from falsework.scenario import Scenario
    from groundwork.errors import FalseworkError, InputError, RejectedSceneError
    from groundwork.progress import Progress
    from recon.cloud import Cloud, segment_with_noise
    from recon.sampling.sampler_settings import AirborneSettings, MeshSettings, MobileSettings, TerrestrialSettings
    from recon.settings import AlignmentSettings, DenseSettings, ReconSettings, SparseSettings
    from render.capture import CalibrationPrior, Capture, CaptureImage, Readout, Truth, load_image
    from render.settings import RenderSettings, SensorSettings
    from usd_schemas.components import ClassRow
    from usd_schemas.distortion import Distortion
    from usd_schemas.flat_lights import Dome, SphereLight, Sun
    from usd_schemas.flat_scene import (
        CameraTrack,
        Detail,
        Draws,
        FlatScene,
        Geometry,
        InstanceRow,
        Material,
        Product,
        Texture,
    )
    from usd_schemas.pinhole import Pinhole, UsdLens
    from usd_schemas.reading.choices import StageChoices

__all__ = [
    "AirborneSettings",
    "AlignmentSettings",
    "CalibrationPrior",
    "CameraTrack",
    "Capture",
    "CaptureImage",
    "ClassRow",
    "Cloud",
    "ConsoleProgress",
    "DenseSettings",
    "Detail",
    "Distortion",
    "Dome",
    "Draws",
    "FalseworkError",
    "FlatScene",
    "Geometry",
    "InputError",
    "InstanceRow",
    "Material",
    "MeshSettings",
    "MobileSettings",
    "Outcome",
    "Pinhole",
    "Product",
    "Progress",
    "Readout",
    "ReconSettings",
    "RejectedSceneError",
    "RenderSettings",
    "Scenario",
    "SensorSettings",
    "SparseSettings",
    "SphereLight",
    "StageChoices",
    "Sun",
    "TerrestrialSettings",
    "Texture",
    "Truth",
    "UsdLens",
    "author",
    "load_image",
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
    "segment_with_noise",
    "swap",
]

_HOMES = {
    "falsework.api": ("author", "swap", "render", "reconstruct", "sample", "run", "save_cloud"),
    "falsework.api_reading": (
        *("read_stage", "read_capture", "read_truth", "read_cloud", "load_scenario", "scenario_of"),
    ),
    "falsework.commands.console": ("ConsoleProgress",),
    "falsework.pipeline": ("Outcome",),
    "falsework.scenario": ("Scenario",),
    "groundwork.errors": ("FalseworkError", "InputError", "RejectedSceneError"),
    "groundwork.progress": ("Progress",),
    "recon.cloud": ("Cloud", "segment_with_noise"),
    "recon.sampling.sampler_settings": ("AirborneSettings", "MeshSettings", "MobileSettings", "TerrestrialSettings"),
    "recon.settings": ("AlignmentSettings", "DenseSettings", "ReconSettings", "SparseSettings"),
    "render.capture": ("CalibrationPrior", "Capture", "CaptureImage", "Readout", "Truth", "load_image"),
    "render.settings": ("RenderSettings", "SensorSettings"),
    "usd_schemas.components": ("ClassRow",),
    "usd_schemas.distortion": ("Distortion",),
    "usd_schemas.flat_lights": ("Dome", "SphereLight", "Sun"),
    "usd_schemas.flat_scene": (
        *("CameraTrack", "Detail", "Draws", "FlatScene", "Geometry", "InstanceRow", "Material", "Product", "Texture"),
    ),
    "usd_schemas.pinhole": ("Pinhole", "UsdLens"),
    "usd_schemas.reading.choices": ("StageChoices",),
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
