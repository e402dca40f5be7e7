"""Handling of interrupts: the first one stops a run soon, a second one or a timeout at once; both can be resumed."""

import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

SOON = 8.0  # [s] for cleaning up; the rest is cleaned up at the next start
ENDING = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def prompt_ending(seconds: float = SOON) -> Iterator[None]:
    """End the process a short time after the first interrupt, and at once at the second one.

    The usual handlers run at the first one. Child processes end with their parent.

    Args:
        seconds: Time from the first one to a forced end [s].
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    here, there = socket.socketpair()
    for end in (here, there):
        end.setblocking(False)
    former = signal.set_wakeup_fd(there.fileno(), warn_on_full_buffer=False)
    stop = threading.Event()
    threading.Thread(target=_watch, args=(here, stop, seconds), daemon=True).start()
    try:
        yield
    finally:
        stop.set()
        signal.set_wakeup_fd(former)
        there.close()  # which wakes the watcher


def _watch(here: socket.socket, stop: threading.Event, seconds: float) -> None:
    """Count the signals, which the signal handler writes into the socket, even if the main thread is busy."""
    first, end = 0, 0.0
    while True:
        here.settimeout(max(end - time.monotonic(), 0.001) if first else None)
        try:
            numbers = [number for number in here.recv(64) or b"" if number in ENDING]
        except TimeoutError:
            numbers = [first]
        except OSError:
            return
        if stop.is_set():
            here.close()
            return
        for number in numbers:
            if first:
                os._exit(128 + first)
            first, end = number, time.monotonic() + seconds
