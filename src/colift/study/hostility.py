"""Separation under all that a network, a clock and a controller can do wrong: random rehearsals, every cycle of which is judged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.control.agents.leaderless import Leaderless
from colift.control.allocation.safe import Safe
from colift.study.rehearsal import (
    DT,
    PULL,
    RESTARTS,
    RUNS,
    STALLS,
    STATUS,
    Asked,
    Rehearsal,
    force_error,
    formation_of,
    least_angles,
    team_of,
)
from colift.team.geometry import Array
from colift.world.network.hostile import Hostile

SLICE = 1000
"""Cycles in one call."""
LEAST = {2: 25.0, 3: 25.0, 4: 25.0, 6: 25.0, 8: 25.0, 12: 20.0, 16: 18.0}
"""Angle that agents keep, by the number of drones, degrees."""
ROOM = 5.0
"""By how much more their allocators plan, degrees."""
FRAMES = 1.0
"""By how much frames may differ, degrees."""
PAUSE = 50
"""Cycles between two restarts of a drone."""
LEAN = 0.35
"""Largest lean of the planned force, rad."""


@dataclass(frozen=True)
class Judged:
    """What came of one random rehearsal.

    Attributes
    ----------
    n, seed : int
    drone_steps : int
    world_deg : float
        Least angle between two cables in the world, degrees.
    wanted_deg : float
        What is promised in the world.
    unfinished : int
        Drones that say that somebody is unheard or not agreed with at the end of a calm stretch.
    error : float
        Of the force at the end of a calm stretch, over the weight.
    sane : bool
        Whether all tensions and directions were numbers within their limits.

    """

    n: int
    seed: int
    drone_steps: int
    world_deg: float
    wanted_deg: float
    unfinished: int
    error: float
    sane: bool

    @property
    def kept(self) -> bool:
        """Whether cables stayed apart, in every cycle."""
        return self.world_deg >= self.wanted_deg

    @property
    def good(self) -> bool:
        """Whether nothing at all was wrong."""
        return self.kept and self.sane and self.unfinished == 0


def agent_for(n: int, made: type[Leaderless] = Leaderless) -> Leaderless:
    """Settings under which n drones are attacked."""
    return made(min_angle_deg=LEAST[n], frame_deg=FRAMES)


def attack(
    n: int, seed: int, cycles: int, made: type[Leaderless] = Leaderless, **network: Any
) -> Judged:
    """One random rehearsal of n drones: wishes, plans, clocks, restarts, stalls and a hostile network, all from a seed.

    Every drone wants what it likes: noise, steps, sometimes no number at all or one beyond all limits. In the calm stretches of the
    network all want the same and nothing happens to the agents: at their end they must have agreed.
    """
    rng = np.random.default_rng([seed, n])
    team, agent = team_of(n), agent_for(n, made)
    hostile = Hostile(
        **{
            "loss": rng.uniform(0.0, 0.78), "late": int(rng.integers(0, 21)),
            "replay": rng.uniform(0.0, 0.2), "garble": rng.uniform(0.0, 0.2),
            "silence": rng.uniform(0.0, 0.3), "calm": 0.5, **network,
        }
    )  # fmt: skip
    skews = rng.integers(-1, 2, n).astype(float)
    flown = Rehearsal(
        agent, hostile, team, formation_of(n, LEAST[n] + 2 * ROOM), key=int(rng.integers(1 << 60)),
        clock_errors=skews, allocation=Safe(min_angle_deg=LEAST[n] + ROOM),
    )  # fmt: skip
    weight = team.load_mass * team.gravity
    world = math.inf
    sane, unfinished, error = True, 0, 0.0
    last = np.full(n, -PAUSE)
    for begin in range(0, cycles, SLICE):
        asked, calm = _asked(
            rng, n, weight, begin, min(SLICE, cycles - begin), skews, seed % 2 == 0, last
        )
        out = flown.run(asked)
        world = min(world, float(least_angles(out[:, :, PULL + 1 : STATUS]).min()))
        sane = sane and _sane(out)
        ends = np.flatnonzero(calm[:-1] & ~calm[1:])
        if len(ends):
            unfinished += int((out[ends, :, STATUS].astype(int) & 1).sum())
            error = max(error, float(force_error(asked, out)[ends].max()) / weight)
    steps = n * cycles
    return Judged(n, seed, steps, math.degrees(world), LEAST[n], unfinished, error, sane)


def _sane(out: Array) -> bool:
    tensions, directions = out[:, :, PULL], out[:, :, PULL + 1 : STATUS]
    unit = np.abs(np.linalg.norm(directions, axis=-1) - 1.0) < 1e-9
    return bool(
        np.isfinite(out).all()
        and unit.all()
        and (tensions >= 0.05).all()
        and (tensions <= 5.0).all()
    )


def _asked(
    rng: np.random.Generator,
    n: int,
    weight: float,
    begin: int,
    rows: int,
    skews: Array,
    turning: bool,
    last: Array,
) -> tuple[Asked, NDArray[np.bool_]]:
    """What happens in a stretch, and where it is calm."""
    steps = np.arange(begin, begin + rows)
    calm = (steps // 100) % 8 >= 4
    # Of clocks that differ by two cycles, and a restart that takes one, frames differ by less than they may.
    rate = 0.3 * math.radians(FRAMES) / DT
    lean = LEAN * np.sin(rate / LEAN * DT * (turning * (steps[:, None] + skews)))
    mass = weight / 9.81
    plans = np.zeros((rows, n, 3))
    plans[..., 0] = 9.81 * np.tan(lean)
    common = mass * (plans + np.array([0.0, 0.0, 9.81]))
    wild = rng.choice([0.0, 0.1, 0.5, 1.5], size=(rows // 50 + 1, n, 1))
    targets = rng.standard_normal((rows // 50 + 1, n, 3)) * wild * weight
    steady = common + np.repeat(targets, 50, axis=0)[:rows]
    wishes = steady + 0.05 * weight * rng.standard_normal((rows, n, 3))
    for values in (steady, wishes):
        odd = rng.random((rows, n)) < 0.01
        values[odd] = rng.choice([math.nan, math.inf, -math.inf, 1e300, -1e6, 0.0], (odd.sum(), 3))
    steady[calm], wishes[calm] = common[calm], common[calm]
    events = np.zeros((rows, n))
    begins = rng.random((rows, n)) < rng.choice([0.001, 0.01])
    begins |= np.roll(begins, 1, axis=1) & (rng.random((rows, n)) < 0.3)  # two at once
    for i in range(n):
        for row in np.flatnonzero(begins[:, i] & ~calm):
            if begin + row - last[i] >= PAUSE:
                events[row, i], last[i] = RESTARTS, begin + row
    stalled = np.repeat(rng.random((rows // 20 + 1, n)) < 0.05, 20, axis=0)[:rows]
    if not turning:  # an agent that stands still does not turn with the plan
        events[stalled] = STALLS
    events[calm | (steps < 20)] = RUNS
    return Asked(wishes, steady, plans, events), calm


def attacks(n: int, drone_steps: int, first_seed: int, cycles: int = 20_000) -> list[Judged]:
    """So many drone-steps or a few more, a seed for each rehearsal of so many ``cycles``."""
    runs = math.ceil(drone_steps / (n * cycles))
    return [attack(n, first_seed + run, cycles) for run in range(runs)]
