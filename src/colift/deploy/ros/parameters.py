"""Settings of a node's parts as ROS parameters: names, types and ranges from the parts' own schema, changes checked by the parts."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from colift.errors import ColiftError, SettingError
from colift.flight.flight import Flight
from colift.part import Part
from colift.team import Team
from colift.wording import meanings


@dataclass(frozen=True)
class Setting:
    """One setting of a part, as a parameter.

    Attributes
    ----------
    name : str
        As in a mission: ``allocation.mu``.
    value : bool, int, float, str, list or None
        None where it is left to the team.
    meaning : str
    low, high : float or None
        Range of a single number, ends included.
    whole : bool
        Whether it is a whole number.
    words : str
        Its constraints, for people.
    fixed : bool
        Whether its type never changes.

    """

    name: str
    value: Any
    meaning: str
    low: float | None
    high: float | None
    whole: bool
    words: str
    fixed: bool


def settings_of(section: str, part: Part) -> list[Setting]:
    """The settings of a part that a parameter can hold."""
    described, texts = type(part).model_json_schema(), meanings(type(part))
    found = []
    for name in type(part).model_fields:
        value = _plain(getattr(part, name))
        if isinstance(value, dict) or (isinstance(value, list) and not _even(value)):
            continue
        spec = described["properties"][name]
        single = [each for each in _members(spec) if each.get("type") in ("number", "integer")]
        low, high = _range(single[0]) if single else (None, None)
        whole = spec.get("type") == "integer"
        found.append(
            Setting(
                f"{section}.{name}", value, texts.get(name, ""), low, high, whole, _words(spec), "anyOf" not in spec,
            )
        )  # fmt: skip
    return found


class Parameters:
    """The parts of some sections of a mission, whose settings change while the node lives.

    Attributes
    ----------
    parts : dict
        By section, as they are now.

    """

    def __init__(self, parts: Mapping[str, Part], team: Team) -> None:
        self.parts, self.team = dict(parts), team

    def settings(self) -> list[Setting]:
        """All of them."""
        return [each for section, part in self.parts.items() for each in settings_of(section, part)]

    def change(self, values: Mapping[str, Any], flight: Flight | None) -> str:
        """Set parameters by name, all or none, and in the flight where there is one; why not, or nothing.

        A change is refused that the part refuses, or that the team cannot keep.
        """
        before, changed = dict(self.parts), dict[str, dict[str, Any]]()
        for name, value in values.items():
            section, _, setting = name.rpartition(".")
            if section in self.parts:
                changed.setdefault(section, {})[setting] = _plain(value)
        try:
            for section, settings in changed.items():
                self.parts[section] = self._checked(section, settings)
            self.put(flight, changed)
        except ColiftError as error:
            self.parts = before
            self.put(flight, changed)
            return str(error)
        return ""

    def put(self, flight: Flight | None, sections: Iterable[str]) -> None:
        """Let a flight go on with the parts of these sections."""
        for section in sections if flight is not None else ():
            if flight.parts[section] is not self.parts[section]:  # type: ignore[union-attr]
                flight.replace(section, self.parts[section])  # type: ignore[union-attr]

    def _checked(self, section: str, settings: Mapping[str, Any]) -> Part:
        part = self.parts[section]
        same = {
            name: value
            for name, value in settings.items()
            if _plain(getattr(part, name, None)) == value
        }
        if len(same) == len(settings):
            return part
        try:
            found = type(part)(**{**part.model_dump(), **settings})
        except SettingError as error:
            raise error.within(section) from error
        problems = [*found.check(self.team), *found.conflicts(self.team)]
        if problems:
            field, message = problems[0]
            raise SettingError.of(f"{section}.{field}", "", message)
        return found


def _plain(value: Any) -> Any:
    """As a parameter holds it: lists for tuples and arrays, of numbers of one kind."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple) or type(value).__name__ == "array":
        items = list(value)
        numbers = all(
            isinstance(each, int | float) and not isinstance(each, bool) for each in items
        )
        return [float(each) for each in items] if numbers else items
    return value


def _even(values: list[Any]) -> bool:
    return bool(values) and all(isinstance(each, type(values[0])) for each in values) and not isinstance(values[0], list | tuple | dict)  # fmt: skip


def _members(spec: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [each for each in spec.get("anyOf", [spec]) if each.get("type") != "null"]


def _range(spec: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Least and largest value, ends included."""
    low, high = spec.get("minimum"), spec.get("maximum")
    if low is None and "exclusiveMinimum" in spec:
        low = np.nextafter(spec["exclusiveMinimum"], np.inf)
    if high is None and "exclusiveMaximum" in spec:
        high = np.nextafter(spec["exclusiveMaximum"], -np.inf)
    if low is None and high is None:
        return None, None
    most = 2**63 - 1 if spec.get("type") == "integer" else sys.float_info.max
    return -most if low is None else low, most if high is None else high


SIGNS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}


def _words(spec: Mapping[str, Any]) -> str:
    """What is allowed, for people."""
    found = []
    for member in _members(spec):
        if "enum" in member:
            found.append("one of " + ", ".join(map(str, member["enum"])))
        elif "const" in member:
            found.append(f"must be {member['const']}")
        inner = (member.get("prefixItems") or [member.get("items", {})])[0]
        bounds = inner if member.get("type") == "array" else member
        signs = [f"{sign} {bounds[key]:g}" for key, sign in SIGNS.items() if key in bounds]
        if member.get("type") == "array":
            size = len(member.get("prefixItems", ()))
            signs = [f"{size} numbers" if size else "one number a drone", *signs]
        if signs:
            found.append(", ".join(signs))
    return " or ".join(dict.fromkeys(found))
