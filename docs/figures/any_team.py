"""Write the table of docs/your-drones.md on random teams of which only the bodies are given.

python docs/figures/any_team.py [--fly]

From ``any_team.json`` beside this file, which ``--fly`` makes first with ``benchmarks/any_team.py``: what is refused is flown as
well, so that false alarms are counted. No tuning saw these seeds, but the bound of the thrust was loosened after two of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from pages import benchmark, fill, stored, table

from colift.kernel.math import shares

FIRST, MISSIONS = 72_000, 400
TEAMS = {"one drone": (1,), "two": (2,), "three to eight": tuple(range(3, 9))}


def fly(seed: int) -> Mapping[str, Any]:
    return benchmark("any_team").fly((seed, True))


def digest(found: Iterable[Mapping[str, Any]]) -> list[list[Any]]:
    """Of each mission its seed, number of drones, why it was refused, whether it flew well, what was wrong."""
    return [
        [each["seed"], each["n"], each["refused"], each.get("good"), each.get("flaw", "")]
        for each in found
    ]


def measure() -> list[list[Any]]:
    with ProcessPoolExecutor() as pool:
        return digest(pool.map(fly, range(FIRST, FIRST + MISSIONS)))


def main() -> None:
    found = stored(__file__, measure)
    lines = []
    for name, sizes in {**TEAMS, "all": range(1, 9)}.items():
        those = [(bool(refused), well) for _, n, refused, well, _ in found if n in sizes]
        count = Counter(those)
        let = [well for refused, well in those if not refused]
        lines.append(
            [
                name, str(len(those)), shares.text(sum(map(bool, let)), len(let)),
                str(count[True, False] + count[True, None]), str(count[True, True]),
                shares.text(sum(map(bool, let)) + count[True, False] + count[True, None], len(those)),
            ]
        )  # fmt: skip
    header = ["drones", "missions", "let fly, and fly well", "refused, would fail", "refused, would fly well", "flies well or is rightly refused"]  # fmt: skip
    fill("your-drones.md", "any-team", table(header, lines))


if __name__ == "__main__":
    main()
