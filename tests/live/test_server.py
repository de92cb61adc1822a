"""The server over real sockets on this machine; the flight is flown by the test, so that nothing depends on time."""

from __future__ import annotations

import asyncio
import json
from contextlib import asynccontextmanager

import pytest

aiohttp = pytest.importorskip("aiohttp", reason="the extra 'live' is not installed")

from colift.errors import ColiftError  # noqa: E402
from colift.record.recording import Recording  # noqa: E402
from colift.show.live import server as module  # noqa: E402
from colift.show.live.server import Server  # noqa: E402
from colift.show.viewer.page import ASSETS  # noqa: E402

PATIENCE = 60.0


class Page:
    """What a page does: says hello, hears, acknowledges."""

    def __init__(self, socket):
        self.socket = socket
        self.heard = []

    async def say(self, **message):
        await self.socket.send_json(message)

    async def next(self, kind, acknowledge=True, where=bool):
        """The next message of a kind; those before it are heard and kept."""
        async with asyncio.timeout(PATIENCE):
            while True:
                received = await self.socket.receive()
                if received.type is not aiohttp.WSMsgType.TEXT:
                    raise ConnectionError(f"closed with {self.socket.close_code}")
                message = json.loads(received.data, parse_constant=pytest.fail)
                self.heard.append(message)
                if message["type"] == "rows" and acknowledge:
                    await self.say(type="ack", seq=message["seq"])
                if message["type"] == kind and where(message):
                    return message

    async def closed(self):
        with pytest.raises(ConnectionError):
            await self.next("nothing")
        return self.socket.close_code


class Web:
    """A server and whoever visits it."""

    def __init__(self, hand, server, client):
        self.hand, self.server, self.client = hand, server, client
        self.base, self.token = server.url.split("#")
        self.origin = self.base.rstrip("/")

    async def get(self, path, **headers):
        async with self.client.get(self.base + path, headers=headers) as answer:
            return answer, await answer.text()

    async def connect(self, origin=None, host=None):
        headers = {"Origin": self.origin if origin is None else origin}
        if host:
            headers["Host"] = host
        return Page(
            await self.client.ws_connect(self.base + "live", headers=headers, max_msg_size=0)
        )

    async def open(self, token=None):
        page = await self.connect()
        await page.say(type="hello", token=token)
        return page


def on_a_server(test):
    """Run a test with ``hand`` and a server on a free port of this machine."""

    @asynccontextmanager
    async def served(hand):
        server = Server(hand.session)
        await server.start()
        try:
            async with aiohttp.ClientSession() as client:
                yield Web(hand, server, client)
        finally:
            await server.stop()

    async def run(hand):
        async with served(hand) as web:
            await test(web)

    def decorated(start):
        hand = start()
        hand.fly(1.0)
        asyncio.run(run(hand))

    decorated.__name__, decorated.__doc__ = test.__name__, test.__doc__
    return decorated


# ---------------------------------------------------------------- who may come in


@on_a_server
async def test_the_page_may_load_nothing_from_elsewhere_and_run_nothing_inline(web):
    answer, text = await web.get("")
    policy = answer.headers["Content-Security-Policy"]
    assert answer.status == 200
    assert "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert answer.headers["Cache-Control"] == "no-store"
    assert "<script>" not in text
    assert web.token not in text


@on_a_server
async def test_only_this_host_by_its_own_name(web):
    port = web.origin.rpartition(":")[2]
    for host in (
        "evil.example",
        f"evil.example:{port}",
        "127.0.0.1",
        "127.0.0.1:1",
        f"127.0.0.1:{port}.evil",
        "",
    ):
        answer, text = await web.get("", Host=host)
        assert answer.status == 403, host
        assert host not in text or not host
    assert web.server.refused["host"] == 6
    answer, _ = await web.get("", Host=f"localhost:{port}")
    assert answer.status == 200


