"""Short flights for tests of the campaign engine, and allocators that misbehave on demand."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from colift.study.campaign import engine
from colift.study.campaign.plan import Case, Source, plan

SHORT = {"timing.duration": 0.2, "timing.allocation": 0.01, "reference.kind": "hover"}
HEAD = """
import os, time
from pathlib import Path
from colift.control.allocation.base import AllocatorPart

class Mine(AllocatorPart):
    layer = "allocation"
    def kernel(now, sees, params, memory, writes):
"""
BODIES = {
    "slow": "time.sleep(0.02)",
    "broken": "raise ValueError('not today')",
    "mortal": "os._exit(7)",
    # Its first flight kills the worker; whoever comes next finds the mark and flies.
    "once": "mark = Path(__file__ + '.mark')\n{pad}mark.exists() or (mark.touch(), os._exit(7))",
}
REST = """
        writes.desired_tensions[:] = abs(sees.force[2]) / len(writes.desired_tensions)
        writes.desired_directions[:] = (0.0, 0.0, -1.0)
        return 0
    kernel = staticmethod(kernel)
"""


def write_allocator(folder: Path, name: str) -> Path:
    """A file with an allocator that shares equally, and does something else besides."""
    pad = " " * 8
    path = folder / f"{name}.py"
    path.write_text(HEAD + pad + BODIES[name].format(pad=pad) + REST)
    return path


def hover(allocator: str, seed: int = 0, **changes: float) -> Case:
    given = {"allocation": {"kind": allocator}, "seed": seed, **SHORT, **changes}
    return Case({"allocator": allocator, "seed": seed}, "hover", given)


def fly(
    cases: Sequence[Case], options: engine.Options, sources: Sequence[Source] = ()
) -> engine.Outcome:
    return engine.run(plan(cases, sources), options)


def wait_for(what: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until something is so; fail the test when it never is."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.05)


def gone(pid: int) -> bool:
    """Whether a process has ended (a zombie that nobody has collected yet has)."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and stat.read_text().rpartition(")")[2].split()[0] == "Z"
