"""The page that the server shows, and the files that it needs."""

from __future__ import annotations

from colift.show.viewer import page


def live_page() -> tuple[str, dict[str, bytes]]:
    """The page, and by name the files that are served under ``/assets/``."""
    files = (file for file in page.ASSETS.iterdir() if file.is_file())
    return page.live_page(), {file.name: file.read_bytes() for file in files}
