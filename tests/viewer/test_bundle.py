"""The front end that ships is the one that its sources build."""

from __future__ import annotations

import json
import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

from colift.kernel.status import Status

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "viewer"
ASSETS = ROOT / "src" / "colift" / "show" / "viewer" / "assets"

built = pytest.mark.skipif(
    not (SOURCES / "node_modules").is_dir() or shutil.which("npm") is None,
    reason="needs Node and the packages: npm ci --prefix viewer",
)


def npm(*arguments: str) -> None:
    done = subprocess.run(
        ["npm", "run", "--silent", *arguments],
        cwd=SOURCES,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@built
def test_the_bundle_is_what_the_sources_build(tmp_path: Path) -> None:
    npm("build", "--", "--out", str(tmp_path))
    for fresh in tmp_path.iterdir():
        assert fresh.read_bytes() == (ASSETS / fresh.name).read_bytes(), (
            f"{fresh.name} is old; build it: npm run build --prefix viewer"
        )


def test_the_page_names_what_the_package_names() -> None:
    written = runpy.run_path(str(SOURCES / "scripts" / "tables.py"))
    assert (SOURCES / "src" / "tables.ts").read_text() == written["typescript"](), (
        "tables.ts is old; write it: python viewer/scripts/tables.py"
    )
    statuses = [status.name.replace("_", " ").lower() for status in Status]
    assert list(Status) == list(range(len(statuses)))
    assert f"export const STATUS = {json.dumps(statuses, indent=2)};" in written["typescript"]()


@built
def test_types_hold() -> None:
    npm("check")


@built
def test_the_logic_holds_without_a_browser() -> None:
    npm("test")


def test_the_licences_of_what_is_bundled_ship_with_it() -> None:
    text = (ASSETS / "LICENSES.txt").read_text()
    packages = json.loads((SOURCES / "package.json").read_text())["dependencies"]
    for name, version in packages.items():
        assert f"{name} {version} (MIT)" in text


def test_packages_are_locked_with_hashes_and_without_a_host() -> None:
    text = (SOURCES / "package-lock.json").read_text()
    assert "resolved" not in text
    packages = json.loads(text)["packages"]
    assert all("integrity" in entry for path, entry in packages.items() if path)
