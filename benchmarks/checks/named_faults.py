"""Faults that a reviewer put in by hand, and that tests once did not detect: tried again with those that are drawn."""

from dataclasses import dataclass


@dataclass(frozen=True)
class NamedFault:
    """A fault in one place.

    Attributes:
        what: What goes wrong.
        module: Its module, or the path of a file that is none.
        before: Text that stands there once.
        after: Text of the fault.
        tests: Modules of the tests that are there to notice.
    """

    what: str
    module: str
    before: str
    after: str
    tests: tuple[str, ...]


def file_of(module: str) -> str:
    """Give the file of a module, from the root of the repository.

    Args:
        module: Its dotted name; a path is returned as it is.
    """
    return module if "/" in module else f"{module.replace('.', '/')}.py"


NAMED = (
    NamedFault(
        "RANSAC's cost is not truncated",
        "recon.placing.align",
        "np.minimum(far, limit).sum(axis=1)",
        "far.sum(axis=1)",
        ("tests.recon.test_align",),
    ),
    NamedFault(
        "side spans sag by half",
        "authoring.parts.suspension_cables",
        "4.0 * self.side_sag",
        "2.0 * self.side_sag",
        ("tests.authoring.bridges.test_cables",),
    ),
    NamedFault(
        "a result's key depends on how the work is done",
        "falsework.store.store",
        "return task_key(self.stage, self.version, self.settings, self.inputs)",
        "return task_key(self.stage, self.version, {**self.settings, **self.manner}, self.inputs)",
        ("tests.falsework.test_store",),
    ),
    NamedFault(
        "a commit does not wait for the disk",
        "groundwork.files",
        "            os.fsync(handle)\n    finally:",
        "            pass\n    finally:",
        ("tests.groundwork.test_files",),
    ),
    NamedFault(
        "a lock does not exclude other processes",
        "groundwork.locks",
        "fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))",
        "pass",
        ("tests.groundwork.test_locks",),
    ),
    NamedFault(
        "classes of saddles and clamps are exchanged",
        "usd_schemas/tables/components.toml",
        '"cable_clamp"]\n\n[cable_top]\ncomponents = ["saddle"',
        '"saddle"]\n\n[cable_top]\ncomponents = ["cable_clamp"',
        ("tests.usd_schemas.test_components",),
    ),
)
