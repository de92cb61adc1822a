"""Directive ``try-allocators``: the files of ``docs/try`` in one piece, so that the page asks for nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

FOLDER = Path(__file__).parents[1] / "try"


def fragment() -> str:
    """What stands in the page."""
    style, page, data, app = (
        (FOLDER / name).read_text("utf-8")
        for name in ("style.css", "page.html", "allocators.json", "app.js")
    )
    return (
        f'<style>\n{style}</style>\n{page}<script type="application/json" id="try-data">\n{data}</script>\n'
        f"<script>\n{app}</script>\n"
    )


class TryAllocators(SphinxDirective):
    """The page's working part."""

    def run(self) -> list[nodes.Node]:
        for file in FOLDER.iterdir():
            self.env.note_dependency(str(file))
        return [nodes.raw("", fragment(), format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("try-allocators", TryAllocators)
    return {"version": "1", "parallel_read_safe": True}
