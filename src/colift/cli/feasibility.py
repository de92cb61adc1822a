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
    from colift.team import Team


@app.command()
def feasibility(
    mission: MissionName,
    sets: Sets = None,
    as_json: Json = False,
) -> None:
    """Before a flight: can these drones hold this load within these limits, and how well.

    For a mission with the safe allocator, in hover: limits of cables, of pairs of cables, of drones and of
    their motors. Exit code 1 if they cannot; `colift run` refuses such a mission.
    """
    from colift.mission.load import parse_overrides

    with loading():
        import colift
        from colift.control.allocation.limits.feasibility import feasibility as judge
        from colift.control.allocation.safe import Safe
        from colift.mission.warnings import notes_of, warnings_of

        loaded = colift.load_mission(mission, parse_overrides(sets), must_fly=False)
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
        show_notes(notes)
        show_warnings(warnings)
        for conflict in conflicts:
            out.print(f"[red]conflict[/red]: {escape(conflict)}", highlight=False)
        out.print("not feasible" if conflicts else "feasible")
    if conflicts:
        raise typer.Exit(EXIT_ERROR)


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
