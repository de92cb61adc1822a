"""The moments of a flight that are worth a mark: one list for report, replay and live view.

:func:`find_moments` finds them in a recording. A live view finds the same ones, in the same words, in what has
been recorded since it last looked (:class:`Watch`); it cannot know yet how long what has just begun will last.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.kernel.phase import Phase
from colift.kernel.status import Status
from colift.mission.schema import Event
from colift.record.recording import Recording
from colift.record.resting import rests
from colift.record.verdict import limits
from colift.team.geometry import pairwise_angles

Array = NDArray[np.float64]

KINDS = {
    "phase": "phase",
    "command": "command",
    "fault": "fault",
    "gap": "not measured",
    "departure": "drone leaves",
    "join": "drone joins",
    "change": "change",
    "descent": "descent",
    "ground": "on the ground",
    "slack": "slack",
    "angle": "angle below limit",
    "fallback": "fallback",
    "outcome": "end",
}
"""Every kind of moment, causes first, and what a legend calls it."""

FOLLOWING = frozenset({"gap", "slack", "angle", "fallback"})
"""Kinds that follow from others, and are many."""

PAUSE = 0.25
"""Two stretches of the same closer than this are one, s."""

MOST_PAIRED = 64
"""Above so many drones no pair is looked at."""

ONE_COMMAND = 0.5
"""Changes of the same thing by hand that follow each other within this time are one command, s."""


class Moment(NamedTuple):
    """When (s), what kind (of :data:`KINDS`), what happened, and to which drone (from 0), if to one."""

    time: float
    kind: str
    text: str
    drone: int | None = None


def find_moments(recording: Recording) -> list[Moment]:
    """All moments of a flight, in order of time."""
    recording = recording.complete()  # what was not recorded is not known
    found = [
        Moment(float(each.time[first]), each.kind, each.text(first, last) + each.more(first, last), each.drone)
        for each in _ongoing(recording)
        for first, last in _stretches(each.time, each.holds)
    ]  # fmt: skip
    found += _coming_and_going(recording, _present(recording)[:1], told=None)
    found += [moment for moment in _unseen_faults(recording) if not _told(moment, found, recording)]
    found += [Moment(time, "command", text) for time, text in recording.commands]
    found += _changes(recording, -np.inf)
    found += _endings(recording.outcome, float(recording.time[-1]))
    return _in_order(found, recording)


class Watch:
    """Finds the moments of a flight that goes on, from what it has recorded since the last look.

    Attributes
    ----------
    seen : float
        Time of the last row looked at, s.

    """

    def __init__(self) -> None:
        self._last: dict[tuple[str, str, int | None], float] = {}
        self._present: NDArray[np.bool_] | None = None
        self.seen = 0.0
        self._outcome = "completed"

    def look(self, recent: Recording, judged_lost: Collection[int] = ()) -> list[Moment]:
        """What has begun.

        Parameters
        ----------
        recent : Recording
            From the last row of the look before on.
        judged_lost : collection of int
            Drones that the detection has given up; who leaves without is told to.

        """
        found = [*self._begun(recent)]
        if len(recent.time):
            here, begins = _present(recent), self._present is None
            before = here[:1] if self._present is None else self._present[None]
            found += _coming_and_going(recent, before, told=lambda drone: drone not in judged_lost)
            found += _changes(recent, -np.inf if begins else self.seen)
            self._present, self.seen = here[-1], float(recent.time[-1])
        if recent.outcome != self._outcome:
            found += _endings(recent.outcome, self.seen)
            self._outcome = recent.outcome
        return _in_order(found, recent)

    def _begun(self, recent: Recording) -> Iterator[Moment]:
        for each in _ongoing(recent):
            what = (each.kind, each.key, each.drone)
            for first, last in _stretches(each.time, each.holds):
                if each.time[first] - self._last.get(what, -np.inf) > PAUSE:
                    text = each.text(first, first)
                    yield Moment(float(each.time[first]), each.kind, text, each.drone)
                self._last[what] = float(each.time[last])


def _in_order(found: list[Moment], recording: Recording) -> list[Moment]:
    """By time, of the same time causes first; cables that are cut at once are one moment."""
    cuts: dict[float, list[Moment]] = {}
    for moment in found:
        if moment.text == _cut(moment.drone):
            cuts.setdefault(moment.time, []).append(moment)
    for time, at_once in cuts.items():
        if len(at_once) > 1:
            row = int(np.searchsorted(recording.time, time - 1e-9))
            rest = np.count_nonzero(recording["attached"][row] == 1.0)
            text = (
                f"{len(at_once)} cables cut at once"
                if rest
                else "All cables cut, the load is released"
            )
            found = [moment for moment in found if moment not in at_once]
            found.append(Moment(time, "fault", text))
    kinds = list(KINDS)
    return sorted(found, key=lambda moment: (moment.time, kinds.index(moment.kind)))


def _cut(drone: int | None) -> str:
    return f"Cable of drone {drone} cut"


class _Ongoing(NamedTuple):
    """Something that may go on for a while: when it does, and what is said of rows ``first`` to ``last``."""

    kind: str
    key: str
    """What tells it from others of its kind and drone."""
    drone: int | None
    time: Array
    holds: NDArray[np.bool_]
    text: Callable[[int, int], str]
    more: Callable[[int, int], str]
    """What can be said once it is over."""


def _ongoing(recording: Recording) -> Iterator[_Ongoing]:
    yield from _phases(recording)
    yield from _faults(recording)
    yield from _slack(recording)
    yield from _touches(recording)
    yield from _fallbacks(recording)
    yield from _angles(recording)
    yield from _gaps(recording)


def _lasting(time: Array) -> Callable[[int, int], str]:
    """How long rows ``first`` to ``last`` are, in words."""

    def words(first: int, last: int) -> str:
        if last + 1 == len(time):
            return " to the end"
        return f" for {_seconds(time[last + 1] - time[first])}"

    return words


def _seconds(duration: float) -> str:
    return f"{duration:.3g} s" if duration >= 0.001 else "less than 1 ms"


def _always(text: str) -> Callable[[int, int], str]:
    def words(_first: int, _last: int) -> str:
        return text

    return words


def _known(recording: Recording, name: str) -> Array | None:
    """A signal, unless nothing of it is known."""
    values = recording[name]
    return None if np.isnan(values).all() else values


PHASES = {
    Phase.STAND: "On the ground",
    Phase.CLIMB: "Drones climb",
    Phase.HOOK: "Cables are drawn taut",
    Phase.TENSION: "Tensions rise",
    Phase.RISE: "Load rises",
    Phase.FLY: "Flight along the reference",
    Phase.LOWER: "Load is lowered",
    Phase.TOUCH: "Load is set down",
    Phase.UNLOAD: "Touch-down told, cables unloaded",
    Phase.SLACKEN: "Cables slacken",
    Phase.RELEASE: "Load released, drones land",
    Phase.LAND: "Drones land",
    Phase.DONE: "All on the ground",
}
"""What is said as each phase begins."""


def _phases(recording: Recording) -> Iterator[_Ongoing]:
    """What a supervised flight is about."""
    found = _known(recording, "phase")
    if found is None or not found.any():
        return
    for number in np.unique(found[~np.isnan(found)]).astype(int).tolist():
        known = number in set(Phase)
        text = PHASES[Phase(number)] if known else f"Phase {number}"
        yield _Ongoing(
            "phase", text, None, recording.time, found[:, 0] == number, _always(text), _always("")
        )


def _faults(recording: Recording) -> Iterator[_Ongoing]:
    """What does not work, as the signals say that faults change."""
    time, n = recording.time, recording.n
    lasting, silence = _lasting(time), _always("")

    def fault(text: str, drone: int | None, holds: Any, more: Any = silence) -> _Ongoing:
        return _Ongoing("fault", text, drone, time, holds, _always(text), more)

    attached = _known(recording, "attached")
    if attached is not None:
        cut = attached == 0.0
        let_go = _known(recording, "unhooked")
        if let_go is not None:
            cut &= let_go == 0.0  # told with the phase
        for i in np.flatnonzero(cut.any(axis=0)).tolist():
            yield fault(_cut(i), i, cut[:, i])
    health = _known(recording, "motor_health")
    if health is not None:
        for i in np.flatnonzero((health < 1.0).any(axis=(0, 2))).tolist():
            weak = health[:, i] < 1.0
            dead = (health[:, i] == 0.0).all(axis=1)
            all_weak = weak.all(axis=1) & ~dead
            yield fault(f"All motors of drone {i} stopped", i, dead)
            yield fault(f"Motors of drone {i} weak", i, all_weak, _left(health[:, i].min(axis=1)))
            for motor in range(4):
                alone = weak[:, motor] & ~weak.all(axis=1)
                text = f"Motor {motor} of drone {i} weak"
                yield fault(text, i, alone, _left(health[:, i, motor]))
    stuck = _known(recording, "stuck")
    if stuck is not None:
        for i in np.flatnonzero((stuck == 1.0).any(axis=0)).tolist():
            whose, drone = ("the load", None) if i == n else (f"drone {i}", i)
            yield fault(f"Sensors of {whose} stuck", drone, stuck[:, i] == 1.0, lasting)
    up = _known(recording, "allocator_up")
    if up is not None:
        yield fault("Allocator silent", None, up[:, 0] == 0.0, lasting)


def _left(health: Array) -> Callable[[int, int], str]:
    """What share of its thrust a motor gives at worst."""
    return lambda first, last: f", down to {100.0 * np.nanmin(health[first : last + 1]):.0f} %"


def _slack(recording: Recording) -> Iterator[_Ongoing]:
    spent = _known(recording, "slack_times")
    if spent is None or not len(recording.time):
        return
    before = np.zeros((1, recording.n)) if recording.time[0] == 0.0 else spent[:1]
    grown = np.diff(spent, axis=0, prepend=before)
    grown[recording["attached"] == 0.0] = 0.0  # a cable that is cut is not slack
    grown[rests(recording)] = 0.0  # nor is one of a load that lies on the ground
    for i in np.flatnonzero((grown > 0.0).any(axis=0)).tolist():

        def more(first: int, last: int, gained: Array = grown[:, i]) -> str:
            return f" for {_seconds(np.nansum(gained[first : last + 1]))}"

        text = f"Cable {i} slack"
        yield _Ongoing("slack", "", i, recording.time, grown[:, i] > 0.0, _always(text), more)


def _touches(recording: Recording) -> Iterator[_Ongoing]:
    """Drones and load on the ground, and how fast they came down."""
    forces, speeds = _known(recording, "ground_forces"), _known(recording, "touch_speeds")
    if forces is None or speeds is None:
        return
    pressed = forces[..., 2] > 0.0
    for i in np.flatnonzero(pressed.any(axis=0)).tolist():
        whose, drone = ("Load", None) if i == recording.n else (f"Drone {i}", i)

        def text(first: int, last: int, whose: str = whose, speed: Array = speeds[:, i]) -> str:
            # The force is that of a step's begin, a touch that of its end: they may be a row apart.
            fastest = np.nanmax(speed[max(first - 1, 0) : last + 1])
            if fastest > 0.0:
                return f"{whose} touches the ground with {fastest:.2g} m/s"
            return f"{whose} stands on the ground"

        yield _Ongoing(
            "ground", whose, drone, recording.time, pressed[:, i], text, _lasting(recording.time)
        )


def _fallbacks(recording: Recording) -> Iterator[_Ongoing]:
    status = recording["allocator_status"]
    told: set[int] = {Status.CONVERGED}
    if _known(recording, "allocator_up") is not None:
        told.add(Status.SILENT)  # told as a fault
    for code in sorted(set(np.unique(status[~np.isnan(status)]).astype(int).tolist()) - told):
        here = status == code

        def more(first: int, last: int, here: NDArray[np.bool_] = here) -> str:
            count = int(np.count_nonzero(here[first : last + 1]))
            return f", {count} cycle{'s' * (count != 1)}"

        text = f"Allocator: {status_word(code)}"
        yield _Ongoing("fallback", text, None, recording.cycle_time, here, _always(text), more)


def status_word(code: int) -> str:
    """What a status code of the allocator is called."""
    if code not in set(Status):
        return f"status {code}"
    return Status(code).name.replace("_", " ").lower()


def angle_pairs(n: int) -> bool:
    """Whether angles between pairs of n cables are looked at."""
    return 2 <= n <= MOST_PAIRED


def _angles(recording: Recording) -> Iterator[_Ongoing]:
    limit, cut = limits(recording.mission).angle_deg, recording["attached"] == 0.0
    if limit is None or not angle_pairs(recording.n):
        return
    directions = np.where(cut[..., None], np.nan, recording["directions"])
    angles = np.degrees(pairwise_angles(directions))
    pairs = list(zip(*np.triu_indices(recording.n, k=1), strict=True))
    lasting = _lasting(recording.time)

    def narrowest(first: int, last: int) -> tuple[int, float]:
        part = np.nanmin(angles[first : last + 1], axis=0, initial=np.inf)
        return int(part.argmin()), float(part.min())

    def text(first: int, last: int) -> str:
        one, other = pairs[narrowest(first, last)[0]]
        return f"Cables {one} and {other} closer than {limit:g} deg"

    def more(first: int, last: int) -> str:
        return f"{lasting(first, last)}, down to {narrowest(first, last)[1]:.1f} deg"

    holds = np.asarray(np.any(angles < limit, axis=1))
    yield _Ongoing("angle", "", None, recording.time, holds, text, more)


def _gaps(recording: Recording) -> Iterator[_Ongoing]:
    """What a real flight's sensors lost for a while."""
    if recording.source != "flight":
        return
    for i in range(recording.n + 1):
        whose, drone = ("Load", None) if i == recording.n else (f"Drone {i}", i)
        values = recording["load"][:, 0] if drone is None else recording["positions"][:, i]
        lost = np.asarray(np.isnan(values).any(axis=1))
        if not lost.all():
            text = _always(f"{whose} not measured")
            yield _Ongoing(
                "gap", whose, drone, recording.time, lost, text, _lasting(recording.time)
            )


