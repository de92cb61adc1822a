"""How moments are marked, in pages and figures alike: a shape for every kind, so that none is told by its colour alone."""

from __future__ import annotations

from typing import NamedTuple

from colift.record.moments import KINDS


class Mark(NamedTuple):
    """An SVG path in a box of 12 x 12 (absolute M, L, Q, Z), and the tone of its colour."""

    shape: str
    tone: str


MARKS = {
    "phase": Mark("M3 1.5L3 10.5M3 2L10 4.5L3 7", "info"),
    "command": Mark("M6 1.5Q10.5 1.5 10.5 6Q10.5 10.5 6 10.5Q1.5 10.5 1.5 6Q1.5 1.5 6 1.5Z", "good"),
    "fault": Mark("M2 2L10 10M10 2L2 10", "bad"),
    "gap": Mark("M1 6L4 6M8 6L11 6", "warn"),
    "departure": Mark("M1.5 6L10.5 6M7 2.5L10.5 6L7 9.5", "bad"),
    "join": Mark("M6 1.5L6 10.5M1.5 6L10.5 6", "good"),
    "change": Mark("M2 4L10 4M2 8L10 8", "good"),
    "descent": Mark("M6 1.5L6 10.5M2.5 7L6 10.5L9.5 7", "bad"),
    "ground": Mark("M1.5 10.5L10.5 10.5M6 1.5L6 8M3.5 5.5L6 8L8.5 5.5", "info"),
    "slack": Mark("M1 4Q6 12 11 4", "warn"),
    "angle": Mark("M6 1.5L11 10.5L1 10.5Z", "warn"),
    "fallback": Mark("M6 1L11 6L6 11L1 6Z", "info"),
    "outcome": Mark("M2.5 2.5L9.5 2.5L9.5 9.5L2.5 9.5Z", "bad"),
}  # fmt: skip
"""By kind of moment (:data:`colift.record.moments.KINDS`)."""


TONES = {"good": "#1B7F4B", "warn": "#A86400", "bad": "#B3261E", "info": "#0B62A8"}
"""Colours of the tones on white."""


def icon(kind: str) -> str:
    """The mark as inline SVG, with its word for those who do not see it."""
    return (
        f'<svg class="icon {MARKS[kind].tone}" viewBox="0 0 12 12" role="img" '
        f'aria-label="{KINDS[kind]}"><path d="{MARKS[kind].shape}"/></svg>'
    )
