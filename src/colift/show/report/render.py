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
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path as MarkerPath
from PIL import Image

from colift.record.moments import KINDS
from colift.record.recording import atomic_path
from colift.show.report import style
from colift.show.report.figures import Entry, Source
from colift.show.report.marks import icon

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
    legend: str = ""
    """The legend as HTML, for screens on which that of the figure has no room."""

    def save(self, folder: Path) -> None:
        """Write ``<name>.svg`` and ``<name>.png``."""
        for suffix, data in ((".svg", self.svg.encode()), (".png", self.png)):
            with atomic_path(folder / f"{self.name}{suffix}") as temporary:
                temporary.write_bytes(data)

    def inline(self) -> str:
        """HTML element that shows the figure without any file."""
        if len(self.svg) <= LARGEST_SVG:
            return themed(self.legend + self.svg[self.svg.index("<svg") :])
        data = base64.b64encode(self.png).decode()
        return f'<img src="data:image/png;base64,{data}" alt="{escape(self.title)}">'


def themed(text: str) -> str:
    """SVG whose colours a page may choose: each becomes a variable that stands for itself by default."""
    known = {colour.lower() for colour in (*style.DARK, "#FFFFFF")}

    def variable(match: re.Match[str]) -> str:
        colour = match[0].lower()
        return f"var(--f-{colour[1:]},{colour})" if colour in known else colour

    return re.sub(r"#[0-9a-fA-F]{6}\b(?=[\s;\"])", variable, text)


def dark_colours() -> str:
    """A style rule that gives the colours of :func:`themed` figures those of a dark page."""
    pairs = "".join(f"--f-{light[1:]}:{dark};" for light, dark in style.DARK.items()).lower()
    return f"@media (prefers-color-scheme:dark){{:root{{{pairs}}}}}"


def draw(table: Mapping[str, Entry[Source]], source: Source) -> list[Drawing]:
    """Every figure of ``table`` for ``source``; the same source gives the same bytes."""
    drawings = []
    with style.look(), _no_collection():
        for name, entry in table.items():
            figure = entry.draw(source)
            text = svg(figure, name, entry.title)
            drawn = png(figure)
            drawings.append(Drawing(name, entry.title, entry.caption, text, drawn, legend(figure)))
    return drawings


def legend(figure: Figure) -> str:
    """The entries of a figure's legends as an HTML list."""
    entries = [
        f"<li>{_swatch(handle, text.get_text())}{escape(text.get_text())}</li>"
        for each in figure.legends
        for handle, text in zip(each.legend_handles, each.get_texts(), strict=True)
    ]
    return f'<ul class="legend">{"".join(entries)}</ul>' if entries else ""


def _swatch(handle: Any, word: str) -> str:
    """What a legend shows beside a word: a line, a mark or a patch of colour."""
    marks = {called: kind for kind, called in KINDS.items()}
    if not isinstance(handle, Line2D):
        shapes = f'<path fill="{to_hex(handle.get_facecolor())}" d="M1 1H21V9H1Z"/>'
    elif isinstance(handle.get_marker(), MarkerPath):
        return icon(marks[word])
    else:
        colour, gap = to_hex(handle.get_color()), handle.get_gapcolor()
        shapes = "" if gap is None else f'<path stroke="{to_hex(gap)}" d="M1 5H21"/>'
        if handle.get_linestyle() != "None":
            dashes = ' stroke-dasharray="5 3"' if handle.is_dashed() else ""
            shapes += f'<path stroke="{colour}"{dashes} d="M1 5H21"/>'
        if handle.get_marker() != "None":
            shapes += f'<circle fill="{colour}" cx="11" cy="5" r="3"/>'
    return f'<svg viewBox="0 0 22 10" aria-hidden="true">{shapes}</svg>'


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
