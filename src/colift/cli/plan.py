"""`colift plan`: take the whole team through a scene of obstacles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from colift.cli.base import Json, JsonFile, app, console, emit, loading, progress, save_json

if TYPE_CHECKING:
    from colift.plan.planner import Plan


@app.command()
def plan(
    scene: Annotated[Path, typer.Argument(help="Scene, a YAML file of the public kind.")],
    drones: Annotated[
        int | None,
        typer.Option(help="Number of drones, in a cone; default: the scene's team.", min=2, max=16),
    ] = None,
    seed: Annotated[int, typer.Option(help="Which guesses are tried.", min=0)] = 0,
    seconds: Annotated[
        float, typer.Option(help="Look for shorter plans no longer than this, s.", min=0, max=3600)
    ] = 3.0,
    attempts: Annotated[int, typer.Option(help="Guesses at most.", min=1, max=10_000)] = 12,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="A limit, or a number of the bodies: room=0.03 keeps so much room, m, around all, most=1.25 asks motors for less.",
        ),
    ] = None,
    npz: Annotated[
        Path | None, typer.Option("--npz", help="Write the trajectory here, sampled at 1 kHz.")
    ] = None,
    mission: Annotated[
        Path | None, typer.Option("--mission", help="Write a mission here that flies it.")
    ] = None,
    file: JsonFile = None,
    as_json: Json = False,
) -> None:
    """Plan load, cables and drones through a scene: exact dynamics, certified by dense sampling.

    Guesses are made from the seed, optimised one after another, and the shortest plan is kept that holds every limit: motors, rates, taut
    cables, distances between drones and to obstacles.
    """
    import numpy as np

    with loading():
        from colift.mission.load import parse_overrides
        from colift.plan import mission as missions
        from colift.plan import planner
        from colift.plan.scene import load_scene
    changes = parse_overrides(limits)
    found = load_scene(scene)
    if drones is not None and drones != len(found.lengths):
        found = replace(found, directions=None, lengths=np.full(drones, found.lengths[0]))
    with progress("Planning") as advance:
        best = planner.plan(
            found, planner.Limits.of(changes), seed=seed, seconds=seconds, attempts=attempts, progress=advance
        )  # fmt: skip
    result: dict[str, Any] = {
        "scene": found.name, "drones": len(found.lengths), "seed": seed, "limits": changes, "duration": best.duration, "excess": best.excess,
        "guess": best.guess, "start_moved_deg": best.moved_deg, "first_s": best.first, "total_s": best.total,
    }  # fmt: skip
    if npz is not None:
        planner.save(best, npz)
        result["npz"] = npz
    if mission is not None:
        missions.write(best, mission)
        result["mission"] = mission
    save_json(file, result)
    if as_json:
        emit(result)
        return
    _tell(best)


def _tell(best: Plan) -> None:
    """The plan in a few lines."""
    name, n = best.scene.name, len(best.scene.lengths)
    out = console()
    out.print(f"{name}, {n} drones: {best.duration:.3f} s", highlight=False)
    for kind, value in best.excess.items():
        out.print(f"  {kind:>10}  {-value:.4g} to its limit", highlight=False)
    if best.moved_deg > 0.5:
        out.print(
            f"  the start's cables were turned by up to {best.moved_deg:.1f} degrees: they could not rest",
            highlight=False,
        )
