"""What the safe allocator guarantees, shown: attacked alone, and flown beside the paper's allocator."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from colift.control.allocation.base import INFO_SIZE, AllocatorPart, Status, ask, unplanned
from colift.control.allocation.limits.feasibility import spread_formation
from colift.control.allocation.limits.reach import out_of_reach
from colift.control.allocation.safe import Safe
from colift.control.allocation.sqp import Sqp
from colift.flight.runner import run
from colift.kernel.jit import address_of, f8, i8, kernel, matrix, monotonic_ns, vector, void
from colift.kernel.math import shares
from colift.team import Team
from colift.team.geometry import Array, pairwise_angles
from colift.team.scaling import PAPER_DRONES, scaled_load, scaled_mu

if TYPE_CHECKING:
    from colift.flight.flight import Progress

PERIOD = 0.01
"""Control period of the attacks, s."""
GRAVITY = 9.81
SLICE = 5_000
"""Cycles that are judged at a time; memory does not grow with their number."""
ANGLE_TOLERANCE = 0.1
"""By how much a wanted angle may fall short of the limit, degrees."""
BALANCE_TOLERANCE = 1e-8
"""Error of the force balance that must be told by the status, N."""
DISTANCE_TOLERANCE = 1e-9
"""By how much a distance may fall short of its limit, m: rounding."""
AVOIDABLE = 1e-3
"""Largest share of cycles that may miss part of a force that is not proved to be out of reach."""
ACTUAL_MARGIN = 3.0
"""By how much actual angles may fall short of the limit in flight, degrees."""
CONES = {2: 35.0, 3: 35.0, 4: 35.0, 6: 45.0, 8: 60.0, 12: 65.0, 16: 70.0, 64: 70.0}
"""Half-angle of the cone in which the attacks start, degrees."""
LEAST_ANGLES = {12: 25.0, 16: 25.0, 20: 22.0, 24: 20.0, 64: 11.0}
"""Least angle asked for where 30 degrees are too wide for the team, degrees."""


@kernel(
    void(
        i8,
        matrix,
        matrix,
        f8,
        vector,
        vector,
        vector,
        matrix,
        vector,
        matrix,
        matrix,
    )
)
def _attack(  # type: ignore[no-untyped-def]
    allocate, forces, accelerations, dt, params, memory, tensions, directions, info, reference, out
):
    """Call an allocator once per force; a row of ``out``: status, ns, tensions (n), directions (3n)."""
    n = tensions.shape[0]
    beside = unplanned(n)
    for k in range(forces.shape[0]):
        for m in range(3):
            reference[2, m] = accelerations[k, m]
        begin = monotonic_ns()
        out[k, 0] = ask(
            allocate, forces[k], reference, beside, dt, params, memory, tensions, directions, info
        )
        out[k, 1] = monotonic_ns() - begin
        for i in range(n):
            out[k, 2 + i] = tensions[i]
            for m in range(3):
                out[k, 2 + n + 3 * i + m] = directions[i, m]


def _smooth(t: Array, rng: np.random.Generator) -> Array:
    return np.column_stack([3 * np.sin(1.9 * t), 3 * np.sin(1.4 * t), np.sin(1.1 * t)])


def _noise(t: Array, rng: np.random.Generator) -> Array:
    slow = np.column_stack([np.sin(0.6 * t), 0 * t, 0 * t])
    return np.asarray(slow + 0.3 * rng.standard_normal((len(t), 3)))


def _coloured(t: Array, rng: np.random.Generator) -> Array:
    keep = math.exp(-PERIOD / 0.3)
    shocks = math.sqrt(1 - keep**2) * rng.standard_normal((len(t), 3))
    states = np.zeros((len(t), 3))
    for k in range(1, len(t)):
        states[k] = keep * states[k - 1] + shocks[k]
    return states


def _steps(t: Array, rng: np.random.Generator) -> Array:
    levels = rng.uniform(-3, 3, (len(t) // 50 + 1, 3))
    return np.repeat(levels, 50, axis=0)[: len(t)]


def _adversary(t: Array, rng: np.random.Generator) -> Array:
    lengths = np.cumsum(rng.random(len(t)) < 0.05)
    levels = rng.choice([-1.0, 0.0, 1.0], (lengths[-1] + 1, 3)) * [3.0, 3.0, 4.0]
    return np.asarray(levels[lengths] + 0.3 * rng.standard_normal((len(t), 3)))


FAMILIES: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "smooth": _smooth,
    "noise": _noise,
    "coloured": _coloured,
    "steps": _steps,
    "adversary": _adversary,
}
"""Wanted accelerations of the load (rows, 3), m/s^2, at the given times."""


@dataclass(frozen=True)
class Attack:
    """How one allocator stood one family of forces; angles in degrees, times in us.

    ``limits_broken_by`` is the worst excess over any other limit, N for tensions and rad for cone and turn.
    ``yield_share`` of the cycles do not give the whole force; ``avoidable_share`` are those of them whose
    force is not *proved* to be out of reach, see :mod:`colift.control.allocation.limits.reach`. ``drone_room`` and ``cable_room``
    are the smallest distances less their limits, m; None where none are asked for.
    """

    n: int
    family: str
    allocator: str
    cycles: int
    least_angle: float
    smallest_angle: float
    limits_broken_by: float
    unflagged_imbalance: int
    yield_share: float
    avoidable_share: float
    not_finite: int
    median_us: float
    p99_us: float
    drone_room: float | None = None
    cable_room: float | None = None

    @property
    def holds(self) -> bool:
        """Whether every promise was kept in every cycle."""
        return (
            self.smallest_angle >= self.least_angle - ANGLE_TOLERANCE
            and self.limits_broken_by <= 1e-6
            and min(self.drone_room or 0.0, self.cable_room or 0.0) >= -DISTANCE_TOLERANCE
            and self.unflagged_imbalance == 0
            and self.avoidable_share <= AVOIDABLE
            and self.not_finite == 0
        )


def problem(n: int) -> tuple[Team, Safe]:
    """Team and limits of the attacks: load and ``mu`` keep the paper's cone from four drones on; fewer carry its load."""
    size = max(n, PAPER_DRONES)
    team = Team.uniform(n, load_mass=scaled_load(size))
    return team, Safe(mu=scaled_mu(size), min_angle_deg=LEAST_ANGLES.get(n, 30.0)).filled(team)


