"""Every error that colift raises on purpose derives from :class:`ColiftError`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace


class ColiftError(Exception):
    """Root of all errors raised by colift."""


class UnknownNameError(ColiftError, LookupError):
    """A part, mission or signal was asked for by a name that does not exist."""

    def __init__(self, what: str, name: str, valid: Sequence[str]) -> None:
        super().__init__(what, name, valid)
        self.what = what
        self.name = name
        self.valid = tuple(valid)

    def __str__(self) -> str:
        import difflib

        near = difflib.get_close_matches(self.name, self.valid, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        return f"no {self.what} named {self.name!r}{hint} Available: {', '.join(self.valid)}."


@dataclass(frozen=True)
class Problem:
    """One mistake in what was asked for: where, what was found, what is allowed."""

    path: str
    value: str
    message: str

    def __str__(self) -> str:
        where = f"{self.path}: " if self.path else ""
        found = f" (found {self.value})" if self.value else ""
        return f"{where}{self.message}{found}"


class SettingError(ColiftError, ValueError):
    """Settings or arguments were refused: of each its name, what was found and what is allowed."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__(problems)
        self.problems = tuple(problems)

    def __str__(self) -> str:
        return "; ".join(map(str, self.problems))

    @classmethod
    def of(cls, path: str, value: object, message: str) -> SettingError:
        """A single mistake."""
        return cls([Problem(path, str(value), message)])

    def within(self, section: str) -> SettingError:
        """The same mistakes, named as settings of a section."""
        return SettingError(
            [replace(each, path=f"{section}.{each.path}".rstrip(".")) for each in self.problems]
        )


class MissionError(ColiftError):
    """A mission is not valid; carries every problem that was found, not only the first."""

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        super().__init__(source, problems)
        self.source = source
        self.problems = tuple(problems)

    def __str__(self) -> str:
        lines = "\n".join(f"  {problem}" for problem in self.problems)
        count = f"{len(self.problems)} problem" + ("s" if len(self.problems) != 1 else "")
        return f"{self.source}: {count}\n{lines}"


class SceneError(MissionError):
    """A scene to plan in is not valid; carries every problem that was found."""


class PlanError(ColiftError):
    """No plan was found, or a file holds none; the message says why."""


class VehicleError(ColiftError):
    """The numbers of a drone cannot be read or are none that a drone can have; names the file and the field."""


class MissingExtraError(ColiftError):
    """A part calls a package that is not installed; the message says how to install it."""


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
