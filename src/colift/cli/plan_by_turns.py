"""`colift plan-by-turns`: a plan that drones and load make in turn, to compare with `colift plan`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from colift.cli.base import Json, JsonFile, app, console, emit, loading, progress, save_json

if TYPE_CHECKING:
    from colift.plan.by_turns import TurnPlan


@app.command(name="plan-by-turns")
def plan_by_turns(
    scene: Annotated[Path, typer.Argument(help="Scene, a YAML file of the public kind.")],
    duration: Annotated[float, typer.Option(help="Of the plan, s.", min=0.1, max=3600)] = 10.0,
    rounds: Annotated[int, typer.Option(help="Rounds at most.", min=1, max=10_000)] = 60,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="A limit, or a number of the bodies, as of plan."
        ),
    ] = None,
    file: JsonFile = None,
    as_json: Json = False,
) -> None:
    """Plan a team as if each drone had a computer of its own: all improve their own path, then the load its own, and tell each other.

    After Jackson et al. (RA-L 2020). Rates are not limited, and cables pass through obstacles: `colift plan` limits and certifies both.
    """  # fmt: skip
    with loading():
        from colift.mission.load import parse_overrides
        from colift.plan.by_turns import plan_by_turns as planned
        from colift.plan.planner import Limits
        from colift.plan.scene import load_scene
    changes = parse_overrides(limits)
    found = load_scene(scene)
    with progress("Planning") as advance:
        plan = planned(found, Limits.of(changes), duration=duration, rounds=rounds, progress=advance)  # fmt: skip
    result: dict[str, Any] = {
        "scene": found.name, "drones": len(found.lengths), "limits": changes, "duration": duration, "done": plan.done, "rounds": plan.rounds,
        "history": plan.history, "violation": plan.violation, "all_s": plan.seconds, "longest_s": plan.longest,
    }  # fmt: skip
    save_json(file, result)
    if as_json:
        emit(result)
        return
    _tell(plan)


def _tell(plan: TurnPlan) -> None:
    """The plan in a few lines."""
    out = console()
    n, how = len(plan.drones), "agreed" if plan.done else "not agreed"
    out.print(f"{plan.scene.name}, {n} drones: {how} after {plan.rounds} rounds, {plan.times[-1]:.3g} s", highlight=False)  # fmt: skip
    for kind, value in plan.violation.items():
        out.print(f"  {kind:>10}  beyond its limit by {max(value, 0.0):.2g}", highlight=False)
