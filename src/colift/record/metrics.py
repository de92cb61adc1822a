"""Numbers that judge a flight, each computed from its recording alone.

A quantity that was not recorded gives NaN: the metric does not apply. Means are over time, not over
rows, since the rows of a real flight are not evenly spaced.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import AbsentSignalError
from colift.kernel.phase import Phase
from colift.kernel.status import Status
from colift.mission.criteria import METRICS
from colift.record.ends import cable_ends
from colift.record.recording import Recording
from colift.record.resting import rests
from colift.team.contact import Boxes
from colift.team.geometry import pairwise_angles
from colift.team.obstacles import Bodies, corners, least_clearance

_FORMULAS: dict[str, Callable[[Recording], float]] = {}

_WITHIN_LIMITS = (int(Status.FORCE_REDUCED), int(Status.RECOVERING))


def _metric(formula: Callable[[Recording], float]) -> None:
    """The formula of the metric of its name in :data:`colift.mission.criteria.METRICS`."""
    if formula.__name__ not in {metric.name for metric in METRICS}:
        raise KeyError(f"{formula.__name__}: the table of metrics has no such line")
    _FORMULAS[formula.__name__] = formula


def compute(recording: Recording) -> dict[str, float]:
    """All metrics of a recording by name, in the order of the table; NaN where one does not apply."""
    return {metric.name: _value(_FORMULAS[metric.name], recording) for metric in METRICS}


def value_of(name: str, recording: Recording) -> float:
    """One metric of a recording, or of a stretch of one; NaN where it does not apply."""
    return _value(_FORMULAS[name], recording)


def _value(formula: Callable[[Recording], float], recording: Recording) -> float:
    try:
        return float(formula(recording))
    except AbsentSignalError:  # the recording is older than the signal
        return math.nan


def tracking_error(recording: Recording) -> NDArray[np.float64]:
    """Load position less reference (rows, 3), m."""
    return np.asarray(recording["load"][:, 0] - recording["reference"][:, 0])


def integral(values: NDArray[np.float64], time: NDArray[np.float64]) -> float:
    """Trapezoidal integral."""
    return float(np.trapezoid(values, time)) if len(time) > 1 else 0.0


def mean(
    values: NDArray[np.float64], time: NDArray[np.float64], axis: int | None = None
) -> NDArray[np.float64]:
    """Mean over time, s, of what is recorded, by the trapezoidal rule: a row counts for half of the time to each neighbour.

    Over all values, or with ``axis=0`` over the rows only; NaN where nothing is recorded.
    """
    spans = np.ones(1)
    if len(time) > 1:
        spans = 0.5 * np.diff(time, prepend=time[0], append=time[-1])
        spans = spans[:-1] + spans[1:]
    weights = np.where(np.isnan(values), 0.0, spans.reshape(-1, *[1] * (values.ndim - 1)))
    total = weights.sum(axis=axis)
    weighted = (weights * np.nan_to_num(values, posinf=np.inf, neginf=-np.inf)).sum(axis=axis)
    return np.asarray(np.divide(weighted, total, out=np.full_like(total, np.nan), where=total > 0))


def _largest(values: NDArray[np.float64]) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else float("nan")


def _count(statuses: NDArray[np.float64], counted: NDArray[np.bool_]) -> float:
    known = ~np.isnan(statuses)
    return float(np.count_nonzero(counted & known)) if known.any() else float("nan")


def _total(recording: Recording) -> NDArray[np.float64]:
    if not recording.measured("tensions"):
        return np.full(len(recording.time), np.nan)
    return np.asarray(np.nansum(np.abs(recording["tensions"]), axis=1))


def _smallest_of_rows(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least number of each row; NaN for a row of which none is known."""
    least = np.min(np.where(np.isnan(values), np.inf, values), axis=1)
    return np.where(np.isinf(least), np.nan, least)


