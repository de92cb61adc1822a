"""A real browser without a window, and pages that may neither complain nor ask for anything."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from flown import PATIENCE, Open, Opened, Size, fly, payload_of

from colift.errors import BrowserError
from colift.record.recording import Recording
from colift.show.viewer.browser import browser as start
from colift.show.viewer.browser import find_browser
from colift.show.viewer.page import DRAWN, write_page


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Whatever starts a browser is marked so."""
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="session")
def spiral() -> Recording:
    return fly()


@pytest.fixture(scope="session")
def chromium() -> None:
    """A browser is there, or else the test is skipped."""
    pytest.importorskip("playwright.sync_api", reason="needs the extra render")
    try:
        find_browser()
    except BrowserError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def browser(chromium: None) -> Iterator[Any]:
    """Of each module its own, since no thread can have two."""
    with start() as started:
        yield started


@pytest.fixture
def open_url(browser: Any) -> Iterator[Open]:
    """Open an address; in the end no page may have complained."""
    contexts, pages = [], []

    def go(address: str, size: Size = (1000, 640), theme: str = "dark", **options: Any) -> Opened:
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=theme, **options
        )
        context.set_default_timeout(1e3 * PATIENCE)
        opened = Opened(context.new_page())
        opened.page.on("console", lambda message: opened.said.append(message.text))
        opened.page.on("pageerror", lambda error: opened.said.append(str(error)))
        opened.page.on("request", lambda request: opened.asked.append(request.url))
        opened.page.goto(address)
        opened.page.locator(DRAWN).wait_for()
        contexts.append(context)
        pages.append(opened)
        return opened

    yield go
    said = [text for opened in pages for text in opened.said]
    for context in contexts:
        context.close()
    assert said == []


@pytest.fixture
def open_replay(open_url: Open, tmp_path: Path) -> Open:
    """Write the page of some recordings and open it."""

    def go(*recordings: Recording, data: Any = None, **options: Any) -> Opened:
        file = write_page(tmp_path / "replay.html", data or payload_of(*recordings))
        return open_url(file.as_uri(), **options)

    return go
