"""Serves the page of a diagram to browsers of this machine."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

from ..language.stages import CheckedGraph
from .page import page, policy
from .values import Values

ADDRESS = "127.0.0.1"


def page_server(
    graph: CheckedGraph, port: int = 0, values: Values | None = None
) -> ThreadingHTTPServer:
    """The server, which listens on the loopback address but does not serve yet.

    With ``values`` the page shows them, and asks for those of a tick by ``/at?tick=``.

    Raises:
        OSError: the port is taken.
    """

    one_at_a_time = threading.Lock()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            host = (self.headers.get("Host") or "").rpartition(":")[0]
            if host not in (ADDRESS, "localhost"):
                self.send_error(403, "this page is for this machine only")
                return
            address = urlsplit(self.path)
            asked = parse_qs(address.query)
            tick = asked.get("tick", [""])[0]
            if address.path == "/at" and values is not None and tick.isdecimal():
                with one_at_a_time:
                    found = values.at(int(tick))
                self.answer(json.dumps(found), "application/json")
            elif address.path == "/":
                self.answer(page(graph, asked.get("closed", []), values), "text/html")
            else:
                self.send_error(404)

        def answer(self, text: str, kind: str) -> None:
            body = text.encode()
            self.send_response(200)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Content-Security-Policy", policy())
            self.send_header("Referrer-Policy", "no-referrer")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing about requests."""

    return ThreadingHTTPServer((ADDRESS, port), Handler)