def _smallest_angles(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest angle of any pair in each row, degrees; NaN for a single cable."""
    if directions.shape[1] < 2:
        return np.full(len(directions), np.nan)
    # In slices: pairs grow as n^2, and memory should not.
    rows = max(1, 2_000_000 // directions.shape[1] ** 2)
    parts = range(0, len(directions), rows)
    smallest = [_smallest_of_rows(pairwise_angles(directions[k : k + rows])) for k in parts]
    return np.asarray(np.degrees(np.concatenate(smallest)))


def _uncut(recording: Recording) -> NDArray[np.float64]:
    """Actual directions; NaN for a cable that is cut, which makes no angle."""
    cut = recording["attached"] == 0.0
    return np.where(cut[..., None], np.nan, recording["directions"])


def _smallest_angle(directions: NDArray[np.float64]) -> float:
    return -_largest(-_smallest_angles(directions))


@_metric
def tracking_rms_m(r: Recording) -> float:
    return float(np.sqrt(mean(np.sum(tracking_error(r) ** 2, axis=1), r.time)))


@_metric
def tracking_max_m(r: Recording) -> float:
    return _largest(np.linalg.norm(tracking_error(r), axis=1))


def attitude_error(recording: Recording) -> NDArray[np.float64]:
    """Rotation vectors (rows, 3), rad, world, from the wanted attitude of a rigid load to its own; NaN of a point."""
    rows = len(recording.time)
    if recording.mission.load.kind != "rigid":
        return np.full((rows, 3), np.nan)
    q, p = recording["load_attitude"], recording["reference_attitude"]
    w = np.sum(q * p, axis=1)
    # Imaginary part of q p*.
    v = q[:, 1:] * p[:, :1] - p[:, 1:] * q[:, :1] - np.cross(q[:, 1:], p[:, 1:])
    v = np.where(w[:, None] < 0.0, -v, v)
    size = np.linalg.norm(v, axis=1)
    angle = 2.0 * np.arctan2(size, np.abs(w))
    return np.asarray(v * (angle / np.maximum(size, 1e-300))[:, None])


@_metric
def attitude_rms_deg(r: Recording) -> float:
    return math.degrees(float(np.sqrt(mean(np.sum(attitude_error(r) ** 2, axis=1), r.time))))


@_metric
def attitude_max_deg(r: Recording) -> float:
    return math.degrees(_largest(np.linalg.norm(attitude_error(r), axis=1)))


@_metric
def yaw_max_deg(r: Recording) -> float:
    return math.degrees(_largest(np.abs(attitude_error(r)[:, 2])))


@_metric
def min_angle_deg(r: Recording) -> float:
    return _smallest_angle(_uncut(r))


@_metric
def usual_angle_deg(r: Recording) -> float:
    known = _smallest_angles(_uncut(r))
    known = known[~np.isnan(known)]
    return float(np.median(known)) if known.size else float("nan")


@_metric
def min_desired_angle_deg(r: Recording) -> float:
    return _smallest_angle(r["desired_directions"])


def _pairs_in_slices(rows: int, n: int) -> Iterator[slice]:
    """Slices of the rows, so that the memory of what is computed for every pair stays small."""
    size = max(1, 1_000_000 // n**2)
    return (slice(k, k + size) for k in range(0, rows, size))


def _nearest_drones(positions: NDArray[np.float64]) -> float:
    """Smallest distance of two drones in (rows, n, 3), m."""
    one, other = np.triu_indices(positions.shape[1], k=1)
    if not len(one):
        return float("nan")
    near = [
        np.linalg.norm(positions[part, one] - positions[part, other], axis=-1)
        for part in _pairs_in_slices(len(positions), positions.shape[1])
    ]
    return -_largest(-np.concatenate(near))


@_metric
def min_drone_distance_m(r: Recording) -> float:
    return _nearest_drones(r["positions"])


@_metric
def min_downwash_distance_m(r: Recording) -> float:
    downwash = r.mission.settings().get("allocation", {}).get("downwash")
    if downwash is None:  # nothing is asked for above each other
        return float("nan")
    return _nearest_drones(r["positions"] / [1.0, 1.0, float(downwash)])


@_metric
def min_cable_distance_m(r: Recording) -> float:
    positions = r["positions"]
    n = positions.shape[1]
    if n < 2:
        return float("nan")
    spans = cable_ends(r)[:, :, 0] - positions
    cables = np.where(r["attached"][..., None] == 0.0, np.nan, spans)
    least = math.inf
    for part in _pairs_in_slices(len(positions), n):
        away = positions[part, :, None] - positions[part, None]  # of drone i from drone j
        cable = cables[part, None]
        share = np.sum(away * cable, axis=-1) / np.sum(cable**2, axis=-1)
        missing = away - np.clip(share, 0.0, 1.0)[..., None] * cable
        distance = np.linalg.norm(missing, axis=-1)
        distance[:, np.arange(n), np.arange(n)] = np.nan
        least = min(least, np.nanmin(distance, initial=math.inf))
    return float(least) if math.isfinite(least) else float("nan")


@_metric
def min_load_distance_m(r: Recording) -> float:
    body = r.mission.true_team.body
    if body is None or "load_attitude" not in r:
        return float("nan")
    boxes = Boxes(body.size, r["load"][:, 0], r["load_attitude"])
    return -_largest(-np.linalg.norm(boxes.away(r["positions"]), axis=-1))


@_metric
def max_tilt_deg(r: Recording) -> float:
    broken = (r["attached"] == 0.0) | (r["motor_health"] < 1.0).any(axis=2)
    return _largest(np.where(broken, np.nan, tilts(r)))


def tilts(recording: Recording) -> NDArray[np.float64]:
    """Angle of each drone's thrust axis from the vertical (rows, n), degrees."""
    q = recording["attitudes"]
    up = 1.0 - 2.0 * (q[..., 1] ** 2 + q[..., 2] ** 2)
    return np.asarray(np.degrees(np.arccos(np.clip(up, -1.0, 1.0))))


@_metric
def peak_thrust_fraction(r: Recording) -> float:
    most = thrust_limits(r)
    return float("nan") if most is None else _largest(r["applied_thrusts"] / most)


def thrust_limits(recording: Recording) -> NDArray[np.float64] | None:
    """The most that each drone can give (n,), N: by its motors, its vehicle, or its allocator's limit; None if unlimited."""
    settings = recording.mission.settings()
    motor = settings.get("actuation", {}).get("max_thrust")
    drone = settings.get("drones", {}).get("max_thrust")
    if drone is None:
        drone = settings.get("allocation", {}).get("max_thrust")
    most = drone if motor is None else 4.0 * np.asarray(motor, dtype=float)
    return None if most is None else np.broadcast_to(np.asarray(most, dtype=float), recording.n)


@_metric
def peak_total_tension_N(r: Recording) -> float:
    return _largest(r["peak_tensions"][:, -1] if r.measured("peak_tensions") else _total(r))


@_metric
def mean_total_tension_N(r: Recording) -> float:
    return float(mean(_total(r), r.time))


@_metric
def peak_tension_N(r: Recording) -> float:
    return _largest(r["peak_tensions"][:, :-1] if r.measured("peak_tensions") else r["tensions"])


@_metric
def max_catch_impulse_Ns(r: Recording) -> float:
    pushed = (r["tensions"] < 0.0).any()  # a rod: what a cable would have caught is not known
    return float("nan") if pushed else _largest(r["catch_impulses"])


@_metric
def tension_integral_10s_Ns(r: Recording) -> float:
    if r.time[0] > 0.0 or r.time[-1] < 10.0 - 1e-9:
        return float("nan")
    rows = r.time <= 10.0 + 1e-9
    return integral(_total(r)[rows], r.time[rows])


@_metric
def tension_integral_Ns(r: Recording) -> float:
    return integral(_total(r), r.time)


@_metric
def tension_tracking_rms_N(r: Recording) -> float:
    return float(np.sqrt(mean((r["tensions"] - r["desired_tensions"]) ** 2, r.time)))


@_metric
def tension_imbalance(r: Recording) -> float:
    means = mean(r["tensions"], r.time, axis=0)
    if np.isnan(means).any():
        return float("nan")
    return float(means.max() / means.min()) if means.min() > 0 else float("inf")


@_metric
def energy_imbalance(r: Recording) -> float:
    power = mean(np.maximum(r["thrusts"], 0.0) ** 1.5, r.time, axis=0)  # a rotor's induced power
    return _largest(power) / float(power.mean()) if power.mean() > 0 else float("nan")


@_metric
def slack_time_s(r: Recording) -> float:
    spent, lies = r["slack_times"], rests(r)
    if not lies.any():
        return float(sum(_largest(times) for times in spent.T))
    grown = np.diff(spent, axis=0, prepend=np.zeros_like(spent[:1]))[~lies]
    return float(np.nansum(np.maximum(grown, 0.0)))


@_metric
def saturated_time_s(r: Recording) -> float:
    return float(sum(_largest(times) for times in r["saturated_times"].T))


@_metric
def touch_speed_mps(r: Recording) -> float:
    return _largest(r["touch_speeds"][:, -1]) if _has_ground(r) else math.nan


@_metric
def ground_time_s(r: Recording) -> float:
    if not (_has_ground(r) and r.measured("ground_forces")):
        return math.nan
    return integral((r["ground_forces"][:, -1, 2] > 0.0).astype(float), r.time)


@_metric
def drone_touch_speed_mps(r: Recording) -> float:
    return _largest(r["touch_speeds"][:, :-1]) if _has_ground(r) else math.nan


@_metric
def lift_peak(r: Recording) -> float:
    return _peak_over_weight(r, Phase.HOOK, Phase.TENSION, Phase.RISE)


@_metric
def touch_peak(r: Recording) -> float:
    return _peak_over_weight(r, Phase.TOUCH, Phase.UNLOAD)


def _peak_over_weight(r: Recording, *phases: Phase) -> float:
    rows = np.isin(r["phase"][:, 0], phases)
    weight = r.mission.true_team.load_mass * r.mission.team.gravity
    return _largest(r["peak_tensions"][rows, :-1]) / weight if weight > 0.0 else math.nan


@_metric
def lifted_m(r: Recording) -> float:
    stood = np.flatnonzero(r["phase"][:, 0] == Phase.STAND)
    heights = r["load"][:, 0, 2]
    return _largest(heights[stood[0] :] - heights[stood[0]]) if stood.size else math.nan


@_metric
def dragged_m(r: Recording) -> float:
    phases = r["phase"][:, 0]
    lies = np.isin(phases, (Phase.STAND, Phase.CLIMB, Phase.HOOK, Phase.TENSION))
    lifted = np.flatnonzero(lies & ~rests(r))
    rows = np.flatnonzero(lies & (phases != Phase.STAND))
    rows = rows[rows < lifted[0]] if lifted.size else rows
    way = r["load"][rows, 0, :2] - r["load"][:1, 0, :2]
    return _largest(np.linalg.norm(way, axis=1))


@_metric
def touch_height_m(r: Recording) -> float:
    phases = r["phase"][:, 0]
    told = np.flatnonzero((phases[1:] == Phase.UNLOAD) & (phases[:-1] == Phase.TOUCH)) + 1
    if not (told.size and r.mission.ground is not None):
        return math.nan
    return _largest(r["load"][told, 0, 2] - r.mission.ground.height)


@_metric
def placement_m(r: Recording) -> float:
    down = np.flatnonzero(r["phase"][:, 0] > Phase.UNLOAD)
    return _largest(np.linalg.norm(tracking_error(r)[down, :2], axis=1))


@_metric
def weighed_mass_kg(r: Recording) -> float:
    weighed = r["lifted_mass"][:, 0]
    return float(weighed[-1]) if weighed[-1] > 0.0 else math.nan


@_metric
def setbacks(r: Recording) -> float:
    phases = r["phase"][:, 0]
    if (phases == Phase.FLY).all():
        return math.nan
    before = phases[:-1][(phases[1:] == Phase.UNLOAD) & (phases[:-1] != Phase.UNLOAD)]
    return float(np.count_nonzero(before != Phase.TOUCH))


@_metric
def min_clearance_m(r: Recording) -> float:
    mission = r.mission
    if not mission.world.obstacles:
        return math.nan
    team = mission.true_team
    load = r["load"][:, :1]
    if team.body is not None and "load_attitude" in r:
        load = corners(team.body.size, load, r["load_attitude"])
    ends = cable_ends(r)[:, :, 0]
    return least_clearance(
        mission.world.rows(), Bodies(team.radii, r["positions"], ends, r["attached"], load)
    )


def _has_ground(r: Recording) -> bool:
    return r.mission.ground is not None


@_metric
def min_height_m(r: Recording) -> float:
    return -_largest(-r["load"][:, 0, 2])


@_metric
def lost_drones(r: Recording) -> float:
    flying = ~np.isnan(r["attached"])
    if not flying.any():
        return math.nan
    return float(np.count_nonzero(flying.any(axis=0) & ~flying[-1]))


@_metric
def detection_delay_s(r: Recording) -> float:
    broken = (r["attached"] == 0.0) | (r["motor_health"].max(axis=2) == 0.0)
    delays = []
    for drone in np.flatnonzero(broken.any(axis=0)):
        since = int(np.argmax(broken[:, drone]))
        gone = np.flatnonzero(np.isnan(r["attached"][since:, drone]))
        delays.append(r.time[since + gone[0]] - r.time[since] if gone.size else math.inf)
    return float(max(delays, default=math.nan))


@_metric
def allocator_failures(r: Recording) -> float:
    statuses = r["allocator_status"]
    return _count(statuses, ~np.isin(statuses, [0, *_WITHIN_LIMITS, int(Status.SILENT)]))


@_metric
def allocator_silent(r: Recording) -> float:
    statuses = r["allocator_status"]
    return _count(statuses, statuses == Status.SILENT)


@_metric
def allocator_limited(r: Recording) -> float:
    statuses = r["allocator_status"]
    return _count(statuses, np.isin(statuses, _WITHIN_LIMITS))


def _answered(r: Recording, name: str) -> NDArray[np.float64]:
    """What is known of the allocations that answered, by the name of the signal."""
    values = r[name]
    return np.asarray(values[~np.isnan(values) & (r["allocator_status"] != Status.SILENT)])


def _of_answers(
    r: Recording, name: str, number: Callable[[NDArray[np.float64]], np.floating[Any]]
) -> float:
    """A number of the allocations that answered; NaN where none did."""
    known = _answered(r, name)
    return float(number(known)) if known.size else float("nan")


@_metric
def max_missing_moment_Nm(r: Recording) -> float:
    if r.mission.load.kind != "rigid":
        return math.nan
    return _of_answers(r, "allocator_moment_residual", np.max)


@_metric
def allocator_mean_iterations(r: Recording) -> float:
    return _of_answers(r, "allocator_iterations", np.mean)


@_metric
def allocator_max_iterations(r: Recording) -> float:
    return _of_answers(r, "allocator_iterations", np.max)


@_metric
def allocator_mean_us(r: Recording) -> float:
    return 1e6 * _of_answers(r, "allocator_time", np.mean)


@_metric
def allocator_median_us(r: Recording) -> float:
    return 1e6 * _of_answers(r, "allocator_time", np.median)


@_metric
def allocator_p99_us(r: Recording) -> float:
    return 1e6 * _of_answers(r, "allocator_time", lambda known: np.percentile(known, 99))


@_metric
def allocator_max_us(r: Recording) -> float:
    return 1e6 * _of_answers(r, "allocator_time", np.max)
