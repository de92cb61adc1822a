"""The heaviest load of ``colift feasibility`` against IPOPT: ``python docs/figures/feasibility.py [--fly]``.

Random teams of 2 to 12 drones: alike, somewhat and very different ones; with tension or motors that limit, a cone, a least
angle, a least tension and a tilt that may do. IPOPT gets the same problem in other variables and other words, written here and
not taken from colift (tensions and unit vectors, squares instead of norms and angles), from random starts of its own. Every
answer, colift's too, is then checked against the limits in plain NumPy, by angles. Writes the table of ``theory/safe.md`` from
``feasibility.json`` beside this file; ``--fly`` asks both first, which takes some minutes. Needs the extra ``ipopt`` for that.
"""

import math
import time
from functools import lru_cache
from unittest import mock

import numpy as np
from pages import fill, stored, table

from colift.control.allocation.limits import feasibility as feasibility_of
from colift.control.allocation.safe import Safe
from colift.kernel.math import shares
from colift.team import Team
from colift.world.actuation.motors import Motors

SEED = 20260
TEAMS = 200
STARTS = 24
"""IPOPT's starts for each team."""
CLOSE = 0.02
KEPT = 1e-6
"""By how much an answer may miss a limit (rad, shares of a force)."""
LIKENESS = ("alike", "different", "very different")


def draw(rng):
    """A random team that is plausible: team, allocator's settings, motors, and how different its drones are."""
    n = int(rng.integers(2, 13))
    likeness = LIKENESS[int(rng.integers(3))]
    ratio = {"alike": 1.0, "different": 1.5, "very different": 5.0}[likeness]

    def each(middle):
        return middle * ratio ** rng.uniform(-1.0, 1.0, n)

    masses = each(rng.uniform(0.2, 2.0))
    own = 9.81 * masses
    # A drone lifts 1.25 to 4 times its weight, a cable bears 0.2 to 4 times that.
    lift = own * (
        1.0
        + (
            rng.uniform(0.5, 1.5) * rng.uniform(0.5, 2.0, n)
            if ratio > 1.0
            else rng.uniform(0.25, 3.0)
        )
    )
    high = each(rng.uniform(0.2, 4.0) * float(np.mean(own)))
    if rng.random() < 0.3:
        high = np.full(n, 100.0 * own.max())
    low = 0.3 * rng.random() * np.minimum(high, lift - own).min() * rng.random(n) + 1e-3
    cone = rng.uniform(25.0, 80.0)
    # n caps of half the least angle cover at most two thirds of the cap that they are in.
    share = rng.uniform(0.02, 0.66)
    least = math.degrees(2.0 * math.acos(1.0 - share * (1.0 - math.cos(math.radians(cone))) / n))
    least = min(least, 1.7 * cone, 140.0)
    safe = Safe(
        tension_min=low.tolist(), tension_max=high.tolist(), max_cone_deg=cone, min_angle_deg=least,
        max_tilt_deg=float(rng.uniform(5.0, 45.0)) if rng.random() < 0.5 else None,
    )  # fmt: skip
    team = Team(
        load_mass=0.4 * float(np.minimum(high, lift - own).sum()) / 9.81, masses=masses,
        inertias=np.outer(masses, [0.04, 0.04, 0.08]), cable_lengths=np.ones(n),
    )  # fmt: skip
    return team, safe, Motors(max_thrust=(0.25 * lift).tolist()), likeness


def numbers(team, safe, motors):
    """What limits cables and drones: weights, least and largest tension, thrust (n,), N; cone, angle, tilt, rad."""
    n = team.n
    tilt = 90.0 if safe.max_tilt_deg is None else safe.max_tilt_deg
    angles = np.radians([safe.max_cone_deg, safe.min_angle_deg, tilt])
    forces = (
        9.81 * team.masses,
        safe.tension_min,
        safe.tension_max,
        4.0 * np.asarray(motors.max_thrust),
    )
    return [np.broadcast_to(np.asarray(each, dtype=float), n) for each in forces], angles