CABLES = (1.0, 0.6, 1.4, 0.8, 1.2)
"""Lengths of the cables where distances are asked for, in turn, m."""
CLEARANCE = 0.2
"""Distance from others' cables that is asked for then, m."""


def metric_problem(n: int) -> tuple[Team, Safe]:
    """The same with cables of :data:`CABLES` and distances in metres, for which the angle leaves room: half of it is asked for.

    On equal cables of 1 m the distance would be nine tenths of the chord of the other problem's angle.
    """
    team, safe = problem(n)
    team = replace(team, cable_lengths=np.resize(CABLES, n))
    apart = 0.9 * 2.0 * math.sin(0.5 * math.radians(safe.min_angle_deg))
    angle = 0.5 * safe.min_angle_deg
    changes = {"min_distance": apart, "cable_distance": CLEARANCE, "min_angle_deg": angle}
    return team, safe.model_copy(update=changes)


def metric_parts(n: int) -> tuple[Safe, Safe]:
    """The allocator of :func:`metric_problem`, and the same without its distances."""
    safe = metric_problem(n)[1]
    return safe, safe.model_copy(update={"min_distance": 0.0, "cable_distance": 0.0})


class Answers(NamedTuple):
    """A slice of an attack: one row per cycle.

    ``forces`` (k, 3), N; ``before`` (k, n, 3), directions before the cycle; ``tensions`` (k, n), N; ``directions``
    (k, n, 3); ``status`` (k,); ``times`` (k,), us.
    """

    forces: Array
    before: Array
    tensions: Array
    directions: Array
    status: Array
    times: Array

    def missing(self) -> Array:
        """Size (k,) of the part of each force that was not given, N."""
        given = np.einsum("ki,kim->km", self.tensions, self.directions)
        return np.asarray(np.linalg.norm(given + self.forces, axis=1))


