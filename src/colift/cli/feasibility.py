"""`colift feasibility`: judge a mission before it is flown."""

from __future__ import annotations

import math
from typing import Annotated

import typer
from rich.markup import escape

from colift.cli.base import EXIT_ERROR, Json, Sets, app, emit, loading, out
from colift.errors import ColiftError


@app.command()
def feasibility(
    mission: Annotated[
        str, typer.Argument(help="Name of a shipped mission (see `colift list`) or a TOML file.")
    ],
    sets: Sets = None,
    as_json: Json = False,
) -> None:
    """Before a flight: can these drones hold this load within these limits, and how well.

    For a mission with the safe allocator, in hover. Exit code 1 if they cannot.
    """
    from colift.mission.load import parse_overrides

    with loading():
        import colift
        from colift.allocation._feasibility import SEARCHED
        from colift.allocation._feasibility import feasibility as judge
        from colift.allocation.safe import Safe

        loaded = colift.load_mission(mission, parse_overrides(sets))
    if not isinstance(loaded.allocation, Safe):
        raise ColiftError(
            f"{loaded.name}: its allocator {loaded.kinds['allocation']!r} has no limits to judge; "
            "try --set allocation.kind=safe"
        )
    found = judge(loaded.team, loaded.allocation)
    weight = loaded.team.load_mass * loaded.team.gravity
    widest = math.degrees(found.widest_angle)
    if as_json:
        emit(
            {
                "mission": loaded.name, "feasible": found.ok, "conflicts": list(found.conflicts),
                "weight_N": weight, "lightest_N": found.lightest, "heaviest_N": found.heaviest,
                "margin": found.margin, "widest_angle_deg": widest,
                "most_cables_found": found.most_cables[0], "most_cables_bound": found.most_cables[1],
                "tensions_N": found.tensions.tolist(),
            }
        )  # fmt: skip
    else:
        part, n = loaded.allocation, loaded.drones.count
        most, bound = found.most_cables
        allowed = f"{most} cables (found; never more than {bound})"
        if most >= SEARCHED:
            allowed = f"{most} cables or more"
        out.print(f"{escape(loaded.name)}: {n} drones, load of {weight:.4g} N (hover)")
        out.print(
            f"Within the limits the cables hold {found.lightest:.4g} to {found.heaviest:.4g} N: "
            f"{found.margin:.2f} times the load."
        )
        out.print(
            f"{n} cables within {part.max_cone_deg:g} deg of the vertical can be {widest:.1f} deg apart; "
            f"{part.min_angle_deg:g} deg are asked for, which allows {allowed}."
        )
        for conflict in found.conflicts:
            out.print(f"[red]conflict[/red]: {escape(conflict)}")
        out.print("feasible" if found.ok else "not feasible")
    if not found.ok:
        raise typer.Exit(EXIT_ERROR)
