"""Can these drones, within these limits, hold this load? Formations, widest angles, named conflicts.

For set-up and analysis, in plain NumPy. Only :func:`cannot_hold`, which is bounded, is asked in flight.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.limits import distance
from colift.control.allocation.limits.heaviest import Limits, best_tensions, extreme
from colift.control.allocation.limits.hover import hovering
from colift.errors import SettingError
from colift.team import Team
from colift.team.geometry import pairwise_angles, ring

if TYPE_CHECKING:
    from colift.control.allocation.base import Motors
    from colift.control.allocation.safe import Safe

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
        No conflict: the allocator holds the load's weight within the limits, and the motors can follow.
    lightest, heaviest : float
        Least and largest weight that the cables can balance in hover, N, in the best formation that was found.
    margin : float
        ``heaviest / weight``; below 1 the load cannot be lifted.
    binding : tuple of Binding
        What keeps the load from being heavier, the costliest first.
    widest_angle : float
        Widest least angle between two cables that was found for this cone, rad.
    most_cables : tuple of int
        How many cables the least angle allows in this cone: found, and never more than.
    conflicts : tuple of str
        Why not, by the names and values of the limits.
    directions : (n, 3) array
        The allocator's formation in hover, drone to load (the least bad one after a conflict).
    tensions : (n,) array
        Its tensions, N.
    thrusts, thrust_limits : (n,) array
        Thrust that each drone needs in it, and the most that it can give, N (inf where nothing limits it).
    drone_distances, cable_distances : (n, n) array
        Of the drones from each other in it, with heights counted as parts of ``downwash``, and of drone i from cable j, m.

    """

    ok: bool
    lightest: float
    heaviest: float
    margin: float
    binding: tuple[Binding, ...]
    widest_angle: float
    most_cables: tuple[int, int]
    conflicts: tuple[str, ...]
    directions: Array
    tensions: Array
    thrusts: Array
    thrust_limits: Array
    drone_distances: Array
    cable_distances: Array


@dataclass(frozen=True)
class Binding:
    """A limit that keeps the load from being heavier.

    Attributes
    ----------
    path : str
        Of the field in a mission, such as ``allocation.tension_max``.
    value : object
    unit : str
    default : bool
        Whether that is the field's default.
    price : float
        Share by which the heaviest load changes for a small share of the limit; negative: with less of it.

    """

    path: str
    value: Any
    unit: str
    default: bool
    price: float

    def __str__(self) -> str:
        value = f"{self.value:g}" if isinstance(self.value, int | float) else str(self.value)
        return f"{self.path} = {value}{self.unit}{' (the default)' if self.default else ''}"


def limits_of(team: Team, settings: Safe, thrusts: Array | None = None) -> Limits:
    """The limits of cables and drones; ``thrusts`` (n,): what the drones' motors can give, N."""
    told = settings.thrust_limits(team)
    least = math.radians(settings.min_angle_deg)
    metres: dict[str, Any] = {}
    angles, causes = settings.pair_angles(team)
    ellipsoids = settings.ellipsoids(team)
    if ellipsoids or np.any(causes != distance.ANGLE):
        if team.n > 1:
            least = float(angles[np.triu_indices(team.n, k=1)].min())
        sizes = settings.drone_distances(team)
        metres = {
            "pairs": angles,
            "causes": causes,
            "lengths": team.cable_lengths,
            "apart": 0.5 * (sizes[:, None] + sizes[None, :]) if ellipsoids else None,
            "stretch": settings.downwash,
        }
    return Limits(
        weights=team.masses * team.gravity,
        low=settings.tension_floors(team),
        high=settings.tension_caps(team),
        thrust=told if thrusts is None else np.minimum(told, thrusts),
        cone=math.radians(settings.max_cone_deg),
        min_angle=least,
        tilt=math.radians(settings.max_tilt_deg or 90.0),
        **metres,
    )


