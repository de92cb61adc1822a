"""Fly a mission: bind its parts to the team, run the loop, hand back a recording."""

from __future__ import annotations

import hashlib
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colift.control.agents.base import AgentPart
from colift.control.allocation.base import AllocatorPart
from colift.control.reference.base import ReferencePart
from colift.errors import ColiftError, Problem, SettingError
from colift.flight.agents import has_left
from colift.flight.leg import Leg, Stretch, due_rows, places_of
from colift.flight.loop import CYCLE_WIDTH, Circuit, Periods, advance, circuit
from colift.flight.membership import Membership
from colift.interrupts import heard
from colift.kernel.math import leaning, winch
from colift.kernel.ports import PORTS, hold, hold_answer
from colift.kernel.signals import CYCLE_SIGNALS, HIDDEN, SIGNALS, columns, make_bus
from colift.mission.mission import Mission
from colift.mission.schema import Event
from colift.mission.warnings import warnings_of
from colift.part import LAYERS, Part, Vector, make
from colift.record.ends import ends_of, turned_ends
from colift.record.recording import Recording
from colift.team import Team, contact
from colift.team.geometry import matrix_of, min_norm_tensions, widest_gap, zero_yaw_quaternion
from colift.team.load import from_to
from colift.team.obstacles import Bodies, corners, first_touch
from colift.team.plan import shares
from colift.wording import numbers
from colift.world.disturbance.base import DisturbancePart
from colift.world.fault.base import LOAD, Change
from colift.world.plant.base import Start

Progress = Callable[[float], None]
"""Called with the fraction flown, between 0 and 1."""

Due = Event | Change | None
"""What happens at a step: an event, a fault's change; None when parts are to be told the lengths of cables that are wound."""

AnyPart = TypeVar("AnyPart", bound=Part)

REBINDS = 20
"""How often, while winches turn, limits and gains follow the lengths of the cables."""

CHUNK = 1.0
"""Simulated seconds between two looks at progress and interrupts."""


