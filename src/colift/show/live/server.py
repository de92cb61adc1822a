"""The web server of a live flight: one page, its files, and a WebSocket that tells and takes commands.

Nothing here can hold the flight up: it reads what the session has made and puts commands into its queue. A
client that is slow misses rows; one that is silent costs nothing. ``docs/live.md`` has the protocol and what
the server refuses.
"""

from __future__ import annotations

import asyncio
import hmac
import secrets
from collections import Counter, deque
from collections.abc import Awaitable, Callable
from typing import Any

from colift.errors import ColiftError, MissingExtraError
from colift.extras import install
from colift.show.live import encode, protocol
from colift.show.live.page import live_page
from colift.show.live.session import Row, Session

try:
    from aiohttp import WebSocketError, WSCloseCode, WSMessage, WSMsgType, web
except ModuleNotFoundError as error:
    raise MissingExtraError(f"flying live needs the package aiohttp: {install('live')}") from error

FRAME = 1.0 / 30.0
"""Time between two messages with rows, s."""
FRAME_ROWS = 6
"""Most rows in one of them; what is more is thinned."""
PAST_ROWS = 600
"""Most rows in the first one, which brings the past."""
UNACKNOWLEDGED = 4
"""Messages with rows that may be under way to a client; it gets no more until it has shown some."""
STATE_FRAMES = 15
"""Frames between two messages about the state."""
RATE, BURST = 150.0, 300.0
"""Messages a second that a client may send for long, and at once."""
PATIENCE = 20
"""Refused messages after which a client is closed."""
MOST_CLIENTS = 32
GREETING = 5.0
"""Time that a client has for its first message, s."""
STUCK = 5.0
"""Time after which a message that a client does not take ends it, s."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Client:
    """One page that looks on, and maybe steers."""

    def __init__(self, socket: web.WebSocketResponse, trusted: bool, time: float) -> None:
        self.socket = socket
        self.trusted = trusted
        self.role = self.told = "watch"
        self.notes: deque[str] = deque(maxlen=8)
        self.refused = 0
        self.sending: asyncio.Task[None] | None = None
        self.greet()
        self._allowance, self._counted = BURST, time

    def greet(self) -> None:
        """Tell it everything (again): nothing that it has shown counts."""
        self.generation = self.epoch = -1
        self.row = self.event = 0
        self.frame = 0
        self.under_way: deque[int] = deque()

    def within_rate(self, time: float) -> bool:
        """Whether it may say something more at a time (s)."""
        passed = time - self._counted
        self._allowance = min(BURST, self._allowance + RATE * passed)
        self._counted = time
        self._allowance -= 1.0
        if self._allowance < 0.0:
            self._allowance = 0.0
            return False
        return True


class Server:
    """Serves a session on one address.

    Attributes
    ----------
    token : str
        Who has it may steer.
    refused : Counter
        Requests and messages that were refused, by reason.
    url : str
        Where the page is, with the token; known once :meth:`start` has run.

    """

    def __init__(self, session: Session, host: str = "127.0.0.1", port: int = 0) -> None:
        if host in {"0.0.0.0", "::", ""}:
            raise ColiftError(
                "give one address to serve on, not all of them: pages are told apart by it"
            )
        self.session = session
        self.token = secrets.token_urlsafe(24)
        self.refused: Counter[str] = Counter()
        self._host, self._port = host, port
        self._origins: dict[str, str] = {}
        self._clients: list[Client] = []
        self._page, self._assets = live_page()
        self._encoded: dict[tuple[int, ...], str] = {}
        self._broadcast: asyncio.Task[None] | None = None

        @web.middleware
        async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._guarded(request, handler)

        app = web.Application(middlewares=[guard])
        app.router.add_get("/", self._index)
        app.router.add_get("/assets/{name}", self._asset)
        app.router.add_get("/live", self._live)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=2.0)

    # ---------------------------------------------------------------- life

    async def start(self) -> None:
        """Listen."""
        await self._runner.setup()
        await web.TCPSite(self._runner, self._host, self._port).start()
        port = self._runner.addresses[0][1]
        names = {self._host} | ({"localhost"} if self._host == "127.0.0.1" else set())
        names = {f"[{name}]" if ":" in name else name for name in names}
        for name in names:
            self._origins[f"{name}:{port}"] = f"http://{name}:{port}"
        shown = f"[{self._host}]" if ":" in self._host else self._host
        self.url = f"http://{shown}:{port}/#{self.token}"
        self._broadcast = asyncio.create_task(self._tell_all())

    async def stop(self) -> None:
        """Say good-bye and stop listening."""
        if self._broadcast is not None:
            self._broadcast.cancel()
        closing = [
            client.socket.close(code=WSCloseCode.GOING_AWAY, message=b"the flight has ended")
            for client in self._clients
        ]
        await asyncio.gather(*closing, return_exceptions=True)
        await self._runner.cleanup()

    # ---------------------------------------------------------------- pages

    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answer only those who asked for this address by its name; forbid the page whatever it does not need."""
        host = request.headers.get("Host", "")
        try:
            if host not in self._origins:
                self.refused["host"] += 1
                raise web.HTTPForbidden(text="this is not the host that you asked for\n")
            response = await handler(request)
        except web.HTTPException as answer:
            response = web.Response(status=answer.status, text=answer.text)
        if not response.prepared:
            response.headers.update(
                {
                    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
                    f"connect-src 'self' ws://{host if host in self._origins else ''}; "
                    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
                    "X-Content-Type-Options": "nosniff",
                    "Cache-Control": "no-store",
                    "Referrer-Policy": "no-referrer",
                    "Cross-Origin-Opener-Policy": "same-origin",
                    "Cross-Origin-Resource-Policy": "same-origin",
                }
            )
        return response

    async def _index(self, request: web.Request) -> web.StreamResponse:
        return web.Response(text=self._page, content_type="text/html")

    async def _asset(self, request: web.Request) -> web.StreamResponse:
        name = request.match_info["name"]
        if name not in self._assets:
            raise web.HTTPNotFound
        kinds = {"js": "text/javascript", "css": "text/css"}
        kind = kinds.get(name.rpartition(".")[2], "text/plain")
        return web.Response(body=self._assets[name], content_type=kind, charset="utf-8")

    # ---------------------------------------------------------------- one client

    async def _live(self, request: web.Request) -> web.StreamResponse:
        # A browser always says where a page comes from that opens a WebSocket.
        if request.headers.get("Origin") != self._origins[request.headers["Host"]]:
            self.refused["origin"] += 1
            raise web.HTTPForbidden(text="pages from elsewhere may not connect\n")
        if len(self._clients) >= MOST_CLIENTS:
            self.refused["clients"] += 1
            raise web.HTTPServiceUnavailable(text="too many are watching\n")
        socket = web.WebSocketResponse(
            max_msg_size=protocol.MAX_BYTES, heartbeat=20.0, compress=False
        )
        await socket.prepare(request)
        client = await self._greeted(socket)
        if client is None:
            return socket
        try:
            async for message in socket:
                if _too_big(message):
                    self._refuse(client, "size", "too large")
                elif message.type is not WSMsgType.TEXT:
                    self._refuse(client, "malformed", "text only")
                elif not client.within_rate(asyncio.get_running_loop().time()):
                    self._refuse(client, "rate", "too many messages")
                else:
                    self._hear(client, message.data)
                if client.refused >= PATIENCE:
                    await socket.close(
                        code=WSCloseCode.POLICY_VIOLATION, message=b"refused too often"
                    )
        finally:
            self._leave(client)
        return socket

    async def _greeted(self, socket: web.WebSocketResponse) -> Client | None:
        """The client, if its first message is the greeting."""
        try:
            async with asyncio.timeout(GREETING):
                message = await socket.receive()
            greeting = protocol.parse(message.data) if message.type is WSMsgType.TEXT else None
        except (TimeoutError, ValueError):
            greeting = None
        if not isinstance(greeting, protocol.Hello):
            self.refused["greeting"] += 1
            await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"no greeting")
            return None
        given = (greeting.token or "").encode()
        trusted = hmac.compare_digest(given, self.token.encode())
        if greeting.token is not None and not trusted:
            self.refused["token"] += 1
        client = Client(socket, trusted, asyncio.get_running_loop().time())
        self._clients.append(client)
        self._pass_on()
        return client

    def _leave(self, client: Client) -> None:
        self._clients.remove(client)
        self._pass_on()

    def _pass_on(self) -> None:
        """Let the first of those who may steer do so, when nobody does."""
        if any(client.role == "steer" for client in self._clients):
            return
        for client in self._clients:
            if client.trusted:
                client.role = "steer"
                return

    def _hear(self, client: Client, text: str) -> None:
        try:
            message = protocol.parse(text)
        except ValueError as error:
            self._refuse(client, "malformed", f"not understood: {_first(error)}")
            return
        if isinstance(message, protocol.Ack):
            while client.under_way and client.under_way[0] <= message.seq:
                client.under_way.popleft()
        elif isinstance(message, protocol.Command):
            if client.role == "steer":
                loop = asyncio.get_running_loop()
                self.session.submit(
                    message.perform,
                    lambda reason: _call(loop, self._note_refusal, client, reason),
                )
            else:
                self._refuse(client, "role", "you are watching, somebody else steers")
        else:
            self._refuse(client, "malformed", "one greeting is enough")

    def _refuse(self, client: Client, why: str, reason: str) -> None:
        """Count a message against its sender, and say so."""
        self.refused[why] += 1
        client.refused += why != "role"
        self._note_refusal(client, reason)

    def _note_refusal(self, client: Client, reason: str) -> None:
        client.notes.append(encode.text({"type": "refused", "reason": reason[:300]}))

    # ---------------------------------------------------------------- to all clients

    async def _tell_all(self) -> None:
        while True:
            await asyncio.sleep(FRAME)
            self._encoded.clear()
            for client in self._clients:
                if client.sending is None or client.sending.done():
                    news = self._news(client)
                    client.sending = asyncio.create_task(self._send(client, news))

    async def _send(self, client: Client, news: list[str]) -> None:
        try:
            async with asyncio.timeout(STUCK):
                for text in news:
                    await client.socket.send_str(text)
        except ConnectionError:
            pass  # it is leaving; its reader sees that too
        except TimeoutError:
            self.refused["stuck"] += 1
            await client.socket.close(code=WSCloseCode.TRY_AGAIN_LATER, drain=False)

    def _news(self, client: Client) -> list[str]:
        """What a client is told in this frame."""
        session, news = self.session, []
        if client.generation != session.generation:
            client.greet()
            client.generation, client.epoch = session.generation, session.epoch
            client.told = client.role
            news.append(encode.hello(session, client.role))
        elif client.epoch != session.epoch:
            client.epoch = session.epoch
            client.row = client.event = 0
            client.under_way.clear()
            news.append(encode.text({"type": "reset"}))
        if client.told != client.role:
            news.append(encode.text({"type": "role", "role": client.role}))
        client.told = client.role
        while client.notes:
            news.append(client.notes.popleft())
        events, client.event = session.events(client.event)
        if events:
            news.append(encode.text({"type": "events", "events": events}))
        if len(client.under_way) < UNACKNOWLEDGED:
            rows, made = session.rows(client.row)
            if rows:
                news.append(self._rows(rows, PAST_ROWS if client.row == 0 else FRAME_ROWS, made))
                client.row = made
                client.under_way.append(made)
        if client.frame % STATE_FRAMES == 0:
            state = {"type": "state", **session.state, "viewers": len(self._clients)}
            news.append(encode.text(state))
        client.frame += 1
        return news

    def _rows(self, rows: list[Row], most: int, made: int) -> str:
        """Encoded once for all clients that get the same."""
        key = (made, len(rows), most)
        if key not in self._encoded:
            if len(rows) > most:
                rows = [rows[round(k * (len(rows) - 1) / (most - 1))] for k in range(most)]
            self._encoded[key] = encode.rows(rows, made)
        return self._encoded[key]


def _first(error: ValueError) -> str:
    """What is wrong, in a line."""
    errors: Any = getattr(error, "errors", None)
    if errors is None:
        return str(error)
    first = errors(include_url=False, include_input=False)[0]
    place = ".".join(map(str, first["loc"]))
    return f"{place}: {first['msg']}" if place else str(first["msg"])


def _too_big(message: WSMessage) -> bool:
    code = message.data.code if isinstance(message.data, WebSocketError) else None
    return bool(code == WSCloseCode.MESSAGE_TOO_BIG)


def _call(loop: asyncio.AbstractEventLoop, function: Callable[..., None], *arguments: Any) -> None:
    """Call in the server's thread, if it still runs."""
    if not loop.is_closed():
        loop.call_soon_threadsafe(function, *arguments)
