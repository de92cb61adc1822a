"""Write the tables of docs/theory/leaderless.md: teams without a leader, attacked, rehearsed and flown.

python docs/figures/agents.py [--fly] [--seeds 10]

From ``agents.json`` beside this file, which ``--fly`` makes first.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from pages import fill, stored, table

import colift
from colift.control.agents.base import AgentPart
from colift.control.agents.distributed_mpc import DistributedMpc
from colift.control.agents.exchange_admm import ExchangeAdmm
from colift.control.agents.leader import Leader
from colift.control.agents.leaderless import Leaderless
from colift.control.allocation.safe import Safe
from colift.kernel.jit import thread_time_ns
from colift.kernel.math import shares
from colift.kernel.signals import MESSAGE
from colift.study import hostility
from colift.study.rehearsal import (
    DT,
    PULL,
    STATUS,
    Asked,
    Rehearsal,
    commanded,
    force_error,
    formation_of,
    least_angles,
    team_of,
)
from colift.team.geometry import Array
from colift.world.link.radio import Radio as Link
from colift.world.network.radio import Radio

SIZES = (2, 4, 8, 16)
LENGTH = 30.0
"""Of a rehearsal, s; the first five are not judged."""
BEGIN = round(5.0 / DT)
FIRST = 30_000
"""First of the seeds, which no tuning saw."""
DRONE_STEPS = 10_000_000
PLANNED = {2: 30.0, 4: 30.0, 8: 30.0, 16: 24.0}
"""Least angle of the allocator, degrees; agents keep 5 less."""
LOSSES = (0.0, 0.2, 0.4, 0.6)
OTHERS: dict[str, type[AgentPart]] = {
    "exchange": ExchangeAdmm,
    "plans": DistributedMpc,
    "leader": Leader,
}
HALF = "half"
"""Of the drones are cut off from the others."""
DELAYS = ((0.0, 0.0), (0.0, 0.02), (0.01, 0.02), (0.02, 0.03))


def wanted(rng: np.random.Generator, n: int, size: float, rocking: bool) -> Asked:
    """A circle flown at an acceleration of ``size`` (m/s^2), or rocking to and fro at 3 rad/s.

    Each drone's wish is off by a steady 2 % of the weight, which its estimate has learned wrongly, and by feedback of 2 %
    that changes within 0.3 s.
    """
    team = team_of(n)
    weight = team.load_mass * team.gravity
    t = np.arange(round(LENGTH / DT)) * DT
    turn = 3.0 if rocking else np.sqrt(size / 0.5)
    ramp = np.clip(t / 2.0, 0.0, 1.0)[:, None]
    phase = turn * t + rng.uniform(0.0, 2.0 * np.pi)
    plan = (
        size
        * ramp
        * np.column_stack([np.cos(phase), 0.0 * t if rocking else np.sin(phase), 0.0 * t])
    )
    common = team.load_mass * (plan + np.array([0.0, 0.0, team.gravity]))
    steady = common[:, None] + 0.02 * weight * rng.standard_normal((n, 3))
    keep = np.exp(-DT / 0.3)
    feedback = np.zeros((len(t), n, 3))
    shocks = np.sqrt(1.0 - keep**2) * 0.02 * weight * rng.standard_normal(feedback.shape)
    for k in range(1, len(t)):
        feedback[k] = keep * feedback[k - 1] + shocks[k]
    plans = np.repeat(plan[:, None], n, axis=1)
    return Asked(steady + feedback, steady, np.ascontiguousarray(plans), np.zeros((len(t), n)))


def numbers(out: Array, asked: Asked) -> dict[str, float]:
    """Force error, N, after the beginning, and smallest angle, degrees."""
    error = force_error(asked, out)[BEGIN:]
    return {
        "rms": float(np.sqrt(np.mean(error**2))),
        "max": float(error.max()),
        "angle": float(np.degrees(least_angles(out[:, :, PULL + 1 : STATUS]).min())),
    }


def rehearsed(
    n: int, seed: int, size: float, rocking: bool, radio: dict[str, Any]
) -> dict[str, dict[str, float]]:
    """The same wishes over the same kind of radio, by agents, in published ways, and with one allocator for all."""
    if radio.get("split") == HALF:
        radio = {**radio, "split": tuple(range(n // 2))}
    asked = wanted(np.random.default_rng([seed, n]), n, size, rocking)
    team, start = team_of(n), formation_of(n, PLANNED[n] + 4.0)
    plan = Safe(min_angle_deg=PLANNED[n])
    agent = Leaderless(min_angle_deg=PLANNED[n] - 5.0)
    flown = Rehearsal(agent, Radio(**radio), team, start, allocation=plan, key=seed)
    link = Link(
        **{
            name: min(value, 0.999)
            for name, value in radio.items()
            if name in {"loss", "delay", "jitter"}
        }
    )
    others = {
        name: numbers(Rehearsal(part(), Radio(**radio), team, start, key=seed).run(asked), asked)
        for name, part in OTHERS.items()
    }
    return others | {
        "agents": numbers(flown.run(asked), asked),
        "central": numbers(commanded(link, team, start, asked, allocation=plan, key=seed), asked),
    }


def spread(values: list[float], scale: float = 1e3) -> str:
    """Mean with the half-width of its 95 % interval (bootstrap over the seeds)."""
    found = scale * np.asarray(values)
    rng = np.random.default_rng(0)
    means = found[rng.integers(0, len(found), (4000, len(found)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return f"{short(found.mean())} ({short(low)}-{short(high)})"


def short(value: float) -> str:
    """Three digits; what is rounding is 0."""
    return "0" if value < 1e-6 else f"{value:.3g}"


def curve(
    cases: dict[str, tuple[float, bool, dict[str, Any]]], sizes: tuple[int, ...], seeds: range
) -> list[list[str]]:
    """A line for each case and kind: force error rms, and over all seeds the largest and the smallest angle."""
    lines = [["", *(f"n = {n}" for n in sizes)]]
    for name, (size, rocking, radio) in cases.items():
        found = {n: [rehearsed(n, seed, size, rocking, radio) for seed in seeds] for n in sizes}
        for kind in (
            ("agents", *OTHERS) if {*radio} & {"burst", "split"} else ("agents", "central", *OTHERS)
        ):
            cells = []
            for n in sizes:
                each = [run[kind] for run in found[n]]
                most, angle = max(e["max"] for e in each), min(e["angle"] for e in each)
                cells.append(
                    f"{spread([e['rms'] for e in each])}, max {short(1e3 * most)}, {angle:.0f}°"
                )
            lines.append([f"{name}, {kind}", *cells])
    return lines


def attacked() -> list[list[str]]:
    """Ten million drone-steps against everything at once."""
    lines = [
        ["n", "drone-steps", "promised", "least angle", "broken", "not settled", "not a number"]
    ]
    sizes = tuple(hostility.LEAST)
    for n in sizes:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            judged = hostility.attacks(n, -(-DRONE_STEPS // len(sizes)), FIRST)
        lines.append(
            [
                str(n), f"{sum(j.drone_steps for j in judged):,}", f"{judged[0].wanted_deg:g}°",
                f"{min(j.world_deg for j in judged):.3f}°", str(sum(not j.kept for j in judged)),
                str(sum(j.unfinished for j in judged)), str(sum(not j.sane for j in judged)),
            ]
        )  # fmt: skip
    return lines


def cost() -> list[list[str]]:
    """Bytes a second, and processor time of a cycle with all that it hears, questions to the allocator and network included."""
    lines = [["n", "bytes a message", "kB/s", "us a cycle and drone"]]
    for n in SIZES:
        asked = wanted(np.random.default_rng(n), n, 2.0, False)
        flown = Rehearsal(
            Leaderless(min_angle_deg=PLANNED[n] - 5.0), Radio(loss=0.0), team_of(n),
            formation_of(n, PLANNED[n] + 4.0), allocation=Safe(min_angle_deg=PLANNED[n]),
        )  # fmt: skip
        begin = thread_time_ns()
        flown.run(asked)
        each = 1e-3 * (thread_time_ns() - begin) / (len(asked.wishes) * n)
        lines.append([str(n), str(MESSAGE), f"{MESSAGE / DT / 1e3:g}", f"{each:.1f}"])
    return lines


def flights(seeds: range) -> list[list[str]]:
    """Distance from the path in ``real-world``, cm, with agents and with the allocator of all over the same radio."""
    lines = [["loss", "agents", "central"]]
    for loss in (0.0, 0.2, 0.5, 0.6):
        radio = {"kind": "radio", "loss": loss, "delay": 0.01, "jitter": 0.02}
        cells = []
        for change in (
            {
                "agents.kind": "leaderless",
                "network": radio,
                "sensing.load_view": 0.02,
                "sensing.push_view": 0.1,
            },
            {"agents.kind": "central", "link": radio},
        ):
            runs = [colift.run("real-world", seed=seed, overrides=change) for seed in seeds]
            metrics = [run.metrics for run in runs if run.recording.outcome == "completed"]
            rms = spread([m["tracking_rms_m"] for m in metrics], 100.0)
            most = max(100.0 * m["tracking_max_m"] for m in metrics)
            angle = min(m["min_angle_deg"] for m in metrics)
            cells.append(f"{rms}, max {most:.2g}, {angle:.0f}° ({len(metrics)}/{len(runs)})")
        lines.append([f"{loss:.0%}", *cells])
    return lines


def circle(**radio: Any) -> tuple[float, bool, dict[str, Any]]:
    """The circle of 2 m/s^2 on a radio that does nothing else."""
    return 2.0, False, {"delay": 0.0, "jitter": 0.0, "loss": 0.0, **radio}


def deaths(seeds: range) -> list[list[str]]:
    """One drone dies in ``real-world`` at half of the messages lost: any of the four, in each seed at another time."""
    radio = {"kind": "radio", "loss": 0.5, "delay": 0.01, "jitter": 0.02}
    agents = {"agents.kind": "leaderless", "network": radio, "detection": {"kind": "self-check"}}
    silent = [{"kind": "allocator-silent", "duration": 1e3}]
    cases: dict[str, tuple[dict[str, Any], Sequence[int], list[dict[str, Any]]]] = {
        "agents, any drone": (agents, range(4), []),
        "central, any drone": ({"link": radio}, range(4), []),
        "agents, drone 0": (agents, (0,), []),
        "central, drone 0, which has the allocator": ({"link": radio}, (0,), silent),
    }
    lines = [["who dies", "survived", "rms", "largest", "least angle"]]
    for name, (change, drones, more) in cases.items():
        metrics, flown = [], 0
        for seed in seeds:
            at = 5.0 + (seed - seeds[0]) % 10
            for drone in drones:
                fault = [
                    {"kind": "drone-lost", "at": at, "drone": drone},
                    *({**each, "at": at} for each in more),
                ]
                run = colift.run("real-world", seed=seed, overrides={**change, "fault": fault})
                flown += 1
                if run.recording.outcome == "completed" and run.metrics["tracking_max_m"] < 1.0:
                    metrics.append(run.metrics)
        if not metrics:
            lines.append([name, shares.text(0, flown), "-", "-", "-"])
            continue
        rms = spread([m["tracking_rms_m"] for m in metrics], 100.0)
        most = max(100.0 * m["tracking_max_m"] for m in metrics)
        angle = min(m["min_angle_deg"] for m in metrics)
        lines.append([name, shares.text(len(metrics), flown), rms, f"{most:.2g}", f"{angle:.0f}°"])
    return lines


def measure(seeds: range) -> dict[str, list[list[str]]]:
    """Header and lines of each table."""
    losses = {f"loss {loss:.0%}": circle(loss=loss) for loss in LOSSES}
    delays = {
        f"{1e3 * d:g}-{1e3 * (d + j):g} ms, loss 20 %": circle(loss=0.2, delay=d, jitter=j)
        for d, j in DELAYS
    }
    bursts = {f"bursts of {b:g} s, loss 20 %": circle(loss=0.2, burst=b) for b in (0.1, 0.5, 5.0)}
    apart = {
        "drone 0 cut off for 5 s": circle(split=(0,), split_at=10.0),
        "halves cut off for 5 s": circle(split=HALF, split_at=10.0),
    }
    hard = {
        f"5 m/s², {1e3 * d:g}-{1e3 * (d + j):g} ms, loss 20 %": (
            5.0,
            True,
            {"loss": 0.2, "delay": d, "jitter": j},
        )
        for d, j in ((0.0, 0.0), (0.02, 0.03))
    }
    return {
        "attacked": attacked(),
        "losses": curve(losses, SIZES, seeds),
        "delays": curve({**delays, **bursts, **apart}, SIZES[1:], seeds),
        "manoeuvres": curve(hard, (4, 8), seeds),
        "cost": cost(),
        "flights": flights(seeds),
        "deaths": deaths(seeds),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fly", action="store_true")
    parser.add_argument("--seeds", type=int, default=10)
    count = parser.parse_known_args()[0].seeds
    for name, (header, *lines) in stored(
        __file__, lambda: measure(range(FIRST, FIRST + count))
    ).items():
        fill("theory/leaderless.md", name, table(header, lines))


if __name__ == "__main__":
    main()
