"""Bags of ROS 2: MCAP with the messages' definitions inside, which ROS, Foxglove and PlotJuggler open.

Needs the package rosbags (extra ``bags``), and no ROS. A bag is a folder; where the path ends in ``.mcap``, the file alone.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from colift.errors import ColiftError, MissingExtraError
from colift.extras import install
from colift.kernel.status import Status
from colift.record.ends import cable_ends
from colift.record.exchange import messages
from colift.record.exchange.messages import Body, Fields, Setpoint
from colift.record.exchange.topics import DIAGNOSTICS, LOAD, TOPICS, drone
from colift.record.exchange.urdf import urdf
from colift.record.recording import Recording, atomic_path

Progress = Callable[[float], None]

SUFFIX = ".mcap"
STILL = np.zeros(3)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def typestore() -> Any:
    """The definitions of ROS's own messages.

    Raises
    ------
    MissingExtraError
        Without rosbags.

    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError(
            f"bags need the package rosbags, the extra bags; run: {install('bags')}"
        ) from None
    return get_typestore(Stores.ROS2_KILTED)


class Writer:
    """Writes one bag; from :func:`writing`."""

    def __init__(self, bag: Any, store: Any) -> None:
        self._bag, self._store = bag, store
        self._topics: dict[str, Any] = {}

    def say(self, name: str, kind: str, at: int, fields: Mapping[str, Any]) -> None:
        """A message of a type, such as ``nav_msgs/msg/Odometry``, at a time (ns)."""
        made = built(self._store, kind, fields)
        self.put(name, kind, at, self._store.serialize_cdr(made, kind))

    def put(self, name: str, kind: str, at: int, data: bytes | memoryview) -> None:
        """The same of a message's own bytes."""
        if name not in self._topics:
            self._topics[name] = self._bag.add_connection(name, kind, typestore=self._store)
        self._bag.write(self._topics[name], at, data)


