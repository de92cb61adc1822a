"""`colift sitl`: a mission flown by simulated autopilots."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from colift.cli.base import (
    RUN_FILES,
    Json,
    MissionName,
    Sets,
    With,
    app,
    at_times,
    check_out,
    load_parts,
    loading,
    progress,
    result_folder,
    show_notes,
    show_warnings,
)


@app.command()
def sitl(
    mission: MissionName = "paper-spiral",
    sets: Sets = None,
    seed: Annotated[int | None, typer.Option(help="Seed instead of the mission's.")] = None,
    kill: Annotated[
        list[str] | None,
        typer.Option(metavar="DRONE@TIME", help="End this drone's autopilot with SIGKILL, s."),
    ] = None,
    folder: Annotated[Path | None, result_folder("MISSION")] = None,
    extra: With = None,
    report: Annotated[bool, typer.Option(help="Write the HTML report and its figures.")] = True,
    as_json: Json = False,
) -> None:
    """Fly a mission with real autopilots: one Betaflight for each drone, a process of its own, in lock step.

    They do the work of attitude control and drive the mission's motors; all else is as in `colift run`, and so are the
    results, the exit codes and what `judge`, `replay` and `report` make of the recording. Linux only; needs the package betaflight.

    [bold]Examples[/bold]

      colift sitl
      colift sitl windy-spiral --set disturbance.0.speed=5
      colift sitl four-to-three --kill 2@4
    """
    from colift.mission.load import parse_overrides

    check_out(folder, RUN_FILES)
    with loading():
        from colift.cli.run import deliver
        from colift.deploy.sitl import process, team
        from colift.mission.warnings import notes_of, warnings_of

        process.check()
        load_parts(extra)
        overrides = {**parse_overrides(sets), **({} if seed is None else {"seed": seed})}
        loaded, motors, lowered = team.for_autopilots(mission, overrides)
        kills = [team.Kill(at, drone) for drone, at in at_times(kill, "--kill")]
        flight = team.SitlFlight(loaded, motors, kills)
    notes, warnings = [*notes_of(loaded), *lowered], warnings_of(loaded)
    show_notes(notes)
    show_warnings(warnings)
    with progress(f"Flying {loaded.name}") as advance:
        flown = flight.run(advance)
    deliver(flown, notes, warnings, folder, report=report, as_json=as_json)
