"""Read a mission: from a shipped name, a file or a mapping; report every mistake at once."""

from __future__ import annotations

import difflib
import json
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from colift.catalogue import FOLDERS, LAYERS, LISTS, default_kind, read_source
from colift.errors import (
    MissingExtraError,
    MissionError,
    Problem,
    SceneError,
    SettingError,
    UnknownNameError,
)
from colift.mission.checks import cross_checks, hover_checks
from colift.mission.crew import on_all_cores
from colift.mission.mission import Mission
from colift.mission.planned import planned_checks
from colift.mission.scenes import obstacle_of, obstacles_of, read_scene
from colift.mission.schema import Frame
from colift.part import KIND, Declaration, Declared, Part, find, names
from colift.team.vehicles import NUMBERS
from colift.wording import parse, problems_of, shown
from colift.world.actuation.base import ActuationPart


def load_mission(
    source: str | Path | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    must_fly: bool = True,
) -> Mission:
    """Load and validate a mission completely.

    Parameters
    ----------
    source
        Name of a shipped mission, path of a TOML file, or a mapping with the same content.
    overrides
        Values by dotted path, such as ``{"allocation.mu": 0.75}`` or, for a whole section,
        ``{"allocation": {"kind": "sqp"}}``. They replace those of the source one after the other, so that
        the later one wins; another ``kind`` drops the settings of the part that stood there before, but none
        that was given by its own path. Another ``timing.delay`` takes those settings along that were the same as the one before.
    must_fly
        Whether a mission whose team cannot hold its load, or keep its limits, is refused as well.

    Raises
    ------
    MissionError
        With every problem found: path, value, allowed range.
    UnknownNameError
        If ``source`` names no shipped mission and no file.

    """
    if isinstance(source, Mapping):
        label, table = "mission", _plain(source)
    elif isinstance(source, str | os.PathLike):
        label, table = read_source(source)
        table = _plain(table)
        _beside(Path(source), table)
    else:
        raise SettingError.of("mission", shown(source), "must be a name, a path or a mapping")
    problems: list[Problem] = []
    given: set[str] = set()
    delay = _declared_delay(table)
    for path, value in _plain(overrides or {}).items():
        problem = _override(table, path, value, given)
        if problem:
            problems.append(problem)
    if "timing.delay" in given or "timing" in given:
        _follow_delay(table, delay, given)
    _with_scene(table, problems)
    with on_all_cores(table):
        mission = _validate(table, problems, must_fly)
    if problems or mission is None:
        raise MissionError(label, problems)
    return mission


def parse_override(text: str) -> tuple[str, Any]:
    """Split ``key=value``; the value is read as TOML, and as plain text where that fails."""
    key, separator, value = text.partition("=")
    if not separator or not key.strip():
        raise MissionError("--set", [Problem(text, "", "must have the form key=value")])
    try:
        table = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        table = {}
    parsed = table["value"] if table.keys() == {"value"} else value.strip()
    return key.strip(), parsed


def parse_overrides(texts: Iterable[str] | None) -> dict[str, Any]:
    """Overrides from texts ``key=value``, of which the later win."""
    return layered(*(dict([parse_override(text)]) for text in texts or ()))


def layered(*changes: Mapping[str, Any]) -> dict[str, Any]:
    """Overrides one after the other; what is given again comes last, where it wins over all before it."""
    found: dict[str, Any] = {}
    for each in changes:
        for path, value in each.items():
            found.pop(path, None)
            found[path] = value
    return found


def _override(table: dict[str, Any], path: str, value: Any, given: set[str]) -> Problem | None:
    """Set one value; ``given`` are the paths that were set before, brought up to date."""
    *parents, leaf = path.split(".")
    node: Any = table
    for depth, key in enumerate(parents):
        above, where = node, ".".join(parents[: depth + 1])
        if isinstance(above, list) and key.isdecimal() and int(key) < len(above):
            node = above[int(key)]
        else:
            node = above.setdefault(key, {}) if isinstance(above, dict) else None
        if not isinstance(node, dict | list):
            if isinstance(above, list) and key.isdecimal():
                return Problem(where, "", f"is not there: the list has {len(above)}, from 0")
            return Problem(where, "", "is not a table; cannot set a key in it")
    if not isinstance(node, dict):
        return Problem(
            path, "", f"{'.'.join(parents)} is a list of {len(node)}; name one by its number"
        )
    section = path.removesuffix(leaf)
    before = node.get("kind", default_kind(parents[-1] if parents else "", table))
    if leaf == "kind" and before not in (None, value):
        own = {
            known[len(section) :].partition(".")[0] for known in given if known.startswith(section)
        }
        for setting in node.keys() - own:
            del node[setting]  # the settings of another part mean nothing to this one
    if parents == ["drones"]:
        _drop_old_vehicle(table, path, value, given)
    node[leaf] = value
    given.difference_update([known for known in given if known.startswith(f"{path}.")])
    given.add(path)
    return None


