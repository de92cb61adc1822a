"""Write how drones that plan in turns come to agree on a doorway (docs/plan.md).

From ``by_turns.json`` beside this file: ``OPENBLAS_NUM_THREADS=1 python docs/figures/by_turns.py [--fly]``; ``--fly`` plans all anew. On more threads
the processor time of all counts, and plans that do not agree end elsewhere.
"""

from pages import DOCS, fill, stored, table

from colift.plan.by_turns import plan_by_turns
from colift.plan.planner import Limits
from colift.plan.scene import load_scene

BODIES = {"drone_mass": 0.85, "load_mass": 0.35, "most": 1.439, "radius": 0.275, "load_radius": 0.2}
DURATIONS = (10.0, 6.0, 4.0, 3.0)


def measure() -> list[list[float]]:
    """Duration, whether all agreed, rounds, what is left of the limits, processor time of all and of the slowest of each round."""
    scene, limits = load_scene(DOCS / "examples" / "doorway.yaml"), Limits.of(BODIES)
    plans = [plan_by_turns(scene, limits, duration=duration) for duration in DURATIONS]
    return [
        [float(p.times[-1]), p.done, p.rounds, p.history[-1], p.seconds, p.longest] for p in plans
    ]


def main() -> None:
    rows = [
        [f"{duration:g}", "yes" if done else "no", str(rounds), f"{left:.1e}", f"{seconds:.1f}", f"{longest:.1f}"]
        for duration, done, rounds, left, seconds, longest in stored(__file__, measure)
    ]  # fmt: skip
    header = ["flight, s", "agreed", "rounds", "left, m or shares", "processor, s", "slowest of each round, s"]  # fmt: skip
    fill("plan.md", "turns", table(header, rows))


if __name__ == "__main__":
    main()
