"""From logs to a recording: what was measured, what follows from it, and what stays unknown."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from colift.errors import FlightDataError
from colift.kernel.signals import CYCLE_SIGNALS, SIGNALS
from colift.mission.schema import Drones, Load, RealFlight, Section, Start, Timing
from colift.record.ends import ends_of
from colift.record.importing._clocks import Offset, merge
from colift.record.importing._plausible import LONGEST, clean, doubt
from colift.record.importing.base import Array, Finding, Log, Reading, read
from colift.record.recording import Recording, versions
from colift.wording import Refusing

CRAZYFLIE_INERTIA = (16.571710e-6, 16.655602e-6, 29.261652e-6)
"""kg m^2: J. Förster, System Identification of the Crazyflie 2.0 Nano Quadrocopter, ETH Zurich, 2015."""

Mass = Annotated[float, Field(gt=0.0, le=1e5)]


class Assumed(Section, metaclass=Refusing):
    """What a log does not tell. The defaults are those of the published Crazyflie flights."""

    load_mass: Mass = 0.01
    """kg."""
    drone_mass: Mass = 0.034
    """kg."""
    cable_length: Annotated[float, Field(gt=0.0, le=1e4)] | None = None
    """m; none: the median distance between each drone and the load."""


def import_flight(
    files: Sequence[str | Path],
    assumed: Assumed | None = None,
    *,
    name: str | None = None,
    told: Reading | None = None,
) -> Recording:
    """One flight from its log, or from several logs that are aligned in time by the load's motion.

    Signals: ``load``, ``reference``, ``positions``, ``velocities`` and, where logged, ``attitudes``,
    ``rates``, ``drone_forces`` and ``load_attitude`` are the logs'. ``force`` is the mean of the drones' own copies.
    ``desired_tensions`` and ``desired_directions`` are size and opposite direction of the share that each
    drone's own allocator gave to its cable. ``directions`` point from drone to load, and
    ``direction_rates`` follow from the velocities. Everything else was not measured and is NaN, the
    actual tensions too. Rows in which a body cannot be where the log says, or has no position, are NaN; these, drones
    that were taken for each other and damage of a file stand in ``provenance["findings"]``.

    Parameters
    ----------
    files
        One log of all drones, or one of each.
    assumed
        What a log does not tell.
    name
        Of the flight; that of the first file where left out.
    told
        Conventions that differ from the documented ones, or that are right although they look wrong.

    Raises
    ------
    FlightDataError
        For a file that cannot be read, or that looks as if its frame or a unit were another one; for files that are
        not of one flight, and for a drone that is given twice.
    OSError
        For a file that cannot be opened.

    """
    assumed = assumed or Assumed()
    told = told or Reading()
    paths = [Path(file) for file in files]
    kinds, logs, drone = [], [], 0
    for path in paths:
        kind, log = read(path, told)
        doubt(str(path), log, told)
        logs.append(_checked(path, clean(log, [f"drone {drone + i}" for i in range(log.n)])))
        kinds.append(kind)
        drone += log.n
    log, offsets = merge(logs, [str(path) for path in paths])
    if len(log.time) < 2:
        raise FlightDataError(f"{paths[0]}: the logs have no stretch of time in common")
    arrays, spread = _signals(log)
    provenance = {
        **_provenance(paths, kinds, offsets, log.findings),
        "assumed": assumed.model_dump(exclude_none=True),
        "force": "mean of the drones' own copies",
        "force_copies_spread_rms_N": spread,
    }
    return Recording(
        mission=_known(log, arrays, assumed, name or paths[0].stem, [path.name for path in paths]),
        time=log.time,
        cycle_time=log.time,
        arrays=arrays,
        provenance=provenance,
    )


def _provenance(
    paths: Sequence[Path], kinds: Sequence[str], shifts: Sequence[Offset], found: Sequence[Finding]
) -> dict[str, Any]:
    """Where a recording comes from, and what was found on the way."""
    findings = sorted(found, key=lambda finding: (finding.kind, finding.begin))
    return {
        "files": [
            {
                "name": path.name,
                "sha256": _digest(path),
                "format": kind,
                "clock_offset_s": shift.seconds,
                "load_mismatch_rms_m": shift.residual,
            }
            for path, kind, shift in zip(paths, kinds, shifts, strict=True)
        ],
        "findings": [{**asdict(each), "text": str(each)} for each in findings],
        "importer": f"colift {versions()['colift']}",
    }


def _digest(path: Path) -> str:
    """Of a file, or of all files of a folder in the order of their names."""
    files = sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else [path]
    return hashlib.sha256(b"".join(each.read_bytes() for each in files)).hexdigest()


def _checked(path: Path, log: Log) -> Log:
    """A log in which load and drones have places, in a time that a flight can last."""
    for i, values in enumerate([log.load[:, 0], *log.drones["positions"].swapaxes(0, 1)]):
        if np.count_nonzero(~np.isnan(values).any(axis=1)) < 2:
            body = f"drone {i - 1}" if i else "the load"
            raise FlightDataError(f"{path}: has no two rows with a position of {body}")
    if np.ptp(log.time) > LONGEST:
        raise FlightDataError(f"{path}: spans {np.ptp(log.time):.3g} s, which is no flight")
    return log


def _signals(log: Log) -> tuple[dict[str, Array], float | None]:
    """Signals by name, and how far the drones' copies of the force lie apart, N RMS."""
    rows = len(log.time)
    arrays = {s.name: np.full((rows, *s.shape_for(log.n)), np.nan) for s in SIGNALS}
    arrays |= {s.name: np.full(rows, np.nan) for s in CYCLE_SIGNALS}
    arrays["load"] = log.load
    arrays["reference"][:, :2] = log.reference
    if log.load_attitude is not None:
        arrays["load_attitude"] = log.load_attitude
    arrays |= {name: log.drones[name] for name in log.drones if name in arrays}
    ends = ends_of(log.load, log.n)
    arrays["directions"], reach = _unit(ends[:, :, 0] - log.drones["positions"])
    turning = ends[:, :, 1] - log.drones["velocities"]
    along = np.sum(turning * arrays["directions"], axis=-1, keepdims=True)
    arrays["direction_rates"] = (turning - along * arrays["directions"]) / reach[..., None]
    arrays["desired_directions"], arrays["desired_tensions"] = _unit(-log.drones["shares"])
    commands = log.drones["commands"]
    arrays["force"] = commands.mean(axis=1)
    balance = log.drones["shares"].sum(axis=1) - arrays["force"]
    arrays["allocator_force_residual"] = np.linalg.norm(balance, axis=1)
    apart = np.sum((commands - arrays["force"][:, None]) ** 2, axis=-1)
    spread = float(np.sqrt(apart[~np.isnan(apart)].mean())) if not np.isnan(apart).all() else None
    return arrays, spread


