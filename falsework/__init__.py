"""Falsework: bridges as USD stages, a virtual inspection flight around them, and annotated point clouds."""

from importlib import import_module
from typing import TYPE_CHECKING

from usd_schemas.registration import register_schemas

if TYPE_CHECKING:
    from authoring.scene import author_scene
    from falsework.pipeline import Outcome, run_scenario
    from falsework.scenario import Scenario, load_scenario
    from recon.cloud import Cloud, read_cloud
    from recon.reconstruct import reconstruct
    from render.capture import Capture, read_capture
    from usd_schemas.flat_scene import FlatScene
    from usd_schemas.reading.stage_reader import read_stage

__all__ = [
    "Capture",
    "Cloud",
    "FlatScene",
    "Outcome",
    "Scenario",
    "author_scene",
    "load_scenario",
    "read_capture",
    "read_cloud",
    "read_stage",
    "reconstruct",
    "run_scenario",
]

_HOME = {
    "Capture": "render.capture",
    "Cloud": "recon.cloud",
    "FlatScene": "usd_schemas.flat_scene",
    "Outcome": "falsework.pipeline",
    "Scenario": "falsework.scenario",
    "author_scene": "authoring.scene",
    "load_scenario": "falsework.scenario",
    "read_capture": "render.capture",
    "read_cloud": "recon.cloud",
    "read_stage": "usd_schemas.reading.stage_reader",
    "reconstruct": "recon.reconstruct",
    "run_scenario": "falsework.pipeline",
}

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
