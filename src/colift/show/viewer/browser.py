"""Find and start a browser without a window; it draws in software, so that every machine draws the same."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from colift.errors import BrowserError, MissingExtraError
from colift.extras import install

if TYPE_CHECKING:
    from playwright.sync_api import Browser

NAMES = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "microsoft-edge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
)
"""Browsers that can be driven, in order of preference."""

FLAGS = (
    "--no-sandbox",  # the page is ours and requests nothing; a container has no sandbox
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def find_browser() -> str:
    """Path of a Chromium or Chrome: the one that ``COLIFT_BROWSER`` names, else one of the machine's.

    Raises
    ------
    BrowserError
        If there is none.

    """
    wanted = os.environ.get("COLIFT_BROWSER")
    for name in (wanted,) if wanted else NAMES:
        path = shutil.which(name)
        if path is not None:
            return path
    if wanted:
        raise BrowserError(f"COLIFT_BROWSER names {wanted!r}, which is no program on this machine")
    raise BrowserError(
        "no Chromium or Chrome was found; install one (Debian: apt-get install chromium), or name "
        "its program in the environment variable COLIFT_BROWSER"
    )


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser without a window, closed when the block ends.

    Raises
    ------
    MissingExtraError
        Without the extra ``render``.
    BrowserError
        If there is no browser, or it does not start.

    """
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError as error:
        raise MissingExtraError(
            f"pictures of the viewer need the package playwright: {install('render')}"
        ) from error
    path = Path(find_browser())
    with sync_playwright() as playwright:
        try:
            started = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        except Error as error:
            raise BrowserError(f"{path} did not start: {error.message}") from error
        try:
            yield started
        finally:
            started.close()