def feasibility(
    team: Team,
    settings: Safe,
    actuation: Motors | None = None,
    start: Array | None = None,
    dt: float = 0.01,
) -> Feasibility:
    """Judge hover: what the best formation holds, and whether the allocator's own can be flown.

    The heaviest and the lightest load are found by optimisation over formations. Whether this mission's load
    is held is asked of the allocator itself, every ``dt`` s from the formation ``start`` (n, 3): it may spread the cables wider
    than the heaviest load would allow.
    """
    n, weight = team.n, team.load_mass * team.gravity
    motors = np.full(n, np.inf) if actuation is None else actuation.thrust_limits(team)
    limits = limits_of(team, settings, motors)
    conflicts = [message for _, message in settings.conflicts(team)]
    if actuation is not None:
        conflicts += [message for _, message in actuation.conflicts(team)]
    starts = formations(n, limits)
    if start is None:
        start = widest_formation(n, limits.cone, enough=limits.widest + math.radians(2.0))[0]
    hover, found = hovering(team, settings, motors, start, dt)
    heaviest, lightest = 0.0, math.nan
    binding: tuple[Binding, ...] = ()
    if len(starts):
        heaviest, binding = _heaviest(team, settings, actuation, limits, starts)
        lightest = extreme(limits, starts, heaviest=False).weight
        if limits.pairs is not None and team.gravity > 0.0:
            # Distances leave more corners to end in: the allocator, asked for too much, may know a better formation.
            asked = replace(team, load_mass=1.2 * max(limits.bound(), weight) / team.gravity)
            overloaded = settings.hover(asked, start, dt).directions
            if is_within(limits, overloaded):
                heaviest = max(heaviest, np.nan_to_num(best_tensions(limits, overloaded)[0]))
    if not conflicts:
        if "allocation" in found and binding:
            found["allocation"] += f"; what limits: {', '.join(map(str, binding))}"
        conflicts = list(found.values())
    drones, cables = settings.distances(team, hover.directions)
    return Feasibility(
        ok=not conflicts,
        lightest=lightest,
        heaviest=heaviest,
        margin=heaviest / weight if weight > 0.0 else math.inf,
        binding=binding,
        widest_angle=max(
            float(pairwise_angles(start).min()) if n > 1 else math.pi,
            widest_angle(n, limits.cone),
        ),
        most_cables=most_cables(math.radians(settings.min_angle_deg), limits.cone),
        conflicts=tuple(conflicts),
        directions=hover.directions,
        tensions=hover.tensions,
        thrusts=team.hover_thrusts(hover.tensions, hover.directions),
        thrust_limits=limits.thrust,
        drone_distances=drones,
        cable_distances=cables,
    )


def binding_limits(
    team: Team, settings: Safe, actuation: Motors | None = None
) -> tuple[Binding, ...]:
    """What keeps the load from being heavier, the costliest first; none where nothing is held at all."""
    motors = None if actuation is None else actuation.thrust_limits(team)
    limits = limits_of(team, settings, motors)
    starts = formations(team.n, limits)
    return _heaviest(team, settings, actuation, limits, starts)[1] if len(starts) else ()


