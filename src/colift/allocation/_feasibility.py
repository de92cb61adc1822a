"""Can these drones, within these limits, hold this load? Formations, widest angles, named conflicts.

For set-up and analysis, in plain NumPy; nothing here runs in a control cycle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colift.geometry import pairwise_angles, ring
from colift.team import Team

if TYPE_CHECKING:
    from colift.allocation.safe import Safe

Array = NDArray[np.float64]

STEPS = 400
"""Ascent steps from one start of the search for a wide formation."""
SEARCHED = 128
"""Most cables for which a formation is searched."""
STARTS = 6
"""Random starts of that search, after the regular ones."""


@dataclass(frozen=True)
class Feasibility:
    """What a team can hold in hover within the limits.

    Attributes
    ----------
    ok : bool
        No conflict, and the load's weight lies inside ``(lightest, heaviest)``.
    lightest, heaviest : float
        Least and largest weight that the cables can balance in hover, N.
    margin : float
        ``heaviest / weight``; below 1 the load cannot be lifted.
    widest_angle : float
        Widest least angle between two cables that was found for this cone, rad.
    most_cables : tuple of int
        How many cables the least angle allows in this cone: found, and never more than.
    conflicts : tuple of str
        Pairs of limits that cannot hold together, by name and value.
    directions : (n, 3) array
        A formation in hover within all limits, drone to load (the least bad one after a conflict).
    tensions : (n,) array
        Its tensions, N.

    """

    ok: bool
    lightest: float
    heaviest: float
    margin: float
    widest_angle: float
    most_cables: tuple[int, int]
    conflicts: tuple[str, ...]
    directions: Array
    tensions: Array


def feasibility(team: Team, settings: Safe) -> Feasibility:
    """Judge hover by the allocator itself: ask it for the load's weight, for nothing, for too much.

    Where the force cannot be had, the allocator answers with the nearest it can do, which is the limit
    wanted here (to within its barrier, about one part in a thousand).
    """
    from colift.allocation.safe import SafeAllocator

    conflicts = [message for _, message in conflicts_of(team, settings)]
    cone, least = math.radians(settings.max_cone_deg), math.radians(settings.min_angle_deg)
    start, angle = widest_formation(team.n, cone, enough=least + math.radians(2.0))
    relaxed = settings.model_copy(update={"settling": 0.02, "max_rate": 50.0})
    weight = team.load_mass * team.gravity
    held = []
    for wanted in (weight, 0.0, 10.0 * (weight + float(np.sum(settings.tension_caps(team.n))))):
        allocator = SafeAllocator.unchecked(team, relaxed)
        allocator.dt = 0.01
        allocator.reset(directions=start)
        for _ in range(300):
            answer = allocator.allocate([0.0, 0.0, wanted])
        held.append((-float(answer.tensions @ answer.directions[:, 2]), answer))
    (reached, hover), (lightest, _), (heaviest, _) = held
    if not conflicts and abs(reached - weight) > 1e-6 * weight:
        what = "heavier" if weight > reached else "lighter"
        conflicts.append(
            f"the load's weight of {weight:.4g} N is {what} than what the limits allow in hover "
            f"({lightest:.4g} to {heaviest:.4g} N)"
        )
    return Feasibility(
        ok=not conflicts,
        lightest=lightest,
        heaviest=heaviest,
        margin=heaviest / weight,
        widest_angle=max(angle, widest_angle(team.n, cone)),
        most_cables=most_cables(least, cone),
        conflicts=tuple(conflicts),
        directions=hover.directions,
        tensions=hover.tensions,
    )


def conflicts_of(team: Team, settings: Safe) -> list[tuple[str, str]]:
    """Limits that cannot hold together, as ``(field, message)``; only what is certain and cheap."""
    n, weight = team.n, team.load_mass * team.gravity
    found = []
    cone = math.radians(settings.max_cone_deg)
    least = math.radians(settings.min_angle_deg)
    if n > 1:
        angle = packing_bound(n, cone)
        if angle >= least and n <= SEARCHED:
            angle = widest_formation(n, cone, enough=least)[1]
        if angle < least:
            found.append(
                (
                    "min_angle_deg",
                    f"min_angle_deg = {settings.min_angle_deg:g} conflicts with max_cone_deg = "
                    f"{settings.max_cone_deg:g}: {n} cables in that cone are at most "
                    f"{math.degrees(angle):.1f} degrees apart",
                )
            )
    most = float(np.sum(settings.tension_caps(n)))
    if most < weight:
        found.append(
            (
                "tension_max",
                f"tension_max (together {most:.4g} N) conflicts with the load's weight of {weight:.4g} N",
            )
        )
    lowest = float(np.sum(settings.tension_floors(n))) * math.cos(cone)
    if lowest > weight:
        found.append(
            (
                "tension_min",
                f"tension_min conflicts with the load's weight: even at max_cone_deg = "
                f"{settings.max_cone_deg:g} the cables pull {lowest:.4g} N upwards, more than {weight:.4g} N",
            )
        )
    return found


def spread_formation(n: int, cone: float, min_angle: float) -> Array:
    """Directions (n, 3), drone to load, at least ``min_angle`` apart in a cone of half-angle ``cone``, rad.

    One ring where that does, ring and centre or several rings beyond.

    Raises
    ------
    ValueError
        If no such formation is found; names both limits and the widest angle that was found.

    """
    best, angle = widest_formation(n, cone, enough=min_angle)
    if angle < min_angle:
        raise ValueError(
            f"min_angle {math.degrees(min_angle):.4g} deg conflicts with cone {math.degrees(cone):.4g} deg: "
            f"{n} cables in it are at most {math.degrees(angle):.1f} deg apart"
        )
    return best


def packing_bound(n: int, cone: float) -> float:
    """An angle (rad) that n cables in the cone cannot all keep: their caps would not fit side by side.

    Caps of half the least angle are disjoint and lie within the cone widened by as much.
    """
    low, high = 0.0, 2.0 * cone
    for _ in range(50):
        half = 0.25 * (low + high)
        fits = n * (1.0 - math.cos(half)) <= 1.0 - math.cos(min(cone + half, math.pi))
        low, high = (2.0 * half, high) if fits else (low, 2.0 * half)
    return high


def widest_angle(n: int, cone: float) -> float:
    """Widest least angle between n cables in a cone of half-angle ``cone``, rad; best found.

    Reproducible: the search starts from rings and from a fixed seed. n = 4 in 60 degrees: 75.5.
    """
    return widest_formation(n, cone)[1]


def most_cables(min_angle: float, cone: float) -> tuple[int, int]:
    """How many cables ``min_angle`` (rad) allows in the cone: found, and never more than; up to ``SEARCHED``."""
    found = 1
    while found < SEARCHED and widest_formation(found + 1, cone, enough=min_angle)[1] >= min_angle:
        found += 1
    bound = found
    while bound < SEARCHED and packing_bound(bound + 1, cone) >= min_angle:
        bound += 1
    return found, bound


@lru_cache(maxsize=64)
def _search(n: int, cone: float, enough: float) -> tuple[Array, float]:
    best, angle = ring(n, cone), -1.0
    for start in _starts(n, cone):
        found, reached = _spread(start, cone, enough)
        if reached > angle:
            best, angle = found, reached
        if angle >= enough:
            break
    return best, angle


def widest_formation(n: int, cone: float, *, enough: float = math.inf) -> tuple[Array, float]:
    """A formation of n cables in the cone and its least angle, rad; stops where that is ``enough``."""
    if n == 1:
        return ring(1, cone), math.pi
    single = ring(n, cone)
    angle = float(pairwise_angles(single).min())
    if angle >= enough or (n <= 5 and cone <= math.radians(60.0)):
        return single, angle
    best, angle = _search(n, cone, enough)
    return best.copy(), angle


def _starts(n: int, cone: float) -> Iterator[Array]:
    """A sunflower, rings with none, one or several cables inside, then random formations."""
    turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(n)
    yield _cap(np.linspace(0.0, 1.0, n), turn, cone)
    yield ring(n, cone)
    for inside in range(1, max(2, n // 2 + 1), max(1, n // 12)):
        if inside < n:
            inner = (
                ring(inside, 0.45 * cone, heading=math.pi / inside) if inside > 1 else ring(1, 0.0)
            )
            yield np.vstack([ring(n - inside, cone), inner])
    rng = np.random.default_rng(0)
    for _ in range(STARTS):
        yield _cap(rng.random(n), 2.0 * math.pi * rng.random(n), cone)


def _cap(share: NDArray[np.floating], azimuth: NDArray[np.floating], cone: float) -> Array:
    """Directions by azimuth (rad) and by the share of the cap's area that lies further inside."""
    height = 1.0 - share * (1.0 - math.cos(cone))
    radius = np.sqrt(1.0 - height**2)
    return -np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height])


