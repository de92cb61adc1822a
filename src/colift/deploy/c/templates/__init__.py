"""Files of an export that are the same for all, but for a few marks."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources


def template(name: str, marks: Mapping[str, str], blocks: Mapping[str, bool] | None = None) -> str:
    """The text of a file, with what stands for each ``@MARK@``; of ``@IF BLOCK@`` to ``@END BLOCK@`` what is wanted."""
    text = resources.files(__package__).joinpath(name).read_text("utf-8")
    for block, wanted in (blocks or {}).items():
        keep = r"\1" if wanted else ""
        text = re.sub(rf"@IF {block}@\n(.*?)@END {block}@\n", keep, text, flags=re.DOTALL)
    for mark, value in marks.items():
        text = text.replace(f"@{mark}@", value)
    return text
