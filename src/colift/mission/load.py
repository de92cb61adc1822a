"""Read a mission: from a shipped name, a file or a mapping; report every mistake at once."""

from __future__ import annotations

import copy
import difflib
import importlib.resources
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from colift.errors import MissionError, Problem, UnknownNameError
from colift.mission.schema import Mission
from colift.part import LAYERS, Part, find

DEFAULT_KINDS = {
    "load_control": "pid",
    "allocation": "sqp",
    "position_control": "pid",
    "attitude_control": "manifold",
    "plant": "rigid-cables",
}


def mission_names() -> list[str]:
    """Names of the shipped missions."""
    folder = importlib.resources.files("colift.missions")
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def read_source(source: str | Path) -> tuple[str, dict[str, Any]]:
    """The raw table of a mission and how to call its source in messages.

    ``source`` is the path of a TOML file or the name of a shipped mission.

    Raises
    ------
    UnknownNameError
        If it is neither.
    MissionError
        If the file cannot be read or is not TOML.
    """
    path = Path(source)
    if path.suffix == ".toml" or path.is_file():
        label = str(path)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise MissionError(label, [Problem("file", "", f"cannot be read: {error}")]) from error
    else:
        if str(source) not in mission_names():
            raise UnknownNameError("mission", str(source), mission_names())
        label = f"{source}.toml (shipped)"
        text = (importlib.resources.files("colift.missions") / f"{source}.toml").read_text("utf-8")
    try:
        return label, tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise MissionError(label, [Problem("file", "", f"is not valid TOML: {error}")]) from error


def load_mission(
    source: str | Path | Mapping[str, Any], overrides: Mapping[str, Any] | None = None
) -> Mission:
    """Load and validate a mission completely.

    Parameters
    ----------
    source
        Name of a shipped mission, path of a TOML file, or a mapping with the same content.
    overrides
        Values by dotted path, such as ``{"allocation.mu": 0.75}``; they replace those of the source.

    Raises
    ------
    MissionError
        With every problem found: path, value, allowed range.
    UnknownNameError
        If ``source`` names no shipped mission and no file.
    """
    if isinstance(source, Mapping):
        label, table = "mission", copy.deepcopy(dict(source))
    else:
        label, table = read_source(source)
    problems: list[Problem] = []
    for path, value in (overrides or {}).items():
        problem = _override(table, path, value)
        if problem:
            problems.append(problem)
    mission = _validate(table, problems)
    if problems or mission is None:
        raise MissionError(label, problems)
    return mission


def parse_override(text: str) -> tuple[str, Any]:
    """Split ``key=value``; the value is read as TOML, and as plain text where that fails."""
    key, separator, value = text.partition("=")
    if not separator or not key.strip():
        raise MissionError("--set", [Problem(text, "", "must have the form key=value")])
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        parsed = value.strip()
    return key.strip(), parsed


def _override(table: dict[str, Any], path: str, value: Any) -> Problem | None:
    *parents, leaf = path.split(".")
    node: Any = table
    for depth, key in enumerate(parents):
        node = node.setdefault(key, {}) if isinstance(node, dict) else None
        if not isinstance(node, dict):
            return Problem(".".join(parents[: depth + 1]), "", "is not a table; cannot set a key in it")
    if leaf == "kind" and isinstance(node.get("kind"), str) and node["kind"] != value:
        node.clear()  # the settings of another part mean nothing to this one
    node[leaf] = value
    return None


