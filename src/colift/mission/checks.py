"""Mistakes between the fields of a mission that are each valid alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from colift.control.allocation.base import AllocatorPart
from colift.control.allocation.limits.hover import hovering
from colift.control.reference.base import ReferencePart
from colift.control.supervision.base import SupervisionPart
from colift.errors import Problem, UnknownNameError
from colift.kernel.math import winch
from colift.kernel.ports import MAX_DISTURBANCES
from colift.kernel.signals import columns
from colift.mission.criteria import METRICS
from colift.mission.forecast import forecast
from colift.mission.grounding import ground_checks
from colift.mission.schema import Event, Frame, Section, Timing
from colift.part import KIND, Declaration, Declared, Part, find, kind_of, placed
from colift.team import Team, contact
from colift.team.geometry import matrix_of
from colift.team.obstacles import Bodies, corners, first_touch
from colift.wording import parse, problems_of, shown
from colift.world.actuation.base import ActuationPart
from colift.world.fault.base import FaultPart
from colift.world.plant.base import PlantPart

Array = NDArray[np.float64]

MAX_RECORDING = 4e9
"""Bytes that a flight may record; it is held in memory."""


def recorded_bytes(n: int, timing: Timing) -> float:
    """Size of what a flight of n drones records."""
    row = 8.0 * float(max(part.stop for part in columns(n).values()))
    return timing.duration * (row / timing.recording + 80.0 / timing.allocation)


def cross_checks(
    frame: Frame,
    parts: Mapping[str, Part],
    lists: Mapping[str, list[Part]],
    broken: set[str],
    *,
    must_fly: bool = True,
) -> Iterable[Problem]:
    """Mistakes between fields; ``broken`` sections stand at their defaults and are left out.

    With ``must_fly`` limits that conflict are mistakes too (:meth:`colift.part.Part.conflicts`).
    """
    broken = set(broken)
    for name, section in frame:
        if isinstance(section, Section):
            for field, value, message in section.problems():
                broken.add(name)
                yield Problem(f"{name}.{field}", value, message)
    n, timing = frame.drones.count, frame.timing
    if "drones" not in broken:
        yield from _length_checks(frame, n, broken)
    if not broken & {"drones", "timing"}:
        size = recorded_bytes(n, timing)
        if size > MAX_RECORDING:
            limit = f"{MAX_RECORDING / 1e9:g} GB; shorten timing.duration or lengthen the periods"
            yield Problem(
                "timing.recording", f"{size / 1e9:.1f} GB", f"must record at most {limit}"
            )
    yield from _event_checks(frame, dict(_with_paths(parts, lists)), broken, must_fly)
    yield from _criteria_checks(frame)
    if not broken & {"world", "load", "drones", "truth"}:
        weak = list(_strength_checks(frame)) if must_fly else []
        yield from weak
        for path, part in _with_paths(parts, lists):
            kind = f"{path}.kind"
            if message := part.missing():
                yield Problem(kind, "", message)
            team = frame.team
            if isinstance(part, PlantPart):
                part, team = part.filled(team), _of_plant(frame, part)
            found = part.check(team)
            if must_fly and not (found or weak):
                found = part.conflicts(team)
            for field, message in found:
                yield Problem(placed(path, field), _of_drones(frame, field), message)
        if must_fly and not weak:
            yield from list(_touching(frame, broken)) or _start_checks(frame, parts, broken)
            yield from _obstructed(frame, parts, broken)
    if "timing" not in broken:
        for path, part in _with_paths(parts, lists):
            for field, message in part.check_timing(timing.step, timing.duration):
                yield Problem(f"{path}.{field}", "", message)
    if len(lists["disturbance"]) > MAX_DISTURBANCES:
        message = f"must be at most {MAX_DISTURBANCES}"
        yield Problem("disturbance", f"{len(lists['disturbance'])} parts", message)
    yield from _fault_checks(frame, parts, lists["fault"], broken)
    yield from ground_checks(frame, parts, broken)
    yield from _supervision_checks(frame, parts)


def _of_plant(frame: Frame, plant: PlantPart, **changes: Any) -> Team:
    """The bodies as a plant has them."""
    return plant.team_of(replace(frame.true_bodies, **changes), frame.drones.cable_density)


def _supervision_checks(frame: Frame, parts: Mapping[str, Part]) -> Iterable[Problem]:
    """A supervisor whose orders another layer does not know."""
    supervisor = parts.get("supervision")
    if not isinstance(supervisor, SupervisionPart):
        return
    for layer, kinds in supervisor.works_with.items():
        found = kind_of(type(parts[layer])) if layer in parts else ""
        if found and found not in (*kinds, "external"):
            wanted = " or ".join(f'"{kind}"' for kind in kinds)
            message = (
                f'needs {layer}.kind = {wanted}: "{found}" knows nothing of a load that stands on the ground, '
                "nor of cables that are slack on purpose"
            )
            yield Problem("supervision.kind", kind_of(type(supervisor)), message)
    if supervisor.works_with and frame.ground is None and not frame.start.on_ground:
        message = 'needs a ground to take off from and to land on, but world.ground = "none"'
        yield Problem("supervision.kind", kind_of(type(supervisor)), message)


def _of_drones(frame: Frame, field: str) -> str:
    """Value of a field of the drones, for messages; of other fields their parts tell."""
    section, _, name = field.rpartition(".")
    return shown(getattr(frame.drones, name)) if section == "drones" else ""


def _strength_checks(frame: Frame) -> Iterable[Problem]:
    """Drones that cannot lift themselves; where their motors say so, those tell it."""
    if "max_thrust" in frame.drones.assumed:
        return
    team = frame.team
    own = team.masses * team.gravity
    for i in np.flatnonzero(team.max_thrusts <= own):
        message = f"must exceed {own[i]:.4g} N: drone {i} weighs that"
        yield Problem("drones.max_thrust", f"{team.max_thrusts[i]:g}", message)
        break


def _fault_checks(
    frame: Frame, parts: Mapping[str, Part], faults: list[Part], broken: set[str]
) -> Iterable[Problem]:
    """Faults of drones that are not there, after the end, or of motors that the rotors do not have."""
    n, timing, rotors = frame.drones.count, frame.timing, parts.get("actuation")
    for i, fault in enumerate(faults):
        assert isinstance(fault, FaultPart)
        at, drone = fault.at, fault.drone
        if fault.needs_motors and rotors is not None and not type(rotors).has_motors:  # type: ignore[attr-defined]
            message = (
                f'needs motors, but actuation.kind = "{kind_of(type(rotors))}" has none: a weak motor would not '
                'turn its drone; set actuation.kind = "motors"'
            )
            yield Problem(f"fault.{i}.kind", kind_of(type(fault)), message)
        if "timing" not in broken and at != "random" and at > timing.duration:
            message = f"must be within timing.duration = {timing.duration:g} s"
            yield Problem(f"fault.{i}.at", f"{at:g}", message)
        if "drones" not in broken and drone != "random" and drone >= n:
            yield Problem(f"fault.{i}.drone", str(drone), f"must be one of the drones 0 to {n - 1}")


def _start_checks(frame: Frame, parts: Mapping[str, Part], broken: set[str]) -> Iterable[Problem]:
    """A start from which the allocator's limits are never reached, where they can be kept at all."""
    part, given = parts.get("allocation"), frame.start.directions
    if not isinstance(part, AllocatorPart) or "start" in broken or part.missing():
        return
    drones = frame.first_drones()
    if (given is None or len(given) == frame.drones.count) and not (
        part.check(frame.team) or part.conflicts(frame.team)
    ):
        message = part.of(drones).cannot_start(frame.team.of(drones), frame.start_directions())
        if message:
            field = "cone_deg" if given is None else "directions"
            value = f"{math.degrees(frame.start_cone):g}" if given is None else ""
            yield Problem(f"start.{field}", value, message)


