"""Read a mission: from a shipped name, a file or a mapping; report every mistake at once."""

from __future__ import annotations

import difflib
import importlib.resources
import json
import os.path
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from colift.errors import MissionError, Problem, UnknownNameError
from colift.mission.schema import Frame, Mission, Section
from colift.part import LAYERS, Part, find, names
from colift.simulation.signals import columns

DEFAULT_KINDS = {
    "load_control": "pid",
    "allocation": "safe",
    "position_control": "pid",
    "attitude_control": "manifold",
    "plant": "rigid-cables",
}
MAX_RECORDING = 4e9
"""Bytes that a flight may record; it is held in memory."""

Model = TypeVar("Model", bound=BaseModel)


def mission_names() -> list[str]:
    """Names of the shipped missions."""
    folder = importlib.resources.files("colift.missions")
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )


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
    if path.suffix == ".toml" or os.path.isfile(path):
        label = str(path)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            raise MissionError(label, [Problem("file", "", f"cannot be read: {error}")]) from error
    else:
        if str(source) not in mission_names():
            raise UnknownNameError("mission", str(source), mission_names())
        label = f"{source}.toml (shipped)"
        text = (importlib.resources.files("colift.missions") / f"{source}.toml").read_text("utf-8")
    try:
        return label, tomllib.loads(text)
    except (ValueError, RecursionError) as error:
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
        label, table = "mission", _plain(source)
    else:
        label, table = read_source(source)
    problems: list[Problem] = []
    # Kinds first: changing one drops the settings of the part that stood there before.
    for path in sorted(overrides or {}, key=lambda path: not path.endswith(".kind")):
        problem = _override(table, path, (overrides or {})[path])
        if problem:
            problems.append(problem)
    mission = _validate(_plain(table), problems)
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


def _override(table: dict[str, Any], path: str, value: Any) -> Problem | None:
    *parents, leaf = path.split(".")
    node: Any = table
    for depth, key in enumerate(parents):
        node = node.setdefault(key, {}) if isinstance(node, dict) else None
        if not isinstance(node, dict):
            return Problem(
                ".".join(parents[: depth + 1]), "", "is not a table; cannot set a key in it"
            )
    before = node.get("kind", DEFAULT_KINDS.get(parents[-1] if parents else ""))
    if leaf == "kind" and before not in (None, value):
        node.clear()  # the settings of another part mean nothing to this one
    node[leaf] = value
    return None


def _plain(table: Mapping[str, Any]) -> dict[str, Any]:
    """A copy as tables, lists, numbers, texts and booleans, which is what a mission file can hold."""
    plain = json.dumps(
        table, default=lambda value: getattr(value, "tolist", value.__str__)(), ensure_ascii=False
    )
    return dict(json.loads(plain.encode("utf-8", "replace")))


def _parse(model: type[Model], table: Mapping[str, Any]) -> Model:
    """Validate plain data strictly: neither "1" nor true is a number."""
    return model.model_validate_json(json.dumps(table), strict=True)