def _present(recording: Recording) -> NDArray[np.bool_]:
    """Which drones (rows, n) fly with the team."""
    attached = _known(
        recording, "attached"
    )  # a number as long as they do, also in a flight that diverges
    positions = recording["positions"][..., 0]
    return np.asarray(~np.isnan(positions if attached is None else attached))


def _coming_and_going(
    recording: Recording, before: NDArray[np.bool_], told: Callable[[int], bool] | None
) -> Iterator[Moment]:
    """Drones that leave and join.

    A drone that leaves without being told to was judged lost; without ``told``, the mission's events say who is.
    """
    if recording.source == "flight":
        return
    present = np.concatenate([before, _present(recording)])
    events, commanded = recording.mission.events, _commanded(recording)
    for row, drone in np.argwhere(present[1:] != present[:-1]).tolist():
        time = float(recording.time[row])
        change = "join" if present[row + 1, drone] else "lose"
        since = recording.time[row - 1] if row else -np.inf
        asked = [
            k for k, event in enumerate(events)
            if event.of_team == change and event.value == drone and since < event.at <= time + 1e-9
        ]  # fmt: skip
        if change == "join":
            yield Moment(
                events[asked[0]].at if asked else time, "join", f"Drone {drone} joins", drone
            )
        elif asked or (told is not None and told(drone)):
            time = events[asked[0]].at if asked else time
            if asked and asked[0] not in commanded:
                yield Moment(time, "fault", _cut(drone), drone)
            yield Moment(time, "departure", f"Drone {drone} leaves the team", drone)
        else:
            text = f"Drone {drone} is judged lost and leaves the team"
            yield Moment(time, "departure", text, drone)


