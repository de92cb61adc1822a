"""Write what docs/theory/control.md and docs/your-drones.md say of loop margins, and draw the regions of stable flight.

python docs/figures/margins.py [--fly]

From ``margins.json`` beside this file, which ``--fly`` makes first: random teams of ``benchmarks/any_team.py`` in calm air whose gains are
multiplied by random factors and whose measurements are late, flown to see which of the verdicts are right. Half of them have colift's own
controllers, half the paper's cascade with gains for the delay. The threshold of the warning was chosen with seeds from ``CHOSEN`` on.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.patches import Patch
from pages import benchmark, fill, stored, table

from colift.control.attitude_control.delay_aware import DelayAware
from colift.control.tuning import LEAN
from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.kernel.math import shares
from colift.mission import Mission, load_mission
from colift.mission.stability import LEAST, loops_of
from colift.record.recording import Recording
from colift.study.size import flaw_of
from colift.world.sensing.noisy import Noisy

CHOSEN, FIRST, MISSIONS = 310_000, 330_000, 500
DURATION = 24.0
LATEST = 0.08
"""Most delay, s."""
SHAKING = 0.25
"""Root mean square of the drones' body rates in the last quarter from which a flight shakes, rad/s: no quiet one has so much."""
NOISE = {
    name: field.default
    for name, field in Noisy.model_fields.items()
    if "noise" in name and isinstance(field.default, float)
}
GAIN = 0.85
"""``position_control.gain`` where nobody says otherwise."""
GAINS, DELAYS, LAGS = (
    np.geomspace(0.2, 3.5, 26),
    np.linspace(0.0, 0.08, 27),
    np.linspace(0.0, 0.1, 26),
)
SOME_GAINS, SOME_DELAYS = (0.3, 0.6, 1.0, 1.4, 2.0, 2.8), (0.005, 0.02, 0.035, 0.05, 0.065)
TOLD = ("load_control", "position_control", "attitude_control", "observation")


def draw(seed: int) -> dict[str, Any]:
    """A random team in calm air with gains of its own, as the table of a mission's file."""
    table: dict[str, Any] = benchmark("any_team").draw(seed)
    table.pop("disturbance", None)
    rng = np.random.default_rng([seed, 1])

    def factor() -> float:
        spread = math.exp(rng.uniform(math.log(0.2), math.log(5.0)))
        return spread if rng.random() < 0.5 else 1.0

    delay = rng.uniform(0.0, LATEST)
    table["sensing"] = {"kind": "noisy"} | {name: 0.1 * size for name, size in NOISE.items()}
    periods = ("load_control", "allocation", "position_control", "attitude_control")
    table["timing"] = {"duration": DURATION, "delay": delay} | dict.fromkeys(periods, 0.01)
    if rng.random() < 0.5:
        table["position_control"] = {
            "kind": "formation", "gain": min(0.85 * factor(), 3.0), "stiffness": min(0.3 * factor(), 1.0),
            "frequency": min(0.55 * factor(), 10.0),
        }  # fmt: skip
        table["observation"] = {
            "kind": "momentum", "total": min(1.2 * factor(), 5.0), "own": min(1.2 * factor(), 5.0),
        }  # fmt: skip
        table["load_control"] = {"kind": "balance", "rate": min(0.45 * factor(), 5.0)}
        table["attitude_control"] = {"kind": "delay-aware", "delay": min(delay * factor(), 0.5)}
        return table
    drones, load = table["drones"], table["load"]["mass"]
    m, J = np.mean(drones["mass"]), np.mean(drones["inertia"], axis=0)
    lag = 0.0 if "actuation" in table else drones["motor_lag"]
    team = load_mission(table, must_fly=False).team
    law = DelayAware(delay=delay, lag=lag, period=0.01, predicted=False)
    band = law.bandwidths(team)
    turn, stiff, damp, hang = (factor() for _ in range(4))
    k_p = LEAN * load * 9.81 / np.mean(drones["cable_length"])
    table["attitude_control"] = {
        "kind": "manifold", "k_d": (turn * band.rate * J).tolist(), "rho": [0.5 * band.rate * factor()] * 3,
        "beta": [1e-9] * 3,
    }  # fmt: skip
    table["position_control"] = {
        "kind": "feed-forward" if rng.random() < 0.5 else "pid",
        "k_p": [m * band.velocity * band.position * stiff] * 3, "k_d": [m * band.velocity * damp] * 3,
        "k_i": [0.1 * m * band.velocity * band.position**2] * 3,
    }  # fmt: skip
    table["load_control"] = {
        "kind": "pid", "k_p": [hang * k_p] * 3, "k_d": [hang * 0.5 * k_p / band.position * factor()] * 3,
        "k_i": [0.1 * hang * k_p * band.position] * 3,
    }  # fmt: skip
    table["estimation"] = {"kind": "predictor" if rng.random() < 0.5 else "none"}
    return table


