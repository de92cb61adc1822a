"""Write the tables of docs/stress.md: ``python docs/figures/stress.py [--fly] [--seeds 240] [--out DIR]``.

From ``stress.json`` beside this file. With ``--fly`` the campaigns of :data:`CAMPAIGNS` are flown first, into a folder
each of DIR, where an interrupted call goes on; their seeds begin at :data:`FIRST_SEED`, or those of :data:`FRESH`, which no tuning has seen.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

from pages import DOCS, fill, table

from colift.kernel.math import shares

RESULTS = Path(__file__).with_suffix(".json")
FIRST_SEED, FRESH = 43_000, {"fresh": 47_000, "taut": 47_000}
SOME = (
    "calm;wind;all, load +50 %;all, load -50 %;cable cut;drone dead, on its cable;one motor dead;"
    "drone's sensors stuck for good"
)
MISSION = "real-world"
"""The mission that the page is about."""
WEATHER = "calm;delay;noise;wind;radio;load +50 %;load -50 %;all, load +50 %;all, load -50 %"
FAULTS = (
    "cable cut;drone dead, on its cable;drone dead, cable cut;one motor dead;one motor at half;battery down to 70 %;"
    "drone's sensors stuck, 0.2 s;drone's sensors stuck for good;load's sensors stuck, 0.1 s;allocator silent, 0.3 s"
)
DRAGGED = [
    "--conditions", "wind;all, load +50 %;all, load -50 %;cable cut in wind;one motor dead in wind",
    "--set", "drones.rotor_drag=0.05", "--set", "disturbance.3.rotor_drag=0.05",
]  # fmt: skip
HALF = ["--conditions", "all, load -50 %"]
CAMPAIGNS = {
    "weather": (["--conditions", WEATHER], 1),
    "faults": (["--conditions", FAULTS], 4),
    "storm": (["--conditions", "* in wind;* in all, load +50 %;* in all, load -50 %"], 8),
    "drag": (DRAGGED, 4),
    "fresh": (HALF, 2),
    "taut": ([*HALF, "--set", "allocation.tension_min=0.39", "--set", "load_control.rate=0.6"], 2),
    "soft": ([*DRAGGED, "--set", "position_control.gain=0.6"], 12),
    "plants": (
        [
            "--allocators",
            "safe,sqp",
            "--plants",
            "slack-cables,elastic-cables,bead-cables,mujoco",
            "--conditions",
            SOME,
        ],
        60,
    ),
}
"""Arguments of ``colift stress``, and of how many seeds of the first campaign one is flown here."""


def fly(seeds, folder):
    """Fly what is not there yet, and keep what the page shows of it."""
    found = {}
    for name, (arguments, part) in CAMPAIGNS.items():
        first = str(FRESH.get(name, FIRST_SEED))
        asked = ["--seeds", str(max(1, seeds // part)), "--first-seed", first, *arguments]
        command = [sys.executable, "-m", "colift", "stress", MISSION, *asked, "--replays", "0"]
        subprocess.run([*command, "--out", str(folder / name)], check=True)
        result = json.loads((folder / name / "stress.json").read_text())
        found[name] = {
            key: result[key] for key in ("mission", "seeds", "passed", "flights", "conditions")
        } | {"arguments": asked}
    RESULTS.write_text(json.dumps(found, indent=1) + "\n")


def single(result):
    """All that is known of one place."""
    header = ["condition", "passed", "95 %", "lost", "distance", "angle", "slack"]
    rows = []
    for condition, (cell,) in result["conditions"].items():
        rows.append([condition, *share(cell), str(cell["lost"]), *numbers(cell)])
    return said(result) + table(header, rows)


def storm(result):
    """A line a fault, a column a weather."""
    weathers = list(dict.fromkeys(name.split(" in ", 1)[1] for name in result["conditions"]))
    faults = list(dict.fromkeys(name.split(" in ", 1)[0] for name in result["conditions"]))
    rows = [
        [fault, *(short(result["conditions"][f"{fault} in {weather}"][0]) for weather in weathers)]
        for fault in faults
    ]
    return said(result) + table(["fault", *(f"in {weather}" for weather in weathers)], rows)


def plants(result):
    """A table an allocator, a column a plant."""
    cells = {
        (condition, cell["allocator"], cell["plant"]): cell
        for condition, row in result["conditions"].items()
        for cell in row
    }
    conditions, allocators, kinds = (
        list(dict.fromkeys(names)) for names in zip(*cells, strict=True)
    )
    tables = [
        table(
            [f"`{allocator}`", *(f"`{kind}`" for kind in kinds)],
            [
                [condition, *(short(cells[condition, allocator, kind]) for kind in kinds)]
                for condition in conditions
            ],
        )
        for allocator in allocators
    ]
    return said(result) + "\n\n".join(tables)


def said(result):
    words = " ".join(
        f'"{word}"' if " " in word or "*" in word or ";" in word else word
        for word in result["arguments"]
    )
    first, last = result["seeds"]
    passed = shares.text(result["passed"], result["flights"])
    return f"`colift stress {result['mission']} {words}`: seeds {first} to {last}, {passed} flights pass.\n\n"


def share(cell):
    digits = 0 if cell["flights"] < 100 else 1
    return f"{cell['passed']}/{cell['flights']}", shares.percent(*cell["interval"], digits)


def numbers(cell):
    units = (("worst_m", 100.0, 1, " cm"), ("least_deg", 1.0, 0, "°"), ("slack_s", 1.0, 2, " s"))
    return [
        "-" if cell[name] is None else f"{scale * cell[name]:.{digits}f}{unit}"
        for name, scale, digits, unit in units
    ]


def short(cell):
    """A cell in one text."""
    lost = f", {cell['lost']} lost" if cell["lost"] else ""
    return f"{shares.text(cell['passed'], cell['flights'])}{lost}, {', '.join(numbers(cell)[:2])}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fly", action="store_true")
    parser.add_argument("--seeds", type=int, default=240)
    parser.add_argument("--out", type=Path, default=Path("runs/stress-of-the-docs"))
    given = parser.parse_args()
    if given.fly:
        fly(given.seeds, given.out)
    results = json.loads(RESULTS.read_text())
    for name, write in (
        ("weather", single),
        ("faults", single),
        ("fresh", single),
        ("taut", single),
        ("drag", single),
        ("soft", single),
        ("storm", storm),
        ("plants", plants),
    ):
        fill("stress.md", name, write(results[name]))
    print(DOCS / "stress.md")


if __name__ == "__main__":
    main()
