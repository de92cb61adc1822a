"""The viewer's page: one file that needs nothing else for a replay, a shell for the live server.

Text of missions and recordings goes into a JSON block and from there into text nodes, never into HTML.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from functools import cache
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

from colift.record.recording import atomic_path

ASSETS = resources.files("colift.show.viewer") / "assets"
"""The built front end: ``viewer.js``, ``viewer.css`` and the licences of what they contain."""


DRAWN = ".cockpit:not(:has(.stage:not([data-drawn])))"
"""Selector that matches once every scene of a page has drawn its first picture."""


def replay_page(data: Mapping[str, Any], **view: Any) -> str:
    """A self-contained page of one or more flights.

    Parameters
    ----------
    data : mapping
        From :func:`colift.show.viewer.data.payload`.
    **view
        How to open it: ``theme`` (``"dark"``, ``"light"``), ``camera``, ``bare`` (only the scene).

    """
    script, style = _asset("viewer.js"), _asset("viewer.css")
    policy = (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; "
        "img-src data:; connect-src 'none'; base-uri 'none'; form-action 'none'"
    )
    text = json.dumps({**data, "view": view}, allow_nan=False, separators=(",", ":"))
    title = " | ".join(flight["name"] for flight in data["flights"])
    return _document(
        title,
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>{style}</style>',
        f'<script type="application/json" id="colift-data">{text.replace("<", chr(92) + "u003c")}</script>\n'
        f"<script>{script}</script>",
    )


def live_page() -> str:
    """The page of a live server, which must serve ``/assets/viewer.js`` and ``/assets/viewer.css``."""
    return _document(
        "live",
        '<link rel="stylesheet" href="/assets/viewer.css">',
        '<script src="/assets/viewer.js" defer></script>',
    )


def write_page(path: str | Path, data: Mapping[str, Any], **view: Any) -> Path:
    """Write :func:`replay_page`, atomically."""
    path = Path(path)
    with atomic_path(path) as temporary:
        temporary.write_text(replay_page(data, **view), encoding="utf-8", newline="\n")
    return path


def _document(title: str, head: str, body: str) -> str:
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{escape(title)} - colift</title>\n<link rel="icon" href="data:,">\n{head}\n</head>\n'
        f'<body>\n<div id="app"></div>\n<noscript>This page draws with JavaScript.</noscript>\n{body}\n'
        "</body>\n</html>\n"
    )


@cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
