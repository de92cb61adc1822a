"""`colift report`: the report of any recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from colift.cli.base import RUN_FILES, Json, app, check_out, emit, out


@app.command()
def report(
    recording: Annotated[Path, typer.Argument(help="A recording, or the result folder of a run.")],
    folder: Annotated[
        Path | None,
        typer.Option("--out", help="Result folder.", show_default="the recording's name"),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write the HTML report and the figures of a recording, of a simulation or of a real flight."""
    from colift.record import metrics
    from colift.record.recording import Recording
    from colift.record.verdict import judge
    from colift.show.report.html import write_report

    flight = Recording.load(recording)
    target = folder or (recording if recording.is_dir() else recording.with_suffix(""))
    check_out(target, (*RUN_FILES[::-1], "figures"))
    numbers = metrics.compute(flight)
    page = write_report(flight, target, metrics=numbers)
    verdict = judge(flight, numbers)
    if as_json:
        said = {"level": verdict.level, "reasons": verdict.reasons}
        emit(
            {"verdict": said, "summary": verdict.sentence, "metrics": numbers, "report": str(page)}
        )
    else:
        out.print(f"{escape(flight.mission.name)}: {escape(verdict.sentence)}", highlight=False)
        out.print(escape(str(page)), highlight=False, soft_wrap=True)
