"""`colift ros`: the controllers and the simulation of a mission as ROS 2 nodes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from colift.cli.base import (
    EXIT_ERROR,
    MissionName,
    Sets,
    With,
    app,
    err,
    load_parts,
    loading,
    out,
    show_notes,
)  # fmt: skip

if TYPE_CHECKING:
    from colift.deploy.ros.nodes.node import TeamNode
    from colift.mission.mission import Mission

Node = Literal["launch", "allocator", "cascade", "simulator", "recorder"]
Takes = Literal["cables", "setpoints"]
BAG = ".mcap"

Period = Annotated[
    float | None,
    typer.Option(
        help="Of what goes over topics, s.", show_default="the mission's, at least 0.01", min=0.001, max=1.0,
    ),
]  # fmt: skip
Told = Annotated[
    Takes,
    typer.Option(
        help="What the simulator's drones are told: their cables' forces, or set-points by the cascade."
    ),
]
Speed = Annotated[
    float | None,
    typer.Option(
        help="Simulated over real time; for all nodes or none.", show_default="lock step", min=0.01, max=100.0,
    ),
]  # fmt: skip
Record = Annotated[
    Path | None,
    typer.Option(
        help="Where the simulator writes its recording, FLIGHT.h5; the recorder its bag, a folder or FLIGHT.mcap; launch starts one for a bag."
    ),
]
Inactive = Annotated[bool, typer.Option("--inactive", help="Wait to be configured and activated.")]
Rest = Annotated[
    list[str] | None,
    typer.Argument(metavar="[-- --ros-args ...]", help="What ROS is told: remappings, parameters."),
]


@app.command()
def ros(
    node: Annotated[Node, typer.Argument(help="Which node; launch starts all of them.")],
    mission: MissionName = "real-world",
    arguments: Rest = None,
    period: Period = None,
    takes: Told = "setpoints",
    speed: Speed = None,
    record: Record = None,
    inactive: Inactive = False,
    sets: Sets = None,
    extra: With = None,
) -> None:
    """Run a mission's controllers and its simulation as ROS 2 nodes: all of them, or one.

    All nodes of a team are given the same mission. Needs ROS 2 (extra `ros`). In lock step, which is what they do unless a speed is
    given, the simulated time waits for all of them.

    [bold]Examples[/bold]

      colift ros launch figure-eight --record flight.h5
      colift ros simulator hover --takes cables
      colift ros cascade hover --speed 1 -- --ros-args -r __ns:=/team_1
    """
    from colift.mission.load import parse_overrides

    with loading():
        from colift.deploy.ros.layers import mission_for
        from colift.deploy.ros.nodes.node import run

        load_parts(extra)
        loaded, notes = mission_for(mission, parse_overrides(sets), period)
    if node == "launch":
        given = _given(mission, period, takes, speed, inactive, sets, extra)
        _launch(given, takes, record, arguments or ())
        return
    show_notes(notes)
    told: dict[str, Any] = {"arguments": arguments or (), "activate": not inactive}
    if node == "recorder":
        _keep(loaded, record or Path(f"{loaded.name}{BAG}"), lock_step=speed is None, **told)
        return
    ended = run(lambda: _made(node, loaded, takes, speed), **told)
    if node == "simulator":
        _tell(ended, record)


def _given(
    mission: str,
    period: float | None,
    takes: Takes,
    speed: float | None,
    inactive: bool,
    sets: list[str] | None,
    extra: list[Path] | None,
) -> list[str]:
    """The command's arguments again, for each node."""
    words = [mission, "--takes", takes, *(["--inactive"] if inactive else [])]
    for option, value in (("--period", period), ("--speed", speed)):
        words += [] if value is None else [option, f"{value:.12g}"]
    for text in sets or ():
        words += ["--set", text]
    for path in extra or ():
        words += ["--with", str(path)]
    return words


def _launch(given: list[str], takes: Takes, record: Path | None, rest: Sequence[str]) -> None:
    from colift.deploy.ros.launch import FIRST, Launch

    tail = ["--", *rest] if rest else []
    saved = [] if record is None else ["--record", str(record)]
    saves = "simulator" if record is None or record.suffix == ".h5" else "recorder"
    names = (*(["recorder"] if saves == "recorder" else []), *FIRST[takes])
    nodes = {name: [*given, *(saved if name == saves else []), *tail] for name in names}
    code = Launch(nodes, lambda text: err.print(text, markup=False)).run()
    if code:
        raise typer.Exit(EXIT_ERROR)


def _keep(mission: Mission, path: Path, *, lock_step: bool, **told: Any) -> None:
    """Run the recorder, whose bag is whole once it ends."""
    from colift.deploy.ros.nodes.node import run
    from colift.deploy.ros.nodes.recorder import RecorderNode
    from colift.record.exchange.bag import writing

    with writing(path) as bag:
        say = partial(print, f"records into {path}", flush=True)
        ended = run(lambda: RecorderNode(mission, bag, lock_step=lock_step), ready=say, **told)
    out.print(f"{path}: {ended.kept} messages", highlight=False, markup=False, soft_wrap=True)


def _made(node: Node, mission: Mission, takes: Takes, speed: float | None) -> TeamNode:
    if node == "simulator":
        from colift.deploy.ros.nodes.simulator import SimulatorNode

        return SimulatorNode(mission, takes, speed=speed)
    if node == "cascade":
        from colift.deploy.ros.nodes.cascade import CascadeNode

        return CascadeNode(mission, lock_step=speed is None)
    from colift.deploy.ros.nodes.allocator import AllocatorNode

    return AllocatorNode(mission, lock_step=speed is None)


def _tell(ended: TeamNode, record: Path | None) -> None:
    """Say how a simulated flight went, and save it."""
    from colift.record import metrics

    recording = ended.does.flight.recording()
    found = metrics.compute(recording)
    tracking = found.get("tracking_max_m", float("nan"))
    out.print(
        f"{recording.outcome}: {recording.time[-1]:.2f} s, load within {100 * tracking:.1f} cm of its reference",
        highlight=False,
    )
    if record is not None:
        out.print(f"{recording.save(record)}", highlight=False, soft_wrap=True)
