"""The one look of every figure: colours, line styles, sizes, margins, legends."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.ticker import LogLocator, NullLocator

from colift.show.report.marks import MARKS, TONES

PALETTE = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#7F6000",
    "#5D3A9B",
)
"""Colours that remain distinct with any colour vision (Okabe and Ito, darker where they were pale)."""

DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1.2, 1.2)),
    (0, (6, 1.5, 1.2, 1.5)),
    (0, (9, 2)),
    (0, (3, 1, 1, 1, 1, 1)),
    (0, (2.5, 2.5)),
    (0, (9, 1.5, 1.2, 1.5, 1.2, 1.5)),
)
"""Line styles, one for each turn through the palette."""

SERIES = ("#000000", "#35608D", "#1FA187", "#B5A000", "#8B2F6F")
"""Colours of whole recordings in a comparison; none of them stands for a drone."""

COMPONENTS = ("#BB5566", "#004488", "#DDAA33")
"""Colours of x, y and z."""

INK, MUTED, LIMIT = "#222222", "#B8B8B8", "#AA0000"
"""Flown and measured; wanted and secondary; thresholds."""

FILL, PALE, SPOILT = "#9DC3DE", "#EAEAEA", "#F3DCDC"
"""Bands: of all drones; of what is around; of what has diverged."""

DARK = {
    "#000000": "#E6E8EA",
    INK: "#E6E8EA",
    "#444444": "#B4BCC4",
    "#666666": "#7F8A94",
    "#777777": "#8E99A3",
    "#808080": "#8E99A3",
    MUTED: "#5C666F",
    "#E6E6E6": "#2C3238",
    "#F2F2F2": "#20252A",  # sides of the box around a path
    "#ECECEC": "#262C32",
    FILL: "#2F5D7C",
    PALE: "#2C3238",
    SPOILT: "#4A2A2A",
    LIMIT: "#FF7B6B",
    **dict(zip(PALETTE, (
        "#56B4E9", "#F0883E", "#2FC79A", "#E08BC0", "#F2C14E", "#9FB8FF", "#C2A878", "#B79AF0",
    ), strict=True)),
    **dict(zip(SERIES[1:], ("#7FA8D8", "#3FCBA9", "#D9C63A", "#D985BE"), strict=True)),
    **dict(zip(COMPONENTS, ("#EE8899", "#6FA8E8", "#E8C25A"), strict=True)),
    **dict(zip(TONES.values(), ("#5FCF95", "#F0B34A", "#FF8A80", "#7CC4FF"), strict=True)),
}  # fmt: skip
"""What the colours of figures become on a dark page; white becomes the page's own."""

MANY = 10
"""Above so many lines of a kind, a band shows their range instead."""

WIDTH, LEFT = 7.0, 0.75
"""Width of a figure and of its left margin, inches."""

MARKED = "mark"
"""Names what stands for a moment."""

MARKS_A_LINE = 6
"""Most kinds of moments in a line of their legend."""

DPI = 150
"""Resolution of bitmaps, dots per inch."""

_RC: Any = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#666666",
    "axes.grid": True,
    "axes.labelsize": 9.5,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9.5,
    "axes.unicode_minus": True,
    "axes.xmargin": 0.0,
    "figure.facecolor": "white",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Helvetica", "Arial"],
    "font.size": 9,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.6,
    "legend.borderaxespad": 0.0,
    "legend.borderpad": 0.0,
    "legend.columnspacing": 1.3,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.handletextpad": 0.5,
    "lines.linewidth": 1.2,
    "lines.solid_capstyle": "round",
    "svg.fonttype": "none",
    "svg.hashsalt": "colift",
    "text.parse_math": False,
    "xtick.color": "#444444",
    "xtick.major.width": 0.7,
    "ytick.color": "#444444",
    "ytick.major.width": 0.7,
}


_active: ContextVar[bool] = ContextVar("active", default=False)


@contextmanager
def look() -> Iterator[None]:
    """Draw and save in this style, whatever the user's own settings; blocks may nest."""
    if _active.get():
        yield
        return
    token = _active.set(True)
    try:
        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(_RC)
            yield
    finally:
        _active.reset(token)