def verdict(mission: Mission) -> list[list[Any]]:
    """Each loop that was judged, with its margin."""
    return [[each.loop, round(each.margin.modulus, 4)] for each in loops_of(mission)]


def shaking(recording: Recording) -> float | None:
    """Root mean square of the body rates in the last quarter, rad/s; None where there is none."""
    rates = recording["rates"][recording.time > 0.75 * recording.mission.timing.duration]
    return float(np.sqrt(np.nanmean(rates**2))) if np.isfinite(rates).any() else None


def fly(seed: int) -> dict[str, Any]:
    """Fly one mission; what was told of it, and what became of it. One that other checks refuse is not flown."""
    found: dict[str, Any] = {"seed": seed}
    try:
        mission = load_mission(draw(seed))
    except MissionError as error:
        return found | {"refused": "; ".join(map(str, error.problems))}
    recording = Flight(mission).run()
    flaw, _ = flaw_of(recording)
    return found | {
        "own": mission.kinds["position_control"] == "formation", "loops": verdict(mission), "flaw": flaw,
        "turning": shaking(recording),
    }  # fmt: skip


def calm(gain: float, delay: float, told: Mapping[str, Any]) -> Mission:
    """`real-world` in calm air with the load as told, at a multiple of the gain of position control."""
    return load_mission(
        "real-world",
        {
            "disturbance": [], "criteria": {}, "truth.load_mass_factor": 1.0, "timing.duration": 8.0,
            "reference": {"kind": "hover"}, "position_control.gain": gain * GAIN, "timing.delay": delay,
            **told,
        },
    )  # fmt: skip


def least(mission: Mission) -> float:
    return float(min(modulus for _, modulus in verdict(mission)))


def wrong(delay: float, lag: float) -> dict[str, Any]:
    """Sensors and motors of which the controllers know nothing: they are told 20 ms of each."""
    told = {f"{layer}.{name}": 0.02 for layer in TOLD for name in ("delay", "lag")}
    sensors = {f"sensing.{name}_delay": delay for name in ("load", "tracking", "attitude", "rates")}
    return {**told, **sensors, "estimation.attitude_delay": 0.02, "actuation.time_constant": lag}


def tried(job: tuple[float, float]) -> float | None:
    return shaking(Flight(calm(*job, {})).run())


def regions(pool: ProcessPoolExecutor) -> dict[str, Any]:
    """Margins over gain and delay, and over delay and lag that nobody told; and flights at some of the first."""
    points = [(gain, delay) for gain in SOME_GAINS for delay in SOME_DELAYS]
    return {
        "gains": [[least(calm(gain, delay, {})) for delay in DELAYS] for gain in GAINS],
        "lags": [[least(calm(1.0, 0.02, wrong(delay, lag))) for delay in DELAYS] for lag in LAGS],
        "flown": [
            [*point, turning]
            for point, turning in zip(points, pool.map(tried, points), strict=True)
        ],
    }


