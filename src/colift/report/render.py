"""Figures as bytes: bitmaps, and SVGs that can stand alone or many in one page."""

from __future__ import annotations

import base64
import gc
import io
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

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
    with style.look(), _no_collection():
        for name, entry in table.items():
            figure = entry.draw(source)
            text = svg(figure, name, entry.title)
            drawings.append(Drawing(name, entry.title, entry.caption, text, png(figure)))
    return drawings


@contextmanager
def _no_collection() -> Iterator[None]:
    """Pause the search for cyclic garbage: figures are full of cycles, and it costs a sixth."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def png(figure: Figure) -> bytes:
    """The figure as a bitmap of :data:`style.DPI`; weakly compressed, for speed."""
    buffer = io.BytesIO()
    with style.look():
        figure.set_dpi(style.DPI)
        canvas: Any = FigureCanvasAgg(figure)  # untyped in matplotlib
        canvas.draw()
        opaque = np.asarray(canvas.buffer_rgba())[..., :3]
        Image.fromarray(opaque).save(buffer, "png", compress_level=1, dpi=(style.DPI, style.DPI))
    return buffer.getvalue()


def svg(figure: Figure, name: str, title: str) -> str:
    """The figure as SVG whose ids and styles are its own: all ids start with ``name``."""
    buffer = io.StringIO()
    undated = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with style.look():
        figure.savefig(buffer, format="svg", metadata=undated)
    text = buffer.getvalue()
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = text.replace('href="#', f'href="#{name}-').replace("url(#", f"url(#{name}-")
    # matplotlib's style rule would reach the whole page; on the root it is inherited just as well.
    text = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>\s*", "", text, count=1, flags=re.DOTALL)
    root = f'<svg role="img" aria-label="{escape(title)}" style="stroke-linejoin:round;stroke-linecap:butt" '
    return text.replace("<svg ", root, 1)