class Flight:
    """A mission in the air: :meth:`run` flies it to the end, :meth:`advance` a stretch of it.

    Between two stretches settings may change (:meth:`change`) and drones leave or join (:meth:`regroup`).

    Attributes
    ----------
    mission : Mission
    loop_time : float
        Wall time spent in the loop so far, s.
    outcome : str
        ``"completed"``, or how the flight ended.
    membership : Membership
        What has become of the team.

    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.loop_time = 0.0
        self.outcome = "completed"
        self.membership = Membership(mission.team)
        self._step = 0
        self._every = Periods(mission.timing.step, **mission.timing.multiples())
        self._seed = mission.seed
        self._parts: dict[str, Part] = {layer: getattr(mission, layer) for layer in LAYERS}
        winds_first = sorted(
            enumerate(mission.disturbance), key=lambda item: not item[1].makes_wind
        )
        self._disturbances: dict[int, DisturbancePart] = dict(winds_first)
        self._obstacles = mission.world.rows()
        self._load_mass = mission.true_bodies.load_mass
        self._due: list[tuple[int, Due]] = sorted(timetable(mission), key=lambda item: item[0])
        self._legs: list[Leg] = []
        drones = mission.first_drones()
        start, thrusts = start_state(mission)
        self._begin_leg(drones, self._fresh_memory(drones, start))
        bus = self.bus
        self._form()
        self._refer_anew()
        bus.reference[:] = self.wires.reference.writes.reference
        bus.reference_attitude[:] = start.load_attitude
        bus.desired_directions[:] = start.directions
        bus.received_directions[:] = start.directions
        bus.thrusts[:] = thrusts

    @property
    def time(self) -> float:
        """Simulated time flown, s."""
        return self._step * self._every.step

    @property
    def clock(self) -> float:
        """Time that the reference is given now, s: the flight's, unless a supervisor has held it."""
        if self._step == 0:
            return 0.0
        (clock, rate), step = self.bus.clock.tolist(), self._every.step
        return float(self.time + (clock - (self._step - 1) * step) - (1.0 - rate) * step)

    @cached_property
    def warnings(self) -> list[str]:
        """What the mission's parts warned of before the flight (:mod:`colift.mission.warnings`)."""
        return [str(warning) for warning in warnings_of(self.mission)]

    @property
    def compiled(self) -> bool:
        """Whether every part is compiled, and so the loop."""
        return self._legs[-1].circuit.compiled

    @property
    def bus(self) -> Any:
        """All signals now, of the drones that fly (:attr:`drones`)."""
        return self._legs[-1].bus

    @property
    def wires(self) -> Any:
        """The kernel of each layer with its parameters and memory, by layer (:class:`~colift.flight.loop.Wires`)."""
        return self._legs[-1].circuit.wires

    @property
    def circuit(self) -> Circuit:
        """All that the loop calls now."""
        return self._legs[-1].circuit

    @property
    def periods(self) -> Periods:
        """Of the layers."""
        return self._every

    @property
    def drones(self) -> list[int]:
        """Numbers of the drones that fly, in the order of the signals."""
        return self._legs[-1].drones

    def run(self, progress: Progress | None = None) -> Recording:
        """Fly from where we are to the end of the mission.

        A flight whose numbers stop being finite, or in which drones, cables and load touch, ends there; the recording
        says so in ``outcome``.
        """
        steps = self.mission.timing.steps
        chunk = max(1, round(CHUNK / self._every.step))
        with heard() as interrupted:
            while self._step < steps and self.outcome == "completed":
                self._fly_to(min(steps, (self._step // chunk + 1) * chunk))
                interrupted()
                if progress is not None:
                    progress(self._step / steps)
        return self.recording()

    def advance(self, duration: float) -> None:
        """Fly on for ``duration`` (s), to the nearest physics step, past the mission's end if need be."""
        self._fly_to(self._step + round(duration / self._every.step))

    @property
    def parts(self) -> dict[str, Part]:
        """The parts that fly now, by section: a layer's name, or ``disturbance.0``."""
        return {**self._parts, **{f"disturbance.{k}": p for k, p in self._disturbances.items()}}

    @property
    def load_mass(self) -> float:
        """The true mass of the load now, kg."""
        return self._load_mass

    def change(self, path: str, value: Any) -> None:
        """Set a setting from now on: ``allocation.mu``, ``load.mass`` (the truth's), ``disturbance.0.force``.

        A section, such as ``reference``, takes a table with the ``kind`` and the settings of the part to put in
        place; ``allocation.kind`` puts another allocator, with its default settings, in place.

        Raises
        ------
        SettingError
            Where the value is refused.
        ColiftError
            For a path that is not there, or a setting that cannot change in flight.

        """
        section, _, name = path.rpartition(".")
        if path == "load.mass":
            leg = self._legs[-1]
            self._load_mass = float(numbers("load.mass", value, (), above=0.0))
            leg.circuit.wires.plant.params[:] = self.mission.plant.params(
                self._true_team(leg.drones)
            )
        elif path == "allocation.kind":
            self.replace("allocation", make("allocation", {"kind": value}, self.mission))
        elif path in self.parts:
            self.replace(path, make(path.partition(".")[0], value, self.mission))
        elif section in self.parts:
            self.replace(section, _with(self.parts[section], section, name, value))
        else:
            raise ColiftError(f"{path}: there is no such setting")

    def act(self, layer: str, **signals: ArrayLike) -> None:
        """Set what a layer whose part is ``external`` writes, from now on: values by the name of the signal.

        Raises
        ------
        ColiftError
            If another part drives the layer, or it does not write such a signal.
        SettingError
            For a value of another shape, or one that is not finite.

        """
        if layer not in self._parts or not _is_driven(self._parts[layer]):
            raise ColiftError(f'{layer}: only a layer of kind "external" is driven from outside')
        if unknown := {*signals} - {*PORTS[layer].writes}:
            raise ColiftError(
                f"{layer}: writes {', '.join(PORTS[layer].writes)}, not {', '.join(sorted(unknown))}"
            )
        writes = getattr(self.wires, layer).writes
        places = {name: getattr(writes, name) for name in signals}
        values = {name: numbers(name, value, places[name].shape) for name, value in signals.items()}
        for name, value in values.items():
            places[name][:] = value

    def replace(self, section: str, part: Part) -> None:
        """Put a part in place of that of a section (:attr:`parts`); one of the same kind goes on with its memory.

        Raises
        ------
        ColiftError
            For the plant; for a disturbance of another kind; for a setting that cannot change in flight.

        """
        leg, before = self._legs[-1], self.parts[section]
        same = type(part) is type(before)
        if problems := part.wrong_lengths(self.mission.team.n):
            raise SettingError([Problem(name, "", text) for name, text in problems]).within(section)
        bound = self._told(section.partition(".")[0])
        if isinstance(part, DisturbancePart):
            bound = self._with_real_load(bound, leg.drones)
        packed = part.of(leg.drones).params(bound)
        if section.startswith("disturbance."):
            if not same:
                raise ColiftError(f"{section}: only one of the same kind can take its place")
            assert isinstance(part, DisturbancePart)
            number = int(section.partition(".")[2])
            place = list(self._disturbances).index(number)
            _refill(leg.circuit.disturbances[place].params, packed, section)
            self._disturbances[number] = part
        elif section == "plant":
            raise ColiftError("plant: cannot change in flight")
        elif same:
            wire = getattr(leg.circuit.wires, section)
            if self._memory(section, part, leg.team).shape != wire.memory.shape:
                raise ColiftError(f"{section}: cannot change like this in flight")
            _refill(wire.params, packed, section)
            self._parts[section] = part
            if section == "reference":
                self._refer_anew()
        else:
            self._parts[section] = part
            self.regroup(self.drones, anew={section})

    def regroup(self, drones: list[int], anew: set[str] | None = None) -> None:
        """Go on with these drones: who is missing has its cable cut, who is new hangs on a taut one.

        The layers in ``anew`` forget what they remember.
        """
        old = self._legs[-1]
        team = self.mission.team.of(drones)
        places = places_of(old.drones, drones)
        stay, new = places[places >= 0], places < 0
        directions = np.zeros((team.n, 3))
        directions[~new] = old.bus.directions[stay]
        for i in np.flatnonzero(new):
            taken = directions[np.linalg.norm(directions, axis=1) > 0.0]
            directions[i] = widest_gap(taken, self.mission.start_cone)
        start = Start(
            load_position=old.bus.load[0],
            load_velocity=old.bus.load[1],
            directions=directions,
            attitudes=np.tile([1.0, 0.0, 0.0, 0.0], (team.n, 1)),
            load_attitude=tuple(old.bus.load_attitude.tolist()),
            load_rates=tuple(old.bus.load_rates.tolist()),
        )
        anew = (anew or set()) | ({"allocation"} if self._leaderless else set())
        memory = {
            layer: fresh
            if layer in anew
            else self._carried(layer, getattr(old.circuit.wires, layer).memory, fresh, places)
            for layer, fresh in self._fresh_memory(drones, start).items()
        }
        self._begin_leg(drones, memory)
        bus = self.bus
        for signal in (*HIDDEN, *SIGNALS):
            now, before = getattr(bus, signal.name), getattr(old.bus, signal.name)
            if signal.shape[:2] == ("n", "n"):
                now[np.ix_(~new, ~new)] = before[np.ix_(stay, stay)]
            elif signal.shape[0] in {"n", "n+1"}:
                now[: team.n][~new] = before[stay]
                now[team.n :] = before[len(old.drones) :]
            else:
                now[:] = before
        self._form()
        bus.desired_directions[new] = bus.received_directions[new] = directions[new]
        bus.thrusts[new] = team.masses[new] * team.gravity
        if bus.reeled.any():
            self._rebind()
        if _is_driven(self._parts["reference"]) and "reference" not in anew:
            wires = self.wires.reference.writes, old.circuit.wires.reference.writes
            for now, before in zip(*wires, strict=True):
                if now.shape == before.shape:
                    now[:] = before
        else:
            self._refer_anew()

    def _form(self) -> None:
        """Let a rigid load hang in the allocator's formation."""
        leg, allocation = self._legs[-1], self._parts["allocation"].of(self.drones)
        assert isinstance(allocation, AllocatorPart)
        if leg.team.body is not None:
            leg.bus.formations[:] = shares(leg.team, *allocation.formation(leg.team))[:, None]

    def _refer_anew(self) -> None:
        """Write what the reference wants now: one that asks for no attitude would leave what stood there before it."""
        wanted, writes = self._parts["reference"], self.wires.reference.writes
        assert isinstance(wanted, ReferencePart)
        motion, attitude, rates = wanted.of(self.drones).pose(self._legs[-1].team, self.clock)
        writes.reference[:], writes.reference_attitude[:], writes.reference_rates[:] = (
            motion, attitude, rates,
        )  # fmt: skip

    def recording(self, since: float = 0.0) -> Recording:
        """What has been recorded, from ``since`` (s) on; NaN for a drone that has left."""
        every, n = self._every, self.mission.drones.count
        begin = max(self._legs[0].begin, round(since / every.step))
        first, rows = -(-begin // every.recording), due_rows(begin, self._step, every.recording)
        arrays = {s.name: np.empty((rows, *s.shape_for(n))) for s in SIGNALS}
        cycles = []
        filled = 0
        for leg in self._legs:
            log, answers = leg.recorded(begin, every)
            cycles.append(answers)
            end = filled + len(log)
            where = columns(leg.team.n)
            gone = np.setdiff1d(np.arange(n), leg.drones)
            for s in SIGNALS:
                values = log[:, where[s.name]].reshape(len(log), *s.shape_for(leg.team.n))
                rows_of = arrays[s.name][filled:end]
                if len(gone) == 0 or s.shape[0] not in {"n", "n+1"}:
                    rows_of[:] = values
                else:
                    rows_of[:, leg.drones] = values[:, : leg.team.n]
                    rows_of[:, n:] = values[:, leg.team.n :]
                    rows_of[:, gone] = np.nan
            filled = end
        allocations = np.concatenate(cycles)
        for k, signal in enumerate(CYCLE_SIGNALS):
            arrays[signal.name] = allocations[:, k]
        first_cycle = -(-begin // every.allocation)
        return Recording(
            mission=self.mission,
            time=np.arange(first, first + rows, dtype=np.float64) * (every.recording * every.step),
            cycle_time=np.arange(first_cycle, first_cycle + len(allocations), dtype=np.float64)
            * (every.allocation * every.step),
            arrays=arrays,
            provenance={
                **({"warnings": self.warnings} if self.warnings else {}),
                **({"outlooks": list(self.membership.said)} if self.membership.said else {}),
            },
            outcome=(self.membership.descent or self.outcome)
            if self.outcome == "completed"
            else self.outcome,
        )

    @property
    def bytes_per_second(self) -> float:
        """What is recorded in a second of flight."""
        every = self._every
        row, cycle = self.bus.row.size / every.recording, CYCLE_WIDTH / every.allocation
        return float(8.0 * (row + cycle) / every.step)

    @property
    def last_allocations(self) -> NDArray[np.float64]:
        """Of the last stretch flown: (allocations, as in :data:`CYCLE_SIGNALS`)."""
        stretches = self._legs[-1].stretches
        return stretches[-1].cycles if stretches else np.zeros((0, CYCLE_WIDTH))

    def forget(self, before: float) -> None:
        """Drop what was recorded in stretches that ended by a time (s)."""
        step = round(before / self._every.step)
        for leg in self._legs:
            leg.forget(step)
        self._legs = [leg for leg in self._legs[:-1] if leg.stretches] + self._legs[-1:]

    def snapshot(self) -> Snapshot:
        """The flight as it is now, to go on from once more: :meth:`restore`."""
        return Snapshot(
            step=self._step,
            seed=self._seed,
            outcome=self.outcome,
            membership=replace(self.membership, found=list(self.membership.found)),
            load_mass=self._load_mass,
            due=tuple(self._due),
            parts=dict(self._parts),
            disturbances=dict(self._disturbances),
            legs=tuple((leg, leg.begin, tuple(leg.stretches)) for leg in self._legs),
            state=tuple(each.copy() for each in self._legs[-1].state()),
        )

    def restore(self, before: Snapshot) -> None:
        """Go back to a snapshot of this flight; what follows is the same again, bit for bit.

        Parts that keep something outside of their memory, as plain Python may, do not go back.
        """
        self._step, self.outcome = before.step, before.outcome
        self.membership = replace(before.membership, found=list(before.membership.found))
        self._due, self._load_mass = list(before.due), before.load_mass
        self._parts, self._disturbances = dict(before.parts), dict(before.disturbances)
        self._legs = [leg for leg, _, _ in before.legs]
        for leg, begin, stretches in before.legs:
            leg.begin, leg.stretches = begin, deque(stretches)
        for vector, kept in zip(self._legs[-1].state(), before.state, strict=True):
            vector[:] = kept
        if before.seed != self._seed:
            self.reseed(before.seed)

    def reseed(self, seed: int) -> None:
        """From now on draw random numbers as a flight of this seed does; what was drawn before, and when faults happen, stays."""
        self._seed, leg = seed, self._legs[-1]
        leg.circuit = leg.circuit.keyed(*self._keys())

    def _keys(self) -> tuple[dict[str, int], list[int]]:
        """Of the random numbers of each layer, and of each disturbance."""
        disturbing = [random_key(self._seed, f"disturbance.{k}") for k in self._disturbances]
        return {layer: random_key(self._seed, layer) for layer in LAYERS}, disturbing

    def _fly_to(self, stop: int) -> None:
        """Fly to a step; on the way apply what is due, and regroup when a drone is judged lost."""
        while self._step < stop and self.outcome == "completed":
            while self._due and self._due[0][0] <= self._step:
                self._apply(self._due.pop(0)[1])
            self._advance(min(stop, self._due[0][0]) if self._due else stop)
            leg = self._legs[-1]
            touched = self._first_contact()
            if touched is not None:
                self._cut(*touched)
            elif not np.isfinite(leg.bus.row).all():
                self.outcome = f"diverged before t = {self.time:g} s"
            elif lost := self._left():
                self.leave(lost)

    def _left(self) -> list[int]:
        """Who has been judged lost, and is known to be by all that it concerns."""
        leg = self._legs[-1]
        return [
            drone
            for place, drone in enumerate(leg.drones)
            if has_left(leg.bus, leg.circuit.leaderless, place)
        ]

    def leave(self, lost: list[int]) -> None:
        """Note that these drones were found to carry no more, and go on without them; where they are all, the flight ends."""
        self.membership.found += [(self.time, drone) for drone in lost]
        if len(lost) < len(self.drones):
            self.lose(lost)
        else:
            self.outcome = f"no drone left to carry at t = {self.time:g} s"

    def lose(self, lost: list[int]) -> None:
        """Go on without these drones; if the others cannot hold the load in hover, bring it down."""
        rest = [drone for drone in self.drones if drone not in lost]
        self._go_on(rest)

    def _go_on(self, drones: list[int]) -> None:
        """With these drones, as the outlook for them is: how the load hangs, the formation, the pace, or down."""
        self._parts |= self.membership.go_on(
            drones, self.drones, self.bus, self._parts, time=self.time, clock=self.clock,
            end=self.mission.timing.duration,
        )  # fmt: skip
        self.regroup(drones)
        bus, found, now = self.bus, self.membership.outlook, self.time
        if self.membership.formation is not None:
            bus.formations[:, 0] = self.membership.formation
        now_wanted = self.wires.reference.writes.reference_attitude
        before = from_to(now_wanted, bus.reference_attitude)
        bus.lean[:] = leaning.lean_of(before, found.hang, now, found.within)
        leaning.run_at(bus.pace, found.pace, now)

    def _advance(self, stop: int) -> None:
        """Run the loop up to a step, or until it ends early; keep what it recorded."""
        leg, every = self._legs[-1], self._every
        loop: Any = advance if leg.circuit.compiled else getattr(advance, "py_func", advance)
        log = np.zeros((due_rows(self._step, stop, every.recording), leg.bus.row.size))
        cycles = np.zeros((due_rows(self._step, stop, every.allocation), CYCLE_WIDTH))
        begin = time.perf_counter()
        reached = loop(self._step, stop, every, *leg.circuit.arguments, log, cycles)
        self.loop_time += time.perf_counter() - begin
        log = log[: due_rows(self._step, reached, every.recording)]
        cycles = cycles[: due_rows(self._step, reached, every.allocation)]
        leg.stretches.append(Stretch(self._step, reached, log, cycles))
        self._step = reached

    def _first_contact(self) -> tuple[int, str] | None:
        """Step and words of the first contact that the last stretch recorded; of drones whose radii are known, and of obstacles."""
        leg, obstacles = self._legs[-1], self._obstacles
        team = self.mission.true_team.of(leg.drones)
        watched = contact.watched(team.radii)
        if not (watched or len(obstacles)):
            return None
        (first, _, log, _), where, period = (
            leg.stretches[-1],
            columns(team.n),
            self._every.recording,
        )
        positions = log[:, where["positions"]].reshape(len(log), team.n, 3)
        load, attached = log[:, where["load"]][:, :3], log[:, where["attached"]]
        ends, boxes = self._ends(log, team)[:, :, 0], None
        if team.body is not None:
            boxes = contact.Boxes(team.body.size, load, log[:, where["load_attitude"]])
        found = []
        if watched:
            reeled = log[:, where["reeled"]].reshape(len(log), team.n, 3)[:, :, 0]
            lengths = team.cable_lengths + reeled
            found.append(
                contact.first_contact(team.radii, lengths, positions, ends, attached, boxes)
            )
        if len(obstacles):
            points = (
                load[:, None] if boxes is None else corners(*boxes[:1], load[:, None], boxes[2])
            )
            touch = first_touch(obstacles, Bodies(team.radii, positions, ends, attached, points))
            found.append(None if touch is None else touch[:2])
        row, text = min((each for each in found if each is not None), default=(-1, ""))
        if row < 0:
            return None
        return (-(-first // period) + row) * period, text.format(*leg.drones)

    def _ends(self, log: NDArray[np.float64], team: Team) -> NDArray[np.float64]:
        """Places and velocities of the cables' ends (rows, n, 2, 3) in rows of the log."""
        where = columns(team.n)
        load = log[:, where["load"]].reshape(len(log), 2, 3)
        if team.body is None:
            return ends_of(load, team.n)
        attitude, rates = log[:, where["load_attitude"]], log[:, where["load_rates"]]
        return turned_ends(load, attitude, rates, team.body.attachments)

    def _cut(self, step: int, text: str) -> None:
        """End the flight at a step of the last stretch, whose later rows are dropped."""
        leg, every = self._legs[-1], self._every
        first, _, log, cycles = leg.stretches.pop()
        stop = step + 1
        leg.stretches.append(
            Stretch(
                first,
                stop,
                log[: due_rows(first, stop, every.recording)],
                cycles[: due_rows(first, stop, every.allocation)],
            )
        )
        self._step = stop
        self.outcome = f"{text} at t = {step * every.step:g} s"

    def _apply(self, due: Due) -> None:
        """Let an event or a fault happen, now."""
        drones = self.drones
        if due is None:
            self._rebind()
        elif isinstance(due, Change):
            signal = getattr(self.bus, due.signal)
            value = np.array(due.value, dtype=np.float64)  # None becomes NaN
            if due.drone == LOAD:
                signal = signal[-1:]
            elif due.drone in drones:
                place = drones.index(due.drone)
                signal = signal[place : place + 1]
            elif due.drone is not None:
                return
            np.copyto(signal, value, where=~np.isnan(value))
        elif due.of_team == "lose":
            if due.value in drones and len(drones) > 1:
                self.lose([due.value])
        elif due.of_team == "join":
            self._go_on(sorted([*drones, due.value]))
        elif due.of_winches:
            self._wind(due)
        else:
            self.change(due.field, due.value)

    def _wind(self, event: Event) -> None:
        """Let winches begin to turn."""
        leg, step = self._legs[-1], self._every.step
        wanted = np.broadcast_to(event.value, self.mission.drones.count)[leg.drones]
        last = 0.0
        for i, length in enumerate(wanted.tolist()):
            before, _, _ = winch.paid_out(leg.bus.winches, i, self.time)
            change = length - leg.team.cable_lengths[i] - before
            duration = winch.winding(change, event.rate)
            leg.bus.winches[i] = before, change, self.time, duration
            last = max(last, duration)
        marks = {self._step + math.ceil(k * last / REBINDS / step) for k in range(1, REBINDS + 1)}
        self._due = sorted(
            [*self._due, *((mark, None) for mark in marks)], key=lambda item: item[0]
        )

    def _told(self, layer: str) -> Team:
        """The team that a layer is bound to now: as at the start for one that sees what winches pay out, and adds it itself."""
        leg = self._legs[-1]
        winches = range(leg.team.n)
        more = [winch.paid_out(leg.bus.winches, i, self.time)[0] for i in winches]
        if not any(more) or "reeled" in PORTS[layer].sees:
            return leg.team
        return replace(leg.team, cable_lengths=leg.team.cable_lengths + more)

    def _rebind(self) -> None:
        """Bind all layers that do not see the winches to the lengths that the cables have now."""
        leg = self._legs[-1]
        for layer, part in self._parts.items():
            if layer != "plant" and "reeled" not in PORTS[layer].sees:
                packed = part.of(leg.drones).params(self._told(layer))
                _refill(getattr(leg.circuit.wires, layer).params, packed, layer)
        lengths = self.membership.team.cable_lengths.copy()
        lengths[leg.drones] = self._told("allocation").cable_lengths
        self.membership.team = replace(self.membership.team, cable_lengths=lengths)

    def _fresh_memory(self, drones: list[int], start: Start) -> dict[str, Vector]:
        team = self._team(drones)
        memory = {layer: self._memory(layer, self._parts[layer], team) for layer in LAYERS[:-1]}
        lengths = self.mission.true_bodies.of(drones).cable_lengths
        real = replace(self._with_real_load(team, drones), cable_lengths=lengths)
        return {**memory, "plant": self.mission.plant.initial(real, start)}

    def _memory(self, layer: str, part: Part, team: Team) -> Vector:
        """What a part remembers at first; of what each drone without a leader has for itself, one after the other."""
        return np.tile(part.memory(team), team.n if self._of_each(layer) else 1)

    def _of_each(self, layer: str) -> bool:
        """Whether each drone has this layer for itself: its own load controller, its own questions to the allocator."""
        return layer in {"load_control", "allocation"} and self._leaderless

    def _carried(self, layer: str, old: Vector, fresh: Vector, places: NDArray[np.int64]) -> Vector:
        """What a layer remembers in the next leg; of one that each drone has for itself, who stays its own."""
        part = self._parts[layer]
        if not (self._of_each(layer) and fresh.size):
            return part.carry_over(old, fresh, places)
        before = old.reshape(len(self.drones), -1)
        rows = zip(fresh.reshape(len(places), -1), places.tolist(), strict=True)
        kept = [row if at < 0 else part.carry_over(before[at], row, places) for row, at in rows]
        return np.concatenate(kept)

    @property
    def _leaderless(self) -> bool:
        agents = self._parts["agents"]
        assert isinstance(agents, AgentPart)
        return agents.decides

    def _begin_leg(self, drones: list[int], memory: dict[str, Vector]) -> None:
        """From here on these drones of the mission fly; every layer is bound to their team."""
        old, team = self._legs[-1] if self._legs else None, self._team(drones)
        keys, disturbing = self._keys()
        disturbances = []
        for place, (key, part) in enumerate(
            zip(disturbing, self._disturbances.values(), strict=True)
        ):
            remembered = part.memory(team)
            if old is not None:
                before = old.circuit.disturbances[place].memory
                remembered = part.carry_over(before, remembered, places_of(old.drones, drones))
            packed = part.of(drones).params(self._with_real_load(team, drones))
            disturbances.append((type(part), key, packed, remembered))
        params = {layer: self._parts[layer].of(drones).params(team) for layer in LAYERS[:-1]}
        params["plant"] = self.mission.plant.params(self._true_team(drones))
        bus = make_bus(team.n)
        bus.members[:] = drones
        bus.attachments[:] = 0.0 if team.body is None else team.body.attachments
        parts = {layer: type(part) for layer, part in self._parts.items()}
        wired = circuit(bus, parts, keys, params, memory, disturbances)
        self._legs.append(Leg(drones, team, bus, wired, self._step))

    def _team(self, drones: list[int]) -> Team:
        """These drones and their load as the controllers are told, hanging as it does on them."""
        return self.membership.outlook.flown(self.mission.team.of(drones))

    def _with_real_load(self, team: Team, drones: list[int]) -> Team:
        """Such a team of ``drones``, with the load as it really is: forces turn it about that centre of mass."""
        return replace(team, body=self.mission.true_bodies.of(drones).body)

    def _true_team(self, drones: list[int]) -> Team:
        bodies = replace(self.mission.true_bodies.of(drones), load_mass=self._load_mass)
        return self.mission.plant.team_of(bodies, self.mission.drones.cable_density)


class Snapshot(NamedTuple):
    """What :meth:`Flight.restore` needs to go on from a moment once more."""

    step: int
    seed: int
    outcome: str
    membership: Membership
    load_mass: float
    due: tuple[tuple[int, Due], ...]
    parts: dict[str, Part]
    disturbances: dict[int, DisturbancePart]
    legs: tuple[tuple[Leg, int, tuple[Stretch, ...]], ...]
    state: tuple[NDArray[np.float64], ...]


def timetable(mission: Mission) -> list[tuple[int, Event | Change]]:
    """Events and the changes that faults make, each with its step."""
    due: list[tuple[float, Event | Change]] = [(event.at, event) for event in mission.events]
    for number, fault in enumerate(mission.fault):
        rng = np.random.default_rng([mission.seed, number])
        found = fault.resolve(rng, mission.drones.count, mission.timing.duration)
        due += [(change.at, change) for change in found]
    return [(round(at / mission.timing.step), item) for at, item in due]


def random_key(seed: int, name: str) -> int:
    """Key of one part's random numbers (:mod:`colift.kernel.math.noise`): any integer of 64 bits."""
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    return int.from_bytes(digest[:8], "big", signed=True)


def _is_driven(part: Part) -> bool:
    """Whether what its layer writes is set from outside."""
    kernel = type(part).kernel
    return getattr(kernel, "py_func", kernel) in (hold, hold_answer)


def _with(part: AnyPart, section: str, name: str, value: Any) -> AnyPart:
    """A copy with one setting changed, validated."""
    try:
        return type(part)(**{**part.model_dump(), name: value})
    except SettingError as error:
        raise error.within(section) from error


def _refill(vector: Vector, packed: Vector, path: str) -> None:
    if packed.shape != vector.shape:
        raise ColiftError(f"{path}: cannot change in flight")
    vector[:] = packed


def start_state(mission: Mission) -> tuple[Start, Vector]:
    """Of the drones that fly at first: at rest on the start formation, each drone's thrust (n,), N, holding its share of the load.

    The attitude is the zero-yaw one for the static thrust, so that the flight starts in balance; level where cables may be slack.
    """
    drones = mission.first_drones()
    team = mission.team.of(drones)
    directions = mission.start_directions()
    first = mission.reference.sample(np.zeros(1), team)[0]
    weight = [0.0, 0.0, team.load_mass * team.gravity]
    stands = mission.start.on_ground
    pose = (mission.reference.upright() if stands else mission.reference).pose(team)
    attitude = pose[1]
    if mission.start.directions is None:
        hover = shares(team, *mission.allocation.of(drones).formation(team))
        planned = mission.position_control.of(drones).planned_pulls(team, [pose], [hover])
        if planned is not None:
            pulls, _ = planned
            directions = pulls[0] / np.linalg.norm(pulls[0], axis=1, keepdims=True)
    levers = team.levers @ matrix_of(attitude).T
    tensions = np.maximum(min_norm_tensions(directions, weight, levers), 0.0)
    thrust = team.hover_forces(tensions, directions)
    norms = np.linalg.norm(thrust, axis=1, keepdims=True)
    upward = np.array([0.0, 0.0, 1.0])
    aim = np.where(norms > 1e-9, thrust / np.maximum(norms, 1e-9), upward)
    load = first[0] + np.asarray(mission.start.load_offset)
    if mission.start.on_ground and mission.ground is not None:
        load[2] = mission.ground.height + mission.sole
    places = mission.start_places(load)
    thrusts = norms[:, 0]
    if places is not None:
        aim = np.tile(upward, (team.n, 1))
        thrusts = np.zeros(team.n) if mission.start.on_ground else team.masses * team.gravity
    start = Start(
        load_position=load,
        load_velocity=np.zeros(3),
        directions=directions,
        attitudes=zero_yaw_quaternion(aim),
        places=places,
        load_attitude=tuple(attitude.tolist()),
    )
    return start, thrusts
