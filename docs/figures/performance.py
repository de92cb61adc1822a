"""Write the page on speed and its figure: ``python docs/figures/performance.py [--measure]``.

From ``performance.json`` and ``latency.json`` beside this file to ``docs/performance.md`` and
``scaling_light.svg``, ``scaling_dark.svg``. With ``--measure`` both are measured first.
"""

import json
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

from colift.study import latency
from colift.study.bench.tables import TITLES, notes, own, ratio, sizes, tables

HERE = Path(__file__).parent
MEASUREMENTS = {
    "performance": ["bench", "--instructions"],
    "latency": ["latency"],
}
"""Command whose result each file holds."""
COLOURS = {
    "sqp": "#3b82c4", "safe": "#3b82c4", "slsqp": "#d9822b", "ipopt": "#3a9d6b", "wahba-hoenig": "#a05fb4"
}  # fmt: skip


def measure():
    for name, arguments in MEASUREMENTS.items():
        command = [sys.executable, "-m", "colift", *arguments, "--out", str(HERE / f"{name}.json")]
        subprocess.run(command, check=True)


def rows_of(result, problem, family):
    return [r for r in result["results"] if (r["problem"], r["family"]) == (problem, family)]


def growth(rows):
    """Exponent of n that the time of our allocator follows, from 16 cables on (least squares)."""
    some = [own(rows, n, "loop") for n in sizes(rows) if n >= 16]
    n, us = np.log([r["n"] for r in some]), np.log([r["median_us"] for r in some])
    return float(np.polyfit(n, us, 1)[0])


def draw(result, ink, path):
    mpl.rcParams.update(
        {
            "svg.hashsalt": "colift", "svg.fonttype": "path", "font.size": 9, "text.color": ink,
            "axes.edgecolor": ink, "axes.labelcolor": ink, "xtick.color": ink, "ytick.color": ink,
            "axes.spines.top": False, "axes.spines.right": False, "grid.color": ink, "grid.alpha": 0.15,
        }
    )  # fmt: skip
    figure, grid = plt.subplots(1, 2, figsize=(8.4, 3.9), layout="constrained", sharey=True)
    for axes, (problem, title) in zip(grid, TITLES.items(), strict=True):
        for family, style in (("smooth", "-"), ("noisy", "--")):
            rows = rows_of(result, problem, family)
            for solver, colour in COLOURS.items():
                some = [r for r in rows if r["solver"] == solver and r["caller"] != "python"]
                some = some or [r for r in rows if r["solver"] == solver]
                if some:
                    axes.plot(
                        [r["n"] for r in some], [r["cpu_us"] for r in some], style, color=colour,
                        marker="o", ms=3, lw=1.2, label=solver if family == "smooth" else None,
                    )  # fmt: skip
        axes.set(xscale="log", yscale="log", title=title, xlabel="number of cables")
        axes.set_xticks(sizes(result["results"]), map(str, sizes(result["results"])), fontsize=7)
        axes.minorticks_off()
        axes.grid(True)
        axes.legend(
            frameon=False,
            fontsize=8,
            loc="upper left",
            title="solid: smooth, dashed: noisy force",
            title_fontsize=7,
        )
    grid[0].set_ylabel("processor time of a call (median), us")
    figure.savefig(path, transparent=True, metadata={"Date": None})
    plt.close(figure)


def markdown(table):
    title, header, rows = table
    header = [name.replace("\n", ", ") for name in header]
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return f"**{title}.**\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def machine(result):
    return ", ".join(f"{key} {value}" for key, value in result["machine"].items())


def summary(result):
    """Plain sentences, computed from the rows."""
    paper, safe = rows_of(result, "paper", "smooth"), rows_of(result, "safe", "smooth")
    noisy = rows_of(result, "safe", "noisy")
    lines = []
    for n in (4, 64):
        if n in sizes(paper):
            row = own(paper, n, "loop")
            line = f"- The paper's problem, n = {n}: {row['median_us']:.2g} us in the loop"
            if ratio(paper, n) == ratio(paper, n):
                line += f", {ratio(paper, n):,.0f} times faster than SLSQP in the same run"
            lines.append(line + ".")
    lines.append(f"- From 16 cables on its time grows as n^{growth(paper):.2f}.")
    for n in (4, 16):
        if n in sizes(safe):
            pair = (own(safe, n, "loop")["median_us"], own(noisy, n, "loop")["median_us"])
            lines.append(
                f"- The safe problem, n = {n}: {pair[0]:.2g} us along the smooth force, {pair[1]:.2g} us along the noisy one."
            )
    lines.append(
        f"- From 16 cables on its time grows as n^{growth(safe):.2f}: more pairs are near."
    )
    return "\n".join(lines)


