"""Choice of the steps to make: those whose results are kept, and those that another step still needs."""

from falsework.execution.chain import Chain, Step
from falsework.store.store import Store

REPORT = "report.html"


def wanted_steps(chain: Chain, keep: tuple[str, ...]) -> set[str]:
    """List the steps that a run makes at all: those whose results are kept, and their inputs.

    Args:
        chain: The steps of a scene.
        keep: Stages whose results are kept.

    Returns:
        Their links.
    """
    wanted: set[str] = set()
    for step in (*(() if "report" not in keep else (chain.report(),)), *reversed(chain.steps)):
        if step.link in wanted or step.kind in keep:
            wanted |= {step.link, *(parent.link for parent in step.parents.values())}
    return wanted


def needed_steps(chain: Chain, store: Store, keep: tuple[str, ...]) -> set[str]:
    """List the steps that are missing and needed.

    Args:
        chain: The steps of a scene.
        store: Store of the results.
        keep: Stages whose results are kept.

    Returns:
        Links of the steps to make.
    """
    without = rejected_steps(chain, store)
    done = {step.link for step in chain.steps if step.link in without or store.has(step.task)}
    needed: set[str] = set()
    clouds = [step for step in chain.steps if step.kind == "cloud"]
    clouds_known = all(step.link in done or store.evicted_files(step.task) is not None for step in clouds)
    if "report" in keep and not (clouds_known and store.has(chain.report(without).task)):
        needed.add(REPORT)
    for step in reversed(chain.steps):
        waited_for = any(other in needed for other in consumers(chain, step))
        if step.link not in done and (waited_for or step.kind in keep):
            needed.add(step.link)
    return needed


def rejected_steps(chain: Chain, store: Store) -> frozenset[str]:
    """List the steps that were rejected in an earlier run, and those made from them.

    Args:
        chain: The steps of a scene.
        store: Store of the results.

    Returns:
        Their links.
    """
    without: frozenset[str] = frozenset()
    for step in chain.steps:
        if _rejected(store, step) or any(parent.link in without for parent in step.parents.values()):
            without |= {step.link}
    return without


def consumers(chain: Chain, step: Step) -> list[str]:
    """List the steps that use a step's result.

    Args:
        chain: The steps of its scene.
        step: The step.

    Returns:
        Their links.
    """
    others = (*chain.steps, chain.report())
    return [other.link for other in others if any(parent.link == step.link for parent in other.parents.values())]


def _rejected(store: Store, step: Step) -> bool:
    failure = store.failure(step.task)
    return failure is not None and failure.kind == "rejected"
