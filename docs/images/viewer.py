"""Draws the pictures of the viewer in this folder: python docs/images/viewer.py (needs the extra render)."""

from __future__ import annotations

import tempfile
from pathlib import Path

import colift
from colift.show.viewer.browser import browser
from colift.show.viewer.data import payload
from colift.show.viewer.page import DRAWN, write_page

HERE = Path(__file__).parent

PICTURES = {
    "replay-dark": ("dark", 8.0, [colift.run("paper-spiral")]),
    "side-by-side-light": (
        "light",
        8.2,
        [colift.run("four-to-three"), colift.run("four-to-three", allocator="sqp")],
    ),
}

with tempfile.TemporaryDirectory() as folder, browser() as started:
    for name, (theme, time, runs) in PICTURES.items():
        data = payload(
            [run.recording for run in runs],
            [run.metrics for run in runs],
            [run.mission.kinds["allocation"] for run in runs],
        )
        page = started.new_page(viewport={"width": 1280, "height": 800})
        page.goto(write_page(Path(folder) / f"{name}.html", data, theme=theme).as_uri())
        page.locator(DRAWN).wait_for()
        page.evaluate("time => colift.seek(time)", time)
        page.screenshot(path=HERE / f"{name}.png")