def page(result, late):
    parts = [PAGE.format(machine=machine(result), summary=summary(result), **result["effort"])]
    parts += [markdown(table) for table in tables(result)]
    parts.append("## Left out\n")
    parts.append(
        "\n".join(f"- {note}" for note in notes(result) if "Left out" in note or "No " in note)
    )
    parts.append(LATENCY.format(**late | {"machine": machine(late)}))
    parts += [markdown(table) for table in latency.tables(late)]
    return "\n".join(parts)


PAGE = """# Speed, and what the answers are worth

Written by `python docs/figures/performance.py` from `docs/figures/performance.json` and
`docs/figures/latency.json`. To measure anew, about twelve minutes on a quiet machine:

```sh
python docs/figures/performance.py --measure     # colift bench --instructions, colift latency, this page
```

Measured on: {machine}.

{summary}

```{{image}} figures/scaling_light.svg
:class: only-light
:alt: Processor time of a call over the number of cables, for all solvers
```

```{{image}} figures/scaling_dark.svg
:class: only-dark
:alt: Processor time of a call over the number of cables, for all solvers
```

## How it is measured

**Problems.** [The paper's](theory/objective.md) every 1 ms, and [the safe one](theory/safe.md) every
10 ms. The wanted force turns on a circle of 2 m/s² with a vertical oscillation of 0.5 m/s²; the noisy family adds
white noise of 0.3 m/s² to every force. Load and `mu` are scaled with n, which keeps the paper's cone. The least
angle of the safe problem is 30 degrees, from about 10 cables on 0.7 of an even spread in the cone.

**Turns.** All solvers run in one process and take turns along the same forces; who leads changes with every
round. {rounds} rounds, {budget:g} s for each solver in each race; a solver for which that does not suffice is left out
and named below. A fast solver's turn is up to 200 calls, of which the first tenth is not timed, because another solver
has just used the caches. Warm-up is excluded; the collector is off. Everyone starts from the same
formation and from there on from its own last answer. General solvers get analytic derivatives and one BLAS thread; only
their own call is timed, not the set-up of the problem.

**Time.** median, p99 and worst are wall time of one call, CPU is processor time of the thread. The machine's other
work shows in p99 and worst; processor time and instructions are what to compare.

**Referee.** Every answer that is judged is judged from tensions and directions alone: error of the *force*
balance over the force; *unit* length; *KKT* residual with the best multipliers of the right sign; shortfall of the least
*angle* and excess over the *cone*, degrees; excess over the bounds of *tensions*, in mean tensions. *wrong* counts
answers with a fault that their solver called solved. *cost* is how far the cost lies above the best faultless answer
to the same force, relative to the closed-form optimum: the median, of the worst n.

`safe` is not at rest at the optimum of each instant: it settles there within 0.3 s and keeps a barrier to the limits, so its KKT
residual is not small. It may give up part of a force that its limits do not allow, and says so; those answers
are not *wrong*. `wahba-hoenig`, `internal-force`, `min-norm` and `ring` solve problems of their
own and are shown for what they cost and what they break.
"""

LATENCY = """
## On a clock, while others use the machine

`colift latency` calls the allocators {rate_hz:g} times a second for {seconds:g} s each while {other_processes}
processes keep the machine busy. *python* sleeps between calls of `allocate()`; *untidy* is the same in a program with
a large heap that makes cyclic garbage in every tick; *loop* is compiled. A tick that was skipped
because the one before took too long counts as missed, and with the time until the answer that came too late for it. Measured
on: {machine}.
"""


if __name__ == "__main__":
    if "--measure" in sys.argv[1:]:
        measure()
    result, late = (json.loads((HERE / f"{name}.json").read_text()) for name in MEASUREMENTS)
    draw(result, "#222222", HERE / "scaling_light.svg")
    draw(result, "#dddddd", HERE / "scaling_dark.svg")
    (HERE.parent / "performance.md").write_text(page(result, late), encoding="utf-8")
