"""A process that swallows an interrupt ends nevertheless: a short time after the first one, or at the second one."""

import os
import signal
import time

import pytest

from falsework.execution.interrupts import SOON, prompt_ending
from tests.falsework.forked import end_of, fork

FAR = 3600.0  # [s] longer than anybody waits


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(("seconds", "signals"), [(0.2, 1), (FAR, 2)])
def test_a_swallowed_signal_ends_the_process(number: signal.Signals, seconds: float, signals: int) -> None:
    """By the time after one signal, or by a second one long before; the exit code is that of the signal."""
    here, there = os.pipe()

    def stubborn() -> None:
        signal.signal(number, lambda *_: os.write(there, b"heard"))
        with prompt_ending(seconds):
            os.write(there, b"ready")
            while True:
                time.sleep(0.01)

    pid = fork(stubborn)
    os.close(there)  # so that a process that ends too early is an end of file here
    try:
        for _ in range(signals):
            assert os.read(here, 5) in (b"ready", b"heard")
            os.kill(pid, number)
        assert end_of(pid) == 128 + number
    finally:
        os.close(here)


def test_the_time_is_within_what_is_promised() -> None:
    """The command ends within 10 s of the first signal; what it closes besides takes the rest."""
    assert SOON <= 9.0