def _declared_delay(table: Mapping[str, Any]) -> Any:
    timing = table.get("timing")
    return timing.get("delay") if isinstance(timing, dict) else None


def _follow_delay(table: dict[str, Any], before: Any, given: set[str]) -> None:
    """Take away settings that the delay declared ``before`` filled in, so that the new one does."""
    for layer in LAYERS:
        section = table.get(layer)
        if before is None or not isinstance(section, dict) or layer in given:
            continue
        try:
            part = find(layer, str(section.get("kind", default_kind(layer, table))))
        except UnknownNameError:
            continue
        for name in part.delays_declared:
            if section.get(name) == before and f"{layer}.{name}" not in given:
                del section[name]


def _beside(source: Path, table: Mapping[str, Any]) -> None:
    """Take files that a mission's file names, of vehicles, of a plan and of a scene, from its own folder."""
    if not source.is_file():
        return

    def found(name: Any, ending: str) -> Any:
        is_file = isinstance(name, str) and name.endswith(ending)
        return str(source.parent / name) if is_file else name

    drones, reference, world = (table.get(name) for name in ("drones", "reference", "world"))
    if isinstance(world, dict) and "scene" in world:
        world["scene"] = found(world["scene"], "")
    if isinstance(drones, dict) and drones.get("vehicle") is not None:
        vehicle = drones["vehicle"]
        several = isinstance(vehicle, list)
        each = [found(name, ".toml") for name in (vehicle if several else [vehicle])]
        drones["vehicle"] = each if several else each[0]
    if isinstance(reference, dict) and reference.get("kind") == "plan" and "file" in reference:
        reference["file"] = found(reference["file"], "")


def _with_scene(table: dict[str, Any], problems: list[Problem]) -> None:
    """Put the obstacles of the scene that a mission names before its own."""
    world = table.get("world")
    if not (isinstance(world, dict) and isinstance(world.get("scene"), str)):
        return
    name = world.pop("scene")
    mistakes: list[Problem] = []
    try:
        rows = obstacles_of(read_scene(Path(name)), mistakes).tolist()
    except SceneError as error:
        mistakes, rows = list(error.problems), []
    except MissingExtraError as error:
        mistakes, rows = [Problem("", "", str(error))], []
    problems.extend(
        Problem("world.scene", name, f"{each.path} {each.message}".strip()) for each in mistakes
    )
    own = world.get("obstacles", [])
    if isinstance(own, list) and not mistakes:
        world["obstacles"] = [obstacle_of(row) for row in rows] + own


def _drop_old_vehicle(table: dict[str, Any], path: str, value: Any, given: set[str]) -> None:
    """Take out what an overridden number of the drones makes out of date, but nothing that was given by its own path.

    Another vehicle drops the numbers of the one that stood there before, with the parts' settings that are a vehicle's;
    another mass, arm or inertia an estimate of the inertia.
    """
    drones = table.get("drones")
    if not isinstance(drones, dict):
        return
    field = path.rpartition(".")[2]
    if field == "vehicle" and drones.get("vehicle") != value:
        old = [("drones", drones, (*NUMBERS, "inertia_from"))]
        for layer in FOLDERS:
            sections = table.get(layer, {})
            for i, section in enumerate(sections if isinstance(sections, list) else [sections]):
                if not isinstance(section, dict):
                    continue
                kind = section.get("kind", default_kind(layer, table))
                if isinstance(kind, str) and kind in names(layer):
                    where = f"{layer}.{i}" if layer in LISTS else layer
                    old.append((where, section, tuple(find(layer, kind).from_team)))
        for where, section, fields in old:
            for name in fields:
                if f"{where}.{name}" not in given:
                    section.pop(name, None)
    elif field == "inertia":
        drones.pop("inertia_from", None)
    elif field in ("mass", "arm") and drones.get("inertia_from") == "estimate":
        if "drones.inertia" not in given:
            drones.pop("inertia", None)
        drones.pop("inertia_from", None)


def _plain(table: Mapping[str, Any]) -> dict[str, Any]:
    """A copy as tables, lists, numbers, texts and booleans, which is what a mission file can hold."""
    try:
        plain = json.dumps(
            table,
            default=lambda value: getattr(value, "tolist", value.__str__)(),
            ensure_ascii=False,
        )
    except (TypeError, ValueError, RecursionError) as error:
        raise MissionError("mission", [Problem("", "", f"is not plain data: {error}")]) from error
    return dict(json.loads(plain.encode("utf-8", "replace")))