def _touching(frame: Frame, broken: set[str]) -> Iterable[Problem]:
    """Drones that touch each other, a cable or the load before anything moves."""
    given = frame.start.directions
    count = frame.drones.count
    if "start" in broken or (given is not None and len(given) != count):
        return
    drones = frame.first_drones()
    team = frame.team.of(drones)
    if not contact.watched(team.radii):
        return
    ends = np.zeros((team.n, 3)) if team.body is None else team.body.attachments
    positions = ends - team.cable_lengths[:, None] * frame.start_directions()
    found = contact.first_contact(
        team.radii,
        team.cable_lengths,
        positions[None],
        ends[None],
        np.ones((1, team.n)),
        _box(team),
    )
    if found is not None:
        field = "cone_deg" if given is None else "directions"
        value = f"{math.degrees(frame.start_cone):g}" if given is None else ""
        message = f"must leave the drones (drones.radius) apart: {found[1].format(*drones)}"
        yield Problem(f"start.{field}", value, message.replace("touched", "touch"))


def _obstructed(frame: Frame, parts: Mapping[str, Part], broken: set[str]) -> Iterable[Problem]:
    """An obstacle that the team touches before anything moves."""
    obstacles, reference = frame.world.rows(), parts.get("reference")
    given, drones = frame.start.directions, frame.first_drones()
    fits = given is None or len(given) == frame.drones.count
    if not (len(obstacles) and isinstance(reference, ReferencePart) and fits) or "start" in broken:
        return
    team = frame.team.of(drones)
    (first, *_), attitude, _ = reference.pose(team)
    load = first + frame.start.load_offset
    if frame.start.on_ground and frame.ground is not None:
        load[2] = frame.ground.height + frame.sole
    arms = np.zeros((team.n, 3)) if team.body is None else team.body.attachments
    ends = load + arms @ matrix_of(attitude).T
    positions = frame.start_places(load)
    if positions is None:
        positions = ends - team.cable_lengths[:, None] * frame.start_directions()
    points = load[None, None]
    if team.body is not None:
        points = corners(team.body.size, points, attitude[None])
    touch = first_touch(
        obstacles, Bodies(team.radii, positions[None], ends[None], np.ones((1, team.n)), points)
    )
    if touch is not None:
        who, _, _ = touch.text.format(*drones).partition(" touched ")
        path = f"world.obstacles.{touch.obstacle}"
        yield Problem(path, "", f"must leave room for the team at the start: {who} touches it")


