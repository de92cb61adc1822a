"""Signals go to compiled code by the place where they stand; who compiles what beside a first flight."""

from __future__ import annotations

import copy
import ctypes
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colift.kernel import jit
from colift.kernel.by_reference import named_signals, signals_type
from colift.kernel.jit import matrix, vector
from colift.kernel.ports import PORTS, Now
from colift.world.link.ideal import Ideal

Pair = named_signals("Pair", ["first", "second"], __name__)


def test_signals_are_told_by_their_place_and_a_copy_has_its_own() -> None:
    signals_type(Pair, [matrix, vector])
    pair = Pair(np.arange(6.0).reshape(2, 3), np.zeros(4))
    words = np.ctypeslib.as_array(ctypes.cast(pair._place, ctypes.POINTER(ctypes.c_ssize_t)), (16,))
    first, second = (each.__array_interface__["data"][0] for each in pair)
    assert words.tolist() == [0, 0, 6, 8, first, 2, 3, 24, 8, 0, 0, 4, 8, second, 4, 8]
    for copied in (copy.copy(pair), copy.deepcopy(pair), pickle.loads(pickle.dumps(pair))):
        assert copied._place != pair._place
    assert pair._replace(second=np.zeros(5))._words[-2] == 5


@pytest.mark.parametrize(
    "second", [np.zeros(4, np.float32), np.zeros((2, 2)), np.zeros(8)[::2], [0.0, 0.0]]
)
def test_an_array_of_another_kind_is_refused_by_name(second: Any) -> None:
    signals_type(Pair, [matrix, vector])
    with pytest.raises(TypeError, match=r"Pair\.second: 1 dimensions of float64, contiguous"):
        _ = Pair(np.zeros((2, 3)), second)._place


def test_a_kernel_tells_that_a_signal_is_of_another_kind() -> None:
    port = PORTS["link"]
    signals = port.signals(2)
    wire = port.wire(Ideal.kernel, np.zeros(0), np.zeros(0), signals)
    wrong = wire.sees._replace(desired_tensions=np.zeros(2, np.float32))
    with pytest.raises(TypeError, match="desired_tensions"):
        wire.kernel(Now(0, 0.0, 0.01, 0), wrong, wire.params, wire.memory, wire.writes)


CALLED = """
import multiprocessing
from colift.mission import crew
crew.CORES = 4
class Process:
    def poll(self): return self.code
    def terminate(self): pass
    code = None
process = Process()
def processes(steps, out, most):
    print("called", len(steps) > 5, most)
    return [process]
crew.processes = processes
def compiles(kind):
    print(kind)
    with crew.on_all_cores({"reference": {"kind": kind}}):
        crew.take(("reference", kind))
multiprocessing.parent_process = lambda: "a campaign"
compiles("hover")
multiprocessing.parent_process = lambda: None
compiles("hover")  # which is there
compiles("spiral")
compiles("waypoints")  # they are at work
process.code = 0
compiles("figure-eight")
"""


@pytest.mark.skipif(not jit.JIT_ENABLED, reason="compiled kernels only")
def test_others_are_called_once_they_are_needed_and_not_by_workers(tmp_path: Path) -> None:
    told = subprocess.run(
        [sys.executable, "-c", CALLED], env=os.environ | {"COLIFT_CACHE": str(tmp_path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert told.stdout.splitlines() == [
        "hover", "hover", "spiral", "called True 3", "waypoints", "figure-eight", "called True 3",
    ]  # fmt: skip
