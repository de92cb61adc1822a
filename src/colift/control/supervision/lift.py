"""Take-off, pick-up, set-down and landing: a load that stands on the ground, cables that are slack at first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from colift.control.supervision._lift_down import land, lower, slacken, touch, unload
from colift.control.supervision._lift_memory import (
    CLIMB,
    DONE,
    FLY,
    HOOK,
    LAND,
    LOWER,
    MEMORY,
    MOST_ROUNDS,
    PARAMS,
    RELEASE,
    RISE,
    SLACKEN,
    STAND,
    TENSION,
    TOUCH,
    UNLOAD,
    M,
    P,
    go,
)
from colift.control.supervision._lift_senses import feel, length
from colift.control.supervision._lift_up import (
    RAISE,
    SLOWLY,
    climb,
    hook,
    rise,
    stand,
    tension,
)
from colift.control.supervision._lift_ways import on_the_way, reel, set_off
from colift.control.supervision.base import SIGNATURE, SupervisionPart
from colift.control.tuning import Delays
from colift.kernel.jit import inline, kernel
from colift.kernel.math.smooth import phase
from colift.part import Setup, Vector
from colift.team import Team

PATIENCE = 10.0
"""Time after which a phase on the ground that does not end is given up, s."""
CATCH = 5e-4
"""Most speed at which a cable comes taut, over gravity and the mass of load and drone per drone's, s: on a cable as stiff as ``(500 / s)^2``
times the mass that is caught, with critical damping, the tension is half of the weight."""
TOLD, THROWN = 0.035, 0.16
"""Time after which a touch-down is told, s, and the speed with which the cables' pull may throw the drones up until they are braked, m/s."""
BRAKE = 5.0
"""Acceleration by which they are braked, m/s^2."""
GENTLE, BRISK, SLOW = 0.08, 0.13, 0.06
"""Least and most speed of a touch-down, m/s, that is as fast as the drones are thrown up, so that no cable catches them; and that where they
are thrown up faster and will be caught in any case, at this speed, or where there are one or two, which turn widely as they brake."""
FADE, LEVELLED = 0.3, 3.0
"""Least time constant of the drones' speed towards a load that has touched, s, and what it is over the time in which an attitude answers:
until a drone that leaned against its cable is level, it goes on outwards."""
RODS = ("rigid-cables",)
"""Plants whose cables cannot be slack."""
MOVING = 0.02
"""Speed of a reference from which on it does not rest, m/s."""
STANDING = 0.2
"""Height of the drones above the load, over a cable, below which all stand on the ground at first."""


@inline
def _begin(t, sees, params, memory):  # type: ignore[no-untyped-def]
    """On the ground, or in the air where the drones are above the load."""
    n, above = sees.estimated_positions.shape[0], 0.0
    for i in range(n):
        height = sees.estimated_positions[i, 2] - sees.estimated_load[0, 2]
        above += height / length(i, sees, params) / n
    memory[M.ground] = params[P.ground]
    memory[M.phase], memory[M.since] = (STAND if above < STANDING else FLY), t
    memory[M.share] = 0.0 if above < STANDING else 1.0


@inline
def _fly(t, time, params, memory, home):  # type: ignore[no-untyped-def]
    """The reference's clock runs; in the end the way to the place of the load. Returns how fast it runs."""
    flown = params[P.fly] * memory[M.round]
    memory[M.clock] = flown + min(time, params[P.fly])
    if time < params[P.fly]:
        return 1.0
    go(memory, LOWER, t)
    ax, ay = home[0], home[1]
    if params[P.aside] != 0.0:
        spot = P.places + 2 * int(memory[M.round])
        ax, ay = params[spot], params[spot + 1]
    high = home[2] + memory[M.above]
    set_off(memory, (home[0], home[1], high), (ax, ay, high), params[P.speed], 0.0)
    return 0.0