def _commanded(recording: Recording) -> set[int]:
    """Places of the mission's events that are commands: those are told in the words of the commands."""
    times = np.array([time for time, _ in recording.commands])
    events = recording.mission.events
    found: set[int] = set()
    latest: dict[str, float] = {}  # of the same thing, the command that followed
    for k in sorted(range(len(events)), key=lambda k: -events[k].at):
        event = events[k]
        near = latest.get(event.field, np.inf) - event.at <= ONE_COMMAND
        if near or (len(times) and np.abs(times - event.at).min() < 1e-9):
            found.add(k)
            latest[event.field] = event.at
    return found


def _changes(recording: Recording, after: float) -> Iterator[Moment]:
    """What changed the team's task later than a time: what the mission asked for, and how a rigid load goes on with other drones.

    Drones that come and go are seen in the signals.
    """
    commanded = _commanded(recording)
    for k, event in enumerate(recording.mission.events):
        asked = k not in commanded and not event.of_team
        if asked and after < event.at <= recording.time[-1]:
            yield Moment(event.at, "change", _asked(event))
    for time, text in recording.provenance.get("outlooks", []):
        if time > after:
            yield Moment(float(time), "change", f"The load {text}")


def _asked(event: Event) -> str:
    value = event.value
    if isinstance(value, dict) and "kind" in value:
        settings = ", ".join(f"{name} = {v}" for name, v in value.items() if name != "kind")
        return f"{event.field}: {value['kind']}" + (f" ({settings})" if settings else "")
    return f"{event.field} = {value}"


