"""A release is whole: one version everywhere, an archive with documentation, examples and tests, a wheel with all that flies."""

from __future__ import annotations

import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_changes_and_citation_are_of_this_version():
    newest = re.search(r"^## (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert newest[1] == cited[1] == PROJECT["version"]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Names in the archive of sources, without its own folder, and in the wheel."""
    pytest.importorskip("hatchling", reason="builds wheel and archive")
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (archive,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    with tarfile.open(archive) as file:
        names = {name.partition("/")[2] for name in file.getnames()}
    return names, set(zipfile.ZipFile(wheel).namelist())


@pytest.mark.parametrize("folder", ["src", "tests", "docs", "examples", "benchmarks"])
def test_the_archive_holds_every_file_of_a_folder(built, folder):
    made = {"__pycache__", "_build", "node_modules"}
    own = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and not made & {*path.parts} and path.suffix not in {".nbi", ".nbc"}
    }
    assert own - built[0] == set()


def test_the_archive_holds_what_sets_it_up(built):
    files = (
        "pyproject.toml",
        "bootstrap.py",
        "hatch_build.py",
        "requirements.lock",
        "requirements-dev.lock",
    )
    assert {*files, "README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE"} <= built[0]
    assert not any(name.startswith(("runs/", ".venv", "viewer/node_modules")) for name in built[0])


def test_the_wheel_holds_the_package_and_nothing_else(built):
    _, wheel = built
    package = ROOT / "src" / "colift"
    own = {
        f"colift/{path.relative_to(package).as_posix()}"
        for path in package.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert own - wheel == set()
    assert all(name.startswith(("colift/", "colift-")) for name in wheel)
    assert any(name.endswith("licenses/LICENSE") for name in wheel)
