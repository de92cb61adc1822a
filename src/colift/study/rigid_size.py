"""How much of a rigid load a team carries, how many drones it takes, on what cables and attached where: ``colift size``.

A load counts as carried if ``colift run`` would fly it: each answer is whether the mission with so many drones, so much load and its cables
ended there is refused, with everything that is asked of one (formation, yaw stiffness, what the reference wants of rotors and cables, wind). Without a
drone it is carried if the flight would carry on (:func:`colift.mission.outlook.outlook`), level or leaning, and in the wind as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from colift.errors import ColiftError, MissionError
from colift.mission.forecast import forecast
from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.mission.outlook import FEWEST, Outlook, lost_one_by_one
from colift.mission.warnings import wind_warnings
from colift.study.size import CLOSE, STEPS, Question, are_alike
from colift.team.geometry import Array
from colift.team.load import edge_attachments, usual_attachments

AS_GIVEN, AS_USUAL = "as the mission says", "as usual"
PLACES: dict[str, Callable[[int, Array], Array]] = {
    AS_USUAL: usual_attachments,
    "edges, from a corner": lambda n, size: edge_attachments(n, size, math.pi / 4.0),
    "edges, from a middle": lambda n, size: edge_attachments(n, size, 0.0),
}
"""Where cables may end, by name: as a mission has it that does not say, and on the edges of the upper face."""
STILL: dict[str, Any] = {"events": [], "fault": []}
"""What a mission is judged without."""
SHORTEST, LONGEST = 0.2, 20.0
"""Cables that are tried, m."""


@dataclass(frozen=True)
class Verdict:
    """What a mission would be told before its flight."""

    problem: str
    """Why it is refused, the first reason; empty where it flies."""
    losses: dict[int, str]
    """By drone why those that are left cannot carry on; empty where they can. All are missing where it is refused, or nobody asked."""
    leaning: dict[int, Outlook] = field(default_factory=dict)
    """How they do."""

    @property
    def ok(self) -> bool:
        """Whether it flies."""
        return not self.problem

    @property
    def spares(self) -> bool:
        """Whether it flies, and carries on without any of its drones."""
        return self.ok and bool(self.losses) and not any(self.losses.values())


@dataclass(frozen=True)
class Most:
    """The heaviest load, kg (0 for none), and what is said of a heavier one."""

    load: float
    why: str


@dataclass(frozen=True)
class Place:
    """Where cables end, and what that is good for."""

    ends: Array
    """(n, 3), m, in the load's frame."""
    most: Most
    most_spare: Most
    """With the worst drone lost."""
    few: int | None
    """Fewest drones for the load that is asked, and so that one may be lost; None where none is asked, or none found."""
    few_spare: int | None


@dataclass(frozen=True)
class Answer:
    """What a team carries of a rigid load."""

    mission: Mission
    """With the drones, the load and the ends that are judged."""
    asked: float | None
    """Load that was asked for, kg."""
    places: dict[str, Place]
    """By name."""
    held: Verdict
    """Of the load that was asked for, or the heaviest, with the cables as they are."""
    tensions: Array
    """Of its cables in hover (n,), N, and the thrusts of its drones, and what their motors give."""
    thrusts: Array
    limits: Array
    shortest: float | None
    """Cable with which it is carried, m; None where it is not, or where they differ."""

    @property
    def ok(self) -> bool:
        """Whether that load is carried."""
        return self.held.ok


