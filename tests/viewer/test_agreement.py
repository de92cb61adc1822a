"""What the page's types and tables name is what the package writes and takes; read from the sources, without Node."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from flown import payload_of

from colift.cli.render import Camera
from colift.mission import load_mission
from colift.record.moments import Moment
from colift.record.recording import Recording
from colift.show.live import encode, protocol
from colift.show.live.session import Session

SOURCES = Path(__file__).parents[2] / "viewer" / "src"
PAGE, LINE, CAMERA = (
    (SOURCES / name).read_text() for name in ("data.ts", "live/connection.ts", "camera.ts")
)


def keys(source: str, interface: str) -> set[str]:
    """Names of the fields of an interface, with those that it extends."""
    pattern = rf"^export interface {interface}(?: extends (\w+))? {{\n(.*?)^}}"
    base, body = re.search(pattern, source, re.MULTILINE | re.DOTALL).groups()  # type: ignore[union-attr]
    found = {*re.findall(r"^  (\w+):", body, re.MULTILINE)}
    assert found, interface
    return found | (keys(source, base) if base else set())


def widths() -> dict[str, Callable[[int], int]]:
    """The page's signals, and how many numbers each has for so many drones."""
    (table,) = re.findall(r"^export const WIDTHS = {\n(.*?)^};", PAGE, re.MULTILINE | re.DOTALL)
    lines = re.findall(
        r"^  (\w+): \((?:n: number)?\) => (?:(\d+)( \* n)?|n),$", table, re.MULTILINE
    )
    assert len(lines) == table.count("=>")
    return {
        name: lambda n, factor=int(factor or 1), each=bool(times or not factor): (
            factor * (n if each else 1)
        )
        for name, factor, times in lines
    }


@pytest.fixture(scope="module")
def session() -> Iterator[Session]:
    flying = Session(load_mission("hover"), lambda _: Path())
    flying.tick(0.0)
    flying.tick(0.5)
    yield flying
    flying.end(save=False)


def test_a_replay_carries_the_signals_of_the_page_in_its_widths(spiral: Recording) -> None:
    flight = payload_of(spiral)["flights"][0]
    rows, wanted = flight["time"]["shape"][0], widths()
    assert flight["signals"].keys() == wanted.keys()
    for name, width in wanted.items():
        first, *rest = flight["signals"][name]["shape"]
        assert first == rows, name
        assert math.prod(rest) == width(spiral.n), name


def test_a_live_flight_sends_the_signals_of_the_page_in_its_widths(session: Session) -> None:
    sent = json.loads(encode.rows(session.rows(0)[0], 1))
    for name, width in widths().items():
        assert {count(row) for row in sent["signals"][name]} == {width(4)}, name


def test_a_replay_has_what_the_page_reads(spiral: Recording) -> None:
    data = payload_of(spiral)
    flight = data["flights"][0]
    assert (
        keys(PAGE, "Payload") - {"view"} <= data.keys()
    )  # the view is added as the page is written
    assert keys(PAGE, "FlightData") <= flight.keys()
    assert keys(PAGE, "Packed") == flight["time"].keys()
    assert keys(PAGE, "Metric") == flight["metrics"][0].keys()
    assert keys(PAGE, "Mark") == {*Moment._fields}


def test_a_server_says_what_the_page_reads(session: Session) -> None:
    hello = json.loads(encode.hello(session, "watch"))
    assert keys(LINE, "Hello") <= hello.keys()
    assert keys(LINE, "Knob") == hello["knobs"][0].keys()
    assert keys(LINE, "Choice") == hello["choices"][0].keys()
    assert keys(LINE, "Rows") == json.loads(encode.rows(session.rows(0)[0], 1)).keys()
    # The server adds the type and how many look on.
    assert keys(LINE, "State") - {"type", "viewers"} <= session.state.keys()


EXAMPLES: dict[str, Any] = {"number": 0.5, "string": "load.mass", "number[]": [0.0, 0.0, 1.0]}


def test_a_server_takes_every_order_of_the_page() -> None:
    (orders,) = re.findall(r"^export type Order =\n(.*?);\n\n", LINE, re.MULTILINE | re.DOTALL)
    taken = set()
    for order in re.findall(r"{ (.*) }", orders):
        fields = dict(field.split(": ", 1) for field in order.split("; "))
        whole = {"drone", "seq"}
        message = {
            name: 1 if name in whole else EXAMPLES[kind]
            for name, kind in fields.items()
            if kind in EXAMPLES
        }
        for name in fields.keys() - message.keys():
            message[name] = re.findall(r'"(\w+)"', fields[name])
        kinds = message.get("action", [None])
        for action in kinds:
            said = message | {"type": message["type"][0]} | ({"action": action} if action else {})
            taken.add(type(protocol.parse(json.dumps(said))))
    asked = {protocol.Ack, *protocol.Command.__subclasses__()}
    assert taken == asked


def test_views_have_the_names_of_the_command() -> None:
    (views,) = re.findall(r"^export const VIEWS = \[(.*)\] as const;", CAMERA, re.MULTILINE)
    assert tuple(re.findall(r'"(\w+)"', views)) == get_args(Camera)


def count(value: Any) -> int:
    """Numbers in nested lists."""
    return sum(map(count, value)) if isinstance(value, list) else 1
