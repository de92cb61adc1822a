"""Before the flight: how near the loops of a mission are to instability, with the gains, periods, delays and motors that it has."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from colift.control.margins import (
    Bodies,
    Loops,
    Margin,
    Response,
    Timing,
    Turning,
    frequencies,
    seen,
    turn_loop,
)
from colift.errors import Problem, SettingError

if TYPE_CHECKING:
    from colift.mission.mission import Mission


LEAST = 0.05
"""Modulus margin below which a loop is warned of: docs/figures/margins.py flies both sides of it."""
FACTORS = (0.7, 0.5, 1.4, 0.35, 2.0, 0.2, 3.0)
"""Of the setting that is to be changed, tried one after the other."""


class Judged(NamedTuple):
    """The margin of a loop, and the layer whose gains decide on it."""

    loop: str
    layer: str
    margin: Margin


def loops_of(mission: Mission) -> list[Judged]:
    """The margins of attitude, position and load, from the inside out.

    What has no linear law of its own, or carries a load with an extent, is left out. An unstable loop is the last one: those around it have no margin.
    """
    drones = mission.first_drones()
    told, true = mission.team.of(drones), mission.true_team.of(drones)
    law = mission.attitude_control.of(drones)
    found = law.gains(told)
    if found is None:
        return []
    K, _, slopes = (np.asarray(each, dtype=float) for each in found)
    time = _timing(mission)
    w = frequencies(math.pi / time.turned)
    cases: dict[tuple[float, float], tuple[Margin, Response, Response]] = {}

    def turned(i: int, axis: int) -> tuple[Margin, Response, Response]:
        key = (K[i, axis] / true.inertias[i, axis], slopes[i, axis])
        if key not in cases:
            cases[key] = turn_loop(w, Turning(key[0], key[1], 1.0), time)
        return cases[key]

    ratios = K / true.inertias
    for axis in range(3):
        for i in (int(np.argmax(ratios[:, axis])), int(np.argmin(ratios[:, axis]))):
            turned(i, axis)
    attitude = min((margin for margin, _, _ in cases.values()), key=lambda m: m.modulus)
    judged = [Judged("attitude", "attitude_control", attitude)]
    position, load = mission.position_control.of(drones), mission.load_control.of(drones)
    laws = [(position.places(told, axis), load.hanging(told, axis)) for axis in (0, 1)]
    known = true.body is None and told.gravity > 0.0 and not any(None in pair for pair in laws)
    if not (attitude.stable and known):
        return judged
    observation, filters = mission.observation.of(drones), mission.estimation.filters()
    bodies = _bodies(mission, drones)
    kalman = filters or (None, None)
    views = seen(w, time.tracking, kalman[0]), seen(w, time.load, kalman[1])
    places: list[Margin] = []
    loads: list[Margin] = []
    asked = set()
    for axis, (feedback, hanging) in enumerate(laws):
        assert feedback is not None
        assert hanging is not None
        middle = int(np.argsort(ratios[:, 1 - axis])[told.n // 2])
        _, tilt, spin = turned(middle, 1 - axis)
        key = (feedback, hanging, ratios[middle, 1 - axis])
        if key in asked:
            continue
        asked.add(key)
        loops = Loops(w, tilt, spin, time, feedback, hanging, observation.watching(told), *views)
        if told.n > 1:
            places.append(loops.alone(told.n))
        whole, hung = loops.together(bodies)
        places.append(whole)
        if time.leaning is not None:
            loads.append(hung)
    return judged + _worst(places, loads)


def _worst(places: list[Margin], loads: list[Margin]) -> list[Judged]:
    """The least margin of position and, where that is stable, of load."""
    judged: list[Judged] = []
    for loop, layer, margins in (
        ("position", "position_control", places),
        ("load", "load_control", loads),
    ):
        if not margins:
            break
        judged.append(Judged(loop, layer, min(margins, key=lambda m: m.modulus)))
        if not judged[-1].margin.stable:
            break
    return judged


def _timing(mission: Mission) -> Timing:
    delays = mission.sensing.delays()
    known_delay, known_lag = mission.attitude_control.made_up_for()
    turn = max(mission.observation.axis_delay(), mission.position_control.axis_delay())
    return Timing(
        attitude=delays["attitude"], rates=delays["rates"], tracking=delays["tracking"],
        load=delays["load"], lag=mission.actuation.motor_lag(), turned=mission.timing.attitude_control,
        placed=mission.timing.position_control, told_delay=known_delay, told_lag=known_lag, told_turn=turn, leaning=mission.allocation.turning_lag(len(mission.first_drones())),
    )  # fmt: skip


def _bodies(mission: Mission, drones: list[int]) -> Bodies:
    team = mission.true_team.of(drones)
    directions = mission.start_directions()
    if team.n > 1:
        allocation, dt = mission.allocation.of(drones), mission.timing.allocation
        directions = allocation.hover(mission.team.of(drones), directions, dt).directions
    places = -team.cable_lengths[:, None] * directions
    height = max(float(places[:, 2].mean()), 1e-3)
    wide = float(0.5 * team.masses @ np.sum(places[:, :2] ** 2, axis=1))
    turning = wide if team.n > 2 else 0.0
    masses = float(team.masses.sum())
    return Bodies(masses, team.load_mass, team.load_mass * team.gravity, height, turning, team.n)


def margin_warnings(mission: Mission) -> Iterable[Problem]:
    """Loops with less margin than flights need, by the path of the setting to change, with a value of it that would do if one does."""
    for loop, layer, margin in loops_of(mission):
        if margin.modulus >= LEAST:
            continue
        part = getattr(mission, layer)
        if layer == "attitude_control" and part.unstable(mission):
            continue  # told by the part
        if margin.stable:
            more = 1.0 / (1.0 - margin.modulus) - 1.0
            turn = math.degrees(2.0 * math.asin(0.5 * margin.modulus))
            fact = (
                f"the {loop} loop has a modulus margin (least |1 + L|) of {margin.modulus:.2g} at {margin.frequency:.3g} rad/s, less than "
                f"{LEAST:g}: {100.0 * more:.2g} % more gain or {turn:.2g} degrees more lag may make it unstable"
            )
        else:
            fact = f"the {loop} loop is unstable near {margin.frequency:.3g} rad/s (a modulus margin of {LEAST:g} is the least)"
        yield Problem(
            f"{layer}.{part.gain_setting}", _shown(part), fact + _remedy(mission, loop, layer)
        )


def _shown(part: Any) -> str:
    value = getattr(part, part.gain_setting, "")
    return f"{value:g}" if isinstance(value, float) else str(value)


def _remedy(mission: Mission, loop: str, layer: str) -> str:
    """A factor of the setting with which this loop and those within it have their margin."""
    part = getattr(mission, layer)
    name = part.gain_setting
    value = getattr(part, name, None)
    if not isinstance(value, float | tuple):
        return ""
    for factor in FACTORS:
        changed = factor * value if isinstance(value, float) else tuple(factor * v for v in value)
        try:
            other = part.model_copy()
            setattr(other, name, changed)
        except SettingError:
            continue
        judged = {each.loop: each for each in loops_of(mission.model_copy(update={layer: other}))}
        if loop in judged and all(each.margin.modulus >= LEAST for each in judged.values()):
            shown = f"{changed:.3g}" if isinstance(changed, float) else f"{changed[0]:.3g}, ..."
            return f"; {name} = {shown} would do"
    return ""
