"""Which bridges the invariants look at: a few that change with every commit, two hundred for the proof."""

import subprocess
import zlib
from collections import OrderedDict
from collections.abc import Callable

import pytest

from groundwork.errors import InputError
from tests.authoring.bridges import invariants, structure
from tests.authoring.bridges.built import Bridge, Figures, make_bridge
from tests.authoring.bridges.ratios import ratios_in_bands
from tests.conftest import ROOT, Count

QUICK, PROOF = 2, 200
FIXED = 1  # seed of the tests that look at one bridge

Invariant = Callable[[Bridge], list[str]]
Judgement = dict[str, list[str]]
Judged = dict[int, tuple[Judgement, dict[str, Figures]]]
INVARIANTS: tuple[Invariant, ...] = (
    invariants.closed_and_outward,
    invariants.no_degenerate_triangle,
    invariants.honest_faces,
    invariants.nothing_floats,
    invariants.no_collision,
    invariants.no_common_faces,
    invariants.named_and_numbered,
    invariants.even_texels,
    invariants.atlas_without_overlap,
    invariants.declared_sizes,
    structure.bearings_carry,
    structure.every_member_meets_its_neighbors,
    structure.cables_end_in_fittings,
    structure.supports_have_bearings,
    structure.headroom,
    structure.rails_at_gauge,
    ratios_in_bands,
)
BUILDS = "every_draw_builds"


def rotating(count: int) -> list[int]:
    """List seeds that change with the commit, out of those that the proof covers.

    So runs over time see many bridges, and a red one is a fault that came in, never the luck of a new draw.

    Args:
        count: How many.
    """
    done = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    first = zlib.crc32(done.stdout.strip().encode())
    return [(first + number) % PROOF for number in range(count)]


def profile_of(seed: int) -> str:
    """Choose a profile: every fourth bridge is one of the paper's.

    Args:
        seed: Seed of the bridge.
    """
    return "paper" if seed % 4 == 0 else "default"


def judge(bridge: Bridge) -> tuple[Judgement, dict[str, Figures]]:
    """Find what is wrong with a bridge, by the invariant's name, where what holds is not listed; and what was measured.

    Args:
        bridge: Any bridge.
    """
    wrong, figures = Judgement(), dict[str, Figures]()
    for invariant in INVARIANTS:
        bridge.measured.clear()
        if found := invariant(bridge):
            wrong[invariant.__name__] = found
        figures[invariant.__name__] = dict(bridge.measured)
    return wrong, figures


@pytest.fixture(scope="session")
def seeds(proof_count: Count) -> list[int]:
    """Seeds of the bridges that are built for each family."""
    return sorted(rotating(proof_count(QUICK, PROOF)))


@pytest.fixture(scope="session")
def judged(seeds: list[int]) -> Callable[[str], Judged]:
    """Give, for a family, what is wrong with each seed's bridge, and its figures. Each is built once and not kept."""
    known: OrderedDict[str, Judged] = OrderedDict()

    def judgements(family: str) -> Judged:
        if family not in known:
            known[family] = {seed: _judge_seed(family, seed) for seed in seeds}
        return known[family]

    return judgements


def _judge_seed(family: str, seed: int) -> tuple[Judgement, dict[str, Figures]]:
    try:
        bridge = make_bridge(family, seed, profile=profile_of(seed))
    except InputError as error:
        return {BUILDS: [str(error)]}, {}
    wrong, figures = judge(bridge)
    return wrong, figures | {BUILDS: {"bridges_built": 1.0}}
