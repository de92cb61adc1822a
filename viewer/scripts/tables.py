"""Writes viewer/src/tables.ts, what page and package both name: python viewer/scripts/tables.py."""

from __future__ import annotations

import json
from pathlib import Path

from colift.kernel.status import Status
from colift.record.moments import FOLLOWING, KINDS, MOST_PAIRED, status_word
from colift.record.verdict import LEVELS
from colift.show.report.marks import MARKS

TARGET = Path(__file__).parents[1] / "src" / "tables.ts"


def typescript() -> str:
    """The whole file."""
    statuses = [status_word(code) for code in range(max(Status) + 1)]
    kinds = {kind: {"word": word, **MARKS[kind]._asdict()} for kind, word in KINDS.items()}
    return f"""\
// Written by viewer/scripts/tables.py from the Python package, which has the same; not to be edited here.

/** Words for the allocator's status codes. */
export const STATUS = {json.dumps(statuses, indent=2)};

/** Kinds of moments: a word, a shape in a box of 12 x 12, and the tone of its colour. */
export const KINDS = {json.dumps(kinds, indent=2)};
export type Kind = keyof typeof KINDS;

/** Kinds that follow from others, and are many. */
export const FOLLOWING: ReadonlySet<Kind> = new Set({json.dumps(sorted(FOLLOWING))} as const);

/** How a flight went, from good to bad. */
export type Level = {" | ".join(json.dumps(level) for level in LEVELS)};

/** Above so many drones no pair of cables is looked at. */
export const MOST_PAIRED = {MOST_PAIRED};
"""


if __name__ == "__main__":
    TARGET.write_text(typescript(), encoding="utf-8", newline="\n")