def _heaviest(
    team: Team, settings: Safe, actuation: Motors | None, limits: Limits, starts: Array
) -> tuple[float, tuple[Binding, ...]]:
    """The heaviest load, N, and the limits with a price of more than a hundredth, the costliest first."""
    best = extreme(limits, starts)
    if not math.isfinite(best.weight):
        return 0.0, ()
    found: dict[str, Binding] = {}
    for name, price in best.prices.items():
        part: Any = settings  # the part whose setting it is
        if name == "max_thrust" and actuation is not None:
            by_motors = actuation.thrust_limits(team) < settings.thrust_limits(team)
            if by_motors.any():
                part, name = actuation, actuation.thrust_setting
        by_drones = name in ("max_thrust", "tension_max") and name in part.by_team(team)
        if part is actuation and actuation.thrust_path(team).startswith("drones."):
            by_drones = True
        path, value, default = f"{part.layer}.{name}", getattr(part, name, None), False
        if by_drones:
            path, most = "drones.max_thrust", team.max_thrusts
            value = float(most[0]) if np.all(most == most[0]) else most.tolist()
        elif name.endswith("_distance") and name in part.by_team(team):
            path, radii = "drones.radius", team.radii
            value = float(radii[0]) if np.all(radii == radii[0]) else radii.tolist()
        elif name in part.from_team:
            value = part.filled(team).model_dump()[name]
            default = name not in part.model_fields_set or value == part.from_team[name]
        elif value is not None:
            default = value == type(part).model_fields[name].default
        if abs(price) < 0.01 or value is None:
            continue
        if path in found:
            price += found[path].price
        unit = " deg" if name.endswith("_deg") else " m" if name.endswith("_distance") else " N"
        found[path] = Binding(path, value, unit, default, price)
    return best.weight, tuple(sorted(found.values(), key=lambda each: -abs(each.price)))


def cannot_hold(team: Team, settings: Safe, thrusts: Array, directions: Array) -> list[str]:
    """Why the team cannot hold the load in hover within the limits; empty when some formation does.

    Bounded, a few milliseconds: it may be asked in flight. ``thrusts`` (n,), N, are what the motors give,
    ``directions`` (n, 3) the cables' now.
    """
    n, weight = team.n, team.load_mass * team.gravity
    limits = limits_of(team, settings, thrusts)
    most = limits.bound()
    if most >= weight:
        most = _quickly_held(limits, weight, directions)
    found = []
    if most < weight:
        named = f"tension_max (together {float(np.sum(limits.high)):.4g} N)"
        if np.any(limits.ceiling(np.ones(n)) < limits.high):
            named += f" and the drones' thrust (together {float(np.sum(limits.thrust)):.4g} N)"
        found.append(
            f"{n} cables hold {max(most, 0.0):.4g} N in hover within {named} and min_angle_deg = "
            f"{settings.min_angle_deg:g}; the load weighs {weight:.4g} N"
        )
    lowest = float(np.sum(limits.low)) * math.cos(limits.cone)
    if lowest > weight:
        found.append(f"tension_min pulls {lowest:.4g} N upwards, the load weighs {weight:.4g} N")
    return found


def _quickly_held(limits: Limits, weight: float, directions: Array) -> float:
    """What the best formation holds that a short search finds, N; it ends where that is enough."""
    n, most = limits.weights.size, 0.0
    narrow = list(_rings(n, limits))
    for formation in narrow:  # in balance when all pull alike
        even = float(np.min(limits.ceiling(-formation[:, 2])))
        across = np.abs(formation[:, :2].sum(axis=0)).max()
        if even > limits.low.max() and across < 1e-9:
            most = max(most, -even * float(formation[:, 2].sum()))
            if most >= weight:
                return most
    if n <= POLISHED:
        known = [*(list(_rings(n, limits, 1.15)) or narrow), directions]
        kept = [each for each in known if is_within(limits, each)]
        if not kept and limits.pairs is not None:
            kept = list(formations(n, limits)[:QUICK])
            if not kept:  # which distances allow, if any: it is not known that they do not
                return limits.bound()
        if np.ptp(limits.ceiling(np.ones(n))) > 0.0:
            kept += [_strongest_inside(limits, each) for each in kept]
        held = extreme(limits, np.array(kept), steps=QUICK, enough=weight).weight if kept else most
        return max(most, held) if held == held else most
    for formation in (*narrow, directions):
        held = best_tensions(limits, _strongest_inside(limits, formation))[0]
        most = max(most, held) if held == held else most
        if most >= weight:
            break
    return most


def _strongest_inside(limits: Limits, formation: Array) -> Array:
    """The formation (n, 3) with the drones that can pull most in the most upright places."""
    placed = np.empty_like(formation)
    strength = np.argsort(limits.ceiling(np.ones(len(formation))))
    placed[strength] = formation[np.argsort(-formation[:, 2])]
    return placed


