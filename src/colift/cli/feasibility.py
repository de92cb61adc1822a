"""`colift feasibility`: judge a mission before it is flown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer
from rich.markup import escape

from colift.cli.base import (
    EXIT_ERROR,
    Json,
    MissionName,
    Sets,
    app,
    emit,
    loading,
    out,
    show_notes,
    show_warnings,
)
from colift.errors import ColiftError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from colift.control.allocation.limits.feasibility import Feasibility
    from colift.control.allocation.safe import Safe
    from colift.mission.mission import Mission
    from colift.mission.planned import Demand
    from colift.study.holding import Report
    from colift.team import Team


@app.command()
def feasibility(
    mission: MissionName,
    sets: Sets = None,
    as_json: Json = False,
) -> None:
    """Before a flight: can these drones hold this load within these limits, and how well.

    For a mission with the safe allocator, in hover: limits of cables, of pairs of cables, of drones and of
    their motors. For a rigid load: how its cables hold its attitude, how far they can push and turn it, what its
    reference asks of rotors and cables, and what becomes of the flight without each of the drones. Exit code 1 if they
    cannot; `colift run` refuses such a mission.
    """
    from colift.mission.load import parse_overrides

    with loading():
        import colift
        from colift.control.allocation.limits.feasibility import feasibility as judge
        from colift.control.allocation.safe import Safe
        from colift.mission.warnings import notes_of, warnings_of

        loaded = colift.load_mission(mission, parse_overrides(sets), must_fly=False)
    if loaded.team.body is not None:
        _judge_rigid(loaded, as_json=as_json)
        return
    if not isinstance(loaded.allocation, Safe):
        raise ColiftError(
            f"{loaded.name}: its allocator {loaded.kinds['allocation']!r} has no limits to judge; "
            "try --set allocation.kind=safe"
        )
    drones = loaded.first_drones()
    team, part = loaded.team.of(drones), loaded.allocation.of(drones)
    found = judge(
        team, part, loaded.actuation.of(drones), loaded.start_directions(), loaded.timing.allocation
    )
    notes = [str(each) for each in notes_of(loaded)]
    warnings = [str(each) for each in warnings_of(loaded)]
    conflicts = [*found.conflicts, *loaded.attitude_control.diverges(loaded)]
    if not found.conflicts and (message := part.cannot_start(team, loaded.start_directions())):
        conflicts.append(message)
    if as_json:
        _emit(loaded, found, conflicts, notes, warnings)
    else:
        _say(loaded, part, found)
        _conclude(conflicts, notes, warnings)
    if conflicts:
        raise typer.Exit(EXIT_ERROR)


def _conclude(conflicts: Sequence[str], notes: Sequence[str], warnings: Sequence[str]) -> None:
    show_notes(notes)
    show_warnings(warnings)
    for conflict in conflicts:
        out.print(f"[red]conflict[/red]: {escape(conflict)}", highlight=False)
    out.print("not feasible" if conflicts else "feasible")


def _judge_rigid(mission: Mission, *, as_json: bool) -> None:
    """The same for a rigid load."""
    from colift.mission.warnings import notes_of, warnings_of
    from colift.study.holding import judge

    drones = mission.first_drones()
    team, part = mission.team.of(drones), mission.allocation.of(drones)
    found = judge(mission)
    conflicts = [f"{name}: {text}" for name, text in found.holding.problems()]
    conflicts += part.cannot_hold(team, found.limits, mission.start_directions())
    if found.demand is not None:
        conflicts += [f"reference {text}" for text in found.demand.problems(drones)]
    warnings = [str(each) for each in warnings_of(mission)]
    notes = [str(each) for each in notes_of(mission)]
    if as_json:
        _emit_rigid(mission, found, conflicts, notes, warnings)
    else:
        _say_rigid(mission, found)
        _conclude(conflicts, notes, warnings)
    if conflicts:
        raise typer.Exit(EXIT_ERROR)


def _emit_rigid(
    mission: Mission,
    found: Report,
    conflicts: Sequence[str],
    notes: Sequence[str],
    warnings: Sequence[str],
) -> None:
    held, asked = found.holding, found.demand
    after = {
        str(drone): {"carries": each.carries, "lean_deg": math.degrees(each.lean), "pace": each.pace, "upright": each.upright, "reason": each.reason}
        for drone, each in found.losses.items()
    }  # fmt: skip
    emit(
        {
            "mission": mission.name, "feasible": not conflicts, "conflicts": conflicts,
            "weight_N": mission.team.load_mass * mission.team.gravity,
            "rank": held.rank, "condition": _number(held.condition), "yaw_stiffness_Nm": held.yaw_stiffness,
            "swings_rad_s": held.swings.tolist(), "tensions_N": found.tensions.tolist(),
            "thrusts_N": found.thrusts.tolist(), "thrust_limits_N": [_number(limit) for limit in found.limits],
            "reach": {name: _number(size) for name, size in found.reach.items()},
            "rotors_share": None if asked is None else asked.share, "least_tension_share": None if asked is None else asked.taut,
            "without": after, "wind": _wind(mission), "notes": notes, "warnings": warnings,
        }
    )  # fmt: skip


def _number(value: float) -> float | None:
    """A number for JSON, which knows no infinity."""
    return float(value) if math.isfinite(value) else None


def _demand(demand: Demand, drones: Sequence[int]) -> str:
    """In words, what a reference asks of rotors and cables."""
    when, which = demand.slack
    return (
        f"of what drone {drones[demand.drone]}'s rotors give to turn it {demand.share:.0%} at {demand.time:.3g} s, and of cable "
        f"{drones[which]} at least {demand.taut:.0%} of its part of the force, at {when:.3g} s"
    )


def _say_rigid(mission: Mission, found: Report) -> None:
    from colift.study.holding import FORCE

    drones, held = mission.first_drones(), found.holding
    weight = mission.team.load_mass * mission.team.gravity
    said = f"{escape(mission.name)}: {len(drones)} drones, rigid load of {weight:.4g} N, hover {_wind(mission)}"
    out.print(said.rstrip(), highlight=False)
    even = f" (conditioning {held.condition:.3g})" if math.isfinite(held.condition) else ""
    out.print(
        f"The cables make {held.rank} of the 6 forces and moments{even}, and turn the load back to "
        f"its heading with {held.yaw_stiffness:.3g} N m per rad.",
        highlight=False,
    )
    if held.swings.size:
        free = ", ".join(f"{abs(each):.3g}" for each in held.swings)
        out.print(f"Below drones that stand it swings at {free} rad/s.", highlight=False)
    i, j = int(found.tensions.argmin()), int((found.thrusts / found.limits).argmax())
    thrust = (
        f"; drone {drones[j]} needs {found.thrusts[j]:.4g} N of thrust, of {found.limits[j]:.4g} N"
    )
    out.print(
        f"In the formation the least tension is {found.tensions[i]:.3g} N, of cable {drones[i]}{thrust if math.isfinite(found.limits[j]) else ''}.",
        highlight=False,
    )
    for name in (FORCE, "moment"):
        unit = "N" if name == FORCE else "N m"
        sizes = [(axis, found.reach[f"{name} {axis}"]) for axis in ("x", "y", "z")]
        words = [f"{axis} {size:.3g}" for axis, size in sizes if math.isfinite(size)]
        words += [f"{axis} without limit" for axis, size in sizes if not math.isfinite(size)]
        out.print(
            f"Beside the weight they give a {name} of {', '.join(words)} {unit} and more either way.",
            highlight=False,
        )
    if found.demand is not None:
        out.print(f"The reference asks {_demand(found.demand, drones)}.", highlight=False)
    for drone, after in found.losses.items():
        out.print(f"  without drone {drone}: {escape(str(after))}", highlight=False)


def _wind(mission: Mission) -> str:
    """Which disturbances are not counted."""
    disturbances = zip(mission.list_kinds["disturbance"], mission.disturbance, strict=True)
    winds = [
        f"disturbance.{i} ({kind})"
        for i, (kind, each) in enumerate(disturbances)
        if each.makes_wind
    ]
    return f"in calm air: the wind of {', '.join(winds)} is not counted" if winds else ""


def _emit(
    mission: Mission,
    found: Feasibility,
    conflicts: Sequence[str],
    notes: Sequence[str],
    warnings: Sequence[str],
) -> None:
    emit(
        {
            "mission": mission.name, "feasible": not conflicts, "conflicts": conflicts,
            "weight_N": mission.team.load_mass * mission.team.gravity,
            "lightest_N": found.lightest, "heaviest_N": found.heaviest,
            "margin": found.margin, "binding": [asdict(each) for each in found.binding],
            "widest_angle_deg": math.degrees(found.widest_angle),
            "most_cables_found": found.most_cables[0], "most_cables_bound": found.most_cables[1],
            "tensions_N": found.tensions.tolist(), "thrusts_N": found.thrusts.tolist(),
            "thrust_limits_N": found.thrust_limits.tolist(), "wind": _wind(mission),
            "drone_distance_m": _least(found.drone_distances), "cable_distance_m": _least(found.cable_distances),
            "notes": notes, "warnings": warnings,
        }
    )  # fmt: skip


def _least(distances: NDArray[np.float64]) -> float | None:
    """The smallest of a table, m; None where there is but one drone."""
    return float(distances.min()) if distances.size > 1 else None


def _distances(team: Team, part: Safe, found: Feasibility) -> str:
    """In words, how far apart the drones of the formation are where that is limited; empty where it is not."""
    asked, clear = part.drone_distances(team).max(), part.cable_distances(team).max()
    words = []
    if team.n > 1 and asked > 0.0:
        counted = f", heights counted 1/{part.downwash:g}" if part.downwash > 1.0 else ""
        words.append(
            f"drones are {found.drone_distances.min():.3g} m apart{counted} ({asked:.3g} m are asked for)"
        )
    if team.n > 1 and clear > 0.0:
        words.append(f"{found.cable_distances.min():.3g} m from others' cables ({clear:.3g} m)")
    return f"In the allocator's formation {' and '.join(words)}." if words else ""


def _say(mission: Mission, part: Safe, found: Feasibility) -> None:
    from colift.control.allocation.limits.feasibility import SEARCHED

    n = len(found.thrusts)
    weight = mission.team.load_mass * mission.team.gravity
    said = f"{escape(mission.name)}: {n} drones, load of {weight:.4g} N, hover {_wind(mission)}"
    out.print(said.rstrip())
    out.print(
        f"Within the limits the cables hold {found.lightest:.4g} to {found.heaviest:.4g} N: "
        f"{found.margin:.2f} times the load."
    )
    for each in found.binding:
        out.print(f"  binding: {escape(str(each))}", highlight=False)
    spare = found.thrust_limits / found.thrusts
    i = int(spare.argmin())
    if math.isfinite(spare[i]):
        out.print(
            f"In the allocator's formation drone {i} needs {found.thrusts[i]:.4g} N of thrust, the most "
            f"for what it has: {found.thrust_limits[i]:.4g} N."
        )
    else:
        out.print("Nothing limits the drones' thrust (actuation, allocation.max_thrust).")
    team = mission.team.of(mission.first_drones())
    if text := _distances(team, part, found):
        out.print(text, highlight=False)
    most, bound = found.most_cables
    allowed = f"{most} cables (found; never more than {bound})"
    if most >= SEARCHED:
        allowed = f"{most} cables or more"
    out.print(
        f"{n} cables within {part.max_cone_deg:g} deg of the vertical can be "
        f"{math.degrees(found.widest_angle):.1f} deg apart; "
        f"{part.min_angle_deg:g} deg are asked for, which allows {allowed}."
    )