def measure() -> dict[str, Any]:
    with ProcessPoolExecutor() as pool:
        flown = list(pool.map(fly, range(FIRST, FIRST + MISSIONS)))
        return {"flown": flown, "regions": regions(pool)}


def failed(flight: Mapping[str, Any]) -> bool:
    return bool(flight["flaw"]) or flight["turning"] is None or flight["turning"] > SHAKING


def lines(flown: Iterable[Mapping[str, Any]]) -> list[list[str]]:
    """The rows of the table."""
    those = [flight for flight in flown if "refused" not in flight]
    found = []
    for name, own in (
        ("colift's own", (True,)),
        ("the paper's cascade", (False,)),
        ("all", (True, False)),
    ):
        count = Counter(
            (min(modulus for _, modulus in flight["loops"]) < LEAST, failed(flight))
            for flight in those
            if flight["own"] in own
        )
        bad, good = count[True, True] + count[False, True], count[True, False] + count[False, False]
        found.append(
            [
                name, str(bad + good), str(count[True, True]), str(count[False, False]),
                shares.text(count[True, False], good), shares.text(count[False, True], bad),
            ]
        )  # fmt: skip
    return found


def draw_regions(found: Mapping[str, Any], ink: str, path: Path) -> None:
    mpl.rcParams.update(
        {
            "svg.hashsalt": "colift", "svg.fonttype": "path", "font.size": 11, "text.color": ink,
            "axes.edgecolor": ink, "axes.labelcolor": ink, "xtick.color": ink, "ytick.color": ink,
            "axes.titlesize": 11,
        }
    )  # fmt: skip
    figure, (left, right) = plt.subplots(2, 1, figsize=(5.2, 7.4), layout="constrained")
    levels, shades = [-1.0, 1e-6, LEAST, 0.2, 1.0], ["#c8553d", "#e09f5a", "#7fa8d1", "#3a7d6b"]
    delays = 1e3 * np.array(DELAYS)
    for axes, up, values in (
        (left, np.array(GAINS), found["gains"]), (right, 1e3 * np.array(LAGS), found["lags"]),
    ):  # fmt: skip
        axes.contourf(delays, up, values, levels, colors=shades)
        axes.set_xlabel("delay of the sensors, ms")
    left.set_yscale("log")
    left.set_yticks([0.25, 0.5, 1.0, 2.0], ["0.25", "0.5", "1", "2"])
    left.minorticks_off()
    left.set_ylabel("gain over the rule's")
    left.set_title("gain of position control; delay told")
    right.set_ylabel("lag of the motors, ms")
    right.set_title("gains for 20 ms of delay and 20 ms of lag")
    right.plot(20.0, 20.0, "+", color="white", markersize=10, markeredgewidth=2)
    for shakes, marker in ((True, "x"), (False, "o")):
        those = [p for p in found["flown"] if (p[2] is None or p[2] > SHAKING) == shakes]
        left.plot(
            [1e3 * p[1] for p in those], [p[0] for p in those], marker, color="white", markersize=5,
            markerfacecolor="none", linestyle="none",
        )  # fmt: skip
    names = ("unstable", f"below {LEAST:g}: warned of", f"{LEAST:g} to 0.2", "more")
    figure.legend(
        handles=[Patch(color=shade, label=name) for shade, name in zip(shades, names, strict=True)],
        title="least modulus margin", loc="outside lower center", ncols=2, frameon=False,
    )  # fmt: skip
    figure.savefig(path, transparent=True, metadata={"Date": None})
    plt.close(figure)


def main() -> None:
    found = stored(__file__, measure)
    header = [
        "controllers", "flown", "warned of, and fail or shake", "not warned of, and fly", "false alarms, of those that fly",
        "missed, of those that fail or shake",
    ]  # fmt: skip
    fill("your-drones.md", "margins", table(header, lines(found["flown"])))
    here = Path(__file__).parent
    draw_regions(found["regions"], "#222222", here / "margins_light.svg")
    draw_regions(found["regions"], "#dddddd", here / "margins_dark.svg")


if __name__ == "__main__":
    main()
