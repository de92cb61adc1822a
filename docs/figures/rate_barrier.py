"""What the barrier of the turning rate costs (docs/theory/safe.md): ``python docs/figures/rate_barrier.py [--fly]``.

From ``rate_barrier.json`` beside this file. With ``--fly`` it is measured first, a minute: the mean total tension with the barrier
relative to that with a millionth of it, in hover at rest and along a smooth force of up to 3 m/s^2.
"""

import numpy as np
from pages import fill, stored, table

from colift.control.allocation.base import Allocator
from colift.control.allocation.limits import cycle
from colift.study import safety

CASES = {
    "defaults": {},
    "`max_rate` 20": {"max_rate": 20.0},
    "1 ms": {"dt": 0.001},
    "20 ms, `max_rate` 20": {"dt": 0.02, "max_rate": 20.0},
    "50 ms": {"dt": 0.05},
    "100 ms": {"dt": 0.1},
}
SIZES = (3, 4, 8, 16)
AT_REST, MOVING = 10.0, 20.0  # s


def tension(n, dt, changes, part_of_barrier):
    """Total tension (N) at rest after ``AT_REST`` and the mean along the smooth force."""
    team, safe = safety.problem(n)
    allocator = Allocator(safe.model_copy(update=changes), team, dt=dt)
    least = np.radians(safe.min_angle_deg + 1.0)
    allocator.reset(safety.spread_formation(n, np.radians(safety.CONES[n]), least))
    allocator._params[cycle.PARAMS.at.kappa_rate] *= part_of_barrier
    for _ in range(round(AT_REST / dt)):
        answer = allocator.allocate([0.0, 0.0, team.load_mass * team.gravity])
    rest = answer.tensions.sum()
    t = dt * np.arange(round(MOVING / dt))
    moving = 0.0
    for acceleration in safety.FAMILIES["smooth"](t, np.random.default_rng(0)):
        force = team.load_mass * (acceleration + np.array([0.0, 0.0, team.gravity]))
        moving += allocator.allocate(force).tensions.sum()
    return np.array([rest, moving / len(t)])


def more(n, dt, changes):
    """By which share the barrier raises both."""
    return tension(n, dt, changes, 1.0) / tension(n, dt, changes, 1e-6) - 1.0


def fly():
    found = []
    for name, case in CASES.items():
        changes = {key: value for key, value in case.items() if key != "dt"}
        for n in SIZES:
            rest, moving = more(n, case.get("dt", safety.PERIOD), changes)
            found.append({"case": name, "n": n, "at_rest": float(rest), "moving": float(moving)})
            print(found[-1], flush=True)
    return found


def main():
    rows = [
        [
            each["case"],
            str(each["n"]),
            *(f"{100 * each[key]:+.3f} %" for key in ("at_rest", "moving")),
        ]
        for each in stored(__file__, fly)
    ]
    fill("theory/safe.md", "rate-barrier", table(["case", "n", "at rest", "moving"], rows))


if __name__ == "__main__":
    main()
