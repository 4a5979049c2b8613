"""Serves the page of a diagram to browsers of this machine."""

from __future__ import annotations

import json
import threading
from http.server import ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

from ..language.stages import CheckedGraph
from .loopback import ADDRESS, LoopbackHandler
from .page import page, policy
from .values import Values


def page_server(
    graph: CheckedGraph, port: int = 0, values: Values | None = None
) -> ThreadingHTTPServer:
    """The server, which listens on the loopback address but does not serve yet.

    With ``values`` the page shows them, and asks for those of a tick by ``/at?tick=``.

    Raises:
        OSError: the port is taken.
    """

    one_at_a_time = threading.Lock()

    class Handler(LoopbackHandler):
        content_policy = policy()

        def do_GET(self) -> None:
            if not self.is_ours():
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

    return ThreadingHTTPServer((ADDRESS, port), Handler)
