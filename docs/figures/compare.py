"""Write the table of docs/compare.md: ``python docs/figures/compare.py [--fly] [--out DIR]``.

From ``compare.json`` beside this file. With ``--fly``, ``colift compare`` is flown first into DIR, where an interrupted call goes on.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

from pages import fill, table

from colift.kernel.math import shares
from colift.study.campaign.judge import CRITERIA

RESULTS = Path(__file__).with_suffix(".json")
ARGUMENTS = ["--seeds", "3", "--first-seed", "1000"]
SHOWN = (
    "tracking_rms_m", "tracking_max_m", "min_angle_deg", "slack_time_s", "peak_tension_N", "tension_integral_Ns",
    "allocator_median_us", "allocator_p99_us",
)  # fmt: skip


def fly(folder):
    command = [sys.executable, "-m", "colift", "compare", *ARGUMENTS, "--no-spread"]
    subprocess.run([*command, "--out", str(folder)], check=True)
    result = json.loads((folder / "compare.json").read_text())
    wanted = ("allocators", "missions", "seeds", "first_seed", "protocol", "words", "not_installed")
    RESULTS.write_text(json.dumps({key: result[key] for key in wanted}, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fly", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("runs/compare-of-the-docs"))
    given = parser.parse_args()
    if given.fly:
        fly(given.out)
    result = json.loads(RESULTS.read_text())
    criteria = [c for c in CRITERIA if c.metric in SHOWN]
    header = [
        "allocator",
        "held (95 %)",
        "missed",
        "lost",
        *(f"{c.title}, {c.unit}" for c in criteria),
    ]
    rows = []
    for name, each in result["allocators"].items():
        numbers = [each["values"].get(c.metric) for c in criteria]
        rows.append(
            [
                f"`{name}`", shares.text(each["held"], each["flights"]),
                str(each["missed"]), str(each["lost"] + each["failed"] + each["refused"]),
                *("-" if v is None else c.text(v) for c, v in zip(criteria, numbers, strict=True)),
            ]
        )  # fmt: skip
    said = f"`colift compare {' '.join(ARGUMENTS)}`. {' '.join(result['protocol'])}"
    words = "\n".join(f"- {sentence}" for sentence in result["words"])
    fill(
        "compare.md",
        "contest",
        f"{said}\n\n{table(header, rows)}\n\nIn words, as the command prints them:\n\n{words}",
    )


if __name__ == "__main__":
    main()
