"""Figures as bytes: bitmaps, and SVGs that can stand alone or many in one page."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

from colift.recording import atomic_path
from colift.report import style
from colift.report.figures import Entry, Source

LARGEST_SVG = 300_000
"""Above this many bytes a page shows the bitmap instead."""


@dataclass(frozen=True)
class Drawing:
    """A drawn figure: name (also of its files), title, caption, SVG text and PNG bytes."""

    name: str
    title: str
    caption: str
    svg: str
    png: bytes

    def save(self, folder: Path) -> None:
        """Write ``<name>.svg`` and ``<name>.png``."""
        for suffix, data in ((".svg", self.svg.encode()), (".png", self.png)):
            with atomic_path(folder / f"{self.name}{suffix}") as temporary:
                temporary.write_bytes(data)

    def inline(self) -> str:
        """HTML element that shows the figure without any file."""
        if len(self.svg) <= LARGEST_SVG:
            return self.svg[self.svg.index("<svg") :]
        data = base64.b64encode(self.png).decode()
        return f'<img src="data:image/png;base64,{data}" alt="{escape(self.title)}">'


def draw(table: Mapping[str, Entry[Source]], source: Source) -> list[Drawing]:
    """Every figure of ``table`` for ``source``; the same source gives the same bytes."""
    drawings = []
    for name, entry in table.items():
        figure = entry.draw(source)
        drawings.append(
            Drawing(name, entry.title, entry.caption, svg(figure, name, entry.title), png(figure))
        )
    return drawings


def png(figure: Figure) -> bytes:
    """The figure as a bitmap."""
    buffer = io.BytesIO()
    with style.look():
        figure.savefig(
            buffer,
            format="png",
            dpi=style.DPI,
            metadata={"Software": None},
            pil_kwargs={"compress_level": 1},
        )
    return buffer.getvalue()


def svg(figure: Figure, name: str, title: str) -> str:
    """The figure as SVG whose ids and styles are its own: all ids start with ``name``."""
    buffer = io.StringIO()
    undated = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with style.look(salt=name):
        figure.savefig(buffer, format="svg", metadata=undated)
    text = buffer.getvalue()
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = text.replace('href="#', f'href="#{name}-').replace("url(#", f"url(#{name}-")
    # matplotlib's style rule would reach the whole page; on the root it is inherited just as well.
    text = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>\s*", "", text, count=1, flags=re.DOTALL)
    root = f'<svg role="img" aria-label="{escape(title)}" style="stroke-linejoin:round;stroke-linecap:butt" '
    return text.replace("<svg ", root, 1)
