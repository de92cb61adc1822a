"""C computes what Python computes, bit for bit, here and on other machines; single precision within stated bounds.

In a process of its own, in which Numba fuses nothing.
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

COUNTS = {"x86-64": 2000, "clang": 500, "aarch64": 100, "wasm": 500, "m7": 60}


def _pinned(text: str, *arguments: str) -> Any:
    """What a piece of Python prints as JSON, where Numba makes code for any processor."""
    environment = os.environ | {"NUMBA_CPU_NAME": "generic"}
    done = subprocess.run(
        [sys.executable, "-c", text, *arguments], env=environment, capture_output=True, text=True, check=False,
        cwd=Path(__file__).parent,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


SAME = """
import json, sys
from colift.deploy.c.asked import CASES, LIMITED, allocator, by_python, calls, the_same
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.machines import Driver
from colift.part import find

machine, count, drones = sys.argv[1], int(sys.argv[2]), (1, 2, 3, 4, 9, int(sys.argv[3]))
found = {}
for kind, settings in (("sqp", {}), ("safe", {}), ("safe", LIMITED)):
    parts = [allocator(kind, n, **settings) for n in drones]
    most = max(drones), max(p.params(t).size for p, t in parts), max(p.memory(t).size for p, t in parts)
    with Driver(Kernel(find("allocation", kind), kind), machine, most) as driver:
        for n, (part, team) in zip(drones, parts):
            for case in CASES:
                asked = calls(part, team, case, count, 40 + n)
                same = the_same(driver(asked), by_python(part, asked))
                found[f"{kind} {len(settings)} {n} {case}"] = int((~same).sum())
print(json.dumps(found))
"""


@pytest.mark.parametrize("machine", list(COUNTS))
def test_allocators_compute_the_same_in_every_bit(machine):
    if missing := MACHINES[machine].missing():
        pytest.skip(missing)
    # With more drones sqp leaves a saddle along angles whose sine WebAssembly's C library rounds otherwise.
    found = _pinned(SAME, machine, str(COUNTS[machine]), "12" if machine == "wasm" else "16")
    assert len(found) == 54
    assert not any(found.values()), {case: wrong for case, wrong in found.items() if wrong}


@pytest.mark.parametrize("mission", ["fetch-and-carry", "agile-box", "real-world-adaptive"])
def test_all_layers_compute_the_same_along_a_flight(mission):
    if missing := MACHINES["x86-64"].missing():
        pytest.skip(missing)
    script = Path(__file__).with_name("beside.py").read_text()
    found = _pinned(script, mission, "0.6")
    assert len(found) == 9
    assert all(calls >= 60 and wrong == 0 for calls, wrong in found.values()), found


ONE_SINE = """
import json, sys
from colift.deploy.c.asked import LIMITED, allocator, calls, the_same
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.machines import Driver
from colift.part import find

found = {}
for kind, settings in (("sqp", {}), ("safe", {}), ("safe", LIMITED)):
    part, team = allocator(kind, 16, **settings)
    asked = calls(part, team, "rough", 15_000, 716)
    asked = asked._replace(forces=asked.forces[:100], moments=asked.moments[:100])
    answers = []
    for machine in ("x86-64", sys.argv[1]):
        most = 16, asked.params.size, asked.memory.size
        with Driver(Kernel(find("allocation", kind), kind), machine, most, ["-include", sys.argv[2]]) as driver:
            answers.append(driver(asked))
    found[f"{kind} {len(settings)}"] = int((~the_same(*answers)).sum())
print(json.dumps(found))
"""


@pytest.mark.parametrize("machine", ["wasm", "m7"])
def test_only_the_c_library_makes_a_difference(machine):
    # In these calls 16 drones end otherwise there, unless sine, cosine and arc cosine are the same.
    for each in ("x86-64", machine):
        if missing := MACHINES[each].missing():
            pytest.skip(missing)
    header = Path(__file__).with_name("one_sine.h")
    assert not any(_pinned(ONE_SINE, machine, str(header)).values())


INSIDE = """
import json
from colift.deploy.c.asked import LIMITED, allocator, calls
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.machines import Driver
from colift.part import find

flags = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
for kind, settings in (("sqp", {}), ("safe", LIMITED)):
    for n in (1, 4, 9):
        part, team = allocator(kind, n, **settings)
        asked = calls(part, team, "rough", 100, 80 + n)
        exactly = n, asked.params.size - 1, asked.memory.size - 1  # the driver has room for one more
        with Driver(Kernel(find("allocation", kind), kind), "x86-64", exactly, flags) as driver:
            driver(asked)