def _box(team: Team) -> contact.Boxes | None:
    """A rigid load at the start, level at the origin."""
    level = np.array([[1.0, 0.0, 0.0, 0.0]])
    return None if team.body is None else contact.Boxes(team.body.size, np.zeros((1, 3)), level)


def _length_checks(frame: Frame, n: int, broken: set[str]) -> Iterable[Problem]:
    """Lists with one value per drone that have another number of them."""
    for field, value, message in frame.truth.wrong_lengths(n):
        broken.add("truth")
        yield Problem(f"truth.{field}", value, message)
    ends = frame.load.attachments
    if ends is not None and len(ends) != n:
        broken.add("load")
        yield Problem("load.attachments", f"{len(ends)} points", f"must be drones.count = {n}")
    given = frame.start.directions
    if given is not None and len(given) != n:
        message = f"must be drones.count = {n}"
        yield Problem("start.directions", f"{len(given)} directions", message)


def hover_checks(
    frame: Frame, parts: Mapping[str, Part], disturbances: Sequence[Part]
) -> Iterable[Problem]:
    """Why the team cannot hold the load in hover, in the formation that its allocator settles in, or in the wind.

    Judged by what the controllers are told. Asked only of a valid mission: it calls the allocator, where
    it has limits that may not do or where motors limit the thrust.
    """
    actuation, allocation = parts["actuation"], parts["allocation"]
    assert isinstance(actuation, ActuationPart)
    assert isinstance(allocation, AllocatorPart)
    drones = frame.first_drones()
    team = frame.team.of(drones)
    actuation, allocation = actuation.of(drones), allocation.of(drones)
    directions, thrusts = frame.start_directions(), actuation.thrust_limits(team)
    unlimited = bool(np.isinf(thrusts).all())
    if team.gravity == 0.0 or (unlimited and not allocation.cannot_hold(team, thrusts, directions)):
        return
    hover, conflicts = hovering(team, allocation, thrusts, directions, frame.timing.allocation)
    if not conflicts:
        bound = frame.criteria.get("tracking_max_m")
        allowed = math.inf if bound is None or bound.max is None else bound.max
        those = [part.of(drones) for part in disturbances]
        ahead = forecast(team, hover, thrusts, allocation, those)
        for layer, message in ahead.problems(team, allowed):
            yield Problem(layer, "", message)
    for layer, message in conflicts.items():
        if layer == "actuation":
            path, field = actuation.thrust_path(team), actuation.thrust_setting
            value = _of_drones(frame, path) or shown(getattr(actuation, field))
            yield Problem(path, value, message)
        else:
            limits = ", ".join(allocation.binding(team, actuation))
            told = f"; what limits: {limits}" if limits else ""
            yield Problem("allocation", "", message + told)


