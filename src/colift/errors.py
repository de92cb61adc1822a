"""Every error that colift raises on purpose derives from :class:`ColiftError`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class ColiftError(Exception):
    """Root of all errors raised by colift."""


class UnknownNameError(ColiftError):
    """A part, mission or signal was asked for by a name that does not exist."""

    def __init__(self, what: str, name: str, valid: Sequence[str]) -> None:
        import difflib

        near = difflib.get_close_matches(name, valid, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        super().__init__(f"no {what} named {name!r}{hint} Available: {', '.join(valid)}.")
        self.name = name
        self.valid = tuple(valid)


@dataclass(frozen=True)
class Problem:
    """One mistake in a mission: where, what was found, what is allowed."""

    path: str
    value: str
    message: str

    def __str__(self) -> str:
        found = f" (found {self.value})" if self.value else ""
        return f"{self.path}: {self.message}{found}"


class MissionError(ColiftError):
    """A mission is not valid; carries every problem that was found, not only the first."""

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        self.source = source
        self.problems = tuple(problems)
        lines = "\n".join(f"  {problem}" for problem in problems)
        count = f"{len(problems)} problem" + ("s" if len(problems) != 1 else "")
        super().__init__(f"{source}: {count}\n{lines}")


class MissingExtraError(ColiftError):
    """A part calls a package that is not installed; the message names the extra that brings it."""


class FlightDataError(ColiftError):
    """A log of a real flight cannot be read; the message names the file and the place in it."""


class BrowserError(ColiftError):
    """No browser was found to draw in, or it could not draw."""


class RecordingError(ColiftError):
    """A file is not a colift recording, or a whole one."""


class AbsentSignalError(RecordingError, KeyError):
    """A recording lacks a signal: it was not recorded, or came after the recording."""

    def __init__(self, name: str, present: Sequence[str]) -> None:
        super().__init__(f"no signal {name!r}; there are {', '.join(present)}")

    __str__ = Exception.__str__