def missed(team, safe, motors, tensions, directions):
    """The largest miss of any limit and of the balance, rad and shares of a force: by angles between vectors."""
    (own, low, high, most), (cone, least, tilt) = numbers(team, safe, motors)
    pulls = -tensions[:, None] * directions
    thrusts = pulls + own[:, None] * [0.0, 0.0, 1.0]

    def apart(a, b):
        return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))

    up, n = np.array([0.0, 0.0, 1.0]), len(own)
    unit = float(np.mean(tensions))
    return max(
        float(np.abs(pulls[:, :2].sum(axis=0)).max()) / unit,
        float(np.max(low - tensions)) / unit,
        float(np.max(tensions - high)) / unit,
        float(np.max(np.linalg.norm(thrusts, axis=1) - most)) / unit,
        max(apart(-d, up) for d in directions) - cone,
        max(apart(f, up) for f in thrusts) - tilt,
        max(least - apart(directions[i], directions[j]) for i in range(n) for j in range(i)),
    )


@lru_cache(maxsize=32)
def solver(n):
    """IPOPT on n cables: variables tensions (n,) and directions (3, n), parameters the limits."""
    import casadi

    T, d = casadi.SX.sym("T", n), casadi.SX.sym("d", 3, n)
    own, most = casadi.SX.sym("own", n), casadi.SX.sym("most", n)
    tangent = casadi.SX.sym("tangent")
    rows = [casadi.dot(d[:, i], d[:, i]) for i in range(n)]  # 1
    rows += [casadi.dot(T, d[0, :].T), casadi.dot(T, d[1, :].T)]  # 0
    rise = [own[i] - T[i] * d[2, i] for i in range(n)]
    aside = [T[i] ** 2 * (d[0, i] ** 2 + d[1, i] ** 2) for i in range(n)]
    rows += [rise[i] ** 2 + aside[i] - most[i] ** 2 for i in range(n)]  # <= 0
    rows += [aside[i] - (tangent * rise[i]) ** 2 for i in range(n)]  # <= 0
    rows += [casadi.dot(d[:, i], d[:, j]) for i in range(n) for j in range(i)]  # <= cosine
    nlp = {
        "x": casadi.vertcat(T, casadi.vec(d)), "f": casadi.dot(T, d[2, :].T),
        "g": casadi.vertcat(*rows), "p": casadi.vertcat(own, most, tangent),
    }  # fmt: skip
    ipopt = {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 400}
    options = {
        "print_time": False,
        "error_on_fail": False,
        "show_eval_warnings": False,
        "ipopt": ipopt,
    }
    return casadi.nlpsol("heaviest", "ipopt", nlp, options)


def by_ipopt(team, safe, motors, rng, starts=STARTS):
    """The heaviest load that IPOPT finds from random starts, N; 0: none. Only answers within the limits count."""
    n = team.n
    (own, low, high, most), (cone, least, tilt) = numbers(team, safe, motors)
    unit = float(np.mean(np.minimum(high, most)))
    free = tilt > 0.5 * math.pi - 1e-9
    pairs = n * (n - 1) // 2
    solve, best = solver(n), 0.0
    for k in range(starts):
        # Uniform in the cone, or in a part of it where the load is heavy.
        part = cone * (1.0 if k % 2 else rng.uniform(0.3, 1.0))
        z, turn = 1.0 - rng.random(n) * (1.0 - math.cos(part)), rng.uniform(0.0, 2.0 * math.pi, n)
        r = np.sqrt(1.0 - z * z)
        d = np.column_stack([r * np.cos(turn), r * np.sin(turn), -z])
        T = (low + rng.uniform(0.2, 0.8) * (np.minimum(high, most) - low)) / unit
        answer = solve(
            x0=np.concatenate([T, d.ravel()]),
            p=np.concatenate([own / unit, most / unit, [1e3 if free else math.tan(tilt)]]),
            lbx=np.concatenate([low / unit, np.tile([-1.0, -1.0, -1.0], n)]),
            ubx=np.concatenate([high / unit, np.tile([1.0, 1.0, -math.cos(cone)], n)]),
            lbg=np.concatenate([np.ones(n), np.zeros(2), np.full(2 * n + pairs, -math.inf)]),
            ubg=np.concatenate([np.ones(n), np.zeros(2 + 2 * n), np.full(pairs, math.cos(least))]),
        )
        x = answer["x"].full().ravel()
        T, d = unit * x[:n], x[n:].reshape(n, 3)
        d = d / np.linalg.norm(d, axis=1)[:, None]
        if missed(team, safe, motors, T, d) < KEPT:
            best = max(best, -float(T @ d[:, 2]))
    return best