POLISHED = 10
"""Most cables for which a team in flight looks for a better formation than those that are known."""
QUICK = 25
"""Steps of that search."""
FORMATIONS = 24
"""Wide formations from which the heaviest load is looked for."""
PLACED = 8
"""Ways to place the drones in a formation, where each pair has an angle of its own."""
NARROW = (1.05, 1.3)
"""And narrow ones: by which factor their angles exceed the least."""


def _rings(n: int, limits: Limits, wider: float = 1.0) -> Iterator[Array]:
    """Narrow formations in the cone: one ring, or rings as full as the least angle allows around 1 to 5 cables.

    ``wider``: by which factor the angles are.
    """
    gap = wider * _ROOM * limits.widest
    for inside in sorted({*range(1, min(n, 6)), n}):
        wide = 0.0 if inside == 1 else math.sin(0.5 * gap) / math.sin(math.pi / inside)
        if wide >= 1.0:
            continue
        cone, left = math.asin(wide), n
        rings: list[Array] = []
        while left > 0 and cone < limits.cone:
            room = (
                1
                if cone < 0.5 * gap
                else int(math.pi / math.asin(math.sin(0.5 * gap) / math.sin(cone)) + 1e-9)
            )
            room = min(room, left) if rings else inside
            single = np.array([[-math.sin(cone), 0.0, -math.cos(cone)]])
            rings.append(ring(room, cone) if room > 1 else single)
            left -= room
            cone += gap
        if left == 0:
            formation = np.vstack(rings)
            if limits.apart is None or _keeps_ellipsoids(limits, formation):
                yield formation


_ROOM = 1.0 + 1e-6


def is_within(limits: Limits, directions: Array) -> bool:
    """Whether directions (n, 3) keep the least angle and the cone."""
    if np.any(-directions[:, 2] < math.cos(limits.cone)):
        return False
    if len(directions) < 2:
        return True
    asked: Any = limits.min_angle
    if limits.pairs is not None:
        asked = limits.pairs[np.triu_indices(len(directions), k=1)]
    if np.any(pairwise_angles(directions) <= asked):
        return False
    return limits.apart is None or _keeps_ellipsoids(limits, directions)


def _keeps_ellipsoids(limits: Limits, directions: Array) -> bool:
    assert limits.lengths is not None
    assert limits.apart is not None
    drones, _ = distance.distances(limits.lengths, directions, limits.stretch)
    return bool(np.all(drones > _ROOM * limits.apart))


def formations(n: int, limits: Limits) -> Array:
    """Formations (k, n, 3) within the limits, to look for the best from: different ones, drones in different places."""
    found = [each.copy() for each in _spread_formations(n, limits.cone, limits.widest)]
    if (
        limits.pairs is not None
    ):  # some pairs ask for less, and drones of short cables want other places
        found += [each.copy() for each in _spread_formations(n, limits.cone, limits.min_angle)]
        rng = np.random.default_rng(1)
        found += [each[rng.permutation(n)] for each in found for _ in range(PLACED)]
        found = [each for each in found if is_within(limits, each)][:FORMATIONS]
    if not found:
        return np.zeros((0, n, 3))
    rng = np.random.default_rng(0)
    bases = len(found)
    found += [_strongest_inside(limits, each) for each in found]
    found += [found[k % bases][rng.permutation(n)] for k in range(max(0, FORMATIONS - 2 * bases))]
    # Narrow ones too: drones that may hardly tilt, or hardly lift, hold nothing in a wide one.
    narrow = [each for wider in NARROW for each in _rings(n, limits, wider)]
    narrow = [each for each in narrow if is_within(limits, each)]
    found += [*narrow, *(_strongest_inside(limits, each) for each in narrow)]
    if limits.pairs is not None:
        found = [each for each in found if is_within(limits, each)]
    return np.array(found)


