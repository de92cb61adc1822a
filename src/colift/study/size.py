"""How much a team carries, how many drones a load takes, and for how long: ``colift size``.

A load counts as carried if ``colift run`` would fly it: the allocator's own formation in hover keeps every limit and leaves the motors
their reserve, and in the wind (steady, with what of turbulence and gusts lasts) the team keeps what :mod:`colift.mission.forecast` asks for.
A team that has lost a drone is judged in the same way, planned anew.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.base import Allocation
from colift.control.allocation.limits.feasibility import (
    Binding,
    feasibility,
    limits_of,
    widest_formation,
)
from colift.control.allocation.limits.hover import hovering
from colift.control.allocation.safe import Safe
from colift.errors import ColiftError, SettingError
from colift.flight.flight import Flight
from colift.kernel.math import shares
from colift.mission.forecast import forecast
from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.part import Part
from colift.record import metrics
from colift.record.recording import Recording
from colift.study.campaign.plan import varied
from colift.study.stress import motors
from colift.team import Team
from colift.world.actuation.base import ActuationPart
from colift.world.disturbance.base import DisturbancePart

Array = NDArray[np.float64]

AIR = 1.225
"""Density of air, kg/m^3, as in data sheets of rotors."""
GUST = 0.5
"""Peak of the gusts over the mean wind."""
STEPS = 16
"""Loads that are tried from the largest that the thrust lifts downwards, before the heaviest is closed in on."""
CLOSE = 1e-3
"""How closely, as a share of that largest load."""
STEADY = 3
"""Cables that hold a load against pushes from every side: two leave it to swing across their plane, one on all sides."""
BASE: dict[str, Any] = {"name": "size", "reference": {"kind": "hover"}}
"""The mission of drones that are given without one: everything else follows from the bodies."""

NAMES = {
    "max_thrust": "thrust of the motors on tilted cables",
    "motor": "thrust of the motors on tilted cables",
    "radius": "distance between drones and cables (their radius)",
    "tension_max": "largest tension of a cable",
    "tension_min": "least tension of a cable",
    "max_cone_deg": "angle of the cables to the vertical",
    "max_tilt_deg": "tilt of the drones",
    "min_angle_deg": "angle between cables",
    "min_distance": "distance between drones",
    "cable_distance": "distance between drones and cables",
}
"""Limits for people, by the last word of the field that sets them."""
IN_WIND = {
    "actuation": "thrust of the motors in the wind",
    "disturbance": "lean of the load in the wind",
}
"""And those of the forecast, by the layer at fault."""


@dataclass(frozen=True)
class Judgement:
    """Whether a team carries its load.

    Attributes
    ----------
    ok : bool
    limit, message : str
        What is in the way, by name and with its numbers; empty where nothing is.
    thrusts : (n,) array
        Of each drone in hover, N.
    in_wind : (n,) array
        What each needs in the strongest wind that lasts, N; in calm air the same. Both NaN where hover fails already.
    limits : (n,) array
        What the motors of each give, N.
    lean : float
        Of the force that holds the load in that wind, from the vertical, rad.

    """

    ok: bool
    limit: str
    message: str
    thrusts: Array
    in_wind: Array
    limits: Array
    lean: float


def are_alike(team: Team, parts: Iterable[Part]) -> bool:
    """Whether all drones of a team are the same, and treated the same."""
    arrays = (getattr(team, name) for name, value in vars(team).items() if np.ndim(value) > 0)
    same = all(
        np.array_equal(each, each[:1].repeat(team.n, axis=0), equal_nan=True) for each in arrays
    )
    return same and not any(
        isinstance(getattr(part, name), list) for part in parts for name in part.per_drone
    )


@dataclass(frozen=True)
class Crew:
    """A team with all that decides what it carries; settings that were left to the team follow it and its load."""

    team: Team
    allocation: Safe
    actuation: ActuationPart
    disturbances: tuple[DisturbancePart, ...]
    period: float
    """Of the allocator, s."""
    allowed: float
    """Largest error of the load's place, m."""

    @classmethod
    def of_mission(cls, mission: Mission) -> Crew:
        """Those that a mission starts with."""
        if not isinstance(mission.allocation, Safe):
            raise ColiftError(
                f"{mission.name}: its allocator {mission.kinds['allocation']!r} has no limits to judge; "
                "try --set allocation.kind=safe"
            )
        if mission.team.gravity == 0.0:
            raise SettingError.of(
                "world.gravity", "0", "must be more than 0: nothing weighs anything"
            )
        bound = mission.criteria.get("tracking_max_m")
        crew = cls(
            team=mission.team,
            allocation=mission.allocation.unsettled(Safe.from_team),
            actuation=mission.actuation,
            disturbances=tuple(part.unsettled(part.from_team) for part in mission.disturbance),
            period=mission.timing.allocation,
            allowed=math.inf if bound is None or bound.max is None else bound.max,
        )
        return crew.of(mission.first_drones())

    def of(self, drones: Sequence[int]) -> Crew:
        """These of its drones; one of them may be named several times, for as many like it."""
        return replace(
            self,
            team=self.team.of(drones),
            allocation=self.allocation.of(drones),
            actuation=self.actuation.of(drones),
            disturbances=tuple(part.of(drones) for part in self.disturbances),
        )

    def carrying(self, load: float) -> Crew:
        """The same with another load, kg."""
        return replace(self, team=replace(self.team, load_mass=load))

    def calm(self) -> Crew:
        """The same without wind."""
        return replace(self, disturbances=())

    @property
    def alike(self) -> bool:
        """Whether all drones are the same."""
        return are_alike(self.team, (self.allocation, self.actuation, *self.disturbances))

    def left(self) -> list[tuple[int, Crew]]:
        """Who may be lost, and the others; one of drones that are all alike."""
        n = self.team.n
        lost = range(1 if self.alike else n) if n > 1 else ()
        return [(i, self.of([k for k in range(n) if k != i])) for i in lost]

    @property
    def ceiling(self) -> float:
        """A load that is never exceeded, kg."""
        limits = limits_of(self.team, self.allocation, self.actuation.thrust_limits(self.team))
        return limits.bound() / self.team.gravity

    def settled(self) -> tuple[Allocation, dict[str, str]]:
        """In hover, as the allocator has it, and by layer why that does not hold the load."""
        limits = limits_of(self.team, self.allocation)
        start, _ = widest_formation(
            self.team.n, limits.cone, enough=limits.widest + math.radians(2.0)
        )
        thrusts = self.actuation.thrust_limits(self.team)
        return hovering(self.team, self.allocation, thrusts, start, self.period)

    def judge(self) -> Judgement:
        """Whether the load is carried in hover and in the wind."""
        team, limits = self.team, self.actuation.thrust_limits(self.team)
        none = np.full(team.n, math.nan)
        own = team.masses * team.gravity
        if np.any(limits <= own):
            i = int(np.argmin(limits - own))
            said = f"drone {i} weighs {own[i]:.4g} N and its motors give {limits[i]:.4g} N"
            return Judgement(False, NAMES["max_thrust"], said, none, none, limits, math.nan)
        for field, message in (*self.allocation.check(team), *self.allocation.conflicts(team)):
            name = NAMES.get(field.rpartition(".")[2], field)
            return Judgement(False, name, message, none, none, limits, math.nan)
        hover, conflicts = self.settled()
        thrusts = team.hover_thrusts(hover.tensions, hover.directions)
        ahead = forecast(team, hover, limits, self.allocation, self.disturbances)
        for layer, said in conflicts.items():
            limit = NAMES["max_thrust"] if layer == "actuation" else ""
            return Judgement(False, limit, said, none, none, limits, math.nan)
        for layer, said in (*ahead.problems(team, self.allowed), *ahead.doubts(team)):
            return Judgement(
                False, IN_WIND[layer], said, thrusts, ahead.thrusts, limits, ahead.lean
            )
        return Judgement(True, "", "", thrusts, ahead.thrusts, limits, ahead.lean)

    def heaviest(self) -> Most:
        """The heaviest load that is carried, and what is in the way of more.

        The allocator's formation changes with the load: loads are tried from the largest downwards, so that one that is carried below
        others that are not is no matter.
        """
        top = self.ceiling
        if not math.isfinite(top) or top <= 0.0:
            found = self.judge()
            return Most(0.0, found.limit, found.message, ())
        ok, not_ok = 0.0, top
        for share in (*np.linspace(1.0, 1.0 / STEPS, STEPS), *np.geomspace(0.03, 0.001, 4)):
            if self.carrying(share * top).judge().ok:
                ok = float(share * top)
                break
            not_ok = float(share * top)
        while ok > 0.0 and not_ok - ok > CLOSE * top:
            middle = 0.5 * (ok + not_ok)
            ok, not_ok = (middle, not_ok) if self.carrying(middle).judge().ok else (ok, middle)
        above = self.carrying(not_ok).judge()
        binding: tuple[Binding, ...] = ()
        optimum = math.nan
        if ok > 0.0:
            best = feasibility(self.carrying(ok).team, self.allocation, self.actuation)
            binding, optimum = best.binding, best.heaviest / self.team.gravity
        limit = above.limit or " and ".join(_named(each) for each in binding[:2])
        return Most(ok, limit, above.message, binding, optimum)


