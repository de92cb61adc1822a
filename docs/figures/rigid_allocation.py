"""Write how the allocators for rigid loads do, cycle by cycle (docs/theory/rigid-allocation.md): limits, misses, time.

A box of 0.5 kg, 0.6 x 0.4 x 0.2 m, on cables of 1 m that end on its upper edges, drones of 0.5 kg, 100 Hz. The wrench is that of a
smooth motion with attitude, the same with white noise on force, moment and measured attitude, or steps of both.

Every answer is judged by code that the allocator does not call, and by the limits of ``safe-wrench``. Of that one a miss is *proved* by a plane in the space of wrenches that parts the
wanted one from all that cables within their tensions, cone and turns can make; what is not proved counts as avoidable. Of two cables, whose
wrenches have five dimensions, nothing is proved.

From ``rigid_allocation.json`` beside this file: ``python docs/figures/rigid_allocation.py [--fly] [--times] [--kinds safe-wrench]
[--drones 3 4] [--cases smooth] [--cycles 1000]``. ``--fly`` measures the rows of these kinds, drones and cases anew, all when left out, but
for their times, which ``--times`` measures on a machine that does nothing else. With ``--cycles`` rows are only shown.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from pages import fill, table
from scipy.stats import beta

from colift.control.allocation.base import (
    INFO_SIZE,
    Allocator,
    AllocatorPart,
    Beside,
    Status,
    ask,
)
from colift.control.allocation.limits.reach import farthest
from colift.control.allocation.limits.rigid import MEMORY
from colift.control.allocation.safe_wrench import PRICES, SafeWrench, outward
from colift.kernel.jit import address_of, monotonic_ns
from colift.part import find
from colift.team import Body, Team
from colift.team.geometry import matrix_of
from colift.team.load import box_inertia, usual_attachments

Array = NDArray[np.float64]

PERIOD = 0.01
SIZE = np.array([0.6, 0.4, 0.2])
MASS = 0.5
SAFE = "safe-wrench"
CYCLES = {
    SAFE: 100_000, "wrench-min-norm": 100_000, "internal-force-wrench": 100_000, "sqp-wrench": 100_000, "wahba-hoenig-wrench": 10_000,
}  # fmt: skip
"""Of each case, by allocator; what runs in Python is a thousand times slower."""
DRONES = [2, 3, 4, 6, 8]
MORE = [12, 16]
"""For ``safe-wrench`` alone."""
DISTANCE, CLOSE = 0.5, 0.3
"""That drones keep, m; the latter for more than eight, who find no other room around the box."""
REPEATS = 5
SEED = 20261128  # no choice of a constant has seen it
MISSED = 1e-6
CASES = ("smooth", "white 0.1", "white 0.3", "raw steps", "slewed steps")


def judge_of(n: int) -> SafeWrench:
    """The limits by which all are judged."""
    return SafeWrench(min_distance=DISTANCE if n <= max(DRONES) else CLOSE)


def team_of(n: int) -> Team:
    """n drones and the box."""
    attachments = usual_attachments(n, SIZE)
    body = Body(box_inertia(MASS, SIZE), attachments, size=SIZE)
    return replace(Team.uniform(n, load_mass=MASS, mass=0.5), body=body)


class Asked(NamedTuple):
    """What is asked in every cycle: wrenches, accelerations, and attitudes as wanted, turning and measured."""

    force: Array
    moment: Array
    acceleration: Array
    attitude: Array
    rates: Array
    measured: Array


def product(a: Array, b: Array) -> Array:
    """Hamilton products (..., 4)."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def turn(vector: Array) -> Array:
    """Quaternions (..., 4) of rotation vectors (..., 3)."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate(
        [np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2.0 * np.pi)) * vector], axis=-1
    )


def asked(case: str, cycles: int, team: Team, rate: float, seed: int = SEED) -> Asked:
    """A case for so many cycles."""
    rng = np.random.default_rng([seed, CASES.index(case)])
    t = PERIOD * np.arange(cycles)[:, None]
    waves = rng.uniform(0.8, 2.2, (3, 3)), rng.uniform(0.0, 2.0 * np.pi, (3, 3))

    def wave(amplitudes: list[float], which: int) -> Array:
        sines = np.sin(
            t[:, :, None] * waves[0][which][None, :, None] * (1.0, 0.73)
            + waves[1][which][None, :, None]
        )
        return np.asarray(amplitudes) * 0.5 * sines.sum(axis=2)

    begin = np.clip(t / 2.0, 0.0, 1.0)
    begin = begin**3 * (10.0 - 15.0 * begin + 6.0 * begin**2)  # from rest
    motion = begin * wave([2.0, 2.0, 1.0], 0)
    swing = begin * wave([math.radians(10.0), math.radians(10.0), 0.0], 1)
    yaw = begin * wave([0.0, 0.0, math.radians(90.0)], 2)
    attitude = product(turn(yaw), turn(swing))
    step = product(attitude[:-1] * [1, -1, -1, -1], attitude[1:])
    spin = np.zeros((cycles, 3))
    spin[:-1] = 2.0 * np.sign(step[:, :1]) * step[:, 1:] / PERIOD
    spin[-1] = spin[-2]
    speed = np.gradient(spin, PERIOD, axis=0)
    inertia = team.body.inertia
    turns = np.array([matrix_of(q) for q in attitude])
    moment = np.einsum("kij,kj->ki", turns, speed @ inertia + np.cross(spin, spin @ inertia))
    measured = attitude
    if case.startswith("white"):
        level = float(case.split()[1])
        motion = motion + level * rng.standard_normal((cycles, 3))
        moment = moment + (0.01 if level < 0.2 else 0.02) * rng.standard_normal((cycles, 3))
        measured = product(turn(math.radians(0.2) * rng.standard_normal((cycles, 3))), attitude)
    if "steps" in case:
        every = 50
        jumps = rng.uniform(-3.0, 3.0, (cycles // every + 1, 3)) * [1.0, 1.0, 0.5]
        tips = rng.uniform(-0.1, 0.1, (cycles // every + 1, 3))
        motion, moment = jumps[np.arange(cycles) // every], tips[np.arange(cycles) // every]
        attitude = np.tile([1.0, 0.0, 0.0, 0.0], (cycles, 1))
        measured, spin, speed = attitude, np.zeros((cycles, 3)), np.zeros((cycles, 3))
    force = MASS * (motion + np.array([0.0, 0.0, team.gravity]))
    if case == "slewed steps":
        most = 0.6 * MASS * team.gravity * rate * PERIOD
        force[:, :2] = slewed(force[:, :2], most)
        moment = slewed(moment, most * float(np.abs(team.levers).max()))
    rates = np.stack([spin, speed, np.zeros((cycles, 3))], axis=1)
    return Asked(*map(np.ascontiguousarray, (force, moment, motion, attitude, rates, measured)))


def slewed(wanted: Array, most: float) -> Array:
    """The same, changing by no more than ``most`` in a cycle."""
    found = wanted.copy()
    for k in range(1, len(found)):
        step = wanted[k] - found[k - 1]
        found[k] = found[k - 1] + step * min(1.0, most / max(float(np.linalg.norm(step)), 1e-300))
    return found


@numba.njit
def _run(address, asked, dt, params, memory, tensions, directions, info, at, out):
    pulls, state, multipliers, times = out
    n = tensions.shape[0]
    reference, nominal = np.zeros((4, 3)), np.full((n, 3, 3), np.nan)
    own = np.zeros((n, 3))  # no formation but its own
    for k in range(asked.force.shape[0]):
        reference[2] = asked.acceleration[k]
        beside = Beside(
            asked.moment[k], asked.attitude[k], asked.rates[k], asked.measured[k], nominal, own
        )  # fmt: skip
        force = asked.force[k]
        begin = monotonic_ns()
        state[k, 0] = ask(
            address, force, reference, beside, dt, params, memory, tensions, directions, info
        )
        times[k] = monotonic_ns() - begin
        state[k, 1:] = info
        multipliers[k] = memory[at : at + 6]
        for i in range(n):
            pulls[k, i] = tensions[i] * directions[i]


class Run(NamedTuple):
    """Answers: cable forces (cycles, n, 3), N; status and info; the last multipliers of the wrench; time of each call, ns."""

    pulls: Array
    state: Array
    multipliers: Array
    times: Array


def run(part: AllocatorPart, team: Team, what: Asked) -> Run:
    """Ask for everything, cycle by cycle, from the plan's formation."""
    cycles, n = len(what.force), team.n
    compiled = hasattr(type(part).kernel, "py_func")
    out = Run(
        np.zeros((cycles, n, 3)),
        np.zeros((cycles, 1 + INFO_SIZE)),
        np.zeros((cycles, 6)),
        np.zeros(cycles),
    )
    directions, tensions = judge_of(n).formation(team)
    if compiled:
        at = MEMORY.at.lam if isinstance(part, SafeWrench) else 0
        memory = np.concatenate([part.memory(team), np.zeros(6)])
        _run(
            address_of(type(part).kernel), what, PERIOD, part.params(team), memory[:-6], tensions.copy(),
            np.ascontiguousarray(directions), np.zeros(INFO_SIZE), at, tuple(out),
        )  # fmt: skip
        return out
    allocator = Allocator(part, team, dt=PERIOD)
    allocator.reset(directions, tensions)
    for k in range(cycles):
        answer = allocator.allocate(
            what.force[k], what.acceleration[k], moment=what.moment[k], attitude=what.measured[k],
            wanted_attitude=what.attitude[k],
        )  # fmt: skip
        out.pulls[k] = answer.tensions[:, None] * answer.directions
        out.state[k, :2] = answer.status, answer.iterations
        out.times[k] = 1e9 * answer.solve_time
    return out


