"""`colift import`: logs of a real flight become a recording."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.markup import escape

from colift.cli.base import Json, app, emit, out

if TYPE_CHECKING:
    from colift.record.recording import Recording

# As in colift.record.importing.base, which help need not import.
Frame = Literal["enu", "ned"]
Unit = Literal["m", "mm"]
TimeUnit = Literal["s", "ms", "us", "ns"]
QuaternionOrder = Literal["wxyz", "xyzw"]

Files = Annotated[
    list[Path],
    typer.Argument(metavar="FILE...", help="One log of all drones, or one log of each drone."),
]
Target = Annotated[
    Path | None,
    typer.Option("--out", help="Recording to write.", show_default="FILE.h5, in this folder"),
]
CableLength = Annotated[
    float | None,
    typer.Option(help="Length of a cable, m.", show_default="median distance to the load"),
]
Axes = Annotated[
    Frame | None,
    typer.Option(help="Axes of a CSV: z up, or north-east-down.", show_default="enu"),
]
Lengths = Annotated[
    Unit | None,
    typer.Option(help="Unit of a CSV's positions and velocities.", show_default="m"),
]
Times = Annotated[TimeUnit | None, typer.Option(help="Unit of a CSV's times.", show_default="s")]
Columns = Annotated[
    QuaternionOrder | None, typer.Option(help="Order of a CSV's columns uavK_q0 to uavK_q3.")
]
Name = Annotated[
    str | None, typer.Option(help="Name of the flight.", show_default="name of the first file")
]


@app.command(name="import")
def import_(
    files: Files,
    target: Target = None,
    load_mass: Annotated[float, typer.Option(help="Mass of the load, kg.")] = 0.01,
    drone_mass: Annotated[float, typer.Option(help="Mass of a drone, kg.")] = 0.034,
    cable_length: CableLength = None,
    frame: Axes = None,
    unit: Lengths = None,
    time_unit: Times = None,
    quaternion: Columns = None,
    name: Name = None,
    as_json: Json = False,
) -> None:
    """Turn the logs of a real flight into a recording, for `report` and `judge`.

    Reads CSV, bags, and logs of PX4, ArduPilot and the Crazyflie, one a drone (see docs/real-flights.md), whose clocks are
    aligned by the motion of the load. What was not logged stays unknown; what cannot be is left out, and said.

    [bold]Examples[/bold]

      colift import flight.csv --out flight.h5
      colift import cf2_01 cf7_01 --load-mass 0.0098 --out window.h5
      colift import px4.csv --frame ned --time-unit us
    """
    from colift.errors import SettingError
    from colift.record import metrics
    from colift.record.importing import Assumed, Reading, import_flight

    try:
        assumed = Assumed(load_mass=load_mass, drone_mass=drone_mass, cable_length=cable_length)
    except SettingError as error:
        first = error.problems[0]
        option = f"--{first.path}".replace("_", "-")
        raise typer.BadParameter(f"{option}: {first.message} (found {first.value})") from None
    told = Reading(frame=frame, unit=unit, time_unit=time_unit, quaternion=quaternion)
    recording = import_flight(files, assumed, name=name, told=told)
    path = recording.save(target or Path(f"{files[0].stem}.h5"))
    numbers = {k: v for k, v in metrics.compute(recording).items() if v == v}
    if as_json:
        emit(
            {
                "flight": recording.mission.name,
                "drones": recording.n,
                "duration_s": float(recording.time[-1]),
                "rows": len(recording.time),
                "cable_lengths_m": recording.mission.team.cable_lengths.tolist(),
                "metrics": numbers,
                "findings": recording.provenance["findings"],
                "provenance": recording.provenance,
                "file": path,
            }
        )
    else:
        _say(recording, numbers, path)


def _say(recording: Recording, numbers: Mapping[str, float], path: Path) -> None:
    lengths = ", ".join(f"{length:.3f}" for length in recording.mission.team.cable_lengths)
    out.print(
        f"{escape(recording.mission.name)}: {recording.n} drones, {recording.time[-1]:.2f} s in "
        f"{len(recording.time)} rows; cables {lengths} m",
        highlight=False,
    )
    for file in recording.provenance["files"][1:]:
        out.print(
            f"{escape(file['name'])}: clock shifted by {file['clock_offset_s']:+.4f} s; its load lies "
            f"{1e3 * file['load_mismatch_rms_m']:.1f} mm RMS from the first log's",
            highlight=False,
        )
    for finding in recording.provenance["findings"]:
        out.print(
            f"[yellow]warning[/yellow]: {escape(finding['text'])}", highlight=False, soft_wrap=True
        )
    for key, value in numbers.items():
        out.print(f"{key:>24}  {value:.4g}", highlight=False)
    out.print(f"{'recording':>24}  {escape(str(path))}", highlight=False, soft_wrap=True)
