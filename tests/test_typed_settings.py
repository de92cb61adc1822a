"""A misspelt setting is found before the program runs, by a type checker; what it knows is what parts have."""

from __future__ import annotations

import inspect
import subprocess
import sys
from typing import get_type_hints

import pytest

import colift
from colift.control.allocation.safe import Safe, SafeSettings
from colift.control.allocation.sqp import Sqp, SqpSettings

PROGRAM = """\
import colift
from colift.control.allocation.safe import Safe

allocator = colift.SafeAllocator(n=4, min_angel_deg=30)  # line 4
colift.SqpAllocator(4, 0.15, tolerence=1e-9)  # line 5
allocator.update(tension_mxa=3.0)  # line 6
Safe(max_cone_dge=60.0)  # line 7
colift.SafeAllocator(n=4, settling="slow")  # line 8

colift.SafeAllocator(colift.Team.uniform(4), mu=0.2, max_rate=3.0, weights=[1.0] * 4, dt=0.01)
colift.SqpAllocator(n=4, mu=0.15, tolerance=1e-9, cone_deg=30.0).update(mu=0.3, max_iterations=9)
allocator.update(tension_max=[3.0] * 4, min_angle_deg=25)
answer = allocator.allocate([0.0, 0.0, 2.2], dt=0.02)
status: colift.Status = answer.status
number: int = allocator.join(direction=[0.0, 0.0, -1.0])
"""


@pytest.mark.parametrize(("part", "settings"), [(Safe, SafeSettings), (Sqp, SqpSettings)])
def test_the_keywords_are_the_settings(part, settings):
    fields = {name: get_type_hints(part)[name] for name in part.model_fields}
    assert get_type_hints(settings) == fields


@pytest.mark.parametrize(
    ("allocator", "part"), [(colift.SafeAllocator, Safe), (colift.SqpAllocator, Sqp)]
)
def test_defaults_are_those_of_the_part(allocator, part):
    given = inspect.signature(allocator).parameters
    for name in given.keys() & part.model_fields.keys():
        assert given[name].default == part.model_fields[name].default, name


@pytest.mark.slow
def test_mypy_finds_what_is_misspelt_and_nothing_else(tmp_path):
    pytest.importorskip("mypy")
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--no-error-summary", "--cache-dir", tmp_path / "cache", program],
        cwd=tmp_path, text=True, capture_output=True, timeout=600,
    )  # fmt: skip
    errors = [line for line in checked.stdout.splitlines() if ": error: " in line]
    found = {int(line.split(":")[1]): line for line in errors}
    assert found.keys() == {4, 5, 6, 7, 8}, checked.stdout
    for line, name in {4: "min_angle_deg", 5: "tolerance", 6: "tension_max"}.items():
        assert f'did you mean "{name}"' in found[line]
    assert "max_cone_dge" in found[7]
    assert '"settling"' in found[8]
