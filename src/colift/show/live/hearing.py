"""A page that shows who hears whom in a swarm, while it flies; it only reads."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

HOST = "127.0.0.1"
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>colift swarm</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
:root { color-scheme: light dark; font: 16px system-ui, sans-serif }
body { max-width: 50rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse } th, td { padding: .4rem .5rem; text-align: right } div { overflow-x: auto }
td { border: 1px solid #8886; min-width: 2.2rem; background: color-mix(in srgb, #2a8 calc(var(--share, 0) * 60%), transparent) }
.dead { opacity: .35 }
</style>
<h1>Who hears whom</h1><p id="now" role="status">waiting</p>
<p>Share of the messages of the last 0.2 s that each drone (row) hears of each other (column), and its pull on the load.</p>
<div><table><tbody id="table"></tbody></table></div>
<script>
const cell = (row, kind, text) => { const made = document.createElement(kind); made.textContent = text; row.append(made); return made };
async function show() {
  try {
    const state = await (await fetch("state")).json();
    document.getElementById("now").textContent =
      `${state.time.toFixed(1)} s: ${Math.round(state.missing * 1e3)} mN of ${state.weight.toFixed(1)} N missing`;
    const body = document.getElementById("table"); body.replaceChildren();
    const head = document.createElement("tr"); cell(head, "th", "");
    state.hears.forEach((_, j) => cell(head, "th", j)); cell(head, "th", "N"); body.append(head);
    state.hears.forEach((shares, i) => {
      const row = document.createElement("tr"); cell(row, "th", i);
      if (!state.alive[i]) row.className = "dead";
      shares.forEach((share, j) => {
        const made = cell(row, "td", i === j ? "" : state.alive[i] ? `${Math.round(100 * share)} %` : "dead");
        made.style.setProperty("--share", i === j || !state.alive[i] ? 0 : share);
      });
      cell(row, "td", state.pulls[i].toFixed(2)); body.append(row);
    });
  } catch { document.getElementById("now").textContent = "the swarm has ended" }
}
show(); setInterval(show, 200);
</script></html>
"""


class HearingPage:
    """Serves :data:`PAGE` on the loopback address, and beside it what was said to it last.

    Attributes
    ----------
    address : str
        Of the page.

    """

    def __init__(self, port: int = 0) -> None:
        self._state = (
            b'{"time": 0, "missing": 0, "weight": 0, "hears": [], "alive": [], "pulls": []}'
        )
        page = self

        class Answers(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                known = {
                    "/": ("text/html", PAGE.encode()),
                    "/state": ("application/json", page._state),
                }
                kind, body = known.get(self.path, ("", b""))
                self.send_response(200 if kind else 404)
                self.send_header("Content-Type", f"{kind or 'text/plain'}; charset=utf-8")
                self.send_header("Content-Length", str(len(body)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *args: Any) -> None:
                """Nobody reads it."""

        self._server = ThreadingHTTPServer((HOST, port), Answers)
        self._server.daemon_threads = True
        self.address = f"http://{HOST}:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def say(self, **state: Any) -> None:
        """What is shown from now on: time, s; missing and weight, N; hears (n, n) shares; alive (n,); pulls (n,), N."""
        self._state = json.dumps(state).encode()

    def close(self) -> None:
        """End."""
        self._server.shutdown()
        self._server.server_close()
