"""Scores of a trained model on unseen clouds; every point counts once."""

from typing import Any

from groundwork.progress import Progress
from learn.instance_defaults import FEWEST, least_link
from learn.sample import ScoredSource
from learn.scoring.record import Tally, tally_cloud, whole_record
from learn.scoring.votes import Predicting, scored_clouds
from usd_schemas.components import component_classes

_REST = ("background", "noisy_point")  # classes of the base table without instances


def evaluate_model(model: Predicting, source: ScoredSource, progress: Progress, voxel: float = 0.0) -> dict[str, Any]:
    """Score a model: each point gets the mean of the predictions in the draws and tiles that hold it, and counts once.

    Args:
        model: A trained model with the classes of the source.
        source: Samples of a split that visits every point.
        progress: Listener.
        voxel: Side of the cubes that its clouds were thinned by [m]; 0 if they were not.

    Returns:
        A record for JSON: scores of all bridges together and of each, matrices, calibration, mean IoU by uncertainty,
        panoptic quality. An undefined score is null.
    """
    names = source.classes
    without = [number for number, name in enumerate(names) if component_classes().get(name, name) in _REST]
    link = least_link(voxel)
    tallies: dict[str, Tally] = {}
    for cloud in scored_clouds(model, source, progress):
        counted = tally_cloud(cloud, len(names), without, link, FEWEST)
        tallies[cloud.bridge] = tallies[cloud.bridge] + counted if cloud.bridge in tallies else counted
    return whole_record(tallies, names, link)