def _unseen_faults(recording: Recording) -> Iterator[Moment]:
    """When the mission, or chance, has faults happen."""
    mission = recording.mission
    for number, fault in enumerate(mission.resolved().get("fault", [])):
        if not isinstance(fault, dict):
            continue
        at = fault.get("at", "random")
        if at == "random":  # the first number of the stream that colift.world.fault draws from
            at = np.random.default_rng([mission.seed, number]).uniform(0.0, mission.timing.duration)
        if isinstance(at, int | float) and at <= recording.time[-1]:
            kind = str(fault.get("kind", "fault")).replace("-", " ")
            yield Moment(float(at), "fault", f"Fault: {kind}")


def _told(moment: Moment, found: list[Moment], recording: Recording) -> bool:
    """Whether a fault of the mission is among those that the signals show."""
    late = recording.mission.timing.recording + 1e-9
    return any(
        other.kind == "fault" and -1e-9 <= other.time - moment.time <= late for other in found
    )


def _endings(outcome: str, end: float) -> Iterator[Moment]:
    """How the flight ended, unless it was completed."""
    if outcome == "completed":
        return
    text = outcome[:1].upper() + outcome[1:]
    descended = re.match(r"descended from t = ([\d.e+-]+) s: (.*)", outcome, re.DOTALL)
    if descended is None:
        yield Moment(end, "outcome", text)
    else:
        yield Moment(float(descended[1]), "descent", f"The load is brought down: {descended[2]}")


def _stretches(time: Array, where: Any) -> list[tuple[int, int]]:
    """First and last row of each stretch in which ``where`` holds; short pauses do not end one."""
    rows = np.flatnonzero(where)
    if not len(rows):
        return []
    ends = np.flatnonzero(np.diff(time[rows]) > PAUSE)
    firsts, lasts = rows[np.concatenate([[0], ends + 1])], rows[np.concatenate([ends, [-1]])]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