def answers(
    n: int,
    family: str,
    cycles: int,
    part: AllocatorPart,
    *,
    seed: int = 0,
    period: float = PERIOD,
    metres: bool = False,
) -> Iterator[Answers]:
    """Send one seeded family of forces through one allocator, called every ``period`` (s).

    ``metres``: of the team that is asked for distances, after it has been led to within them in hover.
    """
    team, limits = metric_problem(n) if metres else problem(n)
    rng = np.random.default_rng([seed, n, list(FAMILIES).index(family)])
    least = math.radians(limits.min_angle_deg + 1.0)
    cone = math.radians(CONES.get(n, 70.0))
    directions = np.ascontiguousarray(spread_formation(n, cone, least))
    if metres:
        directions = np.ascontiguousarray(part.hover(team, directions, period).directions)
    tensions, info = np.zeros(n), np.zeros(INFO_SIZE)
    params, memory = part.params(team), part.memory(team)
    every = round(period / PERIOD)
    for begin in range(0, cycles, SLICE):
        k = np.arange(every * begin, every * min(begin + SLICE, cycles), dtype=np.float64)
        accelerations = np.ascontiguousarray(FAMILIES[family](PERIOD * k, rng)[::every])
        forces = np.ascontiguousarray(
            team.load_mass * (accelerations + np.array([0.0, 0.0, GRAVITY]))
        )
        out = np.zeros((len(forces), 2 + 4 * n))
        first = directions.copy()
        _attack(
            address_of(type(part).kernel), forces, accelerations, period, params, memory, tensions, directions,
            info, np.zeros((4, 3)), out,
        )  # fmt: skip
        alpha = out[:, 2 + n :].reshape(-1, n, 3)
        before = np.concatenate([first[None], alpha[:-1]])
        yield Answers(forces, before, out[:, 2 : 2 + n], alpha, out[:, 0], out[:, 1] / 1e3)


def attack(
    n: int, family: str, cycles: int, part: AllocatorPart, *, seed: int = 0, metres: bool = False
) -> Attack:
    """Send one seeded family of forces through one allocator and judge every answer; ``metres``: distances too."""
    team, limits = metric_problem(n) if metres else problem(n)
    rooms = np.full(2, np.inf)
    lowest, highest = limits.tension_floors(team), limits.tension_caps(team)
    turn = limits.turn_rate(team) * PERIOD
    smallest, broken, unflagged, yields, avoidable, bad = 180.0, 0.0, 0, 0, 0, 0
    times = []
    reach = (
        lowest,
        highest,
        turn,
        math.radians(limits.max_cone_deg),
    )
    flagged = [int(s) for s in Status if not s.ok]
    for found in answers(n, family, cycles, part, seed=seed, metres=metres):
        T, alpha, previous = found.tensions, found.directions, found.before
        bad += int(np.count_nonzero(~(np.isfinite(T).all(1) & np.isfinite(alpha).all((1, 2)))))
        smallest = min(smallest, float(np.degrees(pairwise_angles(alpha).min())))
        if metres:
            rooms = np.minimum(rooms, _rooms(team, limits, alpha))
        chord = np.linalg.norm(alpha - previous, axis=2)
        turned = 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
        over = (
            np.max(T) - float(np.max(highest)),
            float(np.min(lowest)) - np.min(T),
            np.max(np.arccos(np.clip(-alpha[..., 2], -1, 1))) - math.radians(limits.max_cone_deg),
            np.max(turned) - turn,
        )
        broken = max(broken, *(float(x) for x in over))
        told = np.isin(found.status, flagged)
        short = found.missing() > BALANCE_TOLERANCE
        unflagged += int(np.count_nonzero(short & ~told))
        yields += int(np.count_nonzero(short))
        proved = out_of_reach(found.forces[short], previous[short], *reach)
        avoidable += int(np.count_nonzero(~proved))
        times.append(found.times)
    microseconds = np.concatenate(times)
    return Attack(
        n=n,
        family=family,
        allocator=type(part).__name__.lower(),
        cycles=cycles,
        least_angle=limits.min_angle_deg,
        smallest_angle=smallest,
        limits_broken_by=broken,
        unflagged_imbalance=unflagged,
        yield_share=yields / cycles,
        avoidable_share=avoidable / cycles,
        not_finite=bad,
        median_us=float(np.median(microseconds)),
        p99_us=float(np.percentile(microseconds, 99)),
        drone_room=float(rooms[0]) if metres else None,
        cable_room=float(rooms[1]) if metres else None,
    )


