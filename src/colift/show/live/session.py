"""A flight that a person steers: flown against a clock, changed by commands, told to whoever looks.

It knows nothing of the network. One thread calls :meth:`Session.tick`; any thread may :meth:`~Session.submit`
commands and read :meth:`~Session.rows`, :meth:`~Session.events` and the attributes.
"""

from __future__ import annotations

import math
import queue
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from colift.control.reference.base import ReferencePart
from colift.control.reference.guided import Guided, Triple
from colift.errors import ColiftError
from colift.flight.flight import Flight
from colift.mission.load import load_mission
from colift.mission.mission import Mission
from colift.part import kind_of
from colift.record import metrics
from colift.record.moments import ONE_COMMAND, Moment, Watch
from colift.record.recording import Recording
from colift.record.verdict import Verdict, judge
from colift.show.live import knobs
from colift.show.live.endless import flown_mission, live_mission

Array = NDArray[np.float64]
Item = TypeVar("Item")

STRETCH = 0.02
"""Simulated seconds flown at a time; after each there is one row to show."""
MOST_LAG = 0.25
"""When the loop is further behind the clock than this, the rest of the delay is given up, s."""
ROWS = 6000
"""Rows kept to be shown: two minutes."""
MARKS = 2000
"""Events kept to be shown."""
KEPT = 600.0
"""Simulated seconds of the full recording that are kept at most."""
KEPT_BYTES = 3e8
"""Bytes of the full recording that are kept at most."""
STEERING_ENDS = 0.5
"""Clock time after which a velocity that is not renewed becomes zero, s."""
GENTLE = 3.0
"""Shortest transition of a rigid load, s."""
WATCH_PERIOD = 0.1
"""Simulated time between two looks for what is worth a mark, s."""
LOOK_PERIOD = 0.1
"""Clock time between two looks at the knobs, s."""
PACE_PERIOD = 0.5
"""Clock time over which the speed is measured, s."""
JUDGE_PERIOD = 1.0
"""Clock time between two computations of the numbers that judge, s."""
JUDGED = 5.0
"""Simulated time that they look back, s."""
MOST_COMMANDS = 20_000
"""Changes of one flight; more are refused."""


class Row(NamedTuple):
    """The signals at one time, by name; per drone NaN for one that has left."""

    time: float
    signals: dict[str, Array]


