"""Bags of ROS 2 with the topics of a team (:mod:`colift.record.exchange.topics`), below any namespace: of real nodes, or written by `colift export bag`.

Rows are the load's odometry, by the time in its header. Of every other topic a row has the newest message that is not from after it, nor
older than one and a half of its usual periods.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from colift.errors import FlightDataError, MissingExtraError
from colift.record.exchange import messages
from colift.record.exchange.bag import SUFFIX, typestore
from colift.record.exchange.topics import TOPICS
from colift.record.importing.base import DRONE_COLUMNS, Array, Log, Reading

MAGIC = b"\x89MCAP0\r\n"
FRESH = 1.5
"""Periods of a topic for which a message holds."""
MOST = 1000
"""Drones at most."""

Rows = tuple[list[int], list[list[float]]]
"""Stamps, ns, and numbers of the messages of a topic."""


def recognises(head: bytes, path: Path) -> bool:
    """Whether it is MCAP, or a folder with one."""
    return head.startswith(MAGIC) or (path.is_dir() and (path / "metadata.yaml").is_file())


def read(path: Path, told: Reading) -> Log:
    """Read one bag.

    Raises
    ------
    FlightDataError
        For one that is damaged or holds no flight: no odometry of the load or of a drone, time that goes back, several frames.
    MissingExtraError
        Without rosbags.

    """
    try:
        found, frames = _messages(path)
    except (FlightDataError, MissingExtraError):
        raise
    except Exception as error:  # a damaged file makes the reader fail in any way
        raise FlightDataError(f"{path}: cannot be read as a bag: {error}") from error
    if len(frames) > 1:
        raise FlightDataError(
            f"{path}: its odometry is in several frames: {', '.join(sorted(frames))}"
        )
    n = next(i for i in range(MOST) if ("drone", i) not in found)
    if ("load", 0) not in found or n == 0:
        missing = TOPICS["drone"].below(1)[0] if ("load", 0) in found else TOPICS["load"].name
        raise FlightDataError(f"{path}: has no topic that ends in {missing}")
    stamps, load = _series(path, found["load", 0])

    def rows(key: str, width: int, i: int = 0) -> Array:
        return _held(path, stamps, found.get((key, i)), width)

    drones = {
        name: np.full((len(stamps), n, width), np.nan) for name, width in DRONE_COLUMNS.items()
    }
    for i in range(n):
        body = rows("drone", 13, i)
        drones["positions"][:, i], drones["velocities"][:, i] = body[:, :3], body[:, 3:6]
        drones["attitudes"][:, i], drones["rates"][:, i] = body[:, 6:10], body[:, 10:]
        drones["shares"][:, i] = rows("cable_command", 6, i)[:, :3]
        drones["commands"][:, i] = rows("wrench", 6)[:, :3]
    turned = load[:, 6:10]
    return Log(
        time=(stamps - stamps[0]) * 1e-9,
        load=load[:, :6].reshape(-1, 2, 3),
        reference=rows("reference", 13)[:, :6].reshape(-1, 2, 3),
        drones=drones,
        load_attitude=turned if (turned != [1.0, 0.0, 0.0, 0.0]).any() else None,
    )


def _messages(path: Path) -> tuple[Mapping[tuple[str, int], Rows], set[str]]:
    """Messages of each topic and drone, and the frames of odometry."""
    store = typestore()
    from rosbags.highlevel import AnyReader

    found: dict[tuple[str, int], Rows] = defaultdict(lambda: ([], []))
    frames: set[str] = set()
    whole = path if path.is_dir() or path.suffix == SUFFIX else None
    if whole is None:
        raise FlightDataError(f"{path}: the name of a bag's file must end in {SUFFIX}")
    with AnyReader([whole], default_typestore=store) as reader:
        places = {each.id: _place(each.topic, each.msgtype) for each in reader.connections}
        wanted = [each for each in reader.connections if places[each.id]]
        if not wanted:
            names = ", ".join(sorted({each.topic for each in reader.connections})) or "none"
            raise FlightDataError(f"{path}: has no topic of a team; there are {names}")
        for connection, _, data in reader.messages(connections=wanted):
            key, i = places[connection.id]  # type: ignore[misc]
            message: Any = reader.deserialize(data, connection.msgtype)
            if key in ("load", "drone"):
                frames.add(message.header.frame_id)
            stamps, numbers = found[key, i]
            stamps.append(messages.nanoseconds(message.header.stamp))
            numbers.append(READ[key](message))
    return found, frames


def _place(name: str, kind: str) -> tuple[str, int] | None:
    """Which of our topics it is, and of which drone."""
    for key in READ:
        topic = TOPICS[key]
        if topic.type != kind:
            continue
        head, _, tail = topic.name.rpartition("/")
        parts = name.strip("/").split("/")
        if parts[-1] != tail or len(parts) < 2:
            continue
        if parts[-2] == head:
            return key, 0
        number = parts[-2].removeprefix("drone_")
        if "{i}" in head and number.isdigit() and parts[-2] != number:
            return key, int(number)
    return None


def _odometry(message: Any) -> list[float]:
    found = messages.body_of(message, frame=message.header.frame_id)
    return [np.nan] * 13 if found is None else np.concatenate(found).tolist()


def _wrench(message: Any) -> list[float]:
    found = messages.wrench_of(message)
    return [np.nan] * 6 if found is None else np.concatenate(found).tolist()


READ: Mapping[str, Callable[[Any], list[float]]] = {
    "load": _odometry,
    "drone": _odometry,
    "reference": _odometry,
    "wrench": _wrench,
    "cable_command": _wrench,
}
"""What is read of each topic, as one row of numbers."""


def _series(path: Path, rows: Rows) -> tuple[np.ndarray, Array]:
    """Stamps that increase, ns, and their numbers; what was said twice counts once."""
    stamps, numbers = np.array(rows[0], dtype=np.int64), np.array(rows[1])
    new = np.concatenate([[True], np.diff(stamps) != 0])
    stamps, numbers = stamps[new], numbers[new]
    if (np.diff(stamps) < 0).any():
        back = stamps[1:][np.diff(stamps) < 0][0]
        raise FlightDataError(
            f"{path}: time goes back to {back * 1e-9:.3f} s: it holds more than one flight"
        )
    return stamps, numbers


def _held(path: Path, stamps: np.ndarray, rows: Rows | None, width: int) -> Array:
    """Of a topic the newest numbers at each stamp; NaN where there are none, or old ones."""
    found = np.full((len(stamps), width), np.nan)
    if rows is None:
        return found
    times, numbers = _series(path, rows)
    period = np.median(np.diff(times)) if len(times) > 1 else 0.0
    place = np.searchsorted(times, stamps, side="right") - 1
    fresh = (place >= 0) & (stamps - times[place] <= FRESH * period)
    found[fresh] = numbers[place[fresh]]
    return found