def places(team: Team, attitude: Array) -> Array:
    """Where the cables end from the centre of mass (cycles, n, 3), m."""
    turns = np.array([matrix_of(q) for q in attitude])
    return np.einsum("kij,nj->kni", turns, team.levers)


def possible(team: Team, what: Asked) -> Array:
    """The wanted moments (cycles, 3), N m; of two cables without that about the line of their ends, which they cannot make."""
    if team.n != 2:
        return what.moment
    ends = places(team, what.measured)
    line = ends[:, 1] - ends[:, 0]
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    free = np.cross(ends.mean(axis=1), what.force)
    return np.asarray(
        what.moment - np.sum((what.moment - free) * line, axis=1, keepdims=True) * line
    )


def missed(team: Team, what: Asked, pulls: Array) -> Array:
    """What of the wrench is missing (cycles, 6): N, N m."""
    moments = np.cross(places(team, what.measured), pulls).sum(axis=1) + possible(team, what)
    return np.concatenate([pulls.sum(axis=1) + what.force, moments], axis=1)


def loss(team: Team, miss: Array) -> Array:
    """What is missing, weighted by its prices, in shares of the load."""
    share = MASS * team.gravity / team.n
    arm = float(np.abs(team.levers).max())
    return np.asarray(np.abs(miss / share / np.array([1.0, 1.0, 1.0, arm, arm, arm])) @ prices_of())