def _validate(table: dict[str, Any], problems: list[Problem]) -> Mission | None:
    """Validate section by section, so that a mistake in one does not hide those in others."""
    parts: dict[str, Part] = {}
    kinds: dict[str, str] = {}
    rest = dict(table)
    for layer in LAYERS:
        section = rest.pop(layer, {})
        if not isinstance(section, dict):
            problems.append(Problem(layer, _shown(section), "must be a table"))
            continue
        settings = dict(section)
        kind = settings.pop("kind", DEFAULT_KINDS.get(layer))
        if kind is None:
            valid = ", ".join(names(layer))
            problems.append(Problem(f"{layer}.kind", "", f"is required: one of {valid}"))
            continue
        try:
            part = find(layer, str(kind))
        except UnknownNameError as error:
            near = difflib.get_close_matches(str(kind), error.valid, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            valid = ", ".join(error.valid)
            problems.append(Problem(f"{layer}.kind", _shown(kind), f"must be one of {valid}{hint}"))
            continue
        try:
            parts[layer] = _parse(part, settings)
            kinds[layer] = str(kind)
        except ValidationError as error:
            problems.extend(_problems(error, part, settings, layer))
    broken: set[str] = set()
    try:
        frame = _parse(Frame, rest)
    except ValidationError as error:
        found = _problems(error, Frame, rest)
        problems.extend(found)
        broken = {problem.path.partition(".")[0] for problem in found}
        intact = {key: value for key, value in rest.items() if key not in broken}
        frame = _parse(Frame, {"name": "?", **intact})
    problems.extend(_cross_checks(frame, parts, broken))
    if problems:
        return None
    return Mission.model_validate({**dict(frame), **parts, "kinds": kinds})


def _cross_checks(frame: Frame, parts: Mapping[str, Part], broken: set[str]) -> Iterable[Problem]:
    """Mistakes between fields; ``broken`` sections stand at their defaults and are left out."""
    for name, section in frame:
        if isinstance(section, Section):
            for field, value, message in section.problems():
                broken.add(name)
                yield Problem(f"{name}.{field}", value, message)
    n, timing = frame.drones.count, frame.timing
    given = frame.start.directions
    if "drones" not in broken and given is not None and len(given) != n:
        yield Problem("start.directions", f"{len(given)} directions", f"must be drones.count = {n}")
    if not broken & {"drones", "timing"}:
        width = max(part.stop for part in columns(n).values())
        size = 8.0 * width * timing.duration / timing.recording
        size += 80.0 * timing.duration / timing.allocation
        if size > MAX_RECORDING:
            limit = f"{MAX_RECORDING / 1e9:g} GB; shorten timing.duration or lengthen the periods"
            yield Problem(
                "timing.recording", f"{size / 1e9:.1f} GB", f"must record at most {limit}"
            )
    left = set(range(n))
    if all(type(e.value) is int for e in frame.events if e.field.startswith("drones.")):
        left = set(frame.first_drones())
    for i, event in sorted(enumerate(frame.events), key=lambda pair: pair[1].at):
        if "timing" not in broken and event.at > timing.duration:
            yield Problem(
                f"events.{i}.at",
                f"{event.at:g}",
                f"must be within timing.duration = {timing.duration:g} s",
            )
        section, _, name = event.field.partition(".")
        if section == "drones" and "drones" not in broken:
            if name == "join":
                away = sorted(set(range(n)) - left)
                if type(event.value) is not int or event.value not in away:
                    others = ", ".join(map(str, away)) or "none"
                    message = f"must be one of the drones that do not fly then ({others})"
                    yield Problem(f"events.{i}.value", repr(event.value), message)
                else:
                    left.add(event.value)
            elif type(event.value) is not int or event.value not in left or len(left) == 1:
                flying = ", ".join(map(str, sorted(left)))
                message = f"must be one of the drones that fly then ({flying}), not the last one"
                yield Problem(f"events.{i}.value", repr(event.value), message)
            else:
                left.remove(event.value)
            continue
        model = frame.load if section == "load" else parts.get(section)
        if model is None:
            continue
        changed = {**model.model_dump(mode="json"), name: event.value}
        try:
            _parse(type(model), changed)
        except ValidationError as error:
            for problem in _problems(error, type(model), changed, section):
                yield Problem(f"events.{i}", problem.value, f"{problem.path} {problem.message}")
    if not broken & {"world", "load", "drones"}:
        for layer, part in parts.items():
            if message := part.missing():
                yield Problem(f"{layer}.kind", "", message)
            for field, message in part.check(frame.team):
                yield Problem(f"{layer}.{field}", "", message)


def _problems(
    error: ValidationError, model: type[BaseModel], table: Mapping[str, Any], prefix: str = ""
) -> list[Problem]:
    """One problem a place; of what a union's members say, the most specific."""
    found: dict[str, Problem] = {}
    for details in error.errors(include_url=False):
        problem = _problem(details, model, table, prefix)
        earlier = found.get(problem.path)
        if earlier and not _is_short(details) and earlier.message != problem.message:
            problem = replace(problem, message=f"{earlier.message}, or {problem.message}")
        found[problem.path] = problem
    return [p for path, p in found.items() if not any(f.startswith(f"{path}.") for f in found)]


_WORDS = {
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "too_long": "must have at most {max_length} values",
    "too_short": "must have at least {min_length} values",
    "missing": "is required",
}


def _problem(
    details: ErrorDetails, model: type[BaseModel], table: Mapping[str, Any], prefix: str
) -> Problem:
    location, value = _location(details["loc"], table), _shown(details["input"])
    if details["type"] == "extra_forbidden":
        value = ""
        valid = _valid_keys(model, location[:-1])
        near = difflib.get_close_matches(location[-1], valid, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        message = f"unknown key{hint} (valid: {', '.join(valid)})"
    elif _is_short(details):
        message = f"must have at least {int(details['loc'][-1]) + 1} values"
    elif details["type"] in _WORDS:
        message = _WORDS[details["type"]].format(**details.get("ctx", {}))
        if details["type"] == "missing":
            location, value = [*location, str(details["loc"][-1])], ""
    else:
        message = details["msg"].removeprefix("Value error, ")
        message = re.sub("^[A-Z][a-z]+ should", "must", message)
    return Problem(".".join(([prefix] if prefix else []) + location), value, message)


def _is_short(details: ErrorDetails) -> bool:
    """Whether an item of a list of fixed length is missing; of several, the last tells the length."""
    return details["type"] == "missing" and isinstance(details["loc"][-1], int)


def _location(keys: Sequence[int | str], table: Any) -> list[str]:
    """The keys that are in the file; pydantic puts the names of union members between them."""
    found = []
    for key in keys:
        inside = isinstance(table, dict) and key in table
        if inside or (isinstance(table, list) and isinstance(key, int) and key < len(table)):
            table = table[key]
            found.append(str(key))
    return found


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _valid_keys(model: type[BaseModel], location: list[str]) -> list[str]:
    """Keys that may stand in the table at ``location``."""
    if model is Frame and not location:
        return [*Frame.model_fields, *LAYERS]
    current: Any = model
    for key in location:
        field = current.model_fields.get(key) if hasattr(current, "model_fields") else None
        if field is None:
            continue
        annotation = field.annotation
        arguments = getattr(annotation, "__args__", ())
        current = next((a for a in arguments if hasattr(a, "model_fields")), annotation)
    keys = list(getattr(current, "model_fields", {}))
    return keys + (["kind"] if isinstance(current, type) and issubclass(current, Part) else [])