def _criteria_checks(frame: Frame) -> Iterable[Problem]:
    valid = [metric.name for metric in METRICS]
    for name, bound in frame.criteria.items():
        if name not in valid:
            yield Problem(f"criteria.{name}", "", str(UnknownNameError("metric", name, valid)))
        for field, value, message in bound.problems():
            yield Problem(f"criteria.{name}.{field}".rstrip("."), value, message)


def _with_paths(
    parts: Mapping[str, Part], lists: Mapping[str, list[Part]]
) -> Iterable[tuple[str, Part]]:
    yield from parts.items()
    for name, each in lists.items():
        for i, part in enumerate(each):
            yield f"{name}.{i}", part


def _event_checks(
    frame: Frame, parts: Mapping[str, Part], broken: set[str], must_fly: bool
) -> Iterable[Problem]:
    """Mistakes in the events, in the order in which they happen."""
    wound: list[tuple[Array, Array]] = []
    n, timing, present = frame.drones.count, frame.timing, dict(parts)
    told = Declaration(timing, parts.get("sensing"), parts.get("actuation"))
    left = set(range(n))
    if all(type(e.value) is int for e in frame.events if e.of_team):
        left = set(frame.first_drones())
    for i, event in sorted(enumerate(frame.events), key=lambda pair: pair[1].at):
        if "timing" not in broken and event.at > timing.duration:
            message = f"must be within timing.duration = {timing.duration:g} s"
            yield Problem(f"events.{i}.at", f"{event.at:g}", message)
        section, _, name = event.field.rpartition(".")
        if event.of_team:
            if "drones" not in broken:
                yield from _team_change(f"events.{i}.value", name, event.value, left, n)
        elif event.of_winches:
            if not broken & {"world", "load", "drones", "truth", "timing"}:
                yield from _winch_change(f"events.{i}", frame, event, present, wound, must_fly)
        elif section == "load":
            found = list(_setting_change(f"events.{i}", frame.load, section, name, event.value))
            yield from found
            if not found and not broken & {"world", "load", "drones", "truth"}:
                plant = present.get("plant")
                for field, message in (
                    plant.filled(frame.team).check(
                        _of_plant(frame, plant, load_mass=float(event.value))
                    )
                    if isinstance(plant, PlantPart)
                    else ()
                ):
                    yield Problem(
                        f"events.{i}.value", f"{event.value:g}", f"plant.{field} {message}"
                    )
        elif event.field in present:
            yield from _section_change(f"events.{i}", event.field, event.value, present, told)
        elif event.field == "allocation.kind":
            table = {"kind": event.value}
            yield from _section_change(f"events.{i}", section, table, present, told)
        elif name == "kind":
            message = f"to put another part in place give the whole section {section}"
            yield Problem(f"events.{i}.field", event.field, message)
        elif section in present:
            yield from _setting_change(f"events.{i}", present[section], section, name, event.value)
        elif event.field.startswith("disturbance."):
            yield Problem(f"events.{i}.field", event.field, "there is no such section")


