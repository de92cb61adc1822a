"""Missions that the ground does not allow: starts and references below it, slack cables where there is none."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from colift.control.reference.base import ReferencePart
from colift.errors import Problem
from colift.mission.schema import Frame
from colift.part import Part, kind_of
from colift.world.plant.base import PlantPart

LOOKS = 1000
"""Times of the flight at which a reference is looked at."""
DEEP = 0.005
"""How far below the ground a reference may be, m: so deep a load presses itself in when it is set down."""


def ground_checks(frame: Frame, parts: Mapping[str, Part], broken: set[str]) -> Iterable[Problem]:
    """Mistakes between the ground, the start and the reference."""
    start, ground, plant = frame.start, frame.ground, parts.get("plant")
    if broken & {"world", "load", "drones", "start", "timing"}:
        return
    n = frame.drones.count
    if start.positions is not None and len(start.positions) != n:
        message = f"must be drones.count = {n}"
        yield Problem("start.positions", f"{len(start.positions)} places", message)
        return
    if start.on_ground and ground is None:
        message = 'needs a ground to stand on, but world.ground = "none"'
        yield Problem("start.on_ground", "true", message)
        return
    if start.slack and isinstance(plant, PlantPart) and not plant.slackens:
        field, value = ("on_ground", "true") if start.on_ground else ("positions", "")
        message = (
            f'may leave cables slack, but those of plant.kind = "{kind_of(type(plant))}" are rods; '
            'set plant.kind = "slack-cables"'
        )
        yield Problem(f"start.{field}", value, message)
        return
    reference = parts.get("reference")
    if not isinstance(reference, ReferencePart):
        return
    times = np.linspace(0.0, frame.timing.duration, LOOKS)
    path = reference.sample(times, frame.team)[:, 0]
    load = path[0] + np.asarray(start.load_offset)
    if ground is not None:
        stands = ground.height + frame.sole
        yield from _below(frame, stands, path[:, 2], times, load)
        if start.on_ground:
            load[2] = stands
    places = frame.start_places(load)
    if places is None:
        return
    drones = frame.first_drones()
    body = frame.team.of(drones).body
    ends = load if body is None else load + body.attachments
    spans = np.linalg.norm(places - ends, axis=1)
    lengths = frame.true_team.cable_lengths[drones]
    for i, span, length in zip(drones, spans, lengths, strict=True):
        if span > length * (1.0 + 1e-9):
            field, value = (
                ("spread", f"{start.spread:g}")
                if start.positions is None
                else (f"positions.{i}", "")
            )
            message = f"is {span:.4g} m from the load, farther than drone {i}'s cable of {length:.4g} m reaches"
            yield Problem(f"start.{field}", value, message)
            return
    if ground is not None:
        for i, z in zip(drones, places[:, 2], strict=True):
            if z < ground.height - 1e-9:
                message = (
                    f"puts drone {i} below the ground at world.ground.height = {ground.height:g}"
                )
                yield Problem(f"start.positions.{i}", f"z = {z:g}", message)
                return


def _below(
    frame: Frame, height: float, z: np.ndarray, times: np.ndarray, load: np.ndarray
) -> Iterable[Problem]:
    """A load that starts, or is led, into the ground."""
    stands = (
        "" if frame.sole == 0.0 else f", and {frame.sole:g} m from there to the middle of the load"
    )
    allowed = f'must be at least world.ground.height = {height - frame.sole:g} m{stands}; lower it, or set world.ground = "none"'
    if not frame.start.on_ground and load[2] < height - DEEP:
        yield Problem("start.load_offset", f"z = {load[2]:.4g} m at t = 0", f"the load {allowed}")
        return
    deep = np.flatnonzero(z < height - DEEP)
    if deep.size:
        at = f"z = {z[deep[0]]:.4g} m at t = {times[deep[0]]:.3g} s"
        yield Problem("reference", at, f"the load's height {allowed}")