print(json.dumps("clean"))
"""


def test_no_place_outside_of_an_array_and_nothing_that_c_leaves_undefined():
    if missing := MACHINES["x86-64"].missing():
        pytest.skip(missing)
    assert _pinned(INSIDE) == "clean"


SINGLE = """
import json
import numpy as np
from colift.deploy.c.asked import CASES, LIMITED, allocator, by_python, calls, within
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.layers import SINGLE
from colift.deploy.c.machines import Driver
from colift.part import find

found = {}
for kind, settings in (("sqp", {}), ("safe", {}), ("safe", LIMITED)):
    for n in (2, 3, 4, 8):
        part, team = allocator(kind, n, **{**SINGLE[kind], **settings})
        most = n, part.params(team).size, part.memory(team).size
        with Driver(Kernel(find("allocation", kind), kind, single=True), "x86-64", most) as driver:
            for case in CASES:
                asked = calls(part, team, case, 2000, 50 + n)
                answers, double = driver(asked), by_python(part, asked)
                size = np.linalg.norm(asked.forces, axis=1)
                missing = np.linalg.norm((answers.tensions[:, :, None] * answers.directions).sum(1) + asked.forces, axis=1)
                good = (answers.status == 0) & (size > 0)
                found[f"{kind} {len(settings)} {n} {case}"] = {
                    "numbers": bool(np.isfinite(answers.tensions).all() and np.isfinite(answers.directions).all()),
                    "balance": float((missing[good] / size[good]).max(initial=0.0)),
                    "norm": float(abs(np.linalg.norm(answers.directions, axis=2) - 1.0).max()),
                    "converged": float(good.mean()),
                    "beyond": within(part, asked, answers) if kind == "safe" else {},
                }
print(json.dumps(found))
"""


def test_single_precision_keeps_all_limits_and_balances_the_force():
    if missing := MACHINES["x86-64"].missing():
        pytest.skip(missing)
    for case, found in _pinned(SINGLE).items():
        assert found["numbers"], case
        assert found["balance"] < 2e-5, case
        assert found["norm"] < 1e-6, case
        for limit, most in (("angle", 2e-3), ("cone", 2e-3), ("tension", 1e-5), ("turn", 1e-3)):
            assert found["beyond"].get(limit, 0.0) < most, (case, limit)
        if "rough" not in case and " 2 " not in case:
            assert found["converged"] > 0.98, case


CHIP = """
import json
from colift.deploy.c.asked import CASES, LIMITED, allocator, calls
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.layers import EMBEDDED
from colift.deploy.c.machines import Driver
from colift.part import find

found = {}
for kind, settings in (("sqp", {}), ("safe", {}), ("safe", LIMITED)):
    for n in (1, 2, 3, 4):
        part, team = allocator(kind, n, **{**EMBEDDED[kind], **settings})
        most = n, part.params(team).size, part.memory(team).size
        with Driver(Kernel(find("allocation", kind), kind, single=True), "m4", most) as driver:
            name = f"{kind} {len(settings)} {n}"
            found[name] = {"code": driver.code()}
            for case in CASES:
                answers = driver(calls(part, team, case, 400, 60 + n))
                found[name][case] = [float(answers.instructions.mean()), float(answers.instructions.max()), answers.stack]
print(json.dumps(found))
"""

BUDGET = 168_000
"""Instructions of one call in the embedded profile."""
COMPILER = "12.2"
NEEDS = Path(__file__).with_name("needs.json")
"""What a Cortex-M4F needed, by ``python tests/deploy/test_identity.py``."""


def test_a_cortex_m4_keeps_to_the_budget_and_needs_no_more_than_before():
    if missing := MACHINES["m4"].missing():
        pytest.skip(missing)
    version = subprocess.run(
        ["arm-none-eabi-gcc", "-dumpfullversion"], capture_output=True, text=True, check=True
    ).stdout
    found, before = _pinned(CHIP), json.loads(NEEDS.read_text())
    assert found.keys() == before.keys()
    for name, needs in found.items():
        for case in ("smooth", "noisy", "rough"):
            assert needs[case][1] <= BUDGET, (name, case)
            if version.startswith(COMPILER):
                for what, now, then in zip(("mean", "most", "stack"), needs[case], before[name][case], strict=True):  # fmt: skip
                    assert now <= 1.03 * then, (name, case, what)
        if version.startswith(COMPILER):
            assert needs["code"] <= 1.03 * before[name]["code"], name


if __name__ == "__main__":
    NEEDS.write_text(json.dumps(_pinned(CHIP), indent=1) + "\n")
