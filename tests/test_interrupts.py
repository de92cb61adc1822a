"""Ctrl-C ends a flight wherever it falls, and leaves nothing half-done; real processes and real signals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from colift.interrupts import heard

SWALLOWS = """
import os, signal
from colift.control.allocation.base import AllocatorPart
from colift.team.geometry import ring

def solve(now, sees, params, memory, writes):
    "Calls back as a library does that takes any error of a callback for a failed evaluation."
    memory[0] += 1.0
    tensions = writes.desired_tensions
    tensions[:] = sees.force[2] / len(tensions)
    if memory[0] == 20.0:
        try:
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(1000):
                pass
        except BaseException:
            tensions[:] = 0.0
    return 0

class Swallows(AllocatorPart):
    kernel = solve

    def memory(self, team):
        import numpy as np
        return np.zeros(1)
"""


def test_an_interrupt_that_was_swallowed_is_raised_at_the_end() -> None:
    swallowed = []

    def swallow() -> None:
        with heard() as ask:
            ask()
            try:
                os.kill(os.getpid(), signal.SIGINT)
                threading.Event().wait(1.0)
            except KeyboardInterrupt:
                swallowed.append(1)

    with pytest.raises(KeyboardInterrupt):
        swallow()
    assert swallowed == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_nothing_is_raised_without_an_interrupt_or_with_a_handler_that_raises_nothing() -> None:
    with heard() as ask:
        ask()
    caught = []
    before = signal.signal(signal.SIGINT, lambda *_: caught.append(1))
    try:
        with heard() as ask:
            os.kill(os.getpid(), signal.SIGINT)
            ask()
    finally:
        signal.signal(signal.SIGINT, before)
    assert caught == [1]


def test_beside_the_main_thread_nothing_is_done() -> None:
    found: list[object] = []

    def run() -> None:
        with heard() as ask:
            ask()
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert found == [signal.default_int_handler]


def test_a_flight_ends_although_its_solver_swallows_the_interrupt(tmp_path: Path) -> None:
    (tmp_path / "swallows.py").write_text(SWALLOWS)
    out = tmp_path / "out"
    done = subprocess.run(
        [
            sys.executable, "-m", "colift", "run", "hover", "--with", str(tmp_path / "swallows.py"),
            "--set", "allocation.kind=swallows", "--set", "timing.duration=30",
            "--set", "timing.allocation=0.01", "--out", str(out), "--json",
        ],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert done.stdout == ""
    assert "interrupted" in done.stderr
    assert not out.exists()


IPOPT = """
import os, signal, threading, time
import numpy as np
from colift.control.allocation.base import Allocator
from colift.part import find

asked = Allocator(find("allocation", "ipopt")(), 4)
asked.allocate([0.0, 0.0, 2.2])
random, inside, sent, heard = np.random.default_rng(0), False, 0, 0

def interrupt(*_):
    global sent
    if inside:
        sent += 1
        raise KeyboardInterrupt

signal.signal(signal.SIGINT, interrupt)

def disturb():
    while sent < 60:
        time.sleep(random.uniform(0.002, 0.01))
        os.kill(os.getpid(), signal.SIGINT)

thread = threading.Thread(target=disturb)
thread.start()
lost = 0
while sent < 60:
    try:
        inside, before = True, sent
        asked.allocate([0.2, 0.0, 2.2])
        lost += sent - before
    except KeyboardInterrupt:
        heard += 1
    inside = False
thread.join()
print(sent, heard, lost)
"""


def test_ipopt_swallows_no_interrupt() -> None:
    pytest.importorskip("casadi")
    done = subprocess.run(
        [sys.executable, "-c", IPOPT], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-1000:]
    sent, heard, lost = map(int, done.stdout.split())
    assert sent >= 60
    assert heard > 30  # two may fall into one call
    assert lost == 0
