"""The page that the server shows, and the files that it needs."""

from __future__ import annotations

import importlib.util
from importlib import resources

_WITHOUT_VIEWER = (
    '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>live - colift</title>'
    '<link rel="icon" href="data:,"></head>\n'
    "<body><p>The flight is on, and its data are at /live; this copy of colift has no viewer.</p>"
    "</body></html>\n"
)


def live_page() -> tuple[str, dict[str, bytes]]:
    """The page, and by name the files that are served under ``/assets/``."""
    if importlib.util.find_spec("colift.viewer") is None:
        return _WITHOUT_VIEWER, {}
    page = importlib.import_module("colift.viewer.page").live_page()
    folder = resources.files("colift.viewer") / "assets"
    return page, {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}