@on_a_server
async def test_only_pages_of_this_server_may_connect(web):
    port = web.origin.rpartition(":")[2]
    wrong = [
        "http://evil.example",
        "null",
        "",
        f"https://127.0.0.1:{port}",
        "http://127.0.0.1:1",
        f"http://localhost:{port}",
    ]
    for origin in wrong:
        with pytest.raises(aiohttp.WSServerHandshakeError) as caught:
            await web.connect(origin=origin)
        assert caught.value.status == 403
    with pytest.raises(aiohttp.WSServerHandshakeError):
        await web.connect(host="evil.example")
    assert web.server.refused == {"origin": len(wrong), "host": 1}


@on_a_server
async def test_assets_are_those_of_the_list(web):
    answer, text = await web.get("assets/viewer.js")
    assert (answer.status, answer.content_type) == (200, "text/javascript")
    assert text == (ASSETS / "viewer.js").read_text()
    for path in (
        "assets/..%2fserver.py",
        "assets/../server.py",
        "assets/%2fetc%2fpasswd",
        "assets/",
        "runs",
        ".%00",
    ):
        answer, _ = await web.get(path)
        assert answer.status in {400, 404}, path
        assert answer.headers.get("X-Content-Type-Options") == "nosniff"


def test_all_addresses_at_once_are_refused(start):
    for host in ("0.0.0.0", "::"):
        with pytest.raises(ColiftError, match="one address"):
            Server(start().session, host)


# ---------------------------------------------------------------- who steers


@on_a_server
async def test_the_token_steers_and_everybody_sees(web):
    pilot, guest = await web.open(web.token), await web.open()
    hello = await pilot.next("hello")
    assert (hello["role"], hello["protocol"], hello["n"]) == ("steer", 1, 4)
    assert (await guest.next("hello"))["role"] == "watch"
    for page in (pilot, guest):
        rows = await page.next("rows")
        assert rows["signals"].keys() >= {
            "load",
            "tensions",
            "attitudes",
            "external",
            "status",
            "error",
        }
        assert {len(values) for values in rows["signals"].values()} == {len(rows["time"])}
    state = await guest.next("state")
    assert state["viewers"] == 2


@on_a_server
async def test_a_knob_reaches_the_loop_and_comes_back(web):
    page = await web.open(web.token)
    hello = await page.next("hello")
    knob = next(knob for knob in hello["knobs"] if knob["name"] == "allocation.mu")
    assert (knob["value"], knob["log"]) == (0.15, True)
    await page.say(type="set", name="allocation.mu", value=0.33)
    await page.say(type="set", name="allocation.mu", value=99.0)
    while web.hand.session.flight.parts["allocation"].mu != 0.33:
        await asyncio.sleep(0.01)
        web.hand.fly(0.02)
    web.hand.fly(0.5)
    state = await page.next(
        "state", where=lambda message: message["values"]["allocation.mu"] == 0.33
    )
    assert state["values"]["allocation.kind"] == "safe"
    reason = [m for m in page.heard if m["type"] == "refused"] or [await page.next("refused")]
    assert "between" in reason[0]["reason"]


@on_a_server
async def test_who_watches_cannot_steer(web):
    pilot, guest = await web.open(web.token), await web.open("wrong")
    second = await web.open(web.token)
    assert (await guest.next("hello"))["role"] == (await second.next("hello"))["role"] == "watch"
    for page in (guest, second):
        await page.say(type="do", action="cut", drone=1)
        assert "somebody else steers" in (await page.next("refused"))["reason"]
    web.hand.fly(1.0)
    assert web.hand.session.flight.drones == [0, 1, 2, 3]
    assert web.server.refused == {"token": 1, "role": 2}
    assert (await pilot.next("hello"))["role"] == "steer"


@on_a_server
async def test_when_the_pilot_leaves_the_next_with_the_token_steers(web):
    pilot, guest, second = await web.open(web.token), await web.open(), await web.open(web.token)
    for page in (pilot, guest, second):
        await page.next("hello")
    await pilot.socket.close()
    assert (await second.next("role"))["role"] == "steer"
    await second.say(type="do", action="pause")
    while not web.hand.session.state["paused"]:
        await asyncio.sleep(0.01)
        web.hand.fly(0.2)
    await guest.next("state", where=lambda message: message["paused"])
    assert not [message for message in guest.heard if message["type"] == "role"]


