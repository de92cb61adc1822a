"""The figures of one flight, by name. A new figure is one function here."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Generic, NamedTuple, TypeVar

from matplotlib.figure import Figure

from colift.record.recording import Recording
from colift.show.report import panels, style

Source = TypeVar("Source", contravariant=True)


class Entry(NamedTuple, Generic[Source]):
    """One figure of the registry: its title, how to read it, what draws it, and from what."""

    title: str
    caption: str
    draw: Callable[[Source], Figure]
    needs: tuple[str, ...] = ()
    """Signals without which there is nothing to draw; of a comparison the kinds of loads."""
    without: tuple[str, ...] = ()
    """Signals with which another figure says more."""
    rigid: bool = False
    """Whether it is of a rigid load."""


def drawable(recording: Recording) -> dict[str, Entry[Recording]]:
    """The figures of what this flight has recorded."""
    return {
        name: entry
        for name, entry in FIGURES.items()
        if recording.measured(*entry.needs)
        and (recording.mission.load.kind == "rigid" or not entry.rigid)
        and not (entry.without and recording.measured(*entry.without))
    }


def register(
    table: dict[str, Entry[Source]],
    title: str,
    caption: str,
    *,
    needs: tuple[str, ...] = (),
    without: tuple[str, ...] = (),
    rigid: bool = False,
) -> Callable[[Callable[[Source], Figure]], Callable[[Source], Figure]]:
    """Enter the decorated function, which from then on draws in the common style."""

    def enter(function: Callable[[Source], Figure]) -> Callable[[Source], Figure]:
        @wraps(function)
        def draw(source: Source) -> Figure:
            with style.look():
                return function(source)

        table[function.__name__] = Entry(title, caption, draw, needs, without, rigid)
        return draw

    return enter


FIGURES: dict[str, Entry[Recording]] = {}
"""Every figure of one flight by name, in the order of the report."""


@register(
    FIGURES,
    "Path",
    "Wide: where the load should go. Thin: where it went; the squares, or boxes, are the load and "
    "the dots the drones at the times given, with their cables; obstacles are outlined. All axes have the same scale.",
    needs=("load",),
)
def path(recording: Recording) -> Figure:
    figure = Figure(figsize=(style.WIDTH, 4.8))
    axes = figure.add_axes((0.03, 0.03, 0.94, 0.93), projection="3d")
    panels.path(axes, recording)
    style.legend(figure)
    return figure


@register(
    FIGURES,
    "Position error",
    "The load's position less its reference, by component. The pale band is plus and minus the "
    "distance between the two, so it touches whatever component carries the whole error.",
    needs=("load", "reference"),
)
def position_error(recording: Recording) -> Figure:
    return _over_time(recording, panels.position_error)


@register(
    FIGURES,
    "Attitude error",
    "The rotation from the load's wanted attitude to its own, by component about the world's axes: z is yaw. The pale band is plus "
    "and minus its angle.",
    needs=("load_attitude", "reference_attitude"),
    rigid=True,
)
def attitude_error(recording: Recording) -> Figure:
    return _over_time(recording, panels.attitude_error)


@register(
    FIGURES,
    "Cable tensions",
    "Actual tension of each cable. Lines on top of each other mean an evenly shared load; "
    'a line below zero means a cable that would be slack. A note "off scale" gives the whole range '
    "where short peaks leave the axis.",
    needs=("tensions",),
)
def tensions(recording: Recording) -> Figure:
    return _over_time(recording, panels.tensions)


@register(
    FIGURES,
    "Wanted tensions",
    "Tension that the allocator wanted of each cable. The actual ones were not measured. "
    'A note "off scale" gives the whole range where short peaks leave the axis.',
    needs=("desired_tensions",),
    without=("tensions",),
)
def wanted_tensions(recording: Recording) -> Figure:
    return _over_time(recording, panels.wanted_tensions)


@register(
    FIGURES,
    "Angles between cables",
    "Angle between every two actual cables; each line carries the colours of its two drones. "
    "The dashed line is the least angle that the mission asks for, if it does. More than ten "
    "pairs are drawn as the range of all pairs, that of nearest neighbours, and the closest pair.",
    needs=("directions",),
)
def angles(recording: Recording) -> Figure:
    return _over_time(recording, panels.angles)


@register(
    FIGURES,
    "Distances between drones",
    "From centre to centre, of every two drones; more than ten pairs as what each drone has to the one nearest to it. Cables that end apart on a rigid load may be parallel: "
    "this, not their angle, keeps the drones apart. The dashed line is the least distance that the mission asks for, if it does.",
    needs=("positions",),
    rigid=True,
)
def distances(recording: Recording) -> Figure:
    return _over_time(recording, panels.distances)


@register(
    FIGURES,
    "Wanted and actual tension",
    "Above: actual tensions, with those that the allocator wanted thin and dashed. Below: actual "
    "less wanted tension, that is what the controllers did not follow.",
    needs=("tensions", "desired_tensions"),
)
def tension_tracking(recording: Recording) -> Figure:
    return _over_time(recording, panels.desired_tensions, panels.tension_error, height=1.75)


@register(
    FIGURES,
    "Thrust",
    "Thrust of each drone. A dashed line is the most that a drone can give, where that comes near.",
    needs=("thrusts",),
)
def thrust(recording: Recording) -> Figure:
    return _over_time(recording, panels.thrusts, height=1.75)


@register(
    FIGURES,
    "Tilt",
    "Angle of each drone's thrust from the vertical. A dashed line is the criterion, where that comes near.",
    needs=("attitudes",),
)
def tilt(recording: Recording) -> Figure:
    return _over_time(recording, panels.tilt, height=1.75)


@register(
    FIGURES,
    "Time of the allocator",
    "How long one allocation took, measured in the loop; both axes are logarithmic. Rare "
    "slow ones are usually interruptions by the operating system.",
    needs=("allocator_time",),
)
def allocator_time(recording: Recording) -> Figure:
    figure, (axes,) = style.grid()
    panels.allocator_time(axes, recording)
    style.legend(figure)
    return figure


def _over_time(recording: Recording, *draw: panels.Panel, height: float = 2.3) -> Figure:
    """Panels over the same time axis, one above the other."""
    kinds = len({moment.kind for moment in recording.moments})
    figure, axes = style.grid(rows=len(draw), height=height, marks=-(-kinds // style.MARKS_A_LINE))
    for k, (panel, part) in enumerate(zip(axes, draw, strict=True)):
        panels.focus([panel], [part(panel, recording)])
        panels.time_axis(panel, recording, label=k == len(draw) - 1, top=k == 0)
    style.legend(figure)
    return figure
