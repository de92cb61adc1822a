"""`colift offboard`: a mission flown by vehicles over MAVLink."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from colift.cli.base import (
    RUN_FILES,
    Json,
    MissionName,
    Sets,
    app,
    check_out,
    loading,
    progress,
    result_folder,
    show_notes,
)

if TYPE_CHECKING:
    from colift.deploy.mavlink.station import Station
    from colift.mission.mission import Mission


Autopilot = Annotated[
    Literal["px4", "ardupilot"], typer.Option(help="Whose conventions the vehicles keep.")
]
Target = Annotated[
    Literal["position", "attitude"],
    typer.Option(help="Tell place, velocity and acceleration, or attitude and thrust."),
]
Hover = Annotated[
    float | None,
    typer.Option(
        help="Thrust at which a vehicle hovers by itself.", min=0.05, max=0.95, show_default="the autopilot's default",
    ),
]  # fmt: skip
Host = Annotated[str, typer.Option(help="Address of this machine to listen on.")]
Port = Annotated[
    int,
    typer.Option(
        help="UDP port of drone 0; those of the others and, last, of the load follow.", min=1024, max=65000,
    ),
]  # fmt: skip
Simulate = Annotated[
    bool,
    typer.Option(help="Fly simulated vehicles, over UDP on this machine, instead of real ones."),
]


@app.command()
def offboard(
    mission: MissionName = "paper-spiral",
    sets: Sets = None,
    autopilot: Autopilot = "px4",
    target: Target = "position",
    hover: Hover = None,
    host: Host = "127.0.0.1",
    port: Port = 14540,
    simulate: Simulate = False,
    folder: Annotated[Path | None, result_folder("MISSION")] = None,
    report: Annotated[bool, typer.Option(help="Write the HTML report and its figures.")] = True,
    as_json: Json = False,
) -> None:
    """Fly a mission off-board: vehicles tell where they are, and are told where to be, over MAVLink.

    Drone i is system i + 1, at its own UDP port; system 200 tells where the load is. All must be at their places in the mission before any
    is asked to arm. A vehicle that falls silent is left to itself and the others carry on; at the end all are asked to hold their places.

    [bold]Examples[/bold]

      colift offboard --simulate
      colift offboard hover --simulate --autopilot ardupilot --target attitude
      colift offboard my-mission.toml --host 192.168.1.10 --port 14540
    """
    from colift.mission.load import parse_overrides

    check_out(folder, RUN_FILES)
    with ExitStack() as stack:
        with loading():
            from colift.cli.run import deliver
            from colift.deploy.mavlink import station
            from colift.deploy.mavlink.setpoints import CONVENTIONS
            from colift.flight.runner import Run
            from colift.mission import load_mission

            overrides = parse_overrides(sets)
            loaded, notes = station.for_vehicles(mission, overrides)
            control = station.over_udp(
                loaded,
                CONVENTIONS[autopilot],
                host,
                0 if simulate else port,
                target=target,
                hover=hover,
            )
            stack.callback(control.close)
            clock = _paced(station.PERIOD)
            if simulate:
                clock = _simulated(control, load_mission(mission, overrides), stack)
        show_notes(notes)
        with progress(f"Flying {loaded.name}") as advance:
            begin = time.perf_counter()
            recording = station.run(control, clock, advance)
        flown = Run(recording, time.perf_counter() - begin, control.flight.compiled)
        deliver(flown, notes, [], folder, report=report, as_json=as_json)


def _paced(period: float) -> Callable[[], float]:
    """A clock that waits for the next cycle."""
    begin, cycle = time.monotonic(), 0

    def clock() -> float:
        nonlocal cycle
        cycle = max(cycle + 1, int((time.monotonic() - begin) / period))
        time.sleep(max(begin + cycle * period - time.monotonic(), 0.0))
        return time.monotonic() - begin

    return clock


def _simulated(control: Station, asked: Mission, stack: ExitStack) -> Callable[[], float]:
    """A clock whose every cycle begins with one of the simulated vehicles: as fast as this machine is."""
    from colift.deploy.mavlink.peer import World
    from colift.deploy.mavlink.station import PERIOD

    world = World(asked, control.addresses, control.vehicles[0].convention, hover=control.hover)
    stack.callback(world.close)
    cycle = 0

    def clock() -> float:
        nonlocal cycle
        cycle += 1
        world.step(cycle * PERIOD, PERIOD)
        return cycle * PERIOD

    return clock