# ---------------------------------------------------------------- what is told


@on_a_server
async def test_who_comes_back_gets_the_past(web):
    web.hand.fly(29.0)
    for _ in range(2):
        page = await web.open()
        await page.next("hello")
        past = await page.next("rows")
        assert past["time"][0] < 0.1
        assert past["time"][-1] > 29.9
        assert len(past["time"]) == module.PAST_ROWS
        assert past["time"] == sorted(past["time"])
        await page.socket.close()


@on_a_server
async def test_a_silent_page_gets_no_more_and_the_flight_goes_on(web):
    page = await web.open()
    for _ in range(module.UNACKNOWLEDGED):
        web.hand.fly(0.2)
        seq = (await page.next("rows", acknowledge=False))["seq"]
    before = web.hand.session.flight.time
    for _ in range(20):
        web.hand.fly(1.0)
        await asyncio.sleep(module.FRAME)
    assert web.hand.session.flight.time - before == pytest.approx(20.0, abs=0.05)
    await page.next("state")
    await page.next("state")
    assert len([m for m in page.heard if m["type"] == "rows"]) == module.UNACKNOWLEDGED
    await page.say(type="ack", seq=seq)
    late = await page.next("rows")
    assert len(late["time"]) <= module.FRAME_ROWS  # the rows between are dropped
    assert late["time"][-1] > 20.0


@on_a_server
async def test_a_drone_that_has_left_is_null(web):
    page = await web.open(web.token)
    await page.next("hello")
    await page.say(type="do", action="cut", drone=2)
    while len(web.hand.session.flight.drones) == 4:
        await asyncio.sleep(0.01)
        web.hand.fly(0.02)
    web.hand.fly(0.6)
    rows = await page.next("rows", where=lambda m: m["signals"]["tensions"][-1][2] is None)
    assert rows["signals"]["positions"][-1][2] is None
    assert len(rows["signals"]["positions"][-1][3]) == 3
    events = [event for m in page.heard if m["type"] == "events" for event in m["events"]]
    events += (await page.next("events"))["events"] if not events else []
    assert "Cable of drone 2 cut" in {event["text"] for event in events}


@on_a_server
async def test_reset_and_new_knobs_are_told(web):
    page = await web.open(web.token)
    await page.next("hello")
    await page.next("rows")
    await page.say(type="do", action="reset")
    while web.hand.session.epoch == 1:
        await asyncio.sleep(0.01)
        web.hand.fly(0.1)
    await page.next("reset" if web.hand.session.generation == 1 else "hello")
    assert (await page.next("rows"))["time"][0] < 0.1
    await page.say(type="choose", name="allocation.kind", value="ring")
    while "allocation.mu" in web.hand.session.knobs:
        await asyncio.sleep(0.01)
        web.hand.fly(0.1)
    hello = await page.next("hello")
    assert hello["choices"][0]["value"] == "ring"
    assert "allocation.mu" not in {knob["name"] for knob in hello["knobs"]}


@on_a_server
async def test_a_flight_can_be_saved_from_the_page(web):
    page = await web.open(web.token)
    await page.next("hello")
    await page.say(type="do", action="save")
    while web.hand.session.state["saved"] is None:
        await asyncio.sleep(0.01)
        web.hand.fly(0.2)
    path = (await page.next("state", where=lambda message: message["saved"]))["saved"]
    assert Recording.load(path).mission.name == "hover"


# ---------------------------------------------------------------- what is refused

