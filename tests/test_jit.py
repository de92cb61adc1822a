"""Where compiled kernels are kept, above all where the usual place does not exist."""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numba
import numpy as np
import pytest

from colift.kernel import jit
from colift.kernel.compiling import hurried

needs_jit = pytest.mark.skipif(not jit.JIT_ENABLED, reason="compiled kernels only")


@pytest.fixture(autouse=True)
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for function in (jit.cache_folder, jit._temporary_folder):
        monkeypatch.setattr(jit, function.__name__, function.__wrapped__)
    for name in ("COLIFT_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(jit.config, "CACHE_DIR", "")
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(jit.tempfile, "tempdir", str(tmp_path / "tmp"))


def test_the_variable_moves_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLIFT_CACHE", str(tmp_path / "here"))
    assert jit.cache_folder(tmp_path).parent == tmp_path / "here"


def test_without_a_home_the_cache_is_private(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", no_home)
    folder = jit.cache_folder(tmp_path)
    assert folder.parent == tmp_path / "tmp" / f"colift-{os.getuid()}"
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700
    assert jit.cache_folder(tmp_path) == folder


def test_a_folder_that_others_can_write_to_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("COLIFT_CACHE", str(tmp_path / "file/x"))
    taken = tmp_path / "tmp" / f"colift-{os.getuid()}"
    taken.mkdir()
    taken.chmod(0o777)
    folder = jit.cache_folder(tmp_path)
    assert folder.is_dir()
    assert taken not in folder.parents


def mixed(values, k, flag):
    """Operators of floats, integers, constants and booleans, over and over with the same types."""
    total = 0.0
    for i in range(values.shape[0] - 1):
        total += values[i] ** 2 - values[i + 1] * k + (i % 3) * 2.0 - i // 2 + (k << 1)
        if (total > 1.0) & flag or i == k:
            total -= values[i] ** 3 + 2 * total
    return total


@needs_jit
def test_what_is_compiled_in_a_hurry_is_the_same_machine_code() -> None:
    found = []
    for around in (nullcontext, hurried):
        compiled = numba.njit(error_model="numpy")(mixed)
        with around():
            compiled.compile((jit.vector, jit.i8, numba.boolean))
        (code,) = compiled.inspect_asm().values()
        found.append(re.sub(r"B\d+v\d+B", "", code))
    assert found[0] == found[1]


@needs_jit
def _last_but(x, k):  # type: ignore[no-untyped-def]
    x[0] = x[1 - k] + 10.0 * x[-2]


@needs_jit
@pytest.mark.parametrize("ours", [False, True])
def test_only_kernels_of_colift_go_without_counting_from_the_end(
    monkeypatch: pytest.MonkeyPatch, ours: bool
) -> None:
    """Of those in other files an index may be negative, of all one that is a constant."""
    if ours:
        monkeypatch.setattr(_last_but, "__module__", "colift.some.kernel")
    made = numba.njit(error_model="numpy")(_last_but)
    with hurried():
        made.compile(jit.void(jit.vector, jit.i8))
    (text,) = made.inspect_llvm().values()
    body = text.partition("define")[2].partition("\n}")[0]
    assert ("select" in body or "ashr" in body) == (not ours)
    x = np.array([1.0, 2.0, 3.0, 4.0])
    made(x, 0)
    assert x[0] == 32.0
    if not ours:
        made(x, 2)
        assert x[0] == 34.0


def test_of_two_processes_one_compiles_a_kernel_and_the_other_waits_for_it(tmp_path: Path) -> None:
    (tmp_path / "shared.py").write_text("""
from colift.kernel.jit import f8, kernel, vector
@kernel(f8(vector))
def total(values):
    found = 0.0
    for value in values:
        found += value
    return found
""")
    program = "import shared; print(sum(shared.total.stats.cache_hits.values()))"
    two = [
        subprocess.Popen(
            [sys.executable, "-c", program],
            env=os.environ | {"COLIFT_CACHE": str(tmp_path / "cache")},
            cwd=tmp_path, text=True, stdout=subprocess.PIPE,
        )
        for _ in range(2)
    ]  # fmt: skip
    assert sorted(each.communicate(timeout=300)[0] for each in two) == ["0\n", "1\n"]
