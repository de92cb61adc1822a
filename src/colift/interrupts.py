"""Ctrl-C ends what it interrupts, also where a solver's callback has swallowed it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def heard() -> Iterator[Callable[[], None]]:
    """Raise ``KeyboardInterrupt`` at the end of the block, or when asked, if one was raised within and lost.

    A solver that calls back to Python, such as CasADi's, takes an interrupt that falls into a callback for
    a failed evaluation and goes on with other numbers.
    """
    lost = False

    def ask() -> None:
        if lost:
            raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield ask  # signals arrive elsewhere, or interrupt nothing
        return

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal lost
        try:
            before(number, frame)
        except KeyboardInterrupt:
            lost = True
            raise

    signal.signal(signal.SIGINT, note)
    try:
        yield ask
    finally:
        signal.signal(signal.SIGINT, before)
        ask()
