"""Forces that were given up although the limits allowed them: ``python docs/figures/avoidable.py``.

Five families of forces (``colift.safety``) for teams of 2 to 24, at the defaults and with other periods, tension
limits and ``spread``. A cycle that misses more than 1e-8 N is judged in two steps: a plane may prove that no
cables within the limits give that force; where none does, IPOPT looks for tensions and directions that do, within
every limit of the cycle (tension, cone, turn, pairs), to 1e-8 N. If it finds some, the miss was avoidable.
Writes ``avoidable.json`` beside this file. Needs the extra ``ipopt``.
"""

import argparse
import json
import math
from pathlib import Path

import casadi
import numpy as np

from colift import safety
from colift.allocation._reach import out_of_reach

SIZES = (2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24)
CASES = {
    "defaults": {},
    "20 ms": {"period": 0.02},
    "50 ms": {"period": 0.05},
    "100 ms": {"period": 0.1},
    "tension 50:1": {"tension": 50.0},
    "spread 1e-6": {"spread": 1e-6},
    "spread 1e-4": {"spread": 1e-4},
    "spread 0.1": {"spread": 0.1},
    "spread 1": {"spread": 1.0},
}
OTHERS = (3, 4, 6, 8, 12)
"""Teams of all cases but the defaults."""
VIOLATION = 1e-9
"""By how much IPOPT's point may miss a limit (N, cosine)."""


def settings(n, case):
    """The allocator, and the period, s, of one case."""
    team, safe = safety.problem(n)
    changes = {}
    if "spread" in case:
        changes["spread"] = case["spread"]
    if "tension" in case:  # three shares of the load at most
        most = 3.0 * team.load_mass * safety.GRAVITY / n
        changes |= {"tension_max": most, "tension_min": most / case["tension"]}
    return safe.model_copy(update=changes), case.get("period", safety.PERIOD)


def reachable(force, before, tensions, part, turn):
    """Whether IPOPT finds tensions and directions (n, 3) within every limit of the cycle that give the force."""
    n = len(before)
    low, high = part.tension_floors(n), part.tension_caps(n)
    cosine, height = (math.cos(math.radians(x)) for x in (part.min_angle_deg, part.max_cone_deg))
    T, alpha = casadi.SX.sym("T", n), casadi.SX.sym("alpha", 3, n)
    near = [
        (i, j)
        for i in range(n)
        for j in range(i)
        if before[i] @ before[j] > math.cos(math.radians(part.min_angle_deg) + 2.0 * turn)
    ]
    rows = [casadi.dot(alpha[:, i], alpha[:, i]) for i in range(n)]
    rows += [casadi.dot(alpha[:, i], casadi.DM(before[i])) for i in range(n)]
    rows += [-alpha[2, i] for i in range(n)]
    rows += [-casadi.dot(alpha[:, i], alpha[:, j]) for i, j in near]
    least = np.concatenate(
        [np.ones(n), np.full(n, math.cos(turn)), np.full(n, height), np.full(len(near), -cosine)]
    )
    most = np.concatenate([np.ones(n), np.full(2 * n + len(near), math.inf)])
    rest = casadi.mtimes(alpha, T) + casadi.DM(force)
    x = casadi.vertcat(T, casadi.vec(alpha))
    options = {"print_level": 0, "sb": "yes", "tol": 1e-12, "constr_viol_tol": 1e-12}
    options |= {"bound_relax_factor": 0.0, "max_iter": 500, "acceptable_iter": 0}
    solver = casadi.nlpsol(
        "reach", "ipopt", {"x": x, "f": casadi.dot(rest, rest), "g": casadi.vertcat(*rows)},
        {"print_time": False, "error_on_fail": False, "show_eval_warnings": False, "ipopt": options},
    )  # fmt: skip
    free = np.full(3 * n, math.inf)
    found = solver(
        x0=np.concatenate([np.clip(tensions, low, high), before.ravel()]),
        lbx=np.concatenate([low, -free]), ubx=np.concatenate([high, free]), lbg=least, ubg=most,
    )  # fmt: skip
    g = found["g"].full().ravel()
    z = found["x"].full().ravel()
    t, a = z[:n], z[n:].reshape(n, 3)
    a = a / np.linalg.norm(a, axis=1, keepdims=True)
    over = max(np.max(least - g), np.max(g - most), np.max(low - t), np.max(t - high))
    return over <= VIOLATION and np.linalg.norm(t @ a + force) <= safety.BALANCE_TOLERANCE


def misses(n, case, cycles, seed):
    """Cycles flown, those that missed force, and those that need not have."""
    part, period = settings(n, case)
    turn = min(part.max_rate * period, 0.5)
    limits = (part.tension_floors(n), part.tension_caps(n), turn, math.radians(part.max_cone_deg))
    flown = missed = avoidable = 0
    for family in safety.FAMILIES:
        for found in safety.answers(n, family, cycles, part, seed=seed, period=period):
            short = np.flatnonzero(found.missing() > safety.BALANCE_TOLERANCE)
            flown, missed = flown + len(found.forces), missed + len(short)
            proved = out_of_reach(found.forces[short], found.before[short], *limits)
            for k in short[~proved]:
                before, tensions = found.before[k], found.tensions[k]
                avoidable += reachable(found.forces[k], before, tensions, part, turn)
    return flown, missed, avoidable


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--cycles", type=int, default=20_000, help="of each family of forces")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--sizes", type=lambda text: [int(n) for n in text.split(",")])
    parser.add_argument("--cases", type=lambda text: text.split(","), default=list(CASES))
    parser.add_argument("--no-file", action="store_true", help="only print")
    asked = parser.parse_args()
    rows = []
    for name in asked.cases:
        for n in asked.sizes or (SIZES if name == "defaults" else OTHERS):
            flown, missed, avoidable = misses(n, CASES[name], asked.cycles, asked.seed)
            rows.append(
                {"case": name, "n": n, "cycles": flown, "missed": missed, "avoidable": avoidable}
            )
            print(f"{name}, n = {n}: {missed} of {flown} missed, {avoidable} avoidable", flush=True)
    if not asked.no_file:
        text = json.dumps({"seed": asked.seed, "rows": rows}, indent=1)
        Path(__file__).with_suffix(".json").write_text(text + "\n")


if __name__ == "__main__":
    main()