def prices_of() -> Array:
    """Of the rows of a wrench: force and moment."""
    level, tip = PRICES["horizontal"], PRICES["tip"]
    return np.array([level, level, PRICES["vertical"], tip, tip, PRICES["yaw"]])


@numba.njit
def _bound(multiplier, wrench, ends, before, low, high, turn, cone, best):
    """What is lost at least, by weak duality: the multiplier's product with the wrench, less the most that the cables make of it."""
    total = 0.0
    for k in range(6):
        total += multiplier[k] * wrench[k]
    for i in range(ends.shape[0]):
        rx, ry, rz = ends[i]
        x = -(multiplier[0] + multiplier[4] * rz - multiplier[5] * ry)
        y = -(multiplier[1] + multiplier[5] * rx - multiplier[3] * rz)
        z = -(multiplier[2] + multiplier[3] * ry - multiplier[4] * rx)
        size = math.sqrt(x * x + y * y + z * z)
        if size > 0.0:
            far = farthest(
                x / size,
                y / size,
                z / size,
                before[i, 0],
                before[i, 1],
                before[i, 2],
                turn,
                cone,
                best,
            )
            total -= size * far * (high[i] if far > 0.0 else low[i])
    return total


@numba.njit
def _bounds(which, multipliers, wrenches, ends, before, low, high, turn, cone, prices, tries, out):
    """The best bound near each multiplier, by a search that keeps what is better."""
    best = np.zeros(3)
    trial = np.zeros(6)
    for k in range(which.shape[0]):
        c = which[k]
        at = multipliers[c].copy()
        now = _bound(at, wrenches[c], ends[c], before[c], low, high, turn, cone, best)
        step = 0.1
        np.random.seed(k)  # noqa: NPY002  # what compiled code has
        for _ in range(tries):
            for m in range(6):
                trial[m] = at[m] + step * prices[m] * np.random.normal()  # noqa: NPY002
                trial[m] = min(max(trial[m], -prices[m]), prices[m])
            value = _bound(trial, wrenches[c], ends[c], before[c], low, high, turn, cone, best)
            if value > now:
                now, at[:] = value, trial
                step = min(1.5 * step, 0.3)
            else:
                step = max(0.9 * step, 1e-5)
        out[k] = now


