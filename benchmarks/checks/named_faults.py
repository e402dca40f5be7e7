"""Faults that a reviewer put in by hand, and that tests once did not detect: tried again with those that are drawn."""

from dataclasses import dataclass


@dataclass(frozen=True)
class NamedFault:
    """A fault in one place.

    Attributes:
        what: What goes wrong.
        file: File, from the root of the repository.
        before: Text that stands there once.
        after: Text of the fault.
        tests: Files of the tests that are there to notice.
    """

    what: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]


NAMED = (
    NamedFault(
        "RANSAC's cost is not truncated",
        "recon/placing/align.py",
        "np.minimum(far, limit).sum(axis=1)",
        "far.sum(axis=1)",
        ("tests/recon/test_align.py",),
    ),
    NamedFault(
        "side spans sag by half",
        "authoring/parts/suspension_cables.py",
        "4.0 * self.side_sag",
        "2.0 * self.side_sag",
        ("tests/authoring/bridges/test_cables.py",),
    ),
    NamedFault(
        "a result's key depends on how the work is done",
        "falsework/store/store.py",
        "return task_key(self.stage, self.version, self.settings, self.inputs)",
        "return task_key(self.stage, self.version, {**self.settings, **self.manner}, self.inputs)",
        ("tests/falsework/test_store.py",),
    ),
    NamedFault(
        "a commit does not wait for the disk",
        "groundwork/files.py",
        "            os.fsync(handle)\n    finally:",
        "            pass\n    finally:",
        ("tests/groundwork/test_files.py",),
    ),
    NamedFault(
        "a lock does not exclude other processes",
        "groundwork/locks.py",
        "fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))",
        "pass",
        ("tests/groundwork/test_locks.py",),
    ),
    NamedFault(
        "classes of saddles and clamps are exchanged",
        "usd_schemas/tables/components.toml",
        '"cable_clamp"]\n\n[cable_top]\ncomponents = ["saddle"',
        '"saddle"]\n\n[cable_top]\ncomponents = ["cable_clamp"',
        ("tests/usd_schemas/test_components.py",),
    ),
)
