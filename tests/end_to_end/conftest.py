"""One tiny chain that every end-to-end test shares."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from falsework.pipeline import Outcome, run_scenario
from falsework.scenario import Scenario
from groundwork.progress import SILENT
from groundwork.settings import parse_settings

TINY = {
    "seed": 3,
    "bridge": {
        "family": "beam",
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0, "profile": "grade"},
        "beam": {"spans": [12.0]},
    },
    "background": {"name": "none"},
    "survey": [{"kind": "global", "images": 24, "width": 480, "height": 360}],
    "render": {"quality": "fast"},
}


@dataclass(frozen=True)
class Chain:
    """A finished tiny run.

    Attributes:
        scenario: What was asked for.
        out: Its output folder.
        outcome: What came of the first run.
    """

    scenario: Scenario
    out: Path
    outcome: Outcome


@pytest.fixture(scope="session")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Chain:
    """Run the whole chain once, on real parts, as small as it goes."""
    scenario = parse_settings(Scenario, TINY, "tiny")
    out = tmp_path_factory.mktemp("chain") / "out"
    return Chain(scenario, out, run_scenario(scenario, out, SILENT))
