"""What an optional feature needs, and a command that installs it wherever colift itself came from."""

from __future__ import annotations

import importlib.metadata
import re
import shlex
import shutil
import sys
import tomllib
from pathlib import Path


def requirements(extra: str) -> list[str]:
    """The packages of one of colift's extras, with their versions.

    From the installed distribution, or where colift was never installed, from the project beside its sources.
    """
    try:
        declared = importlib.metadata.requires("colift") or []
    except importlib.metadata.PackageNotFoundError:
        project = Path(__file__).resolve().parents[2] / "pyproject.toml"
        table = tomllib.loads(project.read_text(encoding="utf-8"))["project"]
        return list(table["optional-dependencies"][extra])
    mark = re.compile(rf"(\s+and\s+)?extra\s*==\s*['\"]{re.escape(extra)}['\"]")
    found = [text.partition(";") for text in declared]
    asked = [
        (package.strip(), mark.sub("", condition).strip())
        for package, _, condition in found
        if mark.search(condition)
    ]
    return [f"{package}; {rest}" if rest else package for package, rest in asked]


def install(extra: str) -> str:
    """A command that installs the packages of an extra, by their own names, for this Python."""
    own = shutil.which("pip") == shutil.which("pip", path=str(Path(sys.executable).parent))
    pip = ["pip"] if own and shutil.which("pip") else [sys.executable, "-m", "pip"]
    named = (text.partition(";")[0].strip() for text in requirements(extra))
    return shlex.join([*pip, "install", *named])
