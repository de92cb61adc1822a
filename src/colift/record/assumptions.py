"""What a flight took for granted: how strong the wind was, how wrong and how old what is measured, how heavy all is.

A table of quantities that a recording shows, and a monitor that keeps the largest of each and says when it went beyond what was assumed. It reads what
was recorded, a stretch of a flight or all of it; a flight that nobody watches does nothing for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.errors import AbsentSignalError, UnknownNameError
from colift.kernel.status import Status
from colift.record.metrics import thrust_limits, tilts
from colift.record.recording import Recording

Array = NDArray[np.float64]

ANSWERED = (Status.CONVERGED, Status.FORCE_REDUCED, Status.RECOVERING)
"""What an allocator says of an answer that keeps what it promises, or tells which limit does not allow it."""


class Assumption(NamedTuple):
    """One quantity: name (ends in its unit), unit, meaning, and its value in each row; in each allocation where ``each`` says so."""

    name: str
    unit: str
    meaning: str
    value: Callable[[Recording], Array]
    each: str = "row"


def _lengths(vectors: Array) -> Array:
    """Largest length of the vectors of each row; those of drones that have left do not count."""
    return _most(np.linalg.norm(vectors, axis=-1))


def _most(values: Array) -> Array:
    rows = values.reshape(len(values), -1)
    return np.asarray(np.max(np.where(np.isnan(rows), -np.inf, rows), axis=1, initial=-np.inf))


def _turn(recording: Recording) -> Array:
    between = np.abs(np.sum(recording["estimated_attitudes"] * recording["attitudes"], axis=-1))
    return _most(np.degrees(2.0 * np.arccos(np.clip(between, 0.0, 1.0))))


def _off(what: str) -> Callable[[Recording], Array]:
    """By how much a number of the true team differs from what is told, as a share; the same in every row."""

    def value(recording: Recording) -> Array:
        told, true = (
            np.asarray(getattr(team, what), dtype=float)
            for team in (recording.mission.team, recording.mission.true_team)
        )
        return np.full(len(recording.time), np.max(np.abs(true / told - 1.0)))

    return value


def _failed(recording: Recording) -> Array:
    return np.asarray(1.0 - np.isin(recording["allocator_status"], ANSWERED), dtype=np.float64)


def _thrust(recording: Recording) -> Array:
    most = thrust_limits(recording)
    return _most(recording["applied_thrusts"] / (math.nan if most is None else most))


ASSUMPTIONS = (
    Assumption("wind_mps", "m/s", "speed of the air", lambda r: _lengths(r["wind"][:, None])),
    Assumption("disturbance_N", "N", "force on a drone or the load that is neither gravity, thrust nor cable", lambda r: _lengths(r["external_forces"])),
    Assumption("load_error_m", "m", "distance of the load from where the controllers take it to be", lambda r: _lengths((r["estimated_load"] - r["load"])[:, :1])),
    Assumption("drone_error_m", "m", "the same of a drone", lambda r: _lengths(r["estimated_positions"] - r["positions"])),
    Assumption("attitude_error_deg", "deg", "angle of a drone from the attitude that the controllers take it to have", _turn),
    Assumption("measured_age_s", "s", "age of a measurement", lambda r: _most(r["measured_ages"])),
    Assumption("received_age_s", "s", "age of what a drone has received", lambda r: _most(r["received_ages"])),
    Assumption("load_mass_error", "1", "load's true mass over the told one, less 1, at the start", _off("load_mass")),
    Assumption("drone_mass_error", "1", "the same of a drone", _off("masses")),
    Assumption("cable_length_error", "1", "the same of a cable's length", _off("cable_lengths")),
    Assumption("tension_N", "N", "tension of a cable, between recorded rows too", lambda r: _most(r["peak_tensions"][:, :-1])),
    Assumption("thrust_share", "1", "thrust of a drone over the most that it can give", _thrust),
    Assumption("tilt_deg", "deg", "tilt of a drone", lambda r: _most(tilts(r))),
    Assumption("allocator_failed", "1", "1 where the allocator failed or was silent", _failed, "allocation"),
)  # fmt: skip
"""All that is watched; of a team without a leader the allocator's statuses are not known, and count as failed."""


@dataclass
class Monitor:
    """Keeps the largest of each quantity of a flight, and when it first went beyond its limit.

    Attributes
    ----------
    limits : mapping
        What is assumed: the most of a quantity, by its name; one that is not named is only watched.
    worst : dict
        Largest value so far by name, of those that were recorded.
    broken : dict
        When a quantity first went beyond its limit, s, by name.

    Raises
    ------
    UnknownNameError
        For a limit of a quantity that is not in the table.

    """

    limits: Mapping[str, float] = field(default_factory=dict)
    worst: dict[str, float] = field(default_factory=dict)
    broken: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        known = [each.name for each in ASSUMPTIONS]
        for name in self.limits:
            if name not in known:
                raise UnknownNameError("assumption", name, known)

    def look(self, recording: Recording) -> None:
        """Take in a flight, or the stretch of it that was flown since the last look."""
        for each in ASSUMPTIONS:
            time = recording.time if each.each == "row" else recording.cycle_time
            try:
                values = each.value(recording)
            except (AbsentSignalError, AttributeError):
                continue  # an old or a real flight, which does not show it
            if not len(time) or not (known := np.isfinite(values)).any():
                continue
            worst = float(values[known].max())
            self.worst[each.name] = max(worst, self.worst.get(each.name, -math.inf))
            limit = self.limits.get(each.name, math.inf)
            if worst > limit and each.name not in self.broken:
                self.broken[each.name] = float(time[np.argmax(known & (values > limit))])

    def unseen(self) -> list[str]:
        """Limits of which the flight showed nothing."""
        return [name for name in self.limits if name not in self.worst]


def largest(*found: Mapping[str, Any]) -> dict[str, float]:
    """Largest value of each quantity in several flights."""
    names = dict.fromkeys(name for each in found for name in each)
    return {name: max(each[name] for each in found if name in each) for name in names}