def _rooms(team: Team, limits: Safe, directions: Array) -> Array:
    """Smallest distance (2,) of two drones, and of a drone from another's cable, less its limit, m, in answers (k, n, 3)."""
    least = np.full(2, np.inf)
    asked = limits.drone_distances(team)
    apart = 0.5 * (asked[:, None] + asked[None, :])
    clear = limits.cable_distances(team)[:, None]
    rows = max(1, 200_000 // team.n**2)  # memory grows with the pairs
    for begin in range(0, len(directions), rows):
        drones, cables = limits.distances(team, directions[begin : begin + rows])
        found = [np.min(drones - apart), np.min(cables - clear)]
        least = np.minimum(least, found)
    return least


BELOW = [[0.5, 0.0, -0.8], [-0.3, 0.5, -0.8], [-0.3, -0.5, -0.8], [0.3, 0.1, 0.8]]
SCALED = {"allocation.kind": "safe", "allocation.mu_scaling": "weight"}

FLIGHTS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "spiral from rest, cables 7 deg apart": ("from-rest", {}, {}),
    "one drone starts below the load": (
        "paper-spiral",
        {"start.directions": BELOW, "world.ground": "none"},
        {},
    ),
    "figure eight at 5 m/s^2": (
        "figure-eight",
        {"reference.length": 1.4, "reference.width": 0.7, "reference.period": 4.2},
        {},
    ),
    "four drones, then three": ("four-to-three", {}, {}),
    "eight drones, then seven": ("eight-to-seven", {}, {}),
    "three drones, then four": ("three-to-four", {}, {}),
    "twice the load": ("paper-spiral", {"load.mass": 0.45}, SCALED),
    "four times the load": ("paper-spiral", {"load.mass": 0.9}, SCALED),
    "one hour of spiral": (
        "paper-spiral",
        {"timing.duration": 3600.0, "timing.recording": 0.05},
        {},
    ),
}
"""Flights by title: mission, changes for both allocators, further changes for the safe one.

Both fly with the position controller that feeds the cables' motion forward: it is better for both.
"""

UNSETTLED = 5.0
"""Time for which a start that breaks the limits may go on doing so, s."""


@dataclass(frozen=True)
class Flown:
    """One flight with one allocator; lengths in m, angles in degrees."""

    title: str
    allocator: str
    outcome: str
    smallest_angle: float
    smallest_angle_later: float
    tracking_rms: float
    tracking_max: float
    slack_time: float
    failures: int
    limited: int

    @property
    def survives(self) -> bool:
        """Whether the flight ended, stayed near its path and kept its cables from meeting."""
        return self.outcome == "completed" and self.tracking_max < 0.2 and self.smallest_angle > 5.0

    @property
    def separated(self) -> bool:
        """Whether actual angles kept the limit less the margin, once the start was settled."""
        return self.smallest_angle_later >= 30.0 - ACTUAL_MARGIN


def fly(title: str, allocator: str, *, quick: bool = False) -> Flown:
    """Fly one of :data:`FLIGHTS` with the safe allocator or the paper's."""
    mission, changes, safe_only = FLIGHTS[title]
    overrides = {
        "position_control.kind": "feed-forward",
        **changes,
        "allocation.kind": allocator,
        **(safe_only if allocator == "safe" else {}),
    }
    if quick and "timing.duration" in overrides:
        overrides["timing.duration"] = 60.0
    flown = run(mission, overrides=overrides)
    r, m = flown.recording, flown.metrics
    later = r["directions"][r.time >= UNSETTLED]
    return Flown(
        title=title,
        allocator=allocator,
        outcome=r.outcome,
        smallest_angle=m["min_angle_deg"],
        smallest_angle_later=float(np.degrees(np.nanmin(pairwise_angles(later))))
        if len(later)
        else math.nan,
        tracking_rms=m["tracking_rms_m"],
        tracking_max=m["tracking_max_m"],
        slack_time=m["slack_time_s"],
        failures=int(m["allocator_failures"]),
        limited=int(m["allocator_limited"]),
    )


def show_all(
    sizes: list[int], cycles: int, *, quick: bool = False, progress: Progress | None = None
) -> dict[str, Any]:
    """Every attack and every flight, as plain data with verdicts."""
    jobs = 2 * len(sizes) * len(FAMILIES) + len(FLIGHTS)
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / jobs)

    attacks, metric, flights = [], [], []
    for n in sizes:
        team, safe = problem(n)
        for family in FAMILIES:
            for part in (safe, Sqp(mu=safe.penalty(team))):
                found = attack(n, family, cycles, part)
                attacks.append({**asdict(found), "holds": found.holds})
            tick()
    for n in sizes:
        for family in FAMILIES:
            for part in metric_parts(n):
                found = attack(n, family, cycles, part, metres=True)
                metric.append({**asdict(found), "holds": found.holds})
            tick()
    for title in FLIGHTS:
        ours, paper = (fly(title, name, quick=quick) for name in ("safe", "sqp"))
        for flown in (ours, paper):
            verdict = {"survives": flown.survives, "separated": flown.separated}
            flights.append({**asdict(flown), **verdict, "verdict": _verdict(ours, paper)})
        tick()
    return {"cycles": cycles, "attacks": attacks, "distances": metric, "flights": flights}