class Session:
    """A flight in real time (or faster) that can be changed while it flies.

    Parameters
    ----------
    mission : Mission
        Flown without end; its ``timing.duration`` is that of its reference and faults only.
    write : callable
        Saves a recording and says where; called in a thread of its own.
    speed : float
        Simulated over clock time.

    Attributes
    ----------
    epoch : int
        Grows with every reset: what was shown before is past.
    generation : int
        Grows when the knobs change.
    flight : Flight
        The one in the air; belongs to the flying thread.
    knobs : dict
        What can be turned now, by name.
    allocators : list of str
        What can be chosen as allocator.
    state : dict
        Of the last look: paused, speed reached, lag, values of knobs and choices, metrics and verdict of the last
        seconds, where it was saved.

    """

    def __init__(
        self, mission: Mission, write: Callable[[Recording], Path], speed: float = 1.0
    ) -> None:
        self._base = live_mission(mission)
        self._write = write
        self._speed = speed
        self._queue: queue.Queue[tuple[Callable[[Session], None], Callable[[str], None]]]
        self._queue = queue.Queue(256)
        self._lock = threading.Lock()
        self._rows: deque[Row] = deque(maxlen=ROWS)
        self._shown = 0  # rows ever made
        self._marks: deque[dict[str, Any]] = deque(maxlen=MARKS)
        self._marked = 0  # events ever made
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="colift-save")
        self._saving: Future[None] | None = None
        self._saved: str | None = None
        self._turned: dict[str, Any] = {}
        self._paused = False
        self._started = False
        self._now = self._due = 0.0
        self._looked = self._judged = -np.inf
        self._pace = (0.0, 0.0)  # clock and simulated time when the speed was last measured
        self._reached = 0.0
        self._numbers: dict[str, float] = {}
        self._verdict: Verdict | None = None
        self.epoch = self.generation = 0
        self.allocators = knobs.allocators(mission.team)
        self.state: dict[str, Any] = {}
        self.reset()
        self._look(self._now)

    # ---------------------------------------------------------------- read from any thread

    @property
    def mission(self) -> Mission:
        """As flown, without what was changed in flight."""
        return self.flight.mission

    def rows(self, after: int) -> tuple[list[Row], int]:
        """Rows made after so many, and how many have been made by now."""
        with self._lock:
            return _later(self._rows, self._shown, after), self._shown

    def events(self, after: int) -> tuple[list[dict[str, Any]], int]:
        """Events after so many, and how many there have been by now."""
        with self._lock:
            return _later(self._marks, self._marked, after), self._marked

    def submit(
        self,
        perform: Callable[[Session], None],
        refuse: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Have the flying thread do something soon; ``refuse`` is called there with a reason if it cannot."""
        try:
            self._queue.put_nowait((perform, refuse))
        except queue.Full:
            refuse("too many commands are waiting")

    # ---------------------------------------------------------------- the flying thread

    def tick(self, now: float) -> float:
        """Do what was asked and fly a stretch if one is due at clock time ``now`` (s); how long to wait, s."""
        self._now = now
        if not self._started:
            self._started, self._due, self._pace = True, now, (now, 0.0)
        self._perform()
        if self._steering and now > self._steering_ends:
            self.steer((0.0, 0.0, 0.0))
        if self._paused or self.flight.outcome != "completed":
            self._due = now + STRETCH
        elif now >= self._due:
            # Behind by more than is made up for: go on from here.
            self._due = max(self._due, now - MOST_LAG) + STRETCH / self._speed
            self._fly()
        if now - self._looked >= LOOK_PERIOD:
            self._look(now)
        return max(0.0, self._due - now)

    def end(self, save: bool) -> str:
        """Save, if wanted, and wait until it is on disk; a sentence about it. Nobody ticks any more."""
        if save:
            try:
                self._saved = str(self._write(self.recording()))
            except (ColiftError, OSError) as error:
                return f"Not saved: {error}"
        self._writer.shutdown(wait=True)
        return f"Saved {self._saved}" if self._saved else "Not saved."

    def recording(self) -> Recording:
        """The flight so far, its commands as events of its mission.

        Raises
        ------
        ColiftError
            If hardly anything has been flown.

        """
        self._flush()
        mission = flown_mission(self.mission, self.flight, self._commands)
        return replace(self.flight.recording(), mission=mission, commands=list(self._texts))

    # ---------------------------------------------------------------- commands

    def pause(self) -> None:
        """Stop the clock of the flight."""
        self._paused = True

    def resume(self) -> None:
        """Let it fly on."""
        self._paused = False

    def reset(self) -> None:
        """Begin anew with all drones, on the mission's reference, with the settings as they were turned."""
        self.flight = Flight(load_mission(self._base, self._turned))
        self._see_allocator()
        self._watch = Watch()
        self._commands: list[dict[str, Any]] = []
        self._texts: list[tuple[float, str]] = []
        self._pending: tuple[str, float, str] | None = None
        self._steering, self._steering_ends = False, 0.0
        self._pace = (self._now, 0.0)
        self._verdict = None
        with self._lock:
            self._rows.clear()
            self._marks.clear()
            self.epoch += 1

    def turn(self, name: str, value: float) -> None:
        """Turn a knob."""
        knob = self.knobs.get(name)
        if knob is None:
            raise ColiftError(f"there is no knob {name}")
        if not knob.min <= value <= knob.max:
            raise ColiftError(f"{name} must be between {knob.min:g} and {knob.max:g}")
        if knob in knobs.POSE:
            self._pose(knob, value)
            return
        setting = knobs.setting(self.flight, name, value)
        for _, message in knobs.conflicts(self.flight, name, setting):
            raise ColiftError(message)
        self._change(name, setting, f"{knob.label} {value:.4g} {knob.unit}")
        if name == "load.mass":
            self._turned["truth.load_mass_factor"] = value / self.mission.load.mass
        else:
            self._turned[name] = setting

    def choose(self, name: str, value: str) -> None:
        """Put another allocator in place; it keeps where the knobs of the old one stand that it has too."""
        if name != "allocation.kind" or value not in self.allocators:
            raise ColiftError(f"there is no choice {value} of {name}")
        kept = {
            path.partition(".")[2]: knobs.setting(self.flight, path, knobs.read(self.flight, path))
            for path in self.knobs
            if path.startswith("allocation.")
        }
        part = knobs.make_allocator(value, kept)
        self._change(
            "allocation",
            {"kind": value, **part.model_dump(mode="json", exclude_none=True)},
            f"Allocator {value}",
        )
        of_old = [path for path in self._turned if path.startswith("allocation.")]
        for path in of_old:
            del self._turned[path]
        self._turned["allocation.kind"] = value
        self._turned |= {f"allocation.{field}": getattr(part, field) for field in kept
                         if field in knobs.fields(part)}  # fmt: skip

    def push(self, force: Triple, seconds: float) -> None:
        """Push the load with a force (N) for a while."""
        begin = self.flight.time
        table = {"kind": "push", "force": list(force), "at": begin, "duration": seconds}
        size = float(np.linalg.norm(force))
        section = f"disturbance.{len(self.mission.disturbance) - 1}"
        self._change(section, table, f"Push of {size:.3g} N for {seconds:.3g} s")

    def cut(self, drone: int) -> None:
        """Cut a cable: its drone leaves and the others are told."""
        drones = self.flight.drones
        if drone not in drones:
            raise ColiftError(f"drone {drone} does not fly")
        if len(drones) == 1:
            raise ColiftError("the last cable cannot be cut")
        self._room()
        self.flight.lose([drone])
        self._did("drones.lose", drone, f"Cable of drone {drone} cut")

    def target(self, position: Triple) -> None:
        """Fly the load to a point and rest there."""
        place = ", ".join(f"{x:.2f}" for x in position)
        self._steering = False
        self._guide(
            self._guided().towards(position, self.flight.clock, self._reference()),
            f"Fly to ({place}) m",
        )

    def steer(self, velocity: Triple) -> None:
        """Fly the load with a velocity until another one comes, or for :data:`STEERING_ENDS`."""
        self._steering = any(velocity)
        self._steering_ends = self._now + STEERING_ENDS
        guided = self._guided()
        now = guided is self.flight.parts["reference"] and guided.target is None
        if now and guided.velocity == tuple(velocity):
            return
        speed = float(np.linalg.norm(velocity))
        text = f"Steer at {speed:.2f} m/s" if speed else "Stop"
        self._guide(guided.along(velocity, self.flight.clock, self._reference()), text)

    def save(self) -> None:
        """Write the flight so far to a file, in a thread of its own."""
        if self._saving is not None and not self._saving.done():
            raise ColiftError("still saving")
        recording = self.recording()
        self._saving = self._writer.submit(self._save, recording)

    # ---------------------------------------------------------------- inside

    def _perform(self) -> None:
        for _ in range(self._queue.qsize()):
            perform, refuse = self._queue.get_nowait()
            try:
                perform(self)
            except ValidationError as error:
                refuse(error.errors()[0]["msg"])
            except (ColiftError, ValueError) as error:
                refuse(str(error))

    def _fly(self) -> None:
        flight = self.flight
        flight.advance(STRETCH)
        kept = min(KEPT, KEPT_BYTES / flight.bytes_per_second)
        flight.forget(flight.time - kept)
        if type(flight.parts["allocation"]) is not self._allocator:
            self._see_allocator()
        row = Row(flight.time - self.mission.timing.step, _signals(flight))
        found: list[Moment] = []
        if flight.time - self._watch.seen >= WATCH_PERIOD or flight.outcome != "completed":
            recent = flight.recording(since=self._watch.seen)
            found = self._watch.look(recent, [drone for _, drone in flight.membership.found])
        if self._pending and flight.time - self._pending[1] > ONE_COMMAND:
            self._flush()
        with self._lock:
            self._rows.append(row)
            self._shown += 1
            self._mark(found)

    def _see_allocator(self) -> None:
        """The knobs are those of the allocator that flies; a command or the mission may have changed it."""
        self._allocator = type(self.flight.parts["allocation"])
        self.knobs = knobs.knobs_of(self.flight)
        self.generation += 1

    def _mark(self, found: list[Moment]) -> None:
        self._marks.extend(moment._asdict() for moment in found)
        self._marked += len(found)

    def _look(self, now: float) -> None:
        """Bring :attr:`state` up to date."""
        self._looked = now
        clock, time = self._pace
        if now - clock >= PACE_PERIOD:
            self._reached = (self.flight.time - time) / (now - clock)
            self._pace = (now, self.flight.time)
        if now - self._judged >= JUDGE_PERIOD and self.flight.time >= 1.0:
            self._judged = now
            recent = self.flight.recording(since=self.flight.time - JUDGED)
            self._numbers = metrics.compute(recent)
            self._verdict = judge(recent, self._numbers)
        self.state = {
            "paused": self._paused or self.flight.outcome != "completed",
            "speed": round(self._reached, 3),
            "lag": round(max(0.0, now - self._due), 3),
            "values": {
                **{name: knobs.read(self.flight, name) for name in self.knobs},
                "allocation.kind": kind_of(self._allocator),
            },
            "metrics": self._numbers,
            "level": self._verdict.level if self._verdict else "",
            "reasons": self._verdict.reasons if self._verdict else [],
            "saved": self._saved,
        }

    def _reference(self) -> Array:
        """Position and derivatives (4, 3) that the reference has now."""
        part = self.flight.parts["reference"]
        assert isinstance(part, ReferencePart)
        return np.asarray(part.sample(np.array([self.flight.clock]), self.mission.team)[0])

    def _guided(self) -> Guided:
        """What flies by hand; where nothing does yet, a rigid load becomes upright and keeps its heading."""
        part = self.flight.parts["reference"]
        if isinstance(part, Guided) or self.mission.team.body is None:
            return part if isinstance(part, Guided) else Guided()
        angles = knobs.angles(self.flight)
        return Guided(least_time=GENTLE).turned(
            (0.0, 0.0, math.degrees(angles[0, 2])), self.flight.clock, angles
        )

    def _pose(self, knob: knobs.Knob, value: float) -> None:
        """Turn a rigid load about one axis, yaw the shorter way; if it follows the mission's reference, it stops."""
        if value and knob.name != "reference.yaw" and self.flight.membership.outlook.upright:
            raise ColiftError("without the drone that is lost, roll and pitch are not flown")
        guided, angles = self._guided(), knobs.angles(self.flight)
        if guided is not self.flight.parts["reference"]:
            guided = guided.along((0.0, 0.0, 0.0), self.flight.clock, self._reference())
        roll, pitch, yaw = guided.attitude_deg
        if knob.name == "reference.roll":
            roll = value
        elif knob.name == "reference.pitch":
            pitch = value
        else:
            yaw = value
        now = math.degrees(angles[0, 2])
        wanted = (roll, pitch, now + math.remainder(yaw - now, 360.0))
        self._guide(
            guided.turned(wanted, self.flight.clock, angles),
            f"{knob.label} {value:.4g} {knob.unit}",
        )

    def _guide(self, part: Guided, text: str) -> None:
        if self.flight.membership.descent:
            raise ColiftError(
                f"the load is brought down ({self.flight.membership.descent}); reset to fly again"
            )
        self._change(
            "reference", {"kind": "guided", **part.model_dump(mode="json", exclude_none=True)}, text
        )

    def _room(self) -> None:
        if self.flight.outcome != "completed":
            raise ColiftError(f"the flight has ended ({self.flight.outcome}); reset it")
        if len(self._commands) >= MOST_COMMANDS:
            raise ColiftError("too many changes in one flight; save and reset it")

    def _change(self, path: str, value: Any, text: str) -> None:
        self._room()
        self.flight.change(path, value)
        self._did(path, value, text)

    def _did(self, path: str, value: Any, text: str) -> None:
        """Remember a change as an event of the mission and, with those that follow closely, as a mark."""
        self._commands.append({"at": self.flight.time, "field": path, "value": value})
        if self._pending and self._pending[0] != path:
            self._flush()
        self._pending = (path, self.flight.time, text)

    def _flush(self) -> None:
        if self._pending is not None:
            _, time, text = self._pending
            self._pending = None
            self._texts.append((time, text))
            with self._lock:
                self._mark([Moment(time, "command", text)])

    def _save(self, recording: Recording) -> None:
        try:
            path = self._write(recording)
        except (ColiftError, OSError) as error:
            found = Moment(float(recording.time[-1]), "fault", f"Not saved: {error}")
        else:
            self._saved = str(path)
            found = Moment(float(recording.time[-1]), "command", f"Saved {path}")
        with self._lock:
            self._mark([found])


def _later(items: deque[Item], made: int, after: int) -> list[Item]:
    return list(islice(items, max(0, len(items) - (made - after)), None))


def _signals(flight: Flight) -> dict[str, Array]:
    """What is shown of the present state; per drone NaN for one that has left."""
    bus, n, drones = flight.bus, flight.mission.drones.count, flight.drones
    found = {
        "load": bus.load[0].copy(),
        "reference": bus.reference[0].copy(),
        "force": bus.force.copy(),
        "external": bus.external_forces[-1].copy(),
        "load_attitude": bus.load_attitude.copy(),
        "reference_attitude": bus.reference_attitude.copy(),
    }
    for name in (
        "positions", "attitudes", "directions", "desired_directions",
        "tensions", "desired_tensions", "thrusts",
    ):  # fmt: skip
        values = getattr(bus, name)
        found[name] = np.full((n, *values.shape[1:]), np.nan)
        found[name][drones] = values
    found["reeled"] = np.full(n, np.nan)
    found["reeled"][drones] = bus.reeled[:, 0]
    allocations = flight.last_allocations
    # A silent allocation has no duration; the longest of the others counts.
    worst = np.fmax.reduce(allocations, axis=0, initial=np.nan)
    found["status"], found["solve_time"] = worst[0], worst[-1]
    found["error"] = np.linalg.norm(found["load"] - found["reference"])
    return found