@lru_cache(maxsize=64)
def _spread_formations(n: int, cone: float, min_angle: float) -> tuple[Array, ...]:
    if n == 1:
        return (ring(1, 0.0),)
    inner = cone * 0.999
    spread = _spread(np.array(list(_starts(n, inner))), inner, 1.03 * min_angle + 1e-3)
    found = tuple(each for each, angle in spread if angle > min_angle * _ROOM)[: FORMATIONS // 2]
    if not found:
        each, angle = widest_formation(n, inner)
        found = (each,) if angle > min_angle * _ROOM else ()
    return found


def conflicts_of(team: Team, settings: Safe) -> list[tuple[str, str]]:
    """Limits that cannot hold together, as ``(field, message)``; only what is certain and cheap."""
    n, weight = team.n, team.load_mass * team.gravity
    found = []
    cone = math.radians(settings.max_cone_deg)
    least = math.radians(settings.min_angle_deg)
    if n > 1:
        found += _too_far_apart(team, settings)
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
    most = float(np.sum(settings.tension_caps(team)))
    if most < weight and "tension_max" not in settings.by_team(team):
        message = f"tension_max (together {most:.4g} N) conflicts with the load's weight of {weight:.4g} N"
        found.append(("tension_max", message))
    lowest = float(np.sum(settings.tension_floors(team))) * math.cos(cone)
    if lowest > weight:
        found.append(
            (
                "tension_min",
                f"tension_min conflicts with the load's weight: even at max_cone_deg = "
                f"{settings.max_cone_deg:g} the cables pull {lowest:.4g} N upwards, more than {weight:.4g} N",
            )
        )
    return found


def _too_far_apart(team: Team, settings: Safe) -> list[tuple[str, str]]:
    """Distances in metres that cables of these lengths cannot keep in their cone."""
    n, cone = team.n, math.radians(settings.max_cone_deg)
    by_team = settings.by_team(team)
    found = []

    def tell(name: str, values: Array, why: str) -> None:
        path = "drones.radius" if name in by_team else name
        one = f"{values[0]:.4g}" if np.all(values == values[0]) else f"up to {values.max():.4g}"
        what = f"{name} = {one} m{', which follows from it,' if name in by_team else ''}"
        found.append((path, f"{what} conflicts with {why}"))

    clear, lengths = settings.cable_distances(team), team.cable_lengths
    short = np.flatnonzero(clear >= lengths)
    if short.size:
        i = int(short[0])
        why = f"drones.cable_length: the others' cables end on the load, {lengths[i]:.4g} m from drone {i}"
        tell("cable_distance", clear, why)
        return found
    angles, causes = settings.asked_angles(team)
    pairs = np.triu_indices(n, k=1)
    asked = angles[pairs]
    names = {distance.DRONES: "min_distance", distance.CABLE: "cable_distance"}
    values = {"min_distance": settings.drone_distances(team), "cable_distance": clear}
    if not np.any(causes[pairs] != distance.ANGLE):
        return found
    most = packing_bound(n, cone)
    if most >= asked.min() and n <= SEARCHED:
        most = widest_formation(n, cone, enough=float(asked.min()))[1]
    crowded = most < asked.min()
    k = int(np.argmin(asked) if crowded else np.argmax(asked))
    most = most if crowded else min(2.0 * cone, distance.WIDEST)
    i, j = int(pairs[0][k]), int(pairs[1][k])
    if asked[k] > most and causes[i, j] in names:
        name = names[float(causes[i, j])]
        why = (
            f"max_cone_deg = {settings.max_cone_deg:g}: on cables of {lengths[i]:.4g} and {lengths[j]:.4g} m it asks for "
            f"{math.degrees(asked[k]):.1f} degrees or more, and {n if crowded else 2} cables in that cone are at most "
            f"{math.degrees(most):.1f} degrees apart"
        )
        tell(name, values[name], why)
    return found


def spread_formation(n: int, cone: float, min_angle: float) -> Array:
    """Directions (n, 3), drone to load, at least ``min_angle`` apart in a cone of half-angle ``cone``, rad.

    One ring where that does, ring and centre or several rings beyond.

    Raises
    ------
    SettingError
        If no such formation is found; names both limits and the widest angle that was found.

    """
    best, angle = widest_formation(n, cone, enough=min_angle)
    if angle < min_angle:
        raise SettingError.of(
            "min_angle",
            f"{math.degrees(min_angle):.4g} deg",
            f"conflicts with cone {math.degrees(cone):.4g} deg: {n} cables in it are at most "
            f"{math.degrees(angle):.1f} deg apart",
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
    bound = 1
    while bound < SEARCHED and packing_bound(bound + 1, cone) >= min_angle:
        bound += 1

    def fit(n: int) -> bool:
        return widest_formation(n, cone, enough=min_angle)[1] >= min_angle

    found = max(1, int(0.65 * bound))  # which is nearly always held
    while found > 1 and not fit(found):
        found -= 1
    while found < bound and fit(found + 1):
        found += 1
    return found, bound


@lru_cache(maxsize=64)
def _search(n: int, cone: float, enough: float) -> tuple[Array, float]:
    """The formation of the first start that reaches ``enough``, or else the widest of all."""
    starts = list(_starts(n, cone))
    best, angle = ring(n, cone), -1.0
    # Most often one of the first two does, and then the others need no look.
    for some in (starts[:1], starts[1:2], starts[2:]):
        for found, reached in _spread(np.array(some), cone, enough):
            if reached > angle:
                best, angle = found, reached
            if angle >= enough:
                return best, angle
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


def _spread(starts: Array, cone: float, enough: float) -> list[tuple[Array, float]]:
    """Repulsion with a power law that hardens, inside the cone; from each start (k, n, 3) the best formation on the way.

    All starts at once: many small arrays cost more than one larger one. A start is left once it has ``enough``.
    """
    k, n = starts.shape[:2]
    best = starts.copy()
    angle = np.array([pairwise_angles(start).min() for start in starts])
    live = np.flatnonzero(angle < enough)
    x = _clip(starts[live] + 1e-4 * np.cos(np.arange(3 * n)).reshape(n, 3), cone)
    diagonal = np.arange(n)
    for turn in range(STEPS):
        if not live.size:
            break
        progress = turn / STEPS
        power = 5.0 * 150.0**progress
        step = 0.15 * (0.002 / 0.3) ** progress
        squared = np.maximum(2.0 - 2.0 * np.matmul(x, x.transpose(0, 2, 1)), 1e-12)
        squared[:, diagonal, diagonal] = 9.0
        nearest = squared.min(axis=(1, 2))
        reached = 2.0 * np.arcsin(np.minimum(0.5 * np.sqrt(nearest), 1.0))
        wider = reached > angle[live]
        if wider.any():
            angle[live[wider]], best[live[wider]] = reached[wider], x[wider]
            going = angle[live] < enough
            if not going.all():
                live, x, squared, nearest = live[going], x[going], squared[going], nearest[going]
        weights = (nearest[:, None, None] / squared) ** power
        push = weights.sum(axis=2, keepdims=True) * x - np.matmul(weights, x)
        size = np.maximum(np.linalg.norm(push, axis=2).max(axis=1), 1e-12)
        x = _clip(x + step * push / size[:, None, None], cone)
    return [(best[i], float(angle[i])) for i in range(k)]


def _clip(x: Array, cone: float) -> Array:
    """Unit directions (..., 3), those outside the cone moved to its rim."""
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    outside = -x[..., 2] < math.cos(cone)
    rim = x[outside]
    rim[:, :2] *= (math.sin(cone) / np.maximum(np.hypot(rim[:, 0], rim[:, 1]), 1e-12))[:, None]
    rim[:, 2] = -math.cos(cone)
    x[outside] = rim
    return x