def _winch_change(
    path: str,
    frame: Frame,
    event: Event,
    parts: dict[str, Part],
    wound: list[tuple[Array, Array]],
    must_fly: bool,
) -> Iterable[Problem]:
    """Mistakes of cables that are wound; ``wound`` holds lengths and when each winch stops, of the events before."""
    found = list(_setting_change(path, frame.drones, "drones", "cable_length", event.value))
    if found:
        yield from found
        return
    n, plant = frame.drones.count, parts.get("plant")
    if isinstance(event.value, list) and len(event.value) != n:
        message = f"must be one value or a list of drones.count = {n}"
        yield Problem(f"{path}.value", f"{len(event.value)} values", message)
        return
    if isinstance(plant, PlantPart) and plant.reels:
        message = f"needs winches, but plant.kind is {kind_of(type(plant))}: {plant.reels}"
        yield Problem(f"{path}.field", event.field, message)
        return
    lengths, stops = wound[-1] if wound else (frame.team.cable_lengths, np.zeros(n))
    wanted = np.array(np.broadcast_to(event.value, n), dtype=float)
    turns = wanted != lengths
    if (busy := turns & (event.at < stops)).any():
        i = int(np.argmax(busy))
        message = f"comes before the winch of drone {i} has stopped, at {stops[i]:.4g} s"
        yield Problem(f"{path}.at", f"{event.at:g}", message)
        return
    times = np.array([winch.winding(change, event.rate) for change in wanted - lengths])
    wound.append((wanted, np.where(turns, event.at + times, stops)))
    true = frame.true_team
    left = true.cable_lengths + wanted - frame.team.cable_lengths
    if np.min(left) <= 0.0:
        i = int(np.argmin(left))
        message = f"leaves nothing of the cable of drone {i}, which is {-(left[i] - wanted[i]):.4g} m shorter than is told"
        yield Problem(f"{path}.value", shown(event.value), message)
        return
    for name, part in parts.items():
        if part.layer in ("fault", "reference"):
            continue
        if isinstance(part, PlantPart):
            before, team = _of_plant(frame, part), _of_plant(frame, part, cable_lengths=left)
        else:
            before, team = frame.team, replace(frame.team, cable_lengths=wanted)
        if part.check(before) or (must_fly and part.conflicts(before)):
            continue  # told already
        problems = part.check(team) or (part.conflicts(team) if must_fly else [])
        for field, message in problems:
            yield Problem(f"{path}.value", shown(event.value), f"{placed(name, field)} {message}")


def _section_change(
    path: str, section: str, table: Any, present: dict[str, Part], told: Declared
) -> Iterable[Problem]:
    """Mistakes of a part that takes the place of another, which is brought up to date."""
    if not isinstance(table, dict) or "kind" not in table:
        yield Problem(f"{path}.value", shown(table), f"{section} must be a table with a kind")
        return
    settings = dict(table)
    try:
        part = find(section.partition(".")[0], str(settings.pop("kind")))
    except UnknownNameError as error:
        yield Problem(f"{path}.value", shown(table["kind"]), str(error))
        return
    if section.startswith("disturbance.") and type(present[section]) is not part:
        message = f"only a disturbance of the same kind can take the place of {section}"
        yield Problem(f"{path}.value", shown(table["kind"]), message)
        return
    try:
        present[section] = parse(part, {**part.declared(told), **settings})
    except ValidationError as error:
        for problem in problems_of(error, part, settings, section, KIND):
            yield Problem(path, problem.value, f"{problem.path} {problem.message}")


def _team_change(path: str, name: str, value: Any, left: set[int], n: int) -> Iterable[Problem]:
    """Mistakes of a drone that leaves or joins those that are ``left``, which is brought up to date."""
    away = set(range(n)) - left
    if name == "join":
        if type(value) is int and value in away:
            left.add(value)
        else:
            others = ", ".join(map(str, sorted(away))) or "none"
            yield Problem(
                path, repr(value), f"must be one of the drones that do not fly then ({others})"
            )
    elif type(value) is int and value in left and len(left) > 1:
        left.remove(value)
    else:
        flying = ", ".join(map(str, sorted(left)))
        message = f"must be one of the drones that fly then ({flying}), not the last one"
        yield Problem(path, repr(value), message)


def _setting_change(
    path: str, model: Section | Part, section: str, name: str, value: Any
) -> Iterable[Problem]:
    changed = {**model.model_dump(mode="json"), name: value}
    try:
        parse(type(model), changed)
    except ValidationError as error:
        for problem in problems_of(error, type(model), changed, section):
            yield Problem(path, problem.value, f"{problem.path} {problem.message}")
