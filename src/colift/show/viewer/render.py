"""Pictures and films of recordings, drawn by the viewer's page in a browser without a window."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from colift.errors import BrowserError, MissingExtraError
from colift.extras import install
from colift.record.recording import atomic_path
from colift.show.viewer.browser import browser
from colift.show.viewer.page import DRAWN, write_page

if TYPE_CHECKING:
    from playwright.sync_api import Page

START_TIMEOUT = 60_000.0
"""Longest wait for the page's first picture, ms."""


@dataclass(frozen=True)
class Look:
    """How a picture is taken: width and height (pixels, even numbers), view and theme of the page."""

    size: tuple[int, int] = (1280, 720)
    camera: str = "orbit"
    theme: str = "light"


def png(data: Mapping[str, Any], path: Path, look: Look, time: float) -> Path:
    """Write the picture at ``time`` (s), atomically.

    Parameters
    ----------
    data : mapping
        From :func:`colift.show.viewer.data.payload`.
    path : Path
        Replaced only by a whole file.
    look : Look
        Size, view and theme.
    time : float
        Of the flight, s; the nearest time of the flight is shown.

    Raises
    ------
    MissingExtraError
        Without the extra ``render``.
    BrowserError
        If no browser is found, or it cannot draw.

    """
    with _opened(data, look) as page, atomic_path(path) as temporary:
        temporary.write_bytes(_shot(page, time))
    return path


def film(
    data: Mapping[str, Any],
    path: Path,
    look: Look,
    *,
    begin: float,
    end: float,
    rate: float,
    speed: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write a GIF or an MP4 (by the file's name) of the flight from ``begin`` to ``end``, atomically.

    Parameters
    ----------
    data, path, look
        As for :func:`png`.
    begin, end : float
        Stretch of the flight, s.
    rate : float
        Pictures a second of the film, Hz.
    speed : float
        Seconds of flight in a second of film.
    progress
        Called with the fraction done.

    Raises
    ------
    MissingExtraError, BrowserError
        As for :func:`png`.

    """
    times = np.arange(begin, end + 1e-9, speed / rate)
    with _opened(data, look) as page, atomic_path(path) as temporary:
        write = _write_gif if path.suffix == ".gif" else _write_mp4
        write(temporary, _frames(page, times, progress), look.size, rate)
    return path


def _frames(page: Page, times: Any, progress: Callable[[float], None] | None) -> Iterator[Any]:
    from PIL import Image

    for k, time in enumerate(times):
        yield Image.open(io.BytesIO(_shot(page, float(time)))).convert("RGB")
        if progress is not None:
            progress((k + 1) / len(times))


def _write_gif(path: Path, frames: Iterator[Any], size: tuple[int, int], rate: float) -> None:
    first, *others = (frame.quantize(256, dither=0) for frame in frames)
    delay = round(1000.0 / rate)
    first.save(path, save_all=True, append_images=others, duration=delay, loop=0, optimize=False)


def _write_mp4(path: Path, frames: Iterator[Any], size: tuple[int, int], rate: float) -> None:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MissingExtraError(
            f"films need the package imageio-ffmpeg: {install('render')}"
        ) from error
    writer = imageio_ffmpeg.write_frames(
        str(path), size, fps=rate, codec="libx264", quality=8, macro_block_size=2,
        ffmpeg_log_level="error",
    )  # fmt: skip
    writer.send(None)
    try:
        for frame in frames:
            writer.send(np.asarray(frame).tobytes())
    finally:
        writer.close()


def _shot(page: Page, time: float) -> bytes:
    page.evaluate("time => colift.seek(time)", time)
    return page.screenshot(type="png")


@contextmanager
def _opened(data: Mapping[str, Any], look: Look) -> Iterator[Page]:
    """The page, bare of all but the scene, with its first picture drawn."""
    width, height = look.size
    with tempfile.TemporaryDirectory() as folder, browser() as started:
        from playwright.sync_api import Error

        file = Path(folder) / "replay.html"
        write_page(file, data, bare=True, theme=look.theme, camera=look.camera)
        page = started.new_page(viewport={"width": width, "height": height})
        try:
            page.goto(file.as_uri())
            page.locator(DRAWN).wait_for(timeout=START_TIMEOUT)
        except Error as error:
            raise BrowserError(f"the page could not be drawn: {error.message}") from error
        yield page