def bounds(
    part: SafeWrench, team: Team, what: Asked, answers: Run, which: Array, tries: int
) -> Array:
    """What is lost at least in these cycles, as :func:`loss` counts it."""
    share = MASS * team.gravity / team.n
    arm = float(np.abs(team.levers).max())
    along = answers.pulls / np.linalg.norm(answers.pulls, axis=2, keepdims=True)
    start, _ = part.formation(team)
    before = np.concatenate([start[None], along[:-1]])
    wrenches = np.concatenate([what.force / share, possible(team, what) / (share * arm)], axis=1)
    out = np.zeros(len(which))
    _bounds(
        which, answers.multipliers, wrenches, places(team, what.measured) / arm, before,
        part.tension_floors(team) / share, part.tension_caps(team) / share, part.turn_rate(team) * PERIOD,
        math.radians(part.max_cone_deg), prices_of(), tries, out,
    )  # fmt: skip
    return out


def violations(part: SafeWrench, team: Team, what: Asked, pulls: Array) -> dict[str, float]:
    """How far any answer is beyond each limit: N, degrees, m; negative where all are within."""
    tensions = np.linalg.norm(pulls, axis=2)
    along = pulls / np.maximum(tensions, 1e-12)[..., None]  # some leave cables slack
    start, _ = part.formation(team)
    before = np.concatenate([start[None], along[:-1]])
    turned = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(along - before, axis=2), 1.0))
    ends = places(team, what.attitude)
    drones = ends - team.cable_lengths[:, None] * along
    i, j = np.triu_indices(team.n, k=1)
    sizes = part.drone_distances(team)
    apart = np.linalg.norm((drones[:, i] - drones[:, j]) / [1.0, 1.0, part.downwash], axis=2)
    outs = outward(team)
    turns = np.array([matrix_of(q) for q in what.attitude])
    out = np.einsum("kij,nj->kni", turns, outs)
    boxed = np.any(outs != 0.0, axis=1)
    surface = np.degrees(np.arcsin(np.clip(-np.sum(out * along, axis=2)[:, boxed], -1.0, 1.0)))
    rods = min(
        (
            rod_distance(ends[:, a], drones[:, a], ends[:, b], drones[:, b]).min()
            for a in range(team.n)
            for b in range(a)
        ),
        default=math.inf,
    )
    found = {
        "tension, N": max(
            float((part.tension_floors(team) - tensions).max()),
            float((tensions - part.tension_caps(team)).max()),
        ),
        "cone, deg": float(np.degrees(np.arccos(np.clip(-along[..., 2], -1.0, 1.0))).max())
        - part.max_cone_deg,
        "turn, deg": math.degrees(float(turned.max()) - part.turn_rate(team) * PERIOD),
        "drones, m": float((0.5 * (sizes[i] + sizes[j]) - apart).max()),
        "cables, m": part.gap(team) - float(rods),
        "box, deg": part.box_deg - float(surface.min(initial=math.inf)),
    }
    if np.isfinite(part.thrust_limits(team)).any():
        ends_motion = what.acceleration[:, None, :] + np.array([0.0, 0.0, team.gravity])
        thrust = np.linalg.norm(team.masses[:, None] * ends_motion - pulls, axis=2)
        found["thrust, N"] = float((thrust - part.thrust_limits(team)).max())
    return found


