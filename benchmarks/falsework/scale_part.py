"""What `benchmarks.falsework.scale` measures in a process of its own.

Usage: python -m benchmarks.falsework.scale_part {plan,schedule,work} NUMBER

NUMBER counts scenes, or matrix products.

Prints JSON: seconds, processor seconds, and memory [MB].
"""

import json
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.falsework.fake_run import work
from falsework.execution import cluster
from falsework.execution.chain import read_sources
from falsework.execution.cluster import SceneJob, run_on_cluster
from falsework.execution.outcome import Outcome
from falsework.execution.plan import plan_run
from falsework.execution.scene import RunOptions
from falsework.scenario import Scenario, load_scenario
from groundwork.progress import SILENT

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios" / "paper-local.toml"
WORKERS = 2


def no_work(job: SceneJob) -> tuple[Outcome, list[str]]:
    """Replace the scene stage by one that takes no time.

    Args:
        job: Which.
    """
    return Outcome(made=1), []


def plan(scenario: Scenario, out: Path) -> None:
    """Plan a run of which nothing is there.

    Args:
        scenario: What to make.
        out: Where; need not be there.
    """
    plan_run(scenario, out, SILENT)


def schedule(scenario: Scenario, out: Path) -> None:
    """Hand every scene to workers that do nothing with it.

    Args:
        scenario: What to make.
        out: Where; nothing is written.
    """
    sources, manner = read_sources(scenario, SILENT), RunOptions(keep=scenario.keep)
    jobs = [SceneJob(scenario, sources, index, out, manner) for index in range(scenario.scenes)]
    outcome = run_on_cluster(jobs, SILENT, WORKERS, None)
    assert outcome.made == scenario.scenes


PARTS: dict[str, Callable[[Scenario, Path], None]] = {"plan": plan, "schedule": schedule}


def memory() -> float:
    """Return the peak resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> None:
    """Measure one part."""
    if sys.argv[1] == "work":
        work(1)
        begin, spent = time.perf_counter(), time.process_time()
        work(int(sys.argv[2]))
        seconds, spent = time.perf_counter() - begin, time.process_time() - spent
        print(json.dumps({"seconds": seconds, "processor": spent}))  # noqa: T201
        return
    part, scenes = PARTS[sys.argv[1]], int(sys.argv[2])
    cluster.do_job = no_work  # sent to the workers by name
    scenario = load_scenario(SCENARIO)
    with tempfile.TemporaryDirectory() as scratch:
        part(scenario.model_copy(update={"scenes": 2}), Path(scratch) / "few")  # loads what is loaded once
        before, begin, spent = memory(), time.perf_counter(), time.process_time()
        part(scenario.model_copy(update={"scenes": scenes}), Path(scratch) / "out")
        seconds, spent = time.perf_counter() - begin, time.process_time() - spent
    told = {"seconds": seconds, "processor": spent, "memory": memory(), "before": before}
    print(json.dumps(told))  # noqa: T201


if __name__ == "__main__":
    from benchmarks.falsework.scale_part import main as named  # so that workers find `no_work` by its module

    named()
