"""`colift ros`: the controllers and the simulation of a mission as ROS 2 nodes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from colift.cli.base import MissionName, Sets, With, app, load_parts, loading, out, show_notes

if TYPE_CHECKING:
    from colift.deploy.ros.nodes.node import TeamNode
    from colift.mission.mission import Mission

Node = Literal["allocator", "cascade", "simulator"]


@app.command()
def ros(
    node: Annotated[Node, typer.Argument(help="Which node.")],
    mission: MissionName = "real-world",
    arguments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[-- --ros-args ...]", help="What ROS is told: remappings, parameters."
        ),
    ] = None,
    period: Annotated[
        float | None,
        typer.Option(
            help="Of what goes over topics, s.",
            show_default="the mission's, at least 0.01",
            min=0.001,
            max=1.0,
        ),
    ] = None,
    takes: Annotated[
        Literal["cables", "setpoints"],
        typer.Option(
            help="What the simulator's drones are told: their cables' forces, or set-points by the cascade."
        ),
    ] = "setpoints",
    speed: Annotated[
        float | None,
        typer.Option(
            help="Simulated over real time; all nodes must be given it or none.",
            show_default="lock step",
            min=0.01,
            max=100.0,
        ),
    ] = None,
    patience: Annotated[
        float | None,
        typer.Option(
            help="How long the cascade waits for the allocator, s.",
            show_default="half a period; 1 in lock step",
            min=0.0,
            max=10.0,
        ),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="Write the simulator's recording here when it ends.")
    ] = None,
    inactive: Annotated[
        bool, typer.Option("--inactive", help="Wait to be configured and activated.")
    ] = False,
    sets: Sets = None,
    extra: With = None,
) -> None:
    """Run a node: the allocator, the cascade of controllers, or the simulator.

    All nodes of a team are given the same mission. Needs ROS 2 (extra `ros`). In lock step, which is what they do unless a speed is
    given, the simulated time waits for all of them.

    [bold]Examples[/bold]

      colift ros simulator hover --takes cables --record flight.h5
      colift ros allocator hover
      colift ros cascade hover --speed 1 -- --ros-args -r __ns:=/team_1
    """
    from colift.mission.load import parse_overrides

    with loading():
        from colift.deploy.ros.layers import mission_for
        from colift.deploy.ros.nodes.node import run

        load_parts(extra)
        loaded, notes = mission_for(mission, parse_overrides(sets), period)
    show_notes(notes)

    def make() -> TeamNode:
        return _made(node, loaded, takes=takes, speed=speed, patience=patience)

    ended = run(make, arguments=arguments or (), activate=not inactive)
    if node == "simulator":
        _tell(ended, record)


def _made(
    node: Node,
    mission: Mission,
    *,
    takes: Literal["cables", "setpoints"],
    speed: float | None,
    patience: float | None,
) -> TeamNode:
    if node == "simulator":
        from colift.deploy.ros.nodes.simulator import SimulatorNode

        return SimulatorNode(mission, takes, speed=speed)
    if node == "cascade":
        from colift.deploy.ros.nodes.cascade import CascadeNode

        return CascadeNode(mission, lock_step=speed is None, patience=patience)
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
