"""Write the tables of docs/real-flights.md: ``python docs/figures/ten_flights.py [--fly FOLDER]``.

From ``ten_flights.json`` beside this file. With ``--fly`` the flights (``*.csv``) of the folder are judged first, as
``colift judge`` does, and what the tables show is kept; times are worth something on a quiet machine only.
"""

import sys
from pathlib import Path

from pages import fill, stored, table

from colift.study import judge as judgement
from colift.study.judge.asking import ACTUAL, ON_BOARD
from colift.study.judge.tables import shown, summary

LEFT_OUT = ("ipopt", "slsqp")
"""Of the table of angles: they solve the problem of `sqp`."""


def named(allocator):
    return f"*{allocator}*" if allocator in (ACTUAL, ON_BOARD) else f"`{allocator}`"


def ask():
    paths = sorted(Path(sys.argv[sys.argv.index("--fly") + 1]).glob("*.csv"))
    kinds, _ = judgement.choose(None)
    judged = [judgement.judge(judgement.open_flight(path), kinds) for path in paths]
    return {
        "summary": [list(each) for each in summary(judged)],
        "angles": {
            j.flight: {a.allocator: shown(a.numbers["min_angle_deg"], 1) for a in j.answers}
            for j in judged
        },
        "findings": judgement.findings(judged),
    }


def main():
    found = stored(__file__, ask)
    parts = [
        f"**{title}**\n\n{table(header, [[named(row[0]), *row[1:]] for row in rows])}"
        for title, header, rows in found["summary"]
    ]
    fill("real-flights.md", "over-all", "\n\n".join(parts))
    kinds = [k for k in next(iter(found["angles"].values())) if k not in LEFT_OUT]
    rows = [
        [flight, *(angles[kind] for kind in kinds)] for flight, angles in found["angles"].items()
    ]
    fill("real-flights.md", "by-flight", table(["flight", *map(named, kinds)], rows))
    fill("real-flights.md", "findings", "\n".join(f"- {each}" for each in found["findings"]))


if __name__ == "__main__":
    main()
