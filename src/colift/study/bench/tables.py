"""The benchmark's result as titled tables of text that fit 80 columns."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from colift.study.bench.problems import FAMILIES, NAMES

Table = tuple[str, list[str], list[list[str]]]

TITLES = {"paper": "The paper's problem", "safe": "The safe problem"}
MEASURES = {
    "balance": "force",
    "norm": "unit",
    "stationarity": "KKT",
    "angle_deg": "angle",
    "tension": "tens.",
    "cone_deg": "cone",
}
"""The referee's measures that are shown, and what their columns are called."""
PERCENTILES_FROM = 100
"""Calls below which a 99th percentile says nothing."""


def tables(result: dict[str, Any]) -> Iterator[Table]:
    """Times of our allocator, times of all, and what the referee found, for each problem."""
    rows = result["results"]
    for problem in NAMES:
        for family in FAMILIES:
            some = [r for r in rows if (r["problem"], r["family"]) == (problem, family)]
            if some:
                yield _own(f"{TITLES[problem]}, {family} force", some)
                yield _all(f"{TITLES[problem]}, {family} force", some)
        yield _quality(TITLES[problem], [r for r in rows if r["problem"] == problem])
    counted = result.get("instructions", {}).get("rows")
    if counted:
        yield _instructions(result["instructions"])


def own(rows: list[dict[str, Any]], n: int, caller: str) -> dict[str, Any]:
    """The row of our allocator, which comes first, for n cables."""
    return next(r for r in rows if r["n"] == n and r["caller"] == caller)


def ratio(rows: list[dict[str, Any]], n: int, solver: str = "slsqp") -> float:
    """Processor time of a general solver over the time of our allocator in the loop; NaN without it."""
    theirs = [r["cpu_us"] for r in rows if r["n"] == n and r["solver"] == solver]
    return theirs[0] / own(rows, n, "loop")["median_us"] if theirs else math.nan


def sizes(rows: list[dict[str, Any]]) -> list[int]:
    return sorted({r["n"] for r in rows})


def time(us: float) -> str:
    """A time in us with three digits, in ms or s where that is long."""
    if not math.isfinite(us):
        return "-"
    if us >= 1e6:
        return f"{us / 1e6:.3g} s"
    if us >= 1e4:
        return f"{us / 1e3:.3g} ms"
    return f"{us:.3g}" if us < 1e3 else f"{us:.0f}"


def p99(row: dict[str, Any]) -> float:
    """99th percentile of a row, us; NaN where there are too few calls for one."""
    return float(row["p99_us"]) if row["calls"] >= PERCENTILES_FROM else math.nan


def _own(title: str, rows: list[dict[str, Any]]) -> Table:
    body = []
    for n in sizes(rows):
        loop, python = own(rows, n, "loop"), own(rows, n, "python")
        times = (loop["median_us"], p99(loop), loop["worst_us"], loop["cpu_us"])
        body.append(
            [
                str(n), str(loop["calls"]), *map(time, times), f"{loop['iterations']:.1f}",
                time(python["median_us"]), time(p99(python)),
            ]
        )  # fmt: skip
    name = rows[0]["solver"]
    return (
        f"{title}, us: {name} in a compiled loop; the last two from Python",
        ["n", "calls", "median", "p99", "worst", "CPU", "iter.", "Python", "its p99"],
        body,
    )


def _all(title: str, rows: list[dict[str, Any]]) -> Table:
    solvers = list(dict.fromkeys(r["solver"] for r in rows))
    callers = {r["solver"]: r["caller"] for r in reversed(rows)}
    median = {(r["n"], r["solver"], r["caller"]): r["cpu_us"] for r in rows}
    body = [
        [
            str(n),
            *(time(median.get((n, solver, callers[solver]), math.nan)) for solver in solvers),
            f"{ratio(rows, n):.0f}" if math.isfinite(ratio(rows, n)) else "-",
        ]
        for n in sizes(rows)
    ]
    return (
        f"{title}: median processor time, us; the last column is slsqp over {solvers[0]}",
        ["n", *solvers, "ratio"],
        body,
    )


def _quality(title: str, rows: list[dict[str, Any]]) -> Table:
    body = []
    for solver in dict.fromkeys(r["solver"] for r in rows):
        some = [r for r in rows if r["solver"] == solver]
        body.append(
            [
                solver,
                str(sum(r["judged"] for r in some)),
                str(sum(r["wrong"] for r in some)),
                *(_largest(r["worst"][name] for r in some) for name in MEASURES),
                _largest(r["excess"] for r in some),
            ]
        )
    return (
        f"{title}, judged by the answers alone: the worst of each measure",
        ["", "seen", "wrong", *MEASURES.values(), "cost"],
        body,
    )


def _instructions(counted: dict[str, Any]) -> Table:
    found = {(r["problem"], r["family"], r["n"]): r["instructions"] for r in counted["rows"]}
    kinds = [(problem, family) for problem in NAMES for family in FAMILIES]
    return (
        f"Instructions of a call, mean of {counted['calls']}, code for {counted['target']}",
        ["n", *(f"{problem}, {family}" for problem, family in kinds)],
        [
            [str(n), *(f"{found[problem, family, n]:.0f}" for problem, family in kinds)]
            for n in sorted({r["n"] for r in counted["rows"]})
        ],
    )


def _largest(values: Iterable[float | None]) -> str:
    """The largest that is a number; JSON has null for what was not measured."""
    found = [value for value in values if value is not None and math.isfinite(value)]
    if not found:
        return "-"
    return f"{max(found):.0e}" if max(found) > 0.0 else "0"


def notes(result: dict[str, Any]) -> Iterator[str]:
    """What the tables do not say: who was left out and why, the closed loop, the machine."""
    reasons: dict[tuple[str, str], list[int]] = {}
    for row in result["skipped"]:
        what = f"{row['solver']} on the {row['problem']} problem, {row['family']} force"
        reasons.setdefault((what, row["reason"]), []).append(row["n"])
    for (what, reason), left_out in reasons.items():
        yield f"Left out: {what}, from n = {min(left_out)} on: {reason}."
    if reason := result.get("instructions", {}).get("reason"):
        yield f"No instructions counted: {reason}."
    loop = result["closed_loop"]
    yield (
        f"Closed loop, paper-spiral, {loop['simulated_s']:g} s recorded: median {loop['median_s']:.3f} s "
        f"of {loop['repetitions']}, worst {loop['worst_s']:.3f} s."
    )
    yield ", ".join(f"{key} {value}" for key, value in result["machine"].items())