@dataclass(frozen=True)
class Most:
    """The heaviest load of a team.

    Attributes
    ----------
    load : float
        kg; 0 for none.
    limit, message : str
        What is in the way of a heavier one, by name and with its numbers.
    binding : tuple of Binding
        Limits with a price there in calm air, the costliest first.
    optimum : float
        What the best formation would hold in calm air within the limits, kg.
    lost : int or None
        The drone that was lost, where one was: the worst.

    """

    load: float
    limit: str
    message: str
    binding: tuple[Binding, ...]
    optimum: float = math.nan
    lost: int | None = None


def _named(binding: Binding) -> str:
    return NAMES.get(binding.path.rpartition(".")[2], binding.path)


def spared(crew: Crew) -> Most:
    """The heaviest load that is carried whichever drone is lost."""
    found = [replace(others.heaviest(), lost=lost) for lost, others in crew.left()]
    if not found:
        return Most(0.0, NAMES["max_thrust"], "without its only drone nothing carries the load", ())
    return min(found, key=lambda each: each.load)


def worst_loss(crew: Crew) -> tuple[int, Crew, Judgement] | None:
    """The drone whose loss is the worst for the load, the others, and how they carry it; None for a single drone."""
    found = [(lost, others, others.judge()) for lost, others in crew.left()]

    def badness(each: tuple[int, Crew, Judgement]) -> tuple[bool, float]:
        share = float(np.max(each[2].in_wind / each[2].limits))
        return (not each[2].ok, math.inf if math.isnan(share) else share)

    return max(found, key=badness, default=None)