@kernel(SIGNATURE)
def _lift(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t, dt = now.time, now.dt
    home, shift = sees.reference[0], writes.reference_shift
    n = sees.estimated_positions.shape[0]
    if memory[M.started] == 0.0:
        _begin(t, sees, params, memory)
    feel(sees, params, memory, dt)
    memory[M.started] = 1.0
    now_in, time, rate = memory[M.phase], t - memory[M.since], 0.0
    if now_in == STAND:
        stand(t, time, sees, params, memory)
    elif now_in == CLIMB:
        climb(t, time, dt, sees, params, memory, writes.courses)
    elif now_in == HOOK:
        hook(t, time, dt, sees, params, memory)
    elif now_in == TENSION:
        tension(t, dt, sees, params, memory, home)
    elif now_in == RISE:
        rise(t, time, sees, params, memory, n)
    elif now_in == FLY:
        rate = _fly(t, time, params, memory, home)
    elif now_in == LOWER:
        lower(t, time, dt, sees, params, memory)
    elif now_in == TOUCH:
        touch(t, time, dt, sees, params, memory)
    elif now_in == UNLOAD:
        unload(t, time, dt, params, memory, n)
    elif now_in == SLACKEN:
        slacken(t, time, dt, sees, params, memory)
    elif now_in in (RELEASE, LAND):
        land(t, time, dt, sees, params, memory, writes)

    now_in, since = memory[M.phase], t - memory[M.since]
    airborne = now_in in (RISE, FLY, LOWER, TOUCH)
    writes.phase[0] = now_in
    writes.clock[0], writes.clock[1] = memory[M.clock], rate
    writes.lift_share[0] = memory[M.share]
    writes.lifted_mass[0] = memory[M.weighed]
    writes.standing[n] = 0.0 if airborne else 1.0
    for k in range(3):
        writes.held_forces[n, k] = memory[M.held + k]
    for i in range(n):
        o = M.rows + M.width * i
        down = now_in in (STAND, DONE) or memory[o + M.down] != 0.0
        writes.standing[i] = 1.0 if down else 0.0
        reel(i, dt, memory)
        for k in range(3):
            writes.spans[i, k] = memory[o + M.span + k]
            writes.held_forces[i, k] = 0.0 if down else memory[o + M.bias + k]
    if now_in == FLY:
        for m in range(4):
            for k in range(3):
                shift[m, k] = memory[M.above] if m == 0 and k == 2 else 0.0
    else:
        on_the_way(memory, since if now_in in (RISE, LOWER) else memory[M.way], shift, home)
    if now_in == TOUCH:
        gone = phase(since, 0.5, params[P.touch])
        for m in range(4):
            shift[m, 2] -= gone[m]


Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Place = tuple[Coordinate, Coordinate]


class Lift(SupervisionPart, Delays):
    """From the ground to the ground: drones climb, cables come taut, the load is lifted, flown, set down, drones land.

    Everything is told from what is measured. The flight's reference begins once the load has risen to where it begins, and ends after
    ``fly`` seconds of its own; from there the load goes to where it is set down. A flight that begins in the air begins with the reference.
    """

    kernel = _lift
    remembers = MEMORY

    paced_by = "position_control"
    works_with: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "load_control": ("balance", "pose"),
        "position_control": ("formation",),
        "observation": ("momentum",),
        "agents": ("central",),
    }

    fly: Annotated[float, Field(gt=0.0, le=1e6)] = 10.0
    """For how long the reference is flown, s; it should rest by then."""
    set_down: Place | Annotated[list[Place], Field(min_length=1, max_length=MOST_ROUNDS)] | None = (
        None
    )
    """Where the load is set down, world x and y, m; below where the reference ends where not given. Of a list one after the other: at
    each but the last the load is picked up again, and the reference goes on for another ``fly``."""
    afterwards: Literal["land", "release"] = "land"
    """Whether the drones land with their cables hooked, or release the load before."""
    speed: Annotated[float, Field(gt=0.0, le=10.0)] = 0.4
    """Most speed of the load on its way to and from the reference, m/s."""
    touch_speed: Annotated[float, Field(gt=0.0, le=0.5)] | None = None
    """Speed at which it is led onto the ground, m/s. None: 0.08 to 0.13, as fast as the cables' pull throws the drones up until they are
    braked; 0.06 where that is faster than 0.16. A rigid load at most at 0.08: its corners may come first."""
    ground: Annotated[float, Field(ge=-1e6, le=1e6)] = 0.0
    """Height of the ground where the load is set down, m, for a flight that begins in the air; otherwise where it stood."""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "position_control")
        rounds = len(self.set_down) if isinstance(self.set_down, list) else 1
        ends = self.fly * np.arange(1, rounds + 1)
        velocity = mission.reference.sample(ends, mission.team)[:, 1]
        speed = float(np.linalg.norm(velocity, axis=1).max())
        if speed > MOVING:
            message = f"ends the reference where it moves at {speed:.2g} m/s: the load is stopped there at once"
            yield "fly", message
        kind = mission.kinds["plant"]
        if kind in RODS:
            message = f'slackens cables, but those of plant.kind = "{kind}" are rods; set plant.kind = "slack-cables"'
            yield "kind", message

    def params(self, team: Team) -> Vector:
        bandwidths = self.bandwidths(team)
        band = bandwidths.velocity
        L = float(team.cable_lengths.mean())
        pull = team.load_mass * team.gravity / float(team.masses.sum())
        ratio = 1.0 + float(team.masses.sum()) / team.load_mass
        thrown = pull * (TOLD + self.lag + self.delay)
        caught = thrown > THROWN or team.n <= 2
        brisk = BRISK if team.body is None else GENTLE
        touch = self.touch_speed or (SLOW if caught else min(max(thrown, GENTLE), brisk))
        places = self.set_down if isinstance(self.set_down, list) else [self.set_down or (0.0, 0.0)]
        sole = 0.0 if team.body is None else team.body.sole
        spots = np.zeros((MOST_ROUNDS, 2))
        spots[: len(places)] = places
        hook = 0.01 * max(1.0, math.sqrt(L))
        gentle = CATCH * team.gravity * (1.0 + team.load_mass / float(team.masses.mean()))
        drag = [d if math.isfinite(d) else 0.0 for d in team.rotor_drags]
        return PARAMS.pack(
            team.n, g=team.gravity, m_L=team.load_mass, feel=1.5 * band, learn=0.4 * band,
            delay=self.delay if self.predicted else 0.0, lag=self.lag, fly=self.fly,
            rounds=len(places), aside=float(self.set_down is not None), places=spots.ravel(), speed=self.speed, touch=touch,
            release=float(self.afterwards == "release"), ground=self.ground + sole, sole=sole,
            hook=hook, climb=max(2.0, 5.0 * math.sqrt(L)),
            rise=max(RAISE, SLOWLY / band), stiff=0.1 * band * band * ratio,
            damp=0.5 * band * ratio, margin=0.08 * max(1.0, math.sqrt(L)),
            clear=0.15 * max(1.0, math.sqrt(L)), patience=PATIENCE, brake=0.0 if caught else BRAKE,
            fade=max(FADE, LEVELLED / bandwidths.attitude),
            catch=min(0.004 * math.sqrt(L) * min(L, 1.0), gentle),
            m=team.masses, L=team.cable_lengths, drag=drag,
        )  # fmt: skip
