"""C computes what Python computes, bit for bit, here and on other machines; single precision within stated bounds.

In processes of their own, in which Numba fuses nothing: ``identity.py`` for allocators, ``beside.py`` for whole flights.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from colift.deploy.c.machines import MACHINES

HERE = Path(__file__).parent
MACHINES_OF = {
    **{f"same {machine}": [machine] for machine in ("x86-64", "clang", "aarch64", "wasm", "m7")},
    "one_sine wasm": ["x86-64", "wasm"], "one_sine m7": ["x86-64", "m7"],
    "inside": ["x86-64"], "single": ["x86-64"], "chip": ["m4"],
}  # fmt: skip
"""Of each part of ``identity.py`` the machines that it needs."""


def _missing(name: str) -> str:
    return next(filter(None, (MACHINES[each].missing() for each in MACHINES_OF[name])), "")


def _pinned(script: str, *arguments: str) -> Any:
    """What a script prints as JSON, where Numba makes code for any processor."""
    environment = os.environ | {"NUMBA_CPU_NAME": "generic"}
    done = subprocess.run(
        [sys.executable, str(HERE / script), *arguments], env=environment, capture_output=True, text=True, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def found():
    """What is found of a part; all are tried in one process."""
    every = _pinned("identity.py", *(name for name in MACHINES_OF if not _missing(name)))

    def of(name: str) -> Any:
        if missing := _missing(name):
            pytest.skip(missing)
        assert "failed" not in every[name], every[name]["failed"]
        return every[name]["found"]

    return of


@pytest.mark.parametrize("machine", ["x86-64", "clang", "aarch64", "wasm", "m7"])
def test_allocators_compute_the_same_in_every_bit(found, machine):
    wrong = found(f"same {machine}")
    assert len(wrong) == 54
    assert not any(wrong.values()), {case: count for case, count in wrong.items() if count}


def test_all_layers_compute_the_same_along_flights():
    if missing := MACHINES["x86-64"].missing():
        pytest.skip(missing)
    missions = ["fetch-and-carry", "agile-box", "real-world-adaptive"]
    flown = _pinned("beside.py", "0.6", *missions)
    assert list(flown) == missions
    for mission, counts in flown.items():
        assert len(counts) == 9
        assert all(calls >= 60 and wrong == 0 for calls, wrong in counts.values()), (
            mission,
            counts,
        )


@pytest.mark.parametrize("machine", ["wasm", "m7"])
def test_only_the_c_library_makes_a_difference(found, machine):
    # In these calls 16 drones end otherwise there, unless sine, cosine and arc cosine are the same.
    wrong = found(f"one_sine {machine}")
    assert len(wrong) == 3
    assert not any(wrong.values())


def test_no_place_outside_of_an_array_and_nothing_that_c_leaves_undefined(found):
    assert list(found("inside").values()) == [100] * 6


def test_single_precision_keeps_all_limits_and_balances_the_force(found):
    for case, kept in found("single").items():
        assert kept["numbers"], case
        assert kept["balance"] < 2e-5, case
        assert kept["norm"] < 1e-6, case
        for limit, most in (("angle", 2e-3), ("cone", 2e-3), ("tension", 1e-5), ("turn", 1e-3)):
            assert kept["beyond"].get(limit, 0.0) < most, (case, limit)
        if "rough" not in case and " 2 " not in case:
            assert kept["converged"] > 0.98, case


BUDGET = 168_000
"""Instructions of one call in the embedded profile."""
COMPILER = "12.2"
NEEDS = HERE / "needs.json"
"""What a Cortex-M4F needed, by ``python tests/deploy/test_identity.py``."""


def test_a_cortex_m4_keeps_to_the_budget_and_needs_no_more_than_before(found):
    needed, before = found("chip"), json.loads(NEEDS.read_text())
    version = subprocess.run(
        ["arm-none-eabi-gcc", "-dumpfullversion"], capture_output=True, text=True, check=True
    ).stdout
    assert needed.keys() == before.keys()
    for name, needs in needed.items():
        for case in ("smooth", "noisy", "rough"):
            assert needs[case][1] <= BUDGET, (name, case)
            if version.startswith(COMPILER):
                for what, now, then in zip(("mean", "most", "stack"), needs[case], before[name][case], strict=True):  # fmt: skip
                    assert now <= 1.03 * then, (name, case, what)
        if version.startswith(COMPILER):
            assert needs["code"] <= 1.03 * before[name]["code"], name


if __name__ == "__main__":
    NEEDS.write_text(json.dumps(_pinned("identity.py", "chip")["chip"]["found"], indent=1) + "\n")