def _spread(start: Array, cone: float, enough: float) -> tuple[Array, float]:
    """Repulsion with a power law that hardens, inside the cone; the best formation on the way."""
    x = _clip(start + 1e-4 * np.cos(np.arange(start.size)).reshape(start.shape), cone)
    best, angle = start, float(pairwise_angles(start).min())
    for k in range(STEPS):
        progress = k / STEPS
        power = 5.0 * 150.0**progress
        step = 0.15 * (0.002 / 0.3) ** progress
        squared = np.maximum(2.0 - 2.0 * (x @ x.T), 1e-12)
        np.fill_diagonal(squared, 9.0)
        nearest = float(squared.min())
        reached = 2.0 * math.asin(min(0.5 * math.sqrt(nearest), 1.0))
        if reached > angle:
            best, angle = x, reached
            if angle >= enough:
                break
        weights = (nearest / squared) ** power
        push = weights.sum(axis=1, keepdims=True) * x - weights @ x
        x = _clip(x + step * push / max(float(np.linalg.norm(push, axis=1).max()), 1e-12), cone)
    return best, angle


def _clip(x: Array, cone: float) -> Array:
    """Unit directions, those outside the cone moved to its rim."""
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    outside = -x[:, 2] < math.cos(cone)
    radius = np.maximum(np.hypot(x[:, 0], x[:, 1]), 1e-12)
    x[outside, :2] *= (math.sin(cone) / radius)[outside, None]
    x[outside, 2] = -math.cos(cone)
    return x