def _validate(table: dict[str, Any], problems: list[Problem], must_fly: bool) -> Mission | None:
    """Validate section by section, so that a mistake in one does not hide those in others."""
    parts: dict[str, Part] = {}
    kinds: dict[str, str] = {}
    apart = (*LAYERS, *LISTS, "derived")  # what was derived is derived anew
    rest = {name: section for name, section in table.items() if name not in apart}
    frame, mistakes = _frame(rest)
    told = Declaration(frame.timing)
    for layer in sorted(LAYERS, key=lambda layer: layer not in ("sensing", "actuation")):
        kind = default_kind(layer, table)
        found = _part(layer, table.get(layer, {}), layer, kind, told, problems)
        if found is not None:
            kinds[layer], parts[layer] = found
            if layer in ("sensing", "actuation"):
                known: dict[str, Any] = {layer: parts[layer]}
                if not frame.drones.problems():
                    if layer == "actuation":
                        frame = _with_motors(frame, parts[layer])
                    known[layer] = parts[layer].filled(frame.team)
                told = replace(told, **known)
    kinds = {layer: kinds[layer] for layer in LAYERS if layer in kinds}
    parts = {layer: parts[layer] for layer in LAYERS if layer in parts}
    lists: dict[str, list[Part]] = {}
    list_kinds: dict[str, list[str]] = {}
    for name in LISTS:
        sections = table.get(name, [])
        if not isinstance(sections, list):
            problems.append(Problem(name, shown(sections), f"must be a list of tables, [[{name}]]"))
            sections = []
        each = [
            _part(name, section, f"{name}.{i}", None, told, problems)
            for i, section in enumerate(sections)
        ]
        list_kinds[name] = [item[0] for item in each if item]
        lists[name] = [item[1] for item in each if item]
    problems.extend(mistakes)
    broken = {problem.path.partition(".")[0] for problem in mistakes}
    problems.extend(cross_checks(frame, parts, lists, broken, must_fly=must_fly))
    if must_fly and not problems:
        problems.extend(hover_checks(frame, parts, lists["disturbance"]))
        problems.extend(planned_checks(frame, parts))
    if problems:
        return None
    team = frame.team
    filled = {name: part.filled(team) for name, part in parts.items()}
    filled_lists = {name: [part.filled(team) for part in each] for name, each in lists.items()}
    return Mission.model_validate(
        {**dict(frame), **filled, **filled_lists, "kinds": kinds, "list_kinds": list_kinds}
    )


def _frame(table: dict[str, Any]) -> tuple[Frame, list[Problem]]:
    """All but the layers, with defaults for sections that hold mistakes, and these."""
    try:
        return parse(Frame, table), []
    except ValidationError as error:
        mistakes = problems_of(error, Frame, table, further=FOLDERS)
        broken = {problem.path.partition(".")[0] for problem in mistakes}
        intact = {key: value for key, value in table.items() if key not in broken}
        return parse(Frame, {"name": "?", **intact}), mistakes


def _with_motors(frame: Frame, rotors: Part) -> Frame:
    """The frame whose drones have what their motors have, where they do not say it themselves."""
    assert isinstance(rotors, ActuationPart)
    team = frame.team
    if rotors.wrong_lengths(team.n):
        return frame
    drones = frame.drones.assuming(rotors.assumed(team), rotors.guessed(team))
    return frame.model_copy(update={"drones": drones})


def _part(
    layer: str,
    section: Any,
    path: str,
    default: str | None,
    told: Declared,
    problems: list[Problem],
) -> tuple[str, Part] | None:
    """Name and settings of the part that a section asks for, or of the default; None, and problems, where it cannot."""
    if not isinstance(section, dict):
        problems.append(Problem(path, shown(section), "must be a table"))
        return None
    settings = dict(section)
    kind = settings.pop("kind", default)
    if kind is None:
        valid = ", ".join(names(layer))
        problems.append(Problem(f"{path}.kind", "", f"is required: one of {valid}"))
        return None
    try:
        part = find(layer, str(kind))
    except UnknownNameError as error:
        near = difflib.get_close_matches(str(kind), error.valid, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        valid = ", ".join(error.valid)
        problems.append(Problem(f"{path}.kind", shown(kind), f"must be one of {valid}{hint}"))
        return None
    try:
        return str(kind), parse(part, {**part.declared(told), **settings})
    except ValidationError as error:
        problems.extend(problems_of(error, part, settings, path, KIND))
        return None
