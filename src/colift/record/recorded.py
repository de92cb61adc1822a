"""The mission of a recording, read leniently: a recording outlives the fields and parts that flew it."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from pydantic import ConfigDict, Field, ValidationError

from colift.catalogue import LISTS
from colift.mission.schema import Described, Event, Frame, Section, with_derived

UNNAMED = "a flight"


class RecordedMission(Described):
    """What a recording tells of its mission: the frame as far as it is understood, all else as plain data.

    No part is looked up: what flew need not be installed, nor exist any more. A field of the frame that is
    missing, unknown or not understood stands at its default; :meth:`resolved` has it as it was recorded.
    """

    # It is never validated: not building a validator is a tenth of the time that opening a recording takes.
    model_config = ConfigDict(defer_build=True, use_attribute_docstrings=False)

    kinds: dict[str, str] = Field(default_factory=dict)
    """Name of the part in each layer, as far as recorded."""
    list_kinds: dict[str, list[str]] = Field(default_factory=dict)
    """Names of the disturbances and faults, in their order."""
    source: str = "simulation"
    """``"simulation"``, or ``"flight"`` for one that was flown in the real world."""
    table: dict[str, Any] = Field(default_factory=dict)
    """The mission as recorded."""

    @classmethod
    def read(cls, table: Mapping[str, Any], *, drones: int, source: str) -> RecordedMission:
        """From the table in a recording of so many drones."""
        known: dict[str, Any] = _without_none(table)
        parts = {name: kind for name, kind in _kinds(known) if isinstance(kind, str)}
        lists = {name: kinds for name, kinds in _kinds(known) if isinstance(kinds, list)}
        return cls.model_construct(
            **dict(_understood(known, drones)),
            kinds=parts, list_kinds=lists, source=source, table=known,
        )  # fmt: skip

    if not TYPE_CHECKING:  # a misspelt attribute of the frame is still found by the type checker

        def __getattr__(self, name: str) -> Any:
            """Sections of the layers: their settings as attributes, such as ``mission.allocation.mu``."""
            table = with_derived(self.__dict__.get("table", {}))
            if name in table or name in LISTS:
                return _as_attributes(table.get(name, []))
            return super().__getattr__(name)

    def resolved(self) -> dict[str, Any]:
        """The whole mission as it was recorded, as plain data."""
        return copy.deepcopy(self.table)


def _as_attributes(section: Any) -> Any:
    if isinstance(section, dict):
        return SimpleNamespace(**section)
    return [_as_attributes(each) for each in section] if isinstance(section, list) else section


def _kinds(table: Mapping[str, Any]) -> Iterable[tuple[str, str | list[str]]]:
    """What the sections outside of the frame call their parts."""
    for name, section in table.items():
        if name in Frame.model_fields:
            continue
        if isinstance(section, dict) and "kind" in section:
            yield name, str(section["kind"])
        elif isinstance(section, list):
            yield name, [str(item.get("kind", "?")) for item in section if isinstance(item, dict)]


def _understood(table: Mapping[str, Any], drones: int) -> Frame:
    """The frame without what it does not take."""
    table = with_derived(table)
    kept = copy.deepcopy({k: v for k, v in table.items() if k in Frame.model_fields})
    kept.setdefault("name", UNNAMED)
    events = [event for event in map(_event, _listed(kept.pop("events", []))) if event]
    while True:
        try:
            frame = Frame.model_validate(kept)
            break
        except ValidationError as error:
            for details in error.errors(include_url=False, include_input=False):
                _drop(kept, details["loc"])
            kept.setdefault("name", UNNAMED)
    changes: dict[str, Any] = {"events": events}
    for name, section in frame:
        if isinstance(section, Section):
            defaults = {
                field: type(section).model_fields[field].get_default()
                for field, _, _ in section.wrong_lengths(drones)
            }
            changes[name] = section.model_copy(update=defaults)
    changes["drones"].count = drones
    return frame.model_copy(update=changes)


def _drop(table: dict[Any, Any], place: tuple[int | str, ...]) -> None:
    """Leave out the innermost named value at a place, in which names of a union's members may stand."""
    holder, last = table, place[0]
    node = table.get(last)
    for key in place[1:]:
        if isinstance(node, dict) and key in node:
            holder, last = node, key
            node = node[key]
    holder.pop(last, None)


def _without_none(value: Any) -> Any:
    """A copy without what is null, which a mission file cannot hold."""
    if isinstance(value, Mapping):
        return {str(k): _without_none(v) for k, v in value.items() if v is not None}
    return [_without_none(v) for v in value if v is not None] if isinstance(value, list) else value


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _event(item: Any) -> Event | None:
    """A change of any field, also of one that a mission of today does not have."""
    at, field = (item.get("at"), item.get("field")) if isinstance(item, dict) else (None, None)
    if not isinstance(at, int | float) or not math.isfinite(at) or not isinstance(field, str):
        return None
    return Event.model_construct(at=float(at), field=field, value=item.get("value"))
