"""What certificates say, and splitting beside flying all: ``python docs/figures/certify.py [--fly]``.

Writes the tables of ``docs/certify.md`` from ``certify.json`` beside this file. With ``--fly`` all is flown first, a quarter of an hour.
"""

import math

from pages import fill, stored, table

from colift.kernel.math.sequential import student
from colift.kernel.math.shares import interval
from colift.study.certify import certificate, trials
from colift.study.certify.space import Space

CERTIFIED = (
    ("cut-in-flight", {"truth.load_mass_factor": (0.9, 1.1)}, {"wind_mps": 15.0}, 0.05),
    ("real-world", {"truth.load_mass_factor": (0.95, 1.05)}, {}, 0.05),
)
"""Mission, what varies, what is assumed, bound."""
GUSTY = {
    "timing.duration": 6.0, "timing.allocation": 0.01, "timing.load_control": 0.01,
    "disturbance": [{"kind": "wind", "speed": 10.0}, {"kind": "dryden", "speed": 10.0}, {"kind": "drag", "rotor_drag": 0.02}],
}  # fmt: skip
MOSTS = (0.08,)
"""Largest distance of the load from its reference that is allowed in the gusty hover, m."""
WHOLE, ESTIMATES, BLOCK = 400, 12, 0.5


def fly():
    return {"direct": [direct(*each) for each in CERTIFIED], "rare": rare()}


def direct(mission, vary, limits, bound):
    question = certificate.Question(bound=bound, limits=limits)
    found = certificate.certify(Space.of(mission, {}, vary), question)
    kept = ("result", "flights", "failures", "interval", "statement")
    return {"mission": mission, "vary": vary, "limits": limits, "bound": bound} | {
        name: found[name] for name in kept
    }


def rare():
    rows = []
    for most in MOSTS:
        space = Space.of("hover", {**GUSTY, "criteria.tracking_max_m.max": most})
        row = {"most": most}
        if most == MOSTS[0]:
            flown = trials.fly(space, range(5_000_000, 5_000_000 + WHOLE), {})
            row["whole"] = [sum(bool(each.reason) for each in flown), WHOLE]
        question = certificate.Question(
            method="splitting", most=ESTIMATES, particles=16, block=BLOCK
        )
        found = certificate.certify(space, question)
        row |= {name: found[name] for name in ("probability", "interval", "blocks")}
        rows.append(row)
    return rows


def number(value):
    return f"{value:.2g}" if value >= 1e-3 or value == 0.0 else f"{value:.1e}"


def main():
    result = stored(__file__, fly)
    rows = [
        [
            f"`{row['mission']}`", ", ".join(f"`{k}` {a:g} to {b:g}" for k, (a, b) in row["vary"].items()) or "-",
            ", ".join(f"`{k}` <= {v:g}" for k, v in row["limits"].items()) or "-", f"{row['bound']:g}", row["result"],
            f"{len(row['failures'])} of {row['flights']}", " to ".join(map(number, row["interval"])),
        ]
        for row in result["direct"]
    ]  # fmt: skip
    head = [
        "mission",
        "drawn",
        "assumed",
        "bound",
        "result",
        "failed",
        "probability, each end 95 %",
    ]
    fill("certify.md", "certified", table(head, rows))
    rows = []
    for row in result["rare"]:
        flown = "-"
        if "whole" in row:
            failed, flights = row["whole"]
            low, high = interval(failed, flights)
            flown = f"{failed} of {flights}: {number(low)} to {number(high)}"
        blocks = round(GUSTY["timing.duration"] / BLOCK)
        p, ends = row["probability"], row["interval"]
        share = (
            (1.0 - p) / p / ((ends[1] - p) / student(0.95, ESTIMATES - 1)) ** 2 * p * p
            if ends
            else math.nan
        )
        rows.append(
            [
                f"{100 * row['most']:g}", number(p), "-" if ends is None else " to ".join(map(number, ends)),
                f"{row['blocks'] / blocks:.0f}", flown, f"{share:.0f}" if ends else "-",
            ]
        )  # fmt: skip
    head = [
        "allowed (cm)", "probability by splitting", "each end 95 %", "flights' worth of blocks",
        "whole flights: failed, 95 %", "whole flights for the same error",
    ]  # fmt: skip
    fill("certify.md", "rare", table(head, rows))


if __name__ == "__main__":
    main()