def by_colift(team, safe, motors):
    """The heaviest load of ``feasibility``, N, its formation's largest miss, and what all of it took of the processor, s."""
    found = []
    search = feasibility_of.extreme

    def watched(*given, **named):
        found.append(search(*given, **named))
        return found[-1]

    began = time.process_time()
    with mock.patch.object(feasibility_of, "extreme", watched):
        judged = feasibility_of.feasibility(team, safe, motors)
    took = time.process_time() - began
    miss = 0.0
    if judged.heaviest > 0.0:
        best = next(each for each in found if each.weight == judged.heaviest)
        miss = missed(team, safe, motors, best.tensions, best.directions)
    return judged.heaviest, miss, took, judged.binding[0].path if judged.binding else ""


def compare():
    rng = np.random.default_rng(SEED)
    teams = [draw(rng) for _ in range(TEAMS)]
    by_colift(*teams[0][:3])  # compiles
    rows = []
    for k, (team, safe, motors, likeness) in enumerate(teams):
        ours, miss, took, binding = by_colift(team, safe, motors)
        began = time.process_time()
        theirs = by_ipopt(team, safe, motors, np.random.default_rng([SEED, k]))
        rows.append(
            {
                "n": team.n, "drones": likeness, "binding": binding, "colift_N": ours, "ipopt_N": theirs,
                "miss": miss, "colift_s": round(took, 4), "ipopt_s": round(time.process_time() - began, 3),
            }
        )  # fmt: skip
        print(k, rows[-1], flush=True)
    return {"seed": SEED, "starts": STARTS, "teams": rows}


def deviation(row):
    """By which share colift's load is heavier than IPOPT's (negative: lighter)."""
    ours, theirs = row["colift_N"], row["ipopt_N"]
    return 0.0 if ours == theirs else ours / theirs - 1.0 if theirs > 0.0 else math.inf


def line(name, rows):
    off = [deviation(row) for row in rows]
    close = sum(abs(each) <= CLOSE for each in off)
    not_less = sum(each >= -CLOSE for each in off)
    took = sorted(row["colift_s"] for row in rows)
    least, most = min(off), max(off)
    return [
        name, str(len(rows)), shares.text(close, len(rows)), shares.text(not_less, len(rows)),
        f"{100.0 * least:+.1f} %", "IPOPT finds none" if math.isinf(most) else f"{100.0 * most:+.1f} %",
        f"{took[len(took) // 2]:.2f} / {took[-1]:.2f} s",
    ]  # fmt: skip


def main():
    rows = stored(__file__, compare)["teams"]
    lines = [line("all", rows)]
    for low, high in ((2, 4), (5, 8), (9, 12)):
        some = [row for row in rows if low <= row["n"] <= high]
        lines.append(line(f"{low} to {high} drones", some))
    lines += [line(f"drones {name}", [r for r in rows if r["drones"] == name]) for name in LIKENESS]
    by_motors = [row for row in rows if row["binding"] == "actuation.max_thrust"]
    lines.append(line("motors limit most", by_motors))
    lines.append(
        line("tension limits most", [r for r in rows if r["binding"] == "allocation.tension_max"])
    )
    header = [
        "teams", "number", f"within {100.0 * CLOSE:g} %", "not less than that", "lightest", "heaviest",
        "processor, median / longest",
    ]  # fmt: skip
    fill("theory/safe.md", "heaviest", table(header, lines))


if __name__ == "__main__":
    main()