HOSTILE = [
    "",
    "null",
    "[]",
    "{}",
    "<script>alert(1)</script>",
    '{"type":"do"}',
    '{"type":"do","action":"shell","command":"id"}',
    '{"type":"hello","token":null}',
    '{"type":"set","name":"allocation.mu","value":"0.3"}',
    '{"type":"set","name":"allocation.mu","value":NaN}',
    '{"type":"set","name":"allocation.mu","value":1e999}',
    '{"type":"set","name":"allocation.mu","value":0.3,"__proto__":{}}',
    '{"type":"set","name":"__class__.__init__","value":0}',
    '{"type":"set","name":"../../etc/passwd","value":0}',
    '{"type":"do","action":"push","force":[1,0],"seconds":1}',
    '{"type":"do","action":"push","force":[1e9,0,0],"seconds":1}',
    '{"type":"do","action":"cut","drone":-1}',
    '{"type":"do","action":"cut","drone":true}',
]


@on_a_server
async def test_hostile_messages_are_refused_and_counted_without_harm(web):
    page = await web.open(web.token)
    await page.next("hello")
    before = dict(web.hand.session.flight.parts)
    for count, text in enumerate(HOSTILE, start=1):
        await page.socket.send_str(text)
        reason = (await page.next("refused"))["reason"]
        assert len(reason) <= 300
        assert web.server.refused["malformed"] == count, text
    web.hand.fly(0.5)
    assert web.hand.session.flight.parts == before
    assert web.hand.session.flight.drones == [0, 1, 2, 3]
    await page.say(type="do", action="pause")
    await page.next("state")


@on_a_server
async def test_who_is_refused_too_often_is_closed(web):
    page = await web.open(web.token)
    for _ in range(module.PATIENCE):
        await page.socket.send_str("x")
    assert await page.closed() == aiohttp.WSCloseCode.POLICY_VIOLATION
    other = await web.open(web.token)
    assert (await other.next("hello"))["role"] == "steer"


@on_a_server
async def test_messages_that_are_too_large_or_too_many_end_the_connection(web):
    page = await web.open(web.token)
    await page.next("hello")
    await page.socket.send_str("x" * 20_000)
    assert await page.closed() == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
    flood = await web.open(web.token)
    await flood.next("hello")
    for _ in range(2000):
        try:
            await flood.say(type="ack", seq=0)
        except ConnectionError:
            break
    assert await flood.closed() == aiohttp.WSCloseCode.POLICY_VIOLATION
    assert web.server.refused["size"] == 1
    assert web.server.refused["rate"] == module.PATIENCE


@on_a_server
async def test_the_first_message_must_be_a_greeting(web):
    for text in ("{", '{"type":"ack","seq":1}', '{"type":"do","action":"pause"}'):
        page = await web.connect()
        await page.socket.send_str(text)
        assert await page.closed() == aiohttp.WSCloseCode.POLICY_VIOLATION
    page = await web.connect()
    await page.socket.send_bytes(b"\x00")
    assert await page.closed() == aiohttp.WSCloseCode.POLICY_VIOLATION
    assert web.server.refused["greeting"] == 4
    page = await web.open()
    assert (await page.next("state"))["viewers"] == 1  # none of those


@on_a_server
async def test_there_is_a_limit_of_watchers(web):
    pages = [await web.open() for _ in range(module.MOST_CLIENTS)]
    for page in pages:
        await page.next("hello")
    with pytest.raises(aiohttp.WSServerHandshakeError) as caught:
        await web.connect()
    assert caught.value.status == 503


def test_names_of_a_mission_are_data(start):
    name = "</script><img src=x onerror=alert(1)>"

    async def look(hand):
        server = Server(hand.session)
        await server.start()
        async with aiohttp.ClientSession() as client:
            web = Web(hand, server, client)
            _, text = await web.get("")
            page = await web.open()
            hello = await page.next("hello")
        await server.stop()
        return text, hello

    hand = start(name=name)
    text, hello = asyncio.run(look(hand))
    assert "onerror" not in text
    assert hello["name"] == name


@on_a_server
async def test_good_bye_is_said_when_the_flight_ends(web):
    page = await web.open()
    await page.next("hello")
    _, code = await asyncio.gather(web.server.stop(), page.closed())
    assert code == aiohttp.WSCloseCode.GOING_AWAY
