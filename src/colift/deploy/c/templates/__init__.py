"""Files of an export that are the same for all, but for a few marks."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources


def template(name: str, marks: Mapping[str, str]) -> str:
    """The text of a file, with what stands for each ``@MARK@``."""
    text = resources.files(__package__).joinpath(name).read_text("utf-8")
    for mark, value in marks.items():
        text = text.replace(f"@{mark}@", value)
    return text
