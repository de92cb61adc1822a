"""Forces given up although the limits allowed them (docs/theory/safe.md): ``python docs/figures/avoidable.py [--fly]``.

From ``avoidable.json`` beside this file. With ``--fly`` it is measured first, some minutes, and needs the extra ``ipopt``:
five families of forces (``colift.study.safety``) for teams of 2 to 24, at the defaults and with other periods, tension limits
and ``spread``. A cycle that misses more than 1e-8 N is judged in two steps: a plane may prove that no cables within
the limits give that force; where none does, IPOPT looks from several starts for tensions and directions that do, within
every limit of the cycle (tension, cone, turn from the last directions, pairs), to 1e-8 N. If it finds some, the miss
was avoidable.
"""

import math

import numpy as np
from pages import fill, stored, table

from colift.control.allocation.limits.reach import out_of_reach
from colift.kernel.math import shares
from colift.study import safety
from colift.team import Team

SIZES = (2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24)
CASES = {
    "defaults": {},
    "20 ms": {"period": 0.02},
    "50 ms": {"period": 0.05},
    "100 ms": {"period": 0.1},
    "tensions 50:1": {"tension": 50.0},
    "`spread` 1e-6": {"spread": 1e-6},
    "`spread` 1e-4": {"spread": 1e-4},
    "`spread` 0.1": {"spread": 0.1},
    "`spread` 1": {"spread": 1.0},
}
OTHERS = (2, 3, 4, 6, 8, 12, 24)
"""Teams of all cases but the defaults."""
CYCLES, OTHER_CYCLES = 30_000, 6_000
"""Of each family of forces, at the defaults and in all other cases."""
SEED = 271_100
STARTS = 3
"""Random starts for IPOPT, after the directions before the cycle and those of the answer."""
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


def tensions_of(part, n):
    """Least and largest tension (n,), N, of drones whose thrust nobody knows."""
    team = Team.uniform(n)
    return part.tension_floors(team), part.tension_caps(team)


def reachable(force, before, tensions, answer, part, turn):
    """Whether IPOPT finds tensions and directions (n, 3) within every limit of the cycle that give the force."""
    solver, least, most = problem(force, before, part, turn)
    n = len(before)
    low, high = tensions_of(part, n)
    free = np.full(3 * n, math.inf)
    rng = np.random.default_rng(0)
    starts = [before, answer]
    for _ in range(STARTS):
        start = before + 0.6 * turn * rng.standard_normal((n, 3))
        starts.append(start / np.linalg.norm(start, axis=1, keepdims=True))
    for start in starts:
        found = solver(
            x0=np.concatenate([np.clip(tensions, low, high), start.ravel()]),
            lbx=np.concatenate([low, -free]), ubx=np.concatenate([high, free]), lbg=least, ubg=most,
        )  # fmt: skip
        g, z = found["g"].full().ravel(), found["x"].full().ravel()
        t, alpha = z[:n], z[n:].reshape(n, 3)
        alpha = alpha / np.linalg.norm(alpha, axis=1, keepdims=True)
        over = max(np.max(least - g), np.max(g - most), np.max(low - t), np.max(t - high))
        if over <= VIOLATION and np.linalg.norm(t @ alpha + force) <= safety.BALANCE_TOLERANCE:
            return True
    return False


def problem(force, before, part, turn):
    """IPOPT on the distance from the force, and the bounds of its constraints."""
    import casadi

    n = len(before)
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
    asked = {"print_time": False, "error_on_fail": False, "show_eval_warnings": False}
    nlp = {"x": x, "f": casadi.dot(rest, rest), "g": casadi.vertcat(*rows)}
    return casadi.nlpsol("reach", "ipopt", nlp, asked | {"ipopt": options}), least, most


def misses(n, case, cycles, seed):
    """Cycles flown, those that missed force, those no plane explains, and those that need not have."""
    part, period = settings(n, case)
    turn = min(part.max_rate * period, 0.5)
    limits = (*tensions_of(part, n), turn, math.radians(part.max_cone_deg))
    flown = missed = open_ = avoidable = 0
    for family in safety.FAMILIES:
        for found in safety.answers(n, family, cycles, part, seed=seed, period=period):
            short = np.flatnonzero(found.missing() > safety.BALANCE_TOLERANCE)
            flown, missed = flown + len(found.forces), missed + len(short)
            proved = out_of_reach(found.forces[short], found.before[short], *limits)
            for k in short[~proved]:
                cycle = (found.before[k], found.tensions[k], found.directions[k])
                open_ += 1
                avoidable += reachable(found.forces[k], *cycle, part, turn)
    return {"cycles": flown, "missed": missed, "not_proved": open_, "avoidable": avoidable}


def fly():
    rows = []
    for name, case in CASES.items():
        usual = name == "defaults"
        for n in SIZES if usual else OTHERS:
            rows.append(
                {"case": name, "n": n, **misses(n, case, CYCLES if usual else OTHER_CYCLES, SEED)}
            )
            print(rows[-1], flush=True)
    return {"seed": SEED, "rows": rows}


def main():
    rows = []
    for each in stored(__file__, fly)["rows"]:
        low, high = shares.interval(each["avoidable"], each["cycles"])
        counts = (each["n"], each["cycles"], each["missed"], each["not_proved"], each["avoidable"])
        rows.append([each["case"], *map(str, counts), f"{1e4 * low:.2f}-{1e4 * high:.2f}"])
    header = ["case", "n", "cycles", "missed", "not proved", "avoidable", "of 10,000 (95 %)"]
    fill("theory/safe.md", "avoidable", table(header, rows))


if __name__ == "__main__":
    main()
