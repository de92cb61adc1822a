"""A live server that flies nothing: it speaks the protocol, plays a recording's rows and keeps what it is told."""

from __future__ import annotations

import asyncio
import json
import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from aiohttp import WSMsgType, web

from colift.record.recording import Recording
from colift.show.viewer.page import ASSETS, live_page

TOKEN = "right"

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


def plain(value: Any) -> Any:
    if isinstance(value, list):
        listed = [plain(item) for item in value]
        return None if listed and all(item is None for item in listed) else listed
    return value if math.isfinite(value) else None


class FakeServer:
    """In a thread of its own; methods may be called from the test's thread."""

    def __init__(self, recording: Recording, **hello: Any) -> None:
        self.recording = recording
        self.hello = {
            "type": "hello", "protocol": 1, "name": "fake", "n": recording.n,
            "cable_lengths": [1.0] * recording.n, "radii": [None] * recording.n, "body": None, "safe_angle_deg": 30.0, "safe_distance": None, "ground": 0.0, "obstacles": [], "legend": {},
            "knobs": [
                {"name": "allocation.mu", "label": "mu", "unit": "N^2", "min": 0.001, "max": 10.0, "value": 0.15, "log": True},
                {"name": "load.mass", "label": "Load", "unit": "kg", "min": 0.1, "max": 0.6, "value": 0.225, "log": False},
            ],
            "choices": [
                {"name": "allocation.kind", "label": "Allocator", "options": ["safe", "sqp"], "value": "sqp"}
            ],
            **hello,
        }  # fmt: skip
        self.told: list[dict[str, Any]] = []
        self.greeted = 0
        self.port = 0
        self._seq = 0
        self._past: dict[str, Any] | None = None
        self._sockets: list[web.WebSocketResponse] = []
        self._loop = asyncio.new_event_loop()

    @contextmanager
    def running(self) -> Iterator[FakeServer]:
        thread = threading.Thread(target=self._loop.run_forever)
        thread.start()
        try:
            self._call(self._start())
            yield self
        finally:
            self._call(self._runner.cleanup())
            self._loop.call_soon_threadsafe(self._loop.stop)
            thread.join()
            self._loop.close()

    def url(self, token: str = "") -> str:
        return f"http://127.0.0.1:{self.port}/#{token}"

    def send(self, **message: Any) -> None:
        """To every page."""
        self._call(self._broadcast(message))

    def rows(self, begin: int, end: int) -> None:
        """Send these rows of the recording; who comes later gets them as the past."""
        r, s = self.recording, slice(begin, end)
        cycles = np.searchsorted(r.cycle_time, r.time[s])
        signals = {
            "load": r["load"][s, 0], "reference": r["reference"][s, 0], "force": r["force"][s],
            "external": r["external_forces"][s, -1], "solve_time": r["allocator_time"][cycles],
            "status": r["allocator_status"][cycles],
            **{name: r[name][s] for name in ("positions", "attitudes", "tensions", "desired_tensions", "directions", "desired_directions", "thrusts")},
        }  # fmt: skip
        self._seq += 1
        listed = {name: [plain(row) for row in value.tolist()] for name, value in signals.items()}
        self._past = {
            "type": "rows", "seq": self._seq, "time": r.time[s].tolist(), "signals": listed,
        }  # fmt: skip
        self.send(**self._past)

    def drop(self) -> None:
        """Close every connection."""
        self._call(self._drop())

    def wait_told(self, **wanted: Any) -> dict[str, Any]:
        """The first message that carries these entries."""
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            for message in list(self.told):
                if wanted.items() <= message.items():
                    return message
            time.sleep(0.02)
        raise AssertionError(f"never told {wanted}, only {self.told}")

    def wait_greeted(self, times: int) -> None:
        """Until so many pages have said hello and are sent what comes."""
        end = time.monotonic() + 20.0
        while self.greeted < times:
            assert time.monotonic() < end, f"greeted {self.greeted} times"
            time.sleep(0.02)

    def _call(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(20.0)

    async def _start(self) -> None:
        app = web.Application()
        app.router.add_get("/", self._page)
        app.router.add_get("/assets/{name}", self._asset)
        app.router.add_get("/live", self._live)
        self._runner = web.AppRunner(app, shutdown_timeout=1.0)
        await self._runner.setup()
        site = web.TCPSite(self._runner, "127.0.0.1", 0)
        await site.start()
        self.port = self._runner.addresses[0][1]

    async def _page(self, request: web.Request) -> web.Response:
        return web.Response(
            text=live_page(), content_type="text/html", headers={"Content-Security-Policy": POLICY}
        )

    async def _asset(self, request: web.Request) -> web.Response:
        name = request.match_info["name"]
        kind = "text/javascript" if name.endswith(".js") else "text/css"
        return web.Response(body=(ASSETS / name).read_bytes(), content_type=kind, charset="utf-8")

    async def _live(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse()
        await socket.prepare(request)
        async for message in socket:
            if message.type != WSMsgType.TEXT:
                break
            told = json.loads(message.data)
            self.told.append(told)
            if told["type"] == "hello":
                role = "steer" if told["token"] == TOKEN else "watch"
                await socket.send_json({**self.hello, "role": role})
                if self._past:
                    await socket.send_json(self._past)
                self._sockets.append(socket)
                self.greeted += 1
        if socket in self._sockets:
            self._sockets.remove(socket)
        return socket

    async def _broadcast(self, message: dict[str, Any]) -> None:
        for socket in self._sockets:
            await socket.send_json(message)

    async def _drop(self) -> None:
        for socket in list(self._sockets):
            await socket.close()