@contextmanager
def writing(path: Path) -> Iterator[Writer]:
    """A writer of a bag, which is there as a whole when the block ends well, and not at all otherwise.

    Raises
    ------
    ColiftError
        If there is something at the path already.
    MissingExtraError
        Without rosbags.
    OSError
        If it cannot be written.

    """
    store = typestore()
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as BagWriter

    if path.exists():
        raise ColiftError(f"{path}: is there already; a bag is not written over")
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-") as folder:
        inside = Path(folder) / path.stem
        bag = BagWriter(inside, version=BagWriter.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
        with bag:
            yield Writer(bag, store)
        if path.suffix == SUFFIX:
            with atomic_path(path) as temporary:
                shutil.move(inside / f"{path.stem}{SUFFIX}", temporary)
        else:
            inside.rename(path)


def built(store: Any, kind: str, fields: Mapping[str, Any]) -> Any:
    """A message of rosbags' with these fields; the others are zero or empty."""
    values = {}
    for name, (node, detail) in store.fielddefs[kind][1]:
        given = fields.get(name)
        if node.name == "NAME":
            values[name] = built(store, detail, given or {})
        elif node.name == "BASE":
            values[name] = _EMPTY.get(detail[0], 0) if given is None else given
        elif (item := detail[0])[0].name == "NAME":
            values[name] = [built(store, item[1], each) for each in given or ()]
        else:
            length = detail[1] if node.name == "ARRAY" else 0
            values[name] = np.zeros(length, item[1][0]) if given is None else given
    return store.types[kind](**values)


_EMPTY: dict[str, Any] = {"string": "", "bool": False, "float64": 0.0, "float32": 0.0}


def write_bag(recording: Recording, path: Path, progress: Progress | None = None) -> Path:
    """A recording as a bag: each topic whose signals were measured, in every row in which all of it is a number.

    Odometry is that of load and drones as they were: of a simulation the true one. Times are the recording's, from 0.
    """
    rows = len(recording.time)
    said = [(*each, _known(each[2])) for each in _topics(recording)]
    stamps = np.round(recording.time * 1e9).astype(np.int64).tolist()
    with writing(path) as bag:
        description = TOPICS["description"]
        text = urdf(recording.mission.team, recording.mission.name)
        bag.say(description.names(0)[0], description.type, stamps[0], {"data": text})
        for at, fields in _diagnostics(recording):
            bag.say(DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray", at, fields)
        for row, at in enumerate(stamps):
            for name, kind, signals, make, known in said:
                if known[row]:
                    bag.say(name, kind, at, make(at, *(each[row] for each in signals)))
            if progress is not None and row % 100 == 0:
                progress(row / rows)
    return path


def topics_of(recording: Recording) -> set[str]:
    """Names of all topics of a recording's bag."""
    said = {name for name, _, signals, _ in _topics(recording) if any(_known(signals))}
    told = {DIAGNOSTICS} if any(True for _ in _diagnostics(recording)) else set()
    return said | told | {TOPICS["description"].names(0)[0]}


def _known(signals: Sequence[np.ndarray]) -> list[bool]:
    """Rows in which all numbers are there."""
    rows = [np.isfinite(each.reshape(len(each), -1)).all(axis=1) for each in signals]
    return np.logical_and.reduce(rows).tolist()  # type: ignore[no-any-return]


Make = Callable[..., Fields]
Said = tuple[str, str, list[np.ndarray], Make]


def _topics(recording: Recording) -> Iterator[Said]:
    """Name, type and signals of each topic that was measured, and how a row of them becomes a message."""
    of, n, rows = recording.complete(), recording.n, len(recording.time)
    rigid = recording.measured("load_attitude", "load_rates")
    level, still = np.tile(LEVEL, (rows, 1)), np.tile(STILL, (rows, 1))
    attitude = of["load_attitude"] if rigid else level
    rates = of["load_rates"] if rigid else still
    moment = of["moment"] if recording.measured("moment") else still

    def topic(key: str, signals: Sequence[np.ndarray], make: Make, i: int = 0) -> Iterator[Said]:
        if all(np.isfinite(each).any() for each in signals):
            yield TOPICS[key].names(n)[i], TOPICS[key].type, list(signals), make

    def moving(name: str) -> Make:
        return lambda at, x, v, q, w: messages.odometry(at, name, Body(x, v, q, w))

    def pulling(at: int, tension: float, direction: np.ndarray) -> Fields:
        return messages.wrench(at, -tension * direction)

    load, wanted = of["load"], of["reference"]
    yield from topic("load", [load[:, 0], load[:, 1], attitude, rates], moving(LOAD))
    turned = recording.measured("reference_attitude", "reference_rates")
    pose = [of["reference_attitude"], of["reference_rates"][:, 0]] if turned else [level, still]
    bend = of["reference_rates"][:, 1] if turned else still
    yield from topic("reference", [wanted[:, 0], wanted[:, 1], *pose], moving(LOAD))
    yield from topic("acceleration", [wanted[:, 2], bend], messages.acceleration)
    yield from topic("wrench", [of["force"], moment], messages.wrench)
    for i in range(n):
        rates_i = of["rates"][:, i] if recording.measured("rates") else still
        body = [of["positions"][:, i], of["velocities"][:, i], of["attitudes"][:, i], rates_i]
        yield from topic("drone", body, moving(drone(i)), i)
        pull = [of["desired_tensions"][:, i], of["desired_directions"][:, i]]
        yield from topic("cable_command", pull, pulling, i)
        pull = [of["tensions"][:, i], of["directions"][:, i]]
        yield from topic("cable", pull, pulling, i)
        yield from topic("setpoint", _aims(of, i), _aiming(drone(i)), i)
    bodies = [of["positions"], of["velocities"], of["attitudes"]]
    yield from topic("tf", [load, attitude, *bodies, cable_ends(of)[:, :, 0]], _framing)


def _aims(of: Recording, i: int) -> list[np.ndarray]:
    force = of["thrusts"][:, i] / of.mission.team.masses[i]
    return [of["desired_attitudes"][:, i], of["desired_rates"][:, i], force]


def _aiming(name: str) -> Make:
    return lambda at, q, w, f: messages.setpoint(at, name, Setpoint(q, w, float(f)))


def _framing(
    at: int, load: np.ndarray, attitude: np.ndarray, x: np.ndarray, v: np.ndarray, q: np.ndarray, ends: np.ndarray
) -> Fields:  # fmt: skip
    drones = [Body(*each, STILL) for each in zip(x, v, q, strict=True)]
    return {
        "transforms": messages.frames(at, Body(load[0], load[1], attitude, STILL), drones, ends)
    }


def _diagnostics(recording: Recording) -> Iterator[tuple[int, Fields]]:
    """The allocator's status, where it changes."""
    if not recording.measured("allocator_status"):
        return
    before = None
    for time, code in zip(recording.cycle_time, recording["allocator_status"], strict=True):
        if code == before or not np.isfinite(code):
            continue
        before, at = code, round(time * 1e9)
        status = Status(int(code))
        yield (
            at,
            {
                "header": {"stamp": messages.stamp(at), "frame_id": ""},
                "status": [
                    {
                        "level": 0 if status.ok else 1,
                        "name": "colift: allocator",
                        "message": status.name.lower().replace("_", " "),
                        "hardware_id": recording.mission.name,
                    }
                ],
            },
        )