def drone(i: int) -> dict[str, Any]:
    """Colour and line style of drone ``i`` (from 0), the same in every figure."""
    turn, colour = divmod(i, len(PALETTE))
    return {"color": PALETTE[colour], "linestyle": DASHES[turn % len(DASHES)]}


def mark(kind: str) -> dict[str, Any]:
    """Colour and marker of a kind of moment."""
    codes = {"M": Path.MOVETO, "L": Path.LINETO, "Q": Path.CURVE3, "Z": Path.CLOSEPOLY}
    vertices, kinds = [], []
    for letter, numbers in re.findall(r"([MLQZ])([^MLQZ]*)", MARKS[kind].shape):
        points = np.array(numbers.split() or [0.0, 0.0], dtype=float).reshape(-1, 2)
        vertices += [(x - 6.0, 6.0 - y) for x, y in points]
        kinds += [codes[letter]] * len(points)
    return {"color": TONES[MARKS[kind].tone], "marker": Path(vertices, kinds)}


def drone_label(i: int) -> str:
    """Legend text of drone ``i``; only the first spells the word, to keep the legend short."""
    return f"drone {i}" if i == 0 else f"{i}"


def series(k: int) -> dict[str, Any]:
    """Colour and line style of the ``k``-th recording of a comparison."""
    turn, colour = divmod(k, len(SERIES))
    return {"color": SERIES[colour], "linestyle": DASHES[turn % len(DASHES)]}


def grid(
    rows: int = 1,
    columns: int = 1,
    *,
    height: float = 2.3,
    titles: bool = False,
    share: bool = True,
    legend_rows: int = 1,
    left: float = LEFT,
    marks: int = 0,
) -> tuple[Figure, list[Axes]]:
    """A white figure with ``rows`` x ``columns`` axes, each ``height`` inches high, row by row.

    Margins are fixed in inches: room for labels left and below, for the legend's lines on top and,
    if asked, for titles above the axes and for marks with so many lines of legend. With ``share``, the panels of a row have one vertical axis.
    """
    right, bottom, gap = 0.22, 0.48, 0.16
    top = 0.16 + 0.2 * legend_rows + 0.24 * titles + (0.12 + 0.2 * marks if marks else 0.0)
    between = 0.2 if share else 0.75
    total = top + rows * height + (rows - 1) * gap + bottom
    width = (WIDTH - left - right - (columns - 1) * between) / columns
    figure = Figure(figsize=(WIDTH, total))
    axes: list[Axes] = []
    for k in range(rows * columns):
        i, j = divmod(k, columns)
        x = left + j * (width + between)
        y = bottom + (rows - 1 - i) * (height + gap)
        panel = figure.add_axes(
            (x / WIDTH, y / total, width / WIDTH, height / total),
            sharex=axes[j] if i else None,
            sharey=axes[i * columns] if j and share else None,
        )
        panel.locator_params(axis="x", nbins=5, steps=[1, 2, 5, 10])
        panel.locator_params(axis="y", nbins=6)
        panel.tick_params(labelbottom=i == rows - 1, labelleft=j == 0 or not share, length=3)
        panel.yaxis.label.set_gid(f"ylabel_{k}")  # a narrow page moves it out of the way
        axes.append(panel)
    return figure, axes


def legend(figure: Figure, rows: int = 1) -> None:
    """The legend on top of the figure, clear of every line: each label of any axes once, marks below."""
    lines: dict[str, Any] = {}
    marks: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            (marks if handle.get_gid() == MARKED else lines).setdefault(str(label), handle)
    for found, used, wide in ((lines, 0, 1.6), (marks, rows, 0.9)):
        if found:
            tight = {"fontsize": 8, "columnspacing": 0.8, "handlelength": min(1.3, wide)}
            figure.legend(
                list(found.values()),
                list(found),
                loc="upper left",
                bbox_to_anchor=(LEFT / WIDTH, 1.0 - (0.09 + 0.2 * used) / figure.get_figheight()),
                ncols=MARKS_A_LINE if used else -(-len(found) // rows),
                **(tight if used or len(found) > 8 * rows else {"handlelength": wide}),
            )


def plain_ticks(axis: Axis, steps: Sequence[float] = (1.0,)) -> None:
    """Numbers as they are spoken at these multiples of the powers of ten, and nothing between."""
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_locator(NullLocator())