def fewest(crew: Crew, at_most: int) -> tuple[int | None, int | None]:
    """How many drones like the first carry the load, and how many do so that one may be lost; None where ``at_most`` do not.

    Those that are left must be ``STEADY`` at least: with fewer the load swings widely before it is caught, if it is.
    """
    few, before = None, False
    for n in range(1, at_most + 1):
        some = crew.of([0] * n)
        held = some.ceiling >= some.team.load_mass and some.judge().ok
        if held and few is None:
            few = n
        if held and before and n > STEADY:
            return few, n
        before = held
    return few, None


def powers(team: Team, thrusts: Array) -> Array:
    """Electric power of each drone (n,) at a thrust (n,), N, in hover, W; NaN where numbers are not known.

    Momentum theory: ``T^1.5 / sqrt(2 rho A) / efficiency``.
    """
    return np.asarray(thrusts**1.5 / np.sqrt(2.0 * AIR * team.disc_areas) / team.efficiencies)


def endurance(team: Team, thrusts: Array) -> float:
    """Time until the first battery of a team in hover is empty, s; NaN where numbers are not known."""
    return float(np.min(team.energies / powers(team, thrusts)))


def unknown(team: Team) -> list[str]:
    """Numbers of the drones that an endurance takes and that are not known, by field."""
    arrays = {
        "energy": team.energies, "efficiency": team.efficiencies, "rotors": team.rotors, "rotor_radius": team.rotor_radii,
    }  # fmt: skip
    return [name for name, values in arrays.items() if np.isnan(values).any()]


def swing(team: Team, hover: Allocation) -> float:
    """Period with which the load of two drones swings across the plane of their cables, s."""
    drop = -float(np.mean(team.cable_lengths * hover.directions[:, 2]))
    return 2.0 * math.pi * math.sqrt(drop / team.gravity)


def winds(speed: float, heading_deg: float = 0.0) -> list[dict[str, Any]]:
    """A mean wind (m/s) with its turbulence and gusts, as disturbances of a mission."""
    if speed == 0.0:
        return []
    heading = math.radians(heading_deg)
    peak = [GUST * speed * math.cos(heading), GUST * speed * math.sin(heading), 0.0]
    blows = {"speed": speed, "heading_deg": heading_deg}
    return [
        {"kind": "wind", **blows}, {"kind": "dryden", **blows},
        {"kind": "gust", "peak": peak, "at": 3.0, "every": 3.0}, {"kind": "drag"},
    ]  # fmt: skip


