"""`colift swarm`: a team without a leader as processes of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from colift.cli.base import (
    Json,
    JsonFile,
    MissionName,
    Sets,
    app,
    at_times,
    console,
    emit,
    loading,
    save_json,
    show_notes,
)

if TYPE_CHECKING:
    from colift.flight.swarm.world import Flown, Stroke, Swarm
    from colift.show.live.hearing import HearingPage

EVERY = 20
"""Cycles between two pictures."""
BARS = "▁▂▃▄▅▆▇█"


@app.command()
def swarm(
    mission: MissionName = "paper-spiral",
    seconds: Annotated[
        float, typer.Option(help="Length of the flight, s.", min=1, max=3600)
    ] = 10.0,
    loss: Annotated[
        float, typer.Option(help="Share of the messages that nobody hears.", min=0, max=0.99)
    ] = 0.2,
    kill: Annotated[
        list[str] | None, typer.Option(metavar="DRONE@TIME", help="End this agent with SIGKILL, s.")
    ] = None,
    restart: Annotated[
        list[str] | None, typer.Option(metavar="DRONE@TIME", help="Start this agent again, s.")
    ] = None,
    sets: Sets = None,
    waits: Annotated[
        bool,
        typer.Option(
            "--wait",
            help="Let each cycle take as long as its answers do, so that a busy machine changes nothing.",
        ),
    ] = False,
    page: Annotated[bool, typer.Option(help="Show who hears whom on a page as well.")] = False,
    file: JsonFile = None,
    as_json: Json = False,
) -> None:
    """Start a world and one process for each drone, which talk over UDP on this machine; kill some.

    No process is special: each drone's has its own measurements of the load, its own load controller, agent and allocator.
    The load is a point that their pulls carry.

    [bold]Examples[/bold]

      colift swarm
      colift swarm --kill 2@4 --restart 2@6 --loss 0.5
      colift swarm eight-drones --kill 0@5 --kill 3@8 --seconds 15
    """
    from colift.mission.load import parse_overrides

    with loading():
        from colift.flight.swarm import world
        from colift.mission import load_mission

        strokes = [world.Stroke(at, drone) for drone, at in at_times(kill, "--kill")]
        strokes += [
            world.Stroke(at, drone, restart=True) for drone, at in at_times(restart, "--restart")
        ]
        overrides, notes = world.for_agents(mission, parse_overrides(sets))
        loaded = load_mission(mission, overrides)
        for stroke in strokes:
            if stroke.drone >= loaded.team.n:
                raise typer.BadParameter(
                    f"there is no drone {stroke.drone}; the team has {loaded.team.n}"
                )
            if stroke.at >= seconds:
                raise typer.BadParameter(
                    f"{stroke.drone}@{stroke.at:g}: the flight ends at {seconds:g} s (--seconds)"
                )
        team = world.Swarm(loaded, mission, overrides, loss=loss)
    show_notes(notes)
    flown = _fly(team, seconds, strokes, waits=waits, page=page, lines=not as_json)
    result = flown.summary(strokes, loaded.team.load_mass * loaded.team.gravity)
    save_json(file, result)
    if as_json:
        emit(result)
        return
    _tell(result)


def _fly(
    team: Swarm, seconds: float, strokes: list[Stroke], *, waits: bool, page: bool, lines: bool
) -> Flown:
    """Fly, and show on the terminal and on a page who hears whom."""
    shown = None
    if page:
        from colift.show.live.hearing import HearingPage

        shown = HearingPage()
        console(stderr=True).print(f"Who hears whom: {shown.address}", highlight=False)
    if lines:
        console(stderr=True).print(f"Starting {team.n} agents", highlight=False)
    try:
        watch = _Watch(shown, lines=lines and console(stderr=True).is_terminal)
        return team.run(seconds, strokes, waits=waits, watch=watch)
    finally:
        if shown is not None:
            shown.close()


def _tell(result: dict[str, Any]) -> None:
    """Say what came of it."""
    from colift.flight.swarm.world import WHOLE

    out = console()
    out.print(f"Load within {100 * result['tracking_max_m']:.1f} cm of its reference.")
    for each in result["killed"]:
        settled = each["settled"]
        found = (
            f"two seconds later the force still misses more than {WHOLE:.0%} of the weight."
            if settled is None
            else f"within {WHOLE:.0%} of the weight after {1e3 * settled:.0f} ms."
        )
        out.print(f"Drone {each['drone']} killed at {each['at']:g} s: {found}", highlight=False)


class _Watch:
    """Tells a terminal and a page who hears whom, every ``EVERY`` cycles."""

    def __init__(self, page: HearingPage | None, *, lines: bool) -> None:
        self._page, self._lines = page, lines

    def __call__(self, cycle: int, team: Swarm) -> None:
        if cycle % EVERY:
            return
        flown, n = team.flown, team.n
        rows, alive = flown.hears[-EVERY:], [status >= 0 for status in flown.status[-1]]
        shares = [
            [sum(row[i] >> j & 1 for row in rows) / len(rows) for j in range(n)] for i in range(n)
        ]
        time, missing = cycle * team.dt, flown.missing_now()
        if self._page is not None:
            body = team.mission.team
            pulls = [float(sum(pull**2) ** 0.5) for pull in flown.pulls[-1]]
            self._page.say(
                time=time, missing=missing, weight=body.load_mass * body.gravity, hears=shares, alive=alive,
                pulls=pulls,
            )  # fmt: skip
        if self._lines:
            drones = [
                f"{i}: " + "".join("·" if i == j else BARS[min(int(8 * share), 7)] for j, share in enumerate(row))
                if alive[i] else f"{i}: dead"
                for i, row in enumerate(shares)
            ]  # fmt: skip
            console(stderr=True).print(
                f"{time:6.1f} s  {1e3 * missing:6.0f} mN missing   " + "   ".join(drones), highlight=False, markup=False,
            )  # fmt: skip
