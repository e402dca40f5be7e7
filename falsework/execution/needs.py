"""Which steps of a scene have to be there: those whose results stay, and those that another step still needs."""

from falsework.execution.chain import Chain, Step
from falsework.store.store import Store


def needed_steps(chain: Chain, store: Store, keep: tuple[str, ...]) -> set[str]:
    """Name the steps that are neither there nor dispensable.

    Args:
        chain: The steps of a scene.
        store: Where results are.
        keep: Stages whose results stay.

    Returns:
        Links of the steps to make.
    """
    steps = {step.link: step for step in chain.steps}
    settled = {link for link, step in steps.items() if store.has(step.task) or _rejected(store, step)}
    without = frozenset(link for link, step in steps.items() if _rejected(store, step))
    for flight in chain.flights:
        if flight.capture.link in without:
            settled.add(flight.cloud.link)
            without |= {flight.cloud.link}
    needed: set[str] = set()
    clouds = [step for step in chain.steps if step.kind == "cloud"]
    clouds_known = all(step.link in settled or store.evicted_files(step.task) is not None for step in clouds)
    if "report" in keep and not (clouds_known and store.has(chain.report(without).task)):
        needed.add("report.html")
    order = [link for kind in ("cloud", "capture", "stage") for link in sorted(steps) if link.startswith(kind)]
    for link in order:
        waited_for = any(other in needed for other in consumers(chain, steps[link]))
        if link not in settled and (waited_for or steps[link].kind in keep):
            needed.add(link)
    return needed


def consumers(chain: Chain, step: Step) -> list[str]:
    """Name the steps that a step's result goes into.

    Args:
        chain: The steps of its scene.
        step: The step.

    Returns:
        Their links.
    """
    if step.task.stage == "stage":
        captures = (flight.capture.link for flight in chain.flights)
        return [*captures, *(sample.link for sample in chain.samples), "report.html"]
    own = [flight.cloud.link for flight in chain.flights if flight.capture.link == step.link]
    return [*own, "report.html"]


def _rejected(store: Store, step: Step) -> bool:
    failure = store.failure(step.task)
    return failure is not None and failure.kind == "rejected"