@dataclass(frozen=True)
class Question:
    """What is asked.

    Attributes
    ----------
    source : str, path or dict
        A mission, as :func:`colift.mission.load.load_mission` takes it; a dict where only drones are given.
    overrides : dict
        What to change in it.
    drones : int or None
        How many; None: as many as the load takes, or as many as the mission has.
    load : float or None
        kg; None: that of the mission, and where only drones are given the heaviest is asked.
    wind : float or None
        Mean wind, m/s; None: the mission's own.
    at_most : int
        Drones up to which the fewest are looked for.

    """

    source: str | Path | Mapping[str, Any]
    overrides: Mapping[str, Any]
    drones: int | None = None
    load: float | None = None
    wind: float | None = None
    at_most: int = 12

    @property
    def only_drones(self) -> bool:
        """Whether only drones are given, and no mission."""
        return isinstance(self.source, Mapping)

    def mission(self, n: int | None = None) -> Mission:
        """The mission that answers are taken from, with n drones."""
        changes = self.changes(n, self.load)
        return load_mission(self.source, layered(changes, self.overrides), must_fly=False)

    def changes(
        self, n: int | None, load: float | None, heading_deg: float = 0.0
    ) -> dict[str, Any]:
        """What is asked, as changes of the mission."""
        found: dict[str, Any] = {}
        if n is not None:
            found["drones.count"] = n
        if load is not None:
            found["load.mass"] = load
        if self.wind is not None:
            found["disturbance"] = winds(self.wind, heading_deg)
        return found


@dataclass(frozen=True)
class Answer:
    """What a team carries.

    Attributes
    ----------
    mission : Mission
        Of the drones that were judged.
    crew : Crew
        They, with the load that was asked or else with the heaviest.
    wind : float
        Strongest that lasts, m/s.
    asked : float or None
        Load that was asked, kg.
    most, most_spare : dict
        Heaviest loads, by ``"calm"`` and ``"wind"``: of all drones, and with the worst of them lost.
    few, few_spare : int or None
        Fewest drones like these for the load, in the wind, and if one may be lost; None: not within ``at_most``, not asked, or drones that
        are not alike.
    held, held_spare : Judgement
        Of the load, in the wind, and with the drone lost whose loss is the worst; what was a single drone has no team then.
    others : Crew or None
        Those that are left then.
    lost : int or None
        Which one that is.
    ok : bool
        Whether the load that was asked is carried; without one, whether any is.

    """

    mission: Mission
    crew: Crew
    wind: float
    asked: float | None
    most: dict[str, Most]
    most_spare: dict[str, Most]
    few: int | None
    few_spare: int | None
    held: Judgement
    held_spare: Judgement
    others: Crew | None
    lost: int | None
    ok: bool


def size(question: Question) -> Answer:
    """Answer without flying.

    Raises
    ------
    MissionError
        For numbers that are refused, with field, value and range.

    """
    mission = question.mission(question.drones)
    crew = Crew.of_mission(mission)
    asked = question.load if question.only_drones else crew.team.load_mass
    few = few_spare = None
    if asked is not None and crew.alike:
        few, few_spare = fewest(crew, question.at_most)
    if question.drones is None and question.only_drones:
        mission = question.mission(few_spare or few or question.at_most)
        crew = Crew.of_mission(mission)
    blows = np.sum([np.zeros(3), *(part.strongest_wind() for part in crew.disturbances)], axis=0)
    wind, calm = float(np.linalg.norm(blows)), crew.calm()
    most, most_spare = {"calm": calm.heaviest()}, {"calm": spared(calm)}
    most["wind"] = crew.heaviest() if wind > 0.0 else most["calm"]
    most_spare["wind"] = spared(crew) if wind > 0.0 else most_spare["calm"]
    load = asked if asked is not None else most["wind"].load
    loaded = crew.carrying(load) if load > 0.0 else crew
    held, worst = loaded.judge(), worst_loss(loaded)
    lost, others, held_spare = worst if worst else (None, None, _ALONE)
    return Answer(
        mission,
        loaded,
        wind,
        asked,
        most,
        most_spare,
        few,
        few_spare,
        held,
        held_spare,
        others,
        lost,
        held.ok,
    )


_ALONE = Judgement(
    False, NAMES["max_thrust"], "without its only drone nothing carries the load",
    np.zeros(0), np.zeros(0), np.zeros(0), math.nan,
)  # fmt: skip
"""What is left of a single drone."""


def lasts(crew: Crew | None, held: Judgement) -> float:
    """Time of hover in calm air from full batteries until the first is empty, s; NaN: not known, or the load is not carried."""
    return endurance(crew.team, held.thrusts) if crew is not None and held.ok else math.nan


