"""What certificates say, and splitting beside flying all: ``python docs/figures/certify.py [--fly]``.

Writes the tables of ``docs/certify.md`` from ``certify.json`` beside this file. With ``--fly`` all is flown first, a quarter of an hour.
"""

import math

import numpy as np
from pages import fill, stored, table

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
RARE = ((GUSTY, 0.09, 0.5, 32, 8, 200),)
"""Changes of a hover; how far from its reference the load may be, m; block, s; particles; estimates; whole flights beside them."""


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
    return [estimated(*each) for each in RARE]


def estimated(changes, most, block, particles, estimates, whole):
    """A hover by splitting, and so many whole flights beside it; each on seeds of its own."""
    space = Space.of("hover", {**changes, "criteria.tracking_max_m.max": most})
    question = certificate.Question(
        method="splitting", first_seed=6_000_000, most=estimates, particles=particles, block=block
    )
    found = certificate.certify(space, question)
    flown = trials.fly(space, range(5_000_000, 5_000_000 + whole), {})
    row = {name: found[name] for name in ("probability", "interval", "blocks", "estimates")}
    blocks = math.ceil(changes["timing.duration"] / block)
    return row | {
        "most": most, "blocks_per_flight": blocks, "particles": particles,
        "whole": [sum(bool(each.reason) for each in flown), whole],
    }  # fmt: skip


def gains(row):
    """How many whole flights an estimate of the same error takes, for each flight's worth of blocks; and 90 % of resampled estimates."""
    values = np.array([each["probability"] for each in row["estimates"]])
    cost = row["blocks"] / row["blocks_per_flight"]

    def gain(values):
        p, variance = values.mean(), values.var(ddof=1) / len(values)
        return p * (1.0 - p) / variance / cost if variance > 0.0 else math.nan

    rng = np.random.default_rng(0)
    again = [gain(rng.choice(values, len(values))) for _ in range(4000)]
    return gain(values), *np.nanquantile(again, [0.05, 0.95])


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
        failed, flights = row["whole"]
        gain, least, largest = gains(row)
        rows.append(
            [
                f"{100 * row['most']:g}", number(row["probability"]), " to ".join(map(number, row["interval"] or (0.0, 1.0))),
                f"{len(row['estimates'])} of {row['particles']}", f"{row['blocks'] / row['blocks_per_flight']:.0f}",
                f"{failed} of {flights}: {' to '.join(map(number, interval(failed, flights)))}",
                f"{gain:.2g} ({least:.2g} to {largest:.2g})",
            ]
        )  # fmt: skip
    head = [
        "allowed (cm)", "probability by splitting", "each end 95 %", "estimates, particles each", "flights' worth of blocks",
        "whole flights: failed, 95 %", "whole flights for one, at the same error (90 %)",
    ]  # fmt: skip
    fill("certify.md", "rare", table(head, rows))


if __name__ == "__main__":
    main()
