"""`colift size`: how much these drones carry, how many a load takes, for how long, and what if one is lost."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from colift.cli.base import (
    EXIT_ERROR,
    Json,
    Sets,
    With,
    app,
    emit,
    load_parts,
    loading,
    out,
    progress,
    show_notes,
    show_tables,
)
from colift.errors import MissionError, Problem

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from colift.study import rigid_size
    from colift.study.size import Answer, Flown, Judgement, Most, Question

Name = Annotated[
    str | None,
    typer.Argument(help="Shipped mission or TOML file to take drones, load, wind and limits from."),
]
Vehicle = Annotated[
    str | None, typer.Option(help="A known drone, or a TOML file with its numbers.")
]
Drones = Annotated[
    int | None, typer.Option(help="How many drones.", show_default="as many as the load takes")
]
Cable = Annotated[float | None, typer.Option(help="Length of each cable, m.", show_default="1")]
Load = Annotated[float | None, typer.Option(help="Load, kg.", show_default="the heaviest")]
Box = Annotated[
    tuple[float, float, float] | None,
    typer.Option(help="Edges of a rigid load's box, m.", show_default="a point, or the mission's"),
]
Wind = Annotated[
    float | None,
    typer.Option(
        help="Mean wind, m/s, with its turbulence and gusts.",
        show_default="none, or the mission's",
    ),
]
AtMost = Annotated[int, typer.Option(help="Most drones that are looked for.")]
Mass = Annotated[float | None, typer.Option(help="Of a drone with battery, kg.")]
Thrust = Annotated[float | None, typer.Option(help="Largest thrust of a drone, N.")]
Arm = Annotated[float | None, typer.Option(help="From the centre to a rotor's axis, m.")]
Radius = Annotated[float | None, typer.Option(help="From the centre to the outermost tip, m.")]
RotorRadius = Annotated[float | None, typer.Option(help="Of one rotor, m.")]
Rotors = Annotated[int | None, typer.Option(help="Number of rotors: 4, 6 or 8.")]
MotorLag = Annotated[float | None, typer.Option(help="Time constant of the motors' thrust, s.")]
Energy = Annotated[float | None, typer.Option(help="Of a full battery, J (3600 J are 1 Wh).")]
Efficiency = Annotated[
    float | None, typer.Option(help="Ideal power of the rotors in hover over the battery's.")
]
Fly = Annotated[bool, typer.Option("--fly", help="Fly it as well, each drone's cable cut, too.")]
Seeds = Annotated[int, typer.Option(help="Flights of each case.")]


@app.command()
def size(
    mission: Name = None,
    vehicle: Vehicle = None,
    drones: Drones = None,
    cable: Cable = None,
    load: Load = None,
    box: Box = None,
    wind: Wind = None,
    at_most: AtMost = 12,
    mass: Mass = None,
    max_thrust: Thrust = None,
    arm: Arm = None,
    radius: Radius = None,
    rotor_radius: RotorRadius = None,
    rotors: Rotors = None,
    motor_lag: MotorLag = None,
    energy: Energy = None,
    efficiency: Efficiency = None,
    flown: Fly = False,
    seeds: Seeds = 20,
    sets: Sets = None,
    extra: With = None,
    as_json: Json = False,
) -> None:
    """How much these drones carry, how many a load takes, for how long, and what if one is lost.

    Judged by optimisation, in calm air and in the wind, with all drones and with the worst one lost and the others planned
    anew; with --fly also flown. A rigid load is judged as colift run judges it, with its cables attached in several ways. Exit code
    1 if the load (or, without one, any load) is not carried.

    [bold]Examples[/bold]

      colift size --mass 1.4 --max-thrust 28 --drones 3 --cable 2 --load 1.2 --wind 8
      colift size --mass 1.4 --max-thrust 28 --cable 2 --load 5
      colift size --vehicle x500 --drones 4 --cable 2 --fly
      colift size --vehicle x500 --load 2 --box 0.8 0.6 0.3
      colift size my-mission.toml
    """
    from colift.mission.load import parse_overrides

    numbers = {
        "vehicle": vehicle, "cable_length": cable, "mass": mass, "max_thrust": max_thrust, "arm": arm, "radius": radius,
        "rotor_radius": rotor_radius, "rotors": rotors, "motor_lag": motor_lag, "energy": energy,
        "efficiency": efficiency,
    }  # fmt: skip
    numbers = {name: value for name, value in numbers.items() if value is not None}
    _check({"--drones": drones, "--wind": wind, "--at-most": at_most, "--seeds": seeds})
    if mission is None:
        _enough(numbers, drones, load)
    with loading():
        from colift.study import size as study

        load_parts(extra)
        changes = parse_overrides(sets)
        source: Any = mission
        if mission is None:
            source, wind = {**study.BASE, "drones": numbers}, wind or 0.0
        else:
            changes = {f"drones.{name}": value for name, value in numbers.items()} | changes
        if box is not None:
            changes = {"load.kind": "rigid", "load.size": list(box)} | changes
        question = study.Question(source, changes, drones, load, wind, at_most)
        rigid = question.mission(drones).team.body is not None
    if rigid:
        _size_rigid(question, flown=flown, as_json=as_json)
    else:
        _size_point(question, seeds if flown else 0, as_json=as_json)


def _size_point(question: Question, seeds: int, *, as_json: bool) -> None:
    """Answer for a point load; flown on so many ``seeds``."""
    from colift.study import size as study

    with loading():
        answer = study.size(question)
    flights: list[Flown] = []
    if seeds and (answer.held.ok or answer.asked is not None):
        with progress("Flying") as advance:
            flights = study.fly(question, answer, seeds, advance)
    notes = [f"{path} {message}" for path, message in study.notes(answer)]
    if as_json:
        emit({**study.as_json(question, answer, flights), "notes": notes})
    else:
        _say(question, answer, flights)
        show_notes(notes)
    if not answer.ok:
        raise typer.Exit(EXIT_ERROR)


def _size_rigid(question: Question, *, flown: bool, as_json: bool) -> None:
    """Answer for a load with an attitude."""
    from colift.study import rigid_size

    if flown:
        message = "is for point loads: fly a rigid one with colift stress or colift campaign"
        raise MissionError("size", [Problem("--fly", "", message)])
    with loading(), progress("Judging") as advance:
        seen = itertools.count(1)
        # How many there will be nobody knows: the bar nears its end and does not pass it.
        answer = rigid_size.size(question, lambda: advance(1.0 - math.exp(-next(seen) / 150.0)))
    if as_json:
        emit(rigid_size.as_json(question, answer))
    else:
        _say_rigid(question, answer)
    if not answer.ok:
        raise typer.Exit(EXIT_ERROR)


def _say_rigid(question: Question, answer: rigid_size.Answer) -> None:
    from colift.study import rigid_size

    team, n = answer.mission.team, answer.mission.team.n
    edges = " x ".join(f"{edge:g}" for edge in answer.mission.load.size or ())
    out.print(
        f"{n} drones of {_range(team.masses)} kg with {_range(answer.limits)} N each, cables of "
        f"{_range(team.cable_lengths)} m, a load of {edges} m that flies {answer.mission.kinds['reference']}",
        highlight=False,
    )

    def carried(load: float) -> str:
        return "none" if load == 0.0 else f"{load:.2f} kg"

    def many(found: int | None) -> str:
        return "-" if answer.asked is None else str(found or f"more than {question.at_most}")

    rows = [
        [
            name, carried(each.most.load), carried(each.most_spare.load),
            *(["-", "-"] if name == rigid_size.AS_GIVEN else [many(each.few), many(each.few_spare)]),
        ]
        for name, each in answer.places.items()
    ]  # fmt: skip
    head = ["cables end", "carried", "with any one lost", "fewest drones", "if one may be lost"]
    show_tables([("Heaviest load, and drones for the one that is asked", head, rows)])
    limits: dict[str, list[str]] = {}
    for name, each in answer.places.items():
        for found, who in ((each.most, ""), (each.most_spare, ", one lost")):
            limits.setdefault(found.why, []).append(name + who)
    for why, where in limits.items():
        out.print(f"More, {'; '.join(where)}: {escape(why)}", highlight=False)
    _say_held(answer)


def _say_held(answer: rigid_size.Answer) -> None:
    """How the load is held, with all drones and without each of them."""
    load, first = answer.mission.team.load_mass, next(iter(answer.places))
    if not answer.held.ok:
        out.print(f"{load:.4g} kg: {escape(answer.held.problem)}", highlight=False)
        return
    i = int((answer.thrusts / answer.limits).argmax())
    out.print(
        f"{load:.4g} kg, cables end {first}: pulls of {_range(answer.tensions)} N, at most {answer.thrusts[i]:.3g} of {answer.limits[i]:.3g} N of thrust"
        + (f"; cables from {answer.shortest:.2g} m on will do" if answer.shortest else ""),
        highlight=False,
    )
    for drone, why in answer.held.losses.items():
        said = f"comes down: {why}" if why else str(answer.held.leaning[drone])
        out.print(f"  without drone {drone}: {escape(said)}", highlight=False)


RANGES = {"--drones": (1, 64), "--wind": (0, 60), "--at-most": (1, 64), "--seeds": (1, 10_000)}
"""What is no field of a mission: least and most."""


def _check(given: Mapping[str, float | None]) -> None:
    """Refuse values out of range."""
    problems = [
        Problem(name, f"{value:g}", f"must be between {low} and {high}")
        for name, (low, high) in RANGES.items()
        if (value := given[name]) is not None and not low <= value <= high
    ]
    if problems:
        raise MissionError("size", problems)


def _enough(numbers: Mapping[str, Any], drones: int | None, load: float | None) -> None:
    """Refuse a question that names no drone, or neither number nor load."""
    problems = []
    if not {"vehicle", "mass"} & numbers.keys():
        problems.append(
            Problem("--vehicle", "", "is required, or --mass with --max-thrust, or a mission")
        )
    if drones is None and load is None:
        problems.append(
            Problem("--drones", "", "is required, or --load, for which they are counted")
        )
    if problems:
        raise MissionError("size", problems)


def _say(question: Question, answer: Answer, flights: Sequence[Flown]) -> None:
    from colift.study import size as study

    crew, n = answer.crew, answer.crew.team.n
    team = crew.team
    windy = answer.wind > 0.0
    most = (
        f" with {_range(answer.held.limits)} N each"
        if math.isfinite(answer.held.limits.max())
        else ""
    )
    airs = ["calm", "wind"] if windy else ["calm"]
    out.print(
        f"{n} drone{'s' * (n > 1)} of {_range(team.masses)} kg{most}, "
        f"cables of {_range(team.cable_lengths)} m"
        + (f", wind of up to {answer.wind:.3g} m/s that lasts" if windy else ", calm air"),
        highlight=False,
    )

    def heaviest(found: Most) -> list[str]:
        return ["none" if found.load == 0.0 else f"{found.load:.2f} kg", found.limit]

    rows = []
    for air in airs:
        where = "in the wind" if air == "wind" else "in calm air"
        rows.append([where, "no", *heaviest(answer.most[air])])
        rows.append([where, "the worst one", *heaviest(answer.most_spare[air])])
    show_tables([("Heaviest load", ["air", "drone lost", "carried", "limit"], rows)])
    if answer.most["calm"].load == 0.0 and answer.asked is None:
        out.print(escape(answer.most["calm"].message), highlight=False)
    _say_load(question, answer)
    for line in study.remarks(answer):
        out.print(escape(line), highlight=False)
    if flights:
        _say_flights(flights)


def _say_load(question: Question, answer: Answer) -> None:
    """What the load that is asked for, or the heaviest, leaves to spare; and how few drones carry it."""
    from colift.study import size as study

    crew, windy = answer.crew, answer.wind > 0.0
    team = crew.team
    swinging = answer.others is not None and answer.others.team.n < study.STEADY
    load, asked = team.load_mass, answer.asked is not None
    if answer.held.ok or asked:
        what = f"{load:.4g} kg" + ("" if asked else ", the heaviest")
        title = f"{what}{', in the wind' if windy else ''}"
        rows = [
            ["no", *_held(answer.held), _minutes(study.lasts(crew, answer.held))],
            [
                "the worst one",
                *_held(answer.held_spare, swinging=swinging),
                _minutes(study.lasts(answer.others, answer.held_spare)),
            ],
        ]
        head = ["drone lost", "carried", "most thrust", "in the wind", "hover, min"]
        if not windy:
            head.pop(3)
            rows = [[*row[:3], row[4]] for row in rows]
        show_tables([(title, head, rows)])
        for found, who in ((answer.held, "all drones"), (answer.held_spare, "one lost")):
            if found.message:
                out.print(f"{who}: {escape(found.message)}", highlight=False)
    if asked and crew.alike:

        def many(found: int | None) -> str:
            return f"{found}" if found is not None else f"more than {question.at_most}"

        out.print(
            f"Fewest drones for {load:.4g} kg{' in this wind' if windy else ''}: {many(answer.few)}; "
            f"if one may be lost: {many(answer.few_spare)}.",
            highlight=False,
        )


def _say_flights(flights: Sequence[Flown]) -> None:
    from colift.kernel.math import shares

    rows = [
        [
            each.reference, "each drone's" if each.cut else "none",
            shares.text(each.good, each.flights), f"{each.farthest:.2f}" if each.good else "-", each.first_bad or "-",
        ]
        for each in flights
    ]  # fmt: skip
    show_tables(
        [
            (
                "Flown",
                ["reference", "cable cut", "good", "load off, m", "first that was not"],
                rows,
            )
        ]
    )


def _held(found: Judgement, *, swinging: bool = False) -> list[str]:
    """Whether a load is carried, and the drone's thrust that is nearest its limit, in hover and in the wind."""
    cells = ["no" if not found.ok else "swinging" if swinging else "yes"]
    for thrusts in (found.thrusts, found.in_wind):
        share = thrusts / found.limits
        if len(share) == 0 or math.isnan(float(share.max())):
            cells.append("-")
        else:
            i = int(share.argmax())
            most = f" of {found.limits[i]:.3g}" if math.isfinite(found.limits[i]) else ""
            cells.append(f"{thrusts[i]:.3g}{most} N")
    return cells


def _minutes(seconds: float) -> str:
    return "not known" if math.isnan(seconds) else f"{seconds / 60.0:.1f}"


def _range(values: Any) -> str:
    low, high = f"{float(min(values)):.4g}", f"{float(max(values)):.4g}"
    return low if low == high else f"{low} to {high}"
