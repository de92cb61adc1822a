"""How well a team without a leader makes force and moment on a rigid load that are wanted (docs/theory/leaderless.md), over a radio that fails.

From ``rigid_agents.json`` beside this file: ``python docs/figures/rigid_agents.py [--fly]``; ``--fly`` measures all of it anew.
"""

import numpy as np
from agents import short, spread
from pages import fill, stored, table

from colift.control.agents.leaderless_wrench import LeaderlessWrench
from colift.study.rigid_rehearsal import distances, missing, rehearse, team_of, wanted
from colift.team.plan import plan
from colift.world.network.radio import Radio

N = 4
"""Drones."""
SEEDS = range(61_000, 61_003)
"""No choice of a constant has seen them."""
ROWS, BEGIN = 600, 300
SPREAD = 0.02
CASES = {
    **{f"loss {100 * loss:.0f} %": {"loss": loss, "delay": 0.0, "jitter": 0.0} for loss in (0.0, 0.2, 0.6)},
    "20-50 ms, loss 20 %": {"loss": 0.2, "delay": 0.02, "jitter": 0.03},
    "bursts of 0.5 s, loss 20 %": {"loss": 0.2, "burst": 0.5},
}  # fmt: skip


def flown(seed: int, radio: dict) -> dict[str, float]:
    """Errors after the beginning: force, N, moment, N m; and the least distance, m."""
    team = team_of(N)
    what = wanted(team, ROWS, seed, SPREAD)
    pulls, _ = rehearse(LeaderlessWrench(), Radio(**radio), team, plan(team)[0], what, key=seed)
    force, moment = (each[BEGIN:] for each in missing(team, what, pulls))
    return {
        "force": float(np.sqrt(np.mean(force**2))), "most_force": float(force.max()),
        "moment": float(np.sqrt(np.mean(moment**2))), "most_moment": float(moment.max()),
        "least": float(distances(team, what, pulls).min()),
    }  # fmt: skip


def row_of(name: str, found: list[dict[str, float]]) -> list[str]:
    """A row of the table."""
    errors = [
        f"{spread([each[kind] for each in found])}, max {short(1e3 * max(each[f'most_{kind}'] for each in found))}"
        for kind in ("force", "moment")
    ]
    return [name, *errors, f"{min(each['least'] for each in found):.2f}"]


def measure() -> dict[str, list[dict[str, float]]]:
    """All cases with each seed."""
    return {name: [flown(seed, radio) for seed in SEEDS] for name, radio in CASES.items()}


def main() -> None:
    rows = [row_of(name, found) for name, found in stored(__file__, measure).items()]
    header = ["", "force, mN", "moment, mN m", "drones apart, m"]
    fill("theory/leaderless.md", "rigid", table(header, rows))


if __name__ == "__main__":
    main()