def remarks(answer: Answer) -> list[str]:
    """What else must be known, in sentences."""
    found, team, others = [], answer.crew.team, answer.others
    if missing := unknown(team):
        found.append(
            f"How long: not known without {', '.join(f'drones.{name}' for name in missing)}."
        )
    elif answer.held.ok:
        found.append(
            "How long: in calm hover, from full batteries until the first is empty; keep a reserve of your own."
        )
    if team.n > 1 and np.isnan(team.radii).any():
        found.append(
            "Distances in metres: not kept, drones.radius (or arm and rotor_radius) is not known."
        )
    if others is None:
        found.append("A single drone has no spare: if it is lost, the load falls.")
    elif others.team.n == 1:
        need = float(others.team.masses[0] + team.load_mass) * team.gravity
        able = "carries it, if it survives the fall of the load into its cable and the swing that follows"
        found.append(
            f"Two drones are not safe against the loss of one: the other must hold {need:.4g} N in hover, of the "
            f"{answer.held_spare.limits[0]:.4g} N that it has; it {able if answer.held_spare.ok else 'does not carry it'}."
        )
    elif others.team.n < STEADY and answer.held_spare.ok:
        found.append(
            "Three drones are not safe against the loss of one: two could hold the load at rest, but it falls out of the balance of three and "
            f"swings across the plane of two cables with a period of {swing(others.team, others.settled()[0]):.2g} s, widely, which only the "
            "drones' motion damps. Four are steady with one lost; --fly shows how often three get away with it."
        )
    elif others.team.n < STEADY:
        found.append(
            "Three drones are not safe against the loss of one: the two that are left do not carry the load."
        )
    return found


def notes(answer: Answer) -> list[tuple[str, str]]:
    """What was assumed where the mission or the drones do not say it, by field."""
    found = [(f"drones.{name}", message) for name, message in answer.mission.drones.notes()]
    for i, part in enumerate(answer.crew.disturbances):
        if (
            part.feels_wind
            and "load_area" in part.from_team
            and "load_area" not in part.model_fields_set
        ):
            area = float(part.settled("load_area", answer.crew.team)[0])
            message = f"is not given: {area:.3g} m^2 are assumed for a load of {answer.crew.team.load_mass:.3g} kg"
            found.append((f"disturbance.{i}.load_area", message))
    return found


def as_json(question: Question, answer: Answer, flights: Iterable[Flown]) -> dict[str, Any]:
    """The answer as plain data; the page "Your drones" says what each field is."""
    team = answer.crew.team

    def most(found: Most) -> dict[str, Any]:
        return {
            "load_kg": found.load, "limit": found.limit, "why": found.message, "optimum_kg": found.optimum,
            "binding": [each.path for each in found.binding], "lost_drone": found.lost,
        }  # fmt: skip

    def held(found: Judgement, lasting: float) -> dict[str, Any]:
        return {
            "carried": found.ok, "limit": found.limit, "why": found.message, "thrusts_N": found.thrusts.tolist(),
            "in_wind_N": found.in_wind.tolist(), "limits_N": found.limits.tolist(),
            "lean_deg": math.degrees(found.lean), "endurance_s": lasting,
        }  # fmt: skip

    return {
        "drones": team.n, "masses_kg": team.masses.tolist(), "cables_m": team.cable_lengths.tolist(),
        "load_kg": team.load_mass, "load_asked": answer.asked is not None, "wind_mps": answer.wind, "ok": answer.ok,
        "heaviest": {
            air: {"all": most(answer.most[air]), "one_lost": most(answer.most_spare[air])} for air in ("calm", "wind")
        },
        "load": {
            "all": held(answer.held, lasts(answer.crew, answer.held)),
            "one_lost": {
                "lost_drone": answer.lost,
                "steady": answer.others is not None and answer.others.team.n >= STEADY,
            }
            | held(answer.held_spare, lasts(answer.others, answer.held_spare)),
        },
        "fewest": {"all": answer.few, "one_lost": answer.few_spare, "at_most": question.at_most},
        "endurance_needs": unknown(team),
        "remarks": remarks(answer),
        "flown": [
            {
                "reference": each.reference, "cable_cut": each.cut, "good": each.good, "flights": each.flights,
                "interval": each.interval, "farthest_m": each.farthest, "first_bad": each.first_bad,
            }
            for each in flights
        ],
    }  # fmt: skip