def _validate(table: dict[str, Any], problems: list[Problem]) -> Mission | None:
    """Validate part by part, so that a mistake in one section does not hide those in others."""
    parts: dict[str, Part] = {}
    kinds: dict[str, str] = {}
    rest = dict(table)
    for layer in LAYERS:
        section = rest.pop(layer, {})
        if not isinstance(section, dict):
            problems.append(Problem(layer, repr(section), "must be a table"))
            continue
        settings = dict(section)
        kind = settings.pop("kind", DEFAULT_KINDS.get(layer))
        if kind is None:
            problems.append(Problem(f"{layer}.kind", "", "is required"))
            continue
        try:
            part = find(layer, str(kind))
        except UnknownNameError as error:
            near = difflib.get_close_matches(str(kind), error.valid, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            names = ", ".join(error.valid)
            problems.append(Problem(f"{layer}.kind", repr(kind), f"must be one of {names}{hint}"))
            continue
        try:
            parts[layer] = part.model_validate(settings)
            kinds[layer] = str(kind)
        except ValidationError as error:
            problems.extend(_problems(error, part, layer))
    if "kinds" in rest:
        problems.append(Problem("kinds", "", "is not a key of a mission"))
        rest.pop("kinds")
    try:
        mission = Mission.model_validate({**rest, **parts, "kinds": kinds})
    except ValidationError as error:
        given = {*LAYERS, "kinds"}
        problems.extend(p for p in _problems(error, Mission, "") if p.path not in given)
        return None
    problems.extend(_cross_checks(mission))
    return mission


def _cross_checks(mission: Mission) -> Iterable[Problem]:
    n, drones = mission.drones.count, mission.drones
    for name in ("mass", "inertia", "cable_length"):
        value = getattr(drones, name)
        if isinstance(value, list) and len(value) != n:
            yield Problem(
                f"drones.{name}", f"{len(value)} values", f"must be one value or a list of drones.count = {n}"
            )
            return
    rows = drones.inertia if isinstance(drones.inertia, list) else [drones.inertia]
    for jx, jy, jz in rows:
        if max(jx, jy, jz) * 2 > (jx + jy + jz) * (1 + 1e-9):
            yield Problem(
                "drones.inertia",
                f"[{jx:g}, {jy:g}, {jz:g}]",
                "no body has these: each moment must be at most the sum of the other two",
            )
            break
    given = mission.start.directions
    if given is not None and len(given) != n:
        yield Problem("start.directions", f"{len(given)} directions", f"must be drones.count = {n}")
    for name, value, message in mission.timing.problems():
        yield Problem(f"timing.{name}", f"{value:g}", message)
    for i, event in enumerate(mission.events):
        if event.at > mission.timing.duration:
            yield Problem(
                f"events.{i}.at", f"{event.at:g}", f"must be within timing.duration = {mission.timing.duration:g} s"
            )
    for layer in LAYERS:
        for field, message in getattr(mission, layer).check(mission.team):
            yield Problem(f"{layer}.{field}", "", message)


def _problems(error: ValidationError, model: type[BaseModel], prefix: str) -> list[Problem]:
    return [_problem(details, model, prefix) for details in error.errors(include_url=False)]


def _problem(details: ErrorDetails, model: type[BaseModel], prefix: str) -> Problem:
    # Drop pydantic's names of union members: they are not part of the file.
    location = [str(part) for part in details["loc"] if not _is_union_tag(part)]
    path = ".".join(([prefix] if prefix else []) + location)
    message, value = details["msg"], repr(details["input"])
    if details["type"] == "extra_forbidden":
        value = ""
        valid = _valid_keys(model, location[:-1])
        near = difflib.get_close_matches(location[-1], valid, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        message = f"unknown key{hint} (valid: {', '.join(valid)})"
    elif details["type"] == "missing":
        value, message = "", "is required"
    else:
        message = message[:1].lower() + message[1:].replace("Input should", "should")
        message = message.replace("input should", "must").replace("value error, ", "")
    return Problem(path, value if len(value) <= 80 else value[:77] + "...", message)


def _is_union_tag(part: int | str) -> bool:
    return isinstance(part, str) and ("[" in part or part in {"float", "constrained-float"})


def _valid_keys(model: type[BaseModel], location: list[str]) -> list[str]:
    """Keys that may stand in the table at ``location``."""
    current: Any = model
    for key in location:
        field = current.model_fields.get(key) if hasattr(current, "model_fields") else None
        if field is None:
            continue
        annotation = field.annotation
        arguments = getattr(annotation, "__args__", ())
        current = next((a for a in arguments if hasattr(a, "model_fields")), annotation)
    keys = [key for key in getattr(current, "model_fields", {}) if key != "kinds"]
    return keys + (["kind"] if isinstance(current, type) and issubclass(current, Part) else [])


