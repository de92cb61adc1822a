"""`colift certify`: how likely a mission fails, below a bound with a confidence, as a file that can be checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from colift.cli.base import (
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    Json,
    Sets,
    With,
    app,
    emit,
    err,
    loading,
    out,
    show_tables,
)
from colift.cli.campaign import Workers
from colift.errors import MissionError, Problem

Vary = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PATH=LOW:HIGH",
        help="Draw a number of the mission anew for each flight, evenly, e.g. truth.load_mass_factor=0.9:1.1.",
    ),
]
Assume = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=MOST",
        help="Assume that a quantity stays below, e.g. wind_mps=12; a flight in which it does not counts as failed.",
    ),
]
Bound = Annotated[
    float, typer.Option(help="Certify that fewer than this share of flights fail.", min=0, max=1)
]
Confidence = Annotated[float, typer.Option(help="With this confidence.", min=0.5, max=1)]
FirstSeed = Annotated[int, typer.Option(min=1, max=2**61, help="Seed of the first flight.")]
Seeds = Annotated[
    int | None,
    typer.Option(
        min=1, max=10_000_000,
        help="Most flights; with --splitting, estimates, all of which are made.",
        show_default="2000; 20",
    ),
]  # fmt: skip
Split = Annotated[
    bool,
    typer.Option("--splitting", help="For rare failures: copy flights that come near to failing."),
]
Particles = Annotated[int, typer.Option(min=2, max=10_000, help="Flights that are split.")]
Block = Annotated[float, typer.Option(min=0.01, help="Time between splits, s.")]
Check = Annotated[
    Path | None, typer.Option("--check", metavar="FILE", help="Fly a certificate once more.")
]
Audit = Annotated[
    list[Path] | None,
    typer.Option(
        "--audit", metavar="RECORDING",
        help="With --check: do not fly; say whether a recorded flight kept what the certificate assumes and was flown in.",
    ),
]  # fmt: skip
Out = Annotated[
    Path, typer.Option("--out", metavar="FILE", help="Where the certificate is written.")
]


@app.command()
def certify(
    mission: Annotated[
        str | None, typer.Argument(help="Name of a mission, or a TOML file.")
    ] = None,
    bound: Bound = 0.01,
    confidence: Confidence = 0.95,
    seeds: Seeds = None,
    first_seed: FirstSeed = 1_000_000,
    vary: Vary = None,
    assume: Assume = None,
    splitting: Split = False,
    particles: Particles = 32,
    block: Block = 1.0,
    sets: Sets = None,
    extra: With = None,
    workers: Workers = None,
    target: Out = Path("certificate.json"),
    checked: Check = None,
    audit: Audit = None,
    as_json: Json = False,
) -> None:
    """Fly a mission with seed after seed until fewer than a share of its flights are known to fail.

    The test may be looked at after every flight, so it stops as soon as it knows. Failed is a flight that misses a
    criterion, or loses load or team. After Ctrl-C the same command goes on with the flights that are done. Exit code 4 where the bound is not certified, or a check comes out otherwise.

    [bold]Examples[/bold]

      colift certify cut-in-flight --bound 0.02
      colift certify real-world --vary truth.load_mass_factor=0.9:1.1 --assume wind_mps=12
      colift certify hover --splitting --bound 1e-4 --seeds 40
      colift certify --check certificate.json
    """
    from colift.study.campaign.plan import Source

    if audit and checked is None:
        raise typer.BadParameter("is for --check FILE", param_hint="--audit")
    if (mission is None) == (checked is None):
        raise typer.BadParameter("give a mission, or --check FILE", param_hint="MISSION")
    sources = [Source.read(path) for path in extra or []]
    for source in sources:
        source.load()
    if checked is not None or mission is None:
        assert checked is not None
        _end(_audit(checked, audit) if audit else _again(checked, sources, workers), as_json)
        return
    from colift.mission.load import parse_overrides

    with loading():
        from colift.study.certify import certificate
        from colift.study.certify.kept import file_beside
        from colift.study.certify.space import Space

        space = Space.of(mission, parse_overrides(sets), _ranges(vary))
        question = certificate.Question(
            bound=bound, confidence=confidence, first_seed=first_seed, most=seeds or (20 if splitting else 2000),
            limits=_limits(assume), method="splitting" if splitting else "direct", particles=particles, block=block,
        )  # fmt: skip
    part = file_beside(target)
    with _bar("Certifying", question.most, splitting, part) as told:
        found = certificate.certify(
            space, question, sources=sources, workers=workers, told=told, part=part
        )
    certificate.save(found, target)
    if as_json:
        emit({**found, "file": target})
    else:
        _show(found)
        out.print(f"  certificate  {escape(str(target))}", highlight=False, soft_wrap=True)
    if found["result"] != certificate.CERTIFIED:
        raise typer.Exit(EXIT_FAILED)


def _ranges(given: list[str] | None) -> dict[str, tuple[float, float]]:
    found = {}
    for text in given or []:
        path, _, ends = text.partition("=")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            raise MissionError("--vary", [Problem(text, "", "must be PATH=LOW:HIGH")]) from None
        found[path] = (low, high)
    return found


def _limits(given: list[str] | None) -> dict[str, float]:
    found = {}
    for text in given or []:
        name, _, most = text.partition("=")
        try:
            found[name] = float(most)
        except ValueError:
            raise MissionError("--assume", [Problem(text, "", "must be NAME=MOST")]) from None
    return found


@contextmanager
def _bar(
    title: str, most: int, splitting: bool, part: Path | None = None
) -> Iterator[Callable[[int, int], None]]:
    """A bar of flights on a terminal; after Ctrl-C it is said where those are that were done."""
    if part is not None and part.exists():
        err.print(f"goes on with the flights in {part}", markup=False, soft_wrap=True)
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.fields[seen]}"),
    )  # fmt: skip
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(title, total=most, seen="")

        def told(done: int, failed: int) -> None:
            words = f"{failed} above 0" if splitting else f"{failed} failed"
            bar.update(task, completed=done, seen=words)

        try:
            yield told
        except KeyboardInterrupt:
            bar.stop()
            said = "nothing was written"
            if part is not None and part.exists():
                said = f"flights that are done are in {part}; the same command goes on from there"
            err.print(f"interrupted: {said}", markup=False, highlight=False, soft_wrap=True)
            raise typer.Exit(EXIT_INTERRUPTED) from None


def _show(found: dict[str, Any]) -> None:
    from colift.record.assumptions import ASSUMPTIONS

    out.print(escape(found["statement"]), highlight=False)
    ends = found["interval"]
    if ends is not None:
        kind = "holds after all flights at once" if found["exact"] else "as of Student"
        out.print(f"The probability is {ends[0]:.3g} to {ends[1]:.3g}, each end alone with this confidence; {kind}.", highlight=False)  # fmt: skip
    limits = found["question"]["limits"]
    rows = [
        [each.name, f"{found['worst'][each.name]:.4g}", f"{limits[each.name]:g}" if each.name in limits else "-", each.meaning]
        for each in ASSUMPTIONS
        if each.name in found["worst"]
    ]  # fmt: skip
    show_tables([("What the flights were flown in", ["quantity", "largest", "assumed", ""], rows)])


def _again(file: Path, sources: list[Any], workers: int | None) -> dict[str, Any]:
    """Fly a certificate once more."""
    from colift.study.certify import certificate

    found = certificate.read(file)
    most, splitting = found["question"]["most"], not found["exact"]
    with _bar("Checking", most, splitting) as told:
        differs = certificate.check(found, sources=sources, workers=workers, told=told)
    return {"statement": found["statement"], "same": not differs, "differs": differs}


def _audit(file: Path, recordings: list[Path]) -> dict[str, Any]:
    """Whether recorded flights are such as the certificate speaks of."""
    from colift.record.assumptions import Monitor
    from colift.record.recording import Recording
    from colift.study.certify import certificate

    found = certificate.read(file)
    assumed = {**found["worst"], **found["question"]["limits"]}
    differs = []
    for path in recordings:
        monitor = Monitor(assumed)
        monitor.look(Recording.load(path))
        differs += [
            f"{path}: {name} is {monitor.worst[name]:.4g} (beyond {assumed[name]:.4g} at t = {at:g} s)"
            for name, at in monitor.broken.items()
        ]
        differs += [
            f"{path}: does not show {name}"
            for name in found["question"]["limits"]
            if name in monitor.unseen()
        ]
    return {"statement": found["statement"], "same": not differs, "differs": differs}


def _end(result: dict[str, Any], as_json: bool) -> None:
    if as_json:
        emit(result)
    else:
        out.print(escape(result["statement"]), highlight=False)
        for line in result["differs"]:
            out.print(f"[red]differs[/red]: {escape(line)}", highlight=False, soft_wrap=True)
        if result["same"]:
            out.print("It holds here: nothing differs.")
    if not result["same"]:
        raise typer.Exit(EXIT_FAILED)