def _verdict(ours: Flown, paper: Flown) -> str:
    """In words: does the safe allocator fly, keep apart, and track no worse than the paper's."""
    faults = []
    if not ours.survives:
        faults.append(f"does not survive: {ours.outcome}, {100 * ours.tracking_max:.0f} cm off")
    if not ours.separated:
        faults.append(f"actual angle falls to {ours.smallest_angle_later:.1f} deg")
    if paper.survives and ours.tracking_rms > 1.05 * paper.tracking_rms:
        worse = ours.tracking_rms / paper.tracking_rms
        faults.append(f"tracks {worse:.1f} times worse than the paper's allocator")
    words = "; ".join(faults) or "holds"
    return words if paper.survives else f"{words}; the paper's allocator does not survive"


def _percent(share: float, cycles: int) -> str:
    """A share of cycles in percent, its interval behind it."""
    low, high = shares.interval(round(share * cycles), cycles)
    return f"{100 * share:.3f} ({shares.percent(low, high, 3).removesuffix(' %')})"


def _with_distances(result: dict[str, Any]) -> tuple[str, list[str], list[list[str]]]:
    """Title, header and rows of the attacks on distances."""
    rows = [
        [
            str(ours["n"]),
            ours["family"],
            *(
                f"{1e3 * found[room]:.0f}"
                for room in ("drone_room", "cable_room")
                for found in (ours, angles)
            ),
            _percent(ours["yield_share"], ours["cycles"]),
            _percent(ours["avoidable_share"], ours["cycles"]),
            *(f"{found['median_us']:.1f} / {found['p99_us']:.1f}" for found in (ours, angles)),
            "holds" if ours["holds"] else "BROKEN",
        ]
        for ours, angles in zip(result["distances"][::2], result["distances"][1::2], strict=True)
    ]
    return (
        "With least distances, cables of 0.6 to 1.4 m: smallest distance of drones from each other (taller ellipsoids) and from "
        "others' cables less its limit, mm, with and without them",
        [
            "n", "forces", "drones", "angles only", "cables", "angles only", "yield %", "avoid %", "median / p99",
            "angles only", "limits",
        ],
        rows,
    )  # fmt: skip


def tables(result: dict[str, Any]) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """The result as titled tables: header and rows of text."""
    rows = []
    for ours, paper in zip(result["attacks"][::2], result["attacks"][1::2], strict=True):
        rows.append(
            [
                str(ours["n"]),
                ours["family"],
                f"{ours['least_angle']:.0f}",
                f"{ours['smallest_angle']:.2f}",
                f"{paper['smallest_angle']:.2f}",
                _percent(ours["yield_share"], ours["cycles"]),
                _percent(ours["avoidable_share"], ours["cycles"]),
                f"{ours['median_us']:.1f}",
                f"{ours['p99_us']:.1f}",
                "holds" if ours["holds"] else "BROKEN",
            ]
        )
    yield (
        f"Allocators alone, {result['cycles']} cycles of 10 ms each: angles in degrees, times in us; shares with "
        "their 95 % interval, as if cycles were independent",
        [
            "n",
            "forces",
            "limit",
            "safe",
            "paper's",
            "yield %",
            "avoid %",
            "median",
            "p99",
            "limits",
        ],
        rows,
    )
    yield _with_distances(result)
    rows = [
        [
            f["title"],
            f["allocator"],
            f"{f['smallest_angle']:.1f}",
            f"{f['smallest_angle_later']:.1f}",
            f"{100 * f['tracking_rms']:.2f}",
            f"{100 * f['tracking_max']:.1f}",
            f"{f['slack_time']:.2f}",
            f["verdict"] if f["allocator"] == "safe" else "",
        ]
        for f in result["flights"]
    ]
    yield (
        "In flight: actual angles in degrees (whole flight, after 5 s), tracking in cm, slack in s",
        ["flight", "with", "angle", "later", "RMS", "max", "slack", "verdict"],
        rows,
    )