def rod_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distances (k,) between segments a-b and c-d, by the four ends and the common perpendicular."""
    best = np.full(len(a), np.inf)
    for p, (q, r) in ((a, (c, d)), (b, (c, d)), (c, (a, b)), (d, (a, b))):
        u = r - q
        s = np.clip(np.sum((p - q) * u, axis=1) / np.sum(u * u, axis=1), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(p - q - s[:, None] * u, axis=1))
    u, v = b - a, d - c
    normal = np.cross(u, v)
    square = np.maximum(np.sum(normal * normal, axis=1), 1e-300)
    s = np.sum(np.cross(c - a, v) * normal, axis=1) / square
    t = np.sum(np.cross(c - a, u) * normal, axis=1) / square
    inside = (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    return np.where(inside, np.abs(np.sum((c - a) * normal, axis=1)) / np.sqrt(square), best)


def part_of(kind: str, n: int) -> AllocatorPart:
    """An allocator with its defaults; the safe one keeps drones apart."""
    return judge_of(n) if kind == SAFE else find("allocation", kind)()


def measured(kind: str, n: int, case: str, cycles: int) -> dict[str, Any]:
    """One row, but for its times."""
    team, part = team_of(n), part_of(kind, n)
    what = asked(case, cycles, team, judge_of(n).turn_rate(team))
    answers = run(part, team, what)
    miss = missed(team, what, answers.pulls)
    which = np.flatnonzero(np.abs(miss).max(axis=1) > MISSED)
    statuses = answers.state[:, 0]
    return {
        "kind": kind,
        "n": n,
        "case": case,
        "cycles": cycles,
        "iterations": float(answers.state[:, 1].mean()),
        "most_iterations": int(answers.state[:, 1].max()),
        "missed": len(which),
        **(proofs(team, what, answers, miss, which) if kind == SAFE and n > 2 else {}),
        "not_converged": int(np.sum(statuses == Status.ITERATION_LIMIT)),
        "recovering": int(np.sum(statuses == Status.RECOVERING)),
        "failed": int(np.sum(statuses == Status.NUMERICAL_FAILURE)),
        **violations(judge_of(n), team, what, answers.pulls),
    }


def proofs(team: Team, what: Asked, answers: Run, miss: Array, which: Array) -> dict[str, Any]:
    """How many of the misses nothing proves, and how much more is lost than what is proved."""
    least = bounds(judge_of(team.n), team, what, answers, which, 300)
    lost = loss(team, miss[which])
    hard = np.flatnonzero((least <= MISSED) | (lost > 1.1 * least))
    least[hard] = bounds(judge_of(team.n), team, what, answers, which[hard], 20_000)
    proved = least > MISSED
    ratios = lost[proved] / least[proved]
    return {
        "avoidable": int(np.sum(~proved)),
        "avoidable_loss": float(lost[~proved].max(initial=0.0)),
        "loss": float(lost[proved].sum() / least[proved].sum()) if proved.any() else 1.0,
        "over_1_1": int(np.sum(ratios > 1.1)),
    }


def timed(kind: str, n: int, case: str, cycles: int) -> list[float]:
    """Times of a call, us: median, 99th percentile and worst."""
    team, part = team_of(n), part_of(kind, n)
    what = asked(case, cycles, team, judge_of(n).turn_rate(team))
    times = run(part, team, what).times
    for _ in range(REPEATS - 1):  # the same calls again: what is longer was interrupted
        np.minimum(times, run(part, team, what).times, out=times)
    return [float(q) * 1e-3 for q in np.quantile(times, [0.5, 0.99, 1.0])]


def share(count: int, cycles: int) -> str:
    """In percent."""
    return "0" if count == 0 else f"{100.0 * count / cycles:.3f}"


def interval(count: int, cycles: int) -> str:
    """The same with that of Clopper and Pearson at 95 %, as if cycles were independent."""
    low = beta.ppf(0.025, count, cycles - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, cycles - count)
    return f"{share(count, cycles)} ({100.0 * low:.3f}-{100.0 * high:.3f})"


def cases(args: argparse.Namespace) -> list[tuple[str, int, str]]:
    """Allocator, drones and case of every row that is asked for."""
    return [
        (kind, n, case)
        for kind in args.kinds or CYCLES
        for n in args.drones or [*DRONES, *(MORE if kind == SAFE else [])]
        for case in args.cases or CASES
    ]


def line_of(row: dict[str, Any]) -> list[str]:
    """A row of the table."""
    metres = max(value for name, value in row.items() if name.endswith(", m"))
    limits = ("tension, N", "turn, deg", "cone, deg", "box, deg", "drones, m", "cables, m")
    broken = [
        f"{name.split(',')[0]} {row[name]:.2g}{name.split(',')[1]}"
        for name in limits
        if row[name] > 1e-6
    ]
    proved = "avoidable" in row
    return [
        str(row["n"]),
        row["case"],
        f"{row['iterations']:.2f} / {row['most_iterations']}",
        share(row["missed"], row["cycles"]),
        interval(row["avoidable"], row["cycles"]) if proved else "-",
        f"{row['loss']:.3f}" if proved and row["missed"] else "-",
        f"{-1e3 * metres:+.1f} mm",
        ", ".join(broken) or "kept",
        " / ".join(f"{us:.1f}" for us in row["us"]) if row.get("us") else "-",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fly", action="store_true")
    parser.add_argument("--times", action="store_true")
    parser.add_argument("--cycles", type=int)
    parser.add_argument("--kinds", nargs="*")
    parser.add_argument("--drones", type=int, nargs="*")
    parser.add_argument("--cases", nargs="*")
    args = parser.parse_args()
    if args.cycles:
        for case in cases(args):
            print(measured(*case, args.cycles), flush=True)
        return
    file = Path(__file__).with_suffix(".json")
    rows = {
        (row["kind"], row["n"], row["case"]): row
        for row in json.loads(file.read_text(encoding="utf-8"))
    }
    for case in cases(args) if args.fly or args.times else []:
        row, cycles = rows.get(case, {}), CYCLES[case[0]]
        if args.fly:
            row = {**measured(*case, cycles), "us": row.get("us")}
        if args.times:
            row["us"] = timed(*case, cycles)
        rows[case] = row
        file.write_text(json.dumps(list(rows.values()), indent=1, allow_nan=False) + "\n")
        print(*line_of(row), sep=" | ", flush=True)
    header = [
        "n", "case", "iterations, mean / most", "missed, %", "avoidable, % (95 %)", "loss", "closest", "limits", "us, median / 99 % / worst",
    ]  # fmt: skip
    order = sorted(rows.values(), key=lambda row: (row["n"], CASES.index(row["case"])))
    for kind in CYCLES:
        block, own = f"rigid-{kind}", [line_of(row) for row in order if row["kind"] == kind]
        fill("theory/rigid-allocation.md", block, table(header, own))


if __name__ == "__main__":
    main()
