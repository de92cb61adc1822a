"""Where compiled kernels are kept, above all where the usual place does not exist."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from colift.kernel import jit


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
