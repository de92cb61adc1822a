"""Draws the pictures and the film of the viewer in this folder: python docs/images/viewer.py (needs the extra render)."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Page

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

FILMS = {
    "box-figure-eight": (np.arange(9.2, 14.6, 0.1), 160),  # one eight
    "through-a-window": (np.arange(1.0, 3.0, 0.05), 200),  # half as fast
}
"""Times, s, and how many colours."""


def film(
    page: Page, path: Path, times: Iterable[float], size: tuple[int, int], colours: int
) -> None:
    """A small film of an open page without the names of drones, as large as the page gets smaller."""
    page.keyboard.press("l")
    frames = []
    for time in times:
        page.evaluate("time => colift.seek(time)", time)
        frame = Image.open(io.BytesIO(page.screenshot())).convert("RGB").resize(size)
        frames.append(frame.quantize(colours, dither=0))
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=100, loop=0)


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
    for name, (times, colours) in FILMS.items():
        run = colift.run(name)
        data = payload([run.recording], [run.metrics], [""])
        page = started.new_page(viewport={"width": 960, "height": 540})
        page.goto(
            write_page(Path(folder) / f"{name}.html", data, theme="light", bare=True).as_uri()
        )
        page.locator(DRAWN).wait_for()
        film(page, HERE / f"{name}.gif", times.tolist(), (560, 315), colours)