def _unit(vectors: Array) -> tuple[Array, Array]:
    """Unit vectors, NaN for a vector without length, and lengths."""
    lengths = np.linalg.norm(vectors, axis=-1)
    safe = np.where(lengths > 0.0, lengths, np.nan)
    return vectors / safe[..., None], lengths


def _known(
    log: Log, arrays: dict[str, Array], assumed: Assumed, name: str, files: list[str]
) -> RealFlight:
    ends = ends_of(log.load, log.n)
    reach = np.linalg.norm(ends[:, :, 0] - log.drones["positions"], axis=-1)
    lengths = [round(float(length), 4) for length in np.nanmedian(reach, axis=0)]
    period = max(0.001, round(float(np.median(np.diff(log.time))), 3))
    given = assumed.cable_length
    directions = arrays["directions"]
    whole = ~np.isnan(directions).any(axis=(1, 2))
    start = log.load[0, 0] - log.reference[0, 0]
    return RealFlight(
        name=name,
        description=f"A real flight of {log.n} drones, imported from {', '.join(files)}.",
        load=Load(mass=assumed.load_mass),
        drones=Drones(
            count=log.n,
            mass=assumed.drone_mass,
            inertia=CRAZYFLIE_INERTIA,
            cable_length=lengths if given is None else given,
        ),
        start=Start(
            directions=directions[np.argmax(whole)].tolist() if whole.any() else None,
            load_offset=tuple(np.nan_to_num(start).tolist()),
        ),
        timing=Timing(
            duration=float(log.time[-1]), load_control=period, allocation=period,
            position_control=period, attitude_control=period, recording=period,
        ),
    )  # fmt: skip