class Rigid:
    """A question about a rigid load, ready to be judged."""

    def __init__(self, question: Question, told: Callable[[], None]):
        self.question, self.told = question, told
        self.base = self.mission(question.drones or (FEWEST if question.only_drones else None))
        load = self.base.load
        assert load.size is not None
        self.size = np.array(load.size)
        self.given = load.attachments is not None

    def mission(self, n: int | None, *, must_fly: bool = False, **asked: Any) -> Mission:
        """The mission with n drones, and what is ``asked`` of them, by path."""
        own = self.question.changes(n, None)
        changes = layered(STILL, own, self.question.overrides, asked)
        return load_mission(self.question.source, changes, must_fly=must_fly)

    def changes(
        self, place: str, n: int, load: float | None, cable: float | None
    ) -> dict[str, Any]:
        """Of the mission, for so many drones."""
        found: dict[str, Any] = {"drones.count": n}
        if place in PLACES:
            found["load.attachments"] = PLACES[place](n, self.size).tolist()
        if load is not None:
            found["load.mass"] = load
            heavier = load / self.base.load.mass  # of the same shape
            if self.base.load.inertia is not None:
                found["load.inertia"] = [heavier * each for each in self.base.load.inertia]
                found["load.products"] = [heavier * each for each in self.base.load.products]
        if cable is not None:
            found["drones.cable_length"] = cable
        return found

    def judge(
        self,
        place: str,
        n: int,
        load: float | None = None,
        cable: float | None = None,
        *,
        spare: bool,
    ) -> Verdict:
        """What is said of it; with ``spare`` of each drone that is lost as well, up to the first without which it comes down."""
        self.told()
        try:
            changes = self.changes(place, n, load, cable)
            mission = self.mission(None, must_fly=True, **changes)
        except MissionError as error:
            return Verdict(str(error.problems[0]), {})
        for doubt in wind_warnings(mission):
            return Verdict(str(doubt), {})
        losses, leaning = {}, {}
        for drone, found, reason in _losses(mission) if spare else ():
            losses[drone], leaning[drone] = reason, found
            if reason:
                break
        return Verdict("", losses, leaning)

    def heaviest(self, place: str, n: int, top: float, *, spare: bool) -> Most:
        """The heaviest load up to ``top``, kg; loads are tried from the largest downwards, then the limit is closed in on."""

        def why(load: float) -> str:
            found = self.judge(place, n, load, spare=spare)
            lost = next(((i, each) for i, each in found.losses.items() if each), None)
            return found.problem or (f"without drone {lost[0]}: {lost[1]}" if lost else "")

        held, above, reason = 0.0, top, ""
        for share in (*np.linspace(1.0, 1.0 / STEPS, STEPS), 0.03, 0.01):
            reason, before = why(float(share * top)), reason
            if not reason:
                held, reason = float(share * top), before
                break
            above = float(share * top)
        while held > 0.0 and above - held > CLOSE * top:
            middle = 0.5 * (held + above)
            said = why(middle)
            held, above, reason = (held, middle, said) if said else (middle, above, reason)
        return Most(held, reason)

    def fewest(self, place: str, load: float) -> tuple[int | None, int | None]:
        """Drones that carry it, and that do so with any of them lost; fewer than three hold no attitude."""
        few = None
        for n in range(FEWEST, self.question.at_most + 1):
            found = self.judge(place, n, load, spare=True)
            few = n if found.ok and few is None else few
            if found.spares:
                return few, n
        return few, None

    def shortest(self, place: str, n: int, load: float) -> float | None:
        """Cable with which it is carried, m, downwards from the one that is given."""
        lengths = self.base.team.cable_lengths
        if np.ptp(lengths) > 0.0 or not self.judge(place, n, load, spare=False).ok:
            return None
        held, low = float(lengths[0]), SHORTEST
        while held - low > 0.02 * held:
            middle = 0.5 * (held + low)
            fine = self.judge(place, n, load, middle, spare=False).ok
            held, low = (middle, low) if fine else (held, middle)
        return held


def _losses(mission: Mission) -> Iterator[tuple[int, Outlook, str]]:
    """By drone how those that are left go on, and why they do not, also in the wind; empty where they do."""
    if len(only := mission.first_drones()) == 1:
        yield only[0], Outlook(), "no drone is left"
    for drone, rest, found in lost_one_by_one(mission):
        yield drone, found, found.reason or _blown_down(mission, rest, found)


def _blown_down(mission: Mission, drones: list[int], hanging: Outlook) -> str:
    """Why these drones, on which the load is left ``hanging``, do not bear the wind; empty where they do."""
    team, allocation = hanging.flown(mission.team.of(drones)), mission.allocation.of(drones)
    directions, _ = allocation.formation(team)
    hover = allocation.hover(team, directions, mission.timing.allocation)
    limits = mission.actuation.of(drones).thrust_limits(team)
    blows = [part.of(drones) for part in mission.disturbance]
    ahead = forecast(team, hover, limits, allocation, blows)
    return next((said for _, said in (*ahead.problems(team, math.inf), *ahead.doubts(team))), "")