SEEN = ("hover", "figure-eight")
"""References that are flown."""
DURATION, CUT_AT = 30.0, 6.0
"""Of a flight, and when a cable is cut, s."""
NEAR, ANGLE = 0.1, 15.0
"""A flight is good whose load ends no further from its reference than this share of a cable (of 1 m at least), its cables this far apart, degrees."""
FLOWN: dict[str, Any] = {
    **dict.fromkeys(
        (f"timing.{layer}" for layer in ("load_control", "allocation", "position_control", "attitude_control")), 0.01
    ),
    "timing.duration": DURATION, "timing.delay": 0.02, "sensing": {"kind": "noisy"}, "events": [], "fault": [],
}  # fmt: skip
"""What a flight is flown with: controllers at 100 Hz, sensors with noise, 20 ms late."""


@dataclass(frozen=True)
class Flown:
    """Flights of one kind.

    Attributes
    ----------
    reference : str
    cut : bool
        Whether a cable was cut.
    good, flights : int
        How many were good, of how many.
    farthest : float
        Most that the load was off its reference in those that were good, m; NaN without any.
    first_bad : str
        What was wrong with the first that was not.

    """

    reference: str
    cut: bool
    good: int
    flights: int
    farthest: float
    first_bad: str

    @property
    def interval(self) -> tuple[float, float]:
        """Shares that this leaves open, 95 %."""
        return shares.interval(self.good, self.flights)


def fly(
    question: Question, answer: Answer, seeds: int, advance: Callable[[float], None]
) -> list[Flown]:
    """Fly the load: each reference with ``seeds`` seeds, then as often with the cable of each drone cut.

    Nobody is told of a cut; detection has to find it. Winds that are asked by their speed blow to another side in each flight.
    """
    n, done = answer.crew.team.n, 0
    found: list[Flown] = []
    cuts: list[list[int | None]] = [[None]]
    if n > 1:
        cuts.append([*range(n)])
    total = len(SEEN) * seeds * sum(len(drones) for drones in cuts)
    for drones in cuts:
        for reference in SEEN:
            good, flights, farthest, bad = 0, 0, math.nan, ""
            for seed in range(seeds):
                for drone in drones:
                    said, off = _flight(question, answer, reference, seed, drone)
                    good, flights, done = good + (not said), flights + 1, done + 1
                    bad = bad or said
                    farthest = farthest if said else float(np.fmax(farthest, off))
                    advance(done / total)
            found.append(Flown(reference, drones[0] is not None, good, flights, farthest, bad))
    return found


def _flight(
    question: Question, answer: Answer, reference: str, seed: int, cut: int | None
) -> tuple[str, float]:
    """What was wrong with a flight, empty where nothing was, and the most that the load was off its reference, m."""
    team = answer.crew.team
    count = team.n if question.only_drones else question.drones
    changes = question.changes(count, team.load_mass, heading_deg=(137.5 * seed) % 360.0)
    changes |= {**FLOWN, "reference": {"kind": reference}, "seed": seed, **motors(answer.mission)}
    if cut is not None:
        changes["fault"] = [{"kind": "cable-cut", "at": CUT_AT, "drone": cut}]
        changes["detection"] = {"kind": "residuals"}
    mission = load_mission(question.source, layered(changes, question.overrides), must_fly=False)
    recording = Flight(varied(mission, seed)).run()
    where = f"seed {seed}" + ("" if cut is None else f", cable {cut} cut")
    flaw, worst = flaw_of(recording, lost=int(cut is not None))
    return (f"{where}: {flaw}" if flaw else "", worst)


def flaw_of(recording: Recording, lost: int = 0) -> tuple[str, float]:
    """What was wrong with a flight that ``lost`` so many drones, empty where nothing was, and the most that its load was off, m."""
    if recording.outcome != "completed":
        return recording.outcome, math.inf
    values = metrics.compute(recording)
    error = np.linalg.norm(metrics.tracking_error(recording), axis=1)
    worst = float(error.max())
    late = float(error[len(error) // 2 :].max())
    allowed = NEAR * max(1.0, float(recording.mission.team.cable_lengths.max()))
    if not late <= allowed:
        return f"the load is {late:.3g} m off, more than {allowed:.3g} m", worst
    gone = int(values["lost_drones"] or 0)
    if gone != lost:
        return f"{gone} drones were judged lost", worst
    if values["min_angle_deg"] <= ANGLE:
        return f"two cables came within {values['min_angle_deg']:.3g} degrees", worst
    return "", worst