def _alike(ends: Array, others: Array) -> bool:
    """Whether cables end at the same points, in any order."""
    far = np.linalg.norm(ends[:, None] - others[None, :], axis=2)
    return bool((far.min(axis=0) < 1e-9).all() and (far.min(axis=1) < 1e-9).all())


def size(question: Question, told: Callable[[], None] = lambda: None) -> Answer:
    """Answer without flying; ``told`` is called before each of the some hundred missions that are judged.

    Raises
    ------
    MissionError
        For numbers that are refused, with field, value and range.
    ColiftError
        Where nothing says what the drones can lift.

    """
    rigid = Rigid(question, told)
    base = rigid.base
    asked = question.load if question.only_drones or question.load is not None else base.load.mass
    alike = are_alike(base.team, (base.allocation, base.actuation, *base.disturbance))
    names = [AS_GIVEN, *PLACES] if rigid.given else [*PLACES]
    few: dict[str, tuple[int | None, int | None]] = dict.fromkeys(names, (None, None))
    if asked is not None and alike:
        few |= {name: rigid.fewest(name, asked) for name in names if name in PLACES}
    n = question.drones or base.team.n
    if question.drones is None and question.only_drones:
        counts = [spare or plain for plain, spare in few.values() if plain is not None]
        n = min(counts, default=question.at_most)
        base = rigid.mission(n)
    drones = base.first_drones()
    limits = base.actuation.of(drones).thrust_limits(base.team.of(drones))
    top = float(np.sum(limits / max(base.team.gravity, 1e-9) - base.team.masses[drones]))
    if not math.isfinite(top) or base.team.gravity == 0.0:
        raise ColiftError(
            f"{base.name}: nothing says what its drones can lift: give drones.max_thrust, and world.gravity above 0"
        )
    assert base.team.body is not None
    places: dict[str, Place] = {}
    for name in names:
        ends = PLACES[name](n, rigid.size) if name in PLACES else base.team.body.attachments
        same = next((each for each in places.values() if _alike(each.ends, ends)), None)
        most, spare = (
            (same.most, same.most_spare)
            if same
            else (rigid.heaviest(name, n, max(top, 1e-6), spare=lost) for lost in (False, True))
        )
        places[name] = Place(ends, most, spare, *few[name])
    load = asked if asked is not None else places[names[0]].most.load
    changes = rigid.changes(names[0], n, load or None, None)
    mission = rigid.mission(None, **changes)
    drones = mission.first_drones()
    team, allocation = mission.team.of(drones), mission.allocation.of(drones)
    directions, tensions = allocation.formation(team)
    held = Verdict("no load at all is carried", {})
    if load > 0.0:
        held = rigid.judge(names[0], n, load, spare=False)
        if held.ok:
            found = list(_losses(mission))
            held = Verdict("", {i: why for i, _, why in found}, {i: how for i, how, _ in found})
    return Answer(
        mission, asked, places, held, tensions, team.hover_thrusts(tensions, directions), limits,
        rigid.shortest(names[0], n, load) if held.ok else None,
    )  # fmt: skip


def as_json(question: Question, answer: Answer) -> dict[str, Any]:
    """The answer as plain data; the page "Rigid loads" says what each field is."""
    team = answer.mission.team
    return {
        "drones": team.n, "masses_kg": team.masses.tolist(), "cables_m": team.cable_lengths.tolist(),
        "load_kg": team.load_mass, "load_asked": answer.asked is not None, "ok": answer.ok, "why": answer.held.problem,
        "one_lost": {
            str(i): {"carried": not why, "how": why or str(answer.held.leaning[i])}
            for i, why in answer.held.losses.items()
        },
        "tensions_N": answer.tensions.tolist(), "thrusts_N": answer.thrusts.tolist(), "limits_N": answer.limits.tolist(),
        "shortest_cable_m": answer.shortest,
        "attachments": {
            name: {
                "ends_m": each.ends.tolist(),
                "heaviest": {"load_kg": each.most.load, "why": each.most.why},
                "heaviest_one_lost": {"load_kg": each.most_spare.load, "why": each.most_spare.why},
                "fewest": {"all": each.few, "one_lost": each.few_spare, "at_most": question.at_most},
            }
            for name, each in answer.places.items()
        },
    }  # fmt: skip
