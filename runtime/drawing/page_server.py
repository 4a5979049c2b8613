"""Serves the page of a diagram to browsers of this machine."""

from __future__ import annotations

from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

from ..language.stages import CheckedGraph
from .page import page, policy

ADDRESS = "127.0.0.1"


def page_server(graph: CheckedGraph, port: int = 0) -> ThreadingHTTPServer:
    """The server, which listens on the loopback address but does not serve yet.

    Raises:
        OSError: the port is taken.
    """

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            host = (self.headers.get("Host") or "").rpartition(":")[0]
            if host not in (ADDRESS, "localhost"):
                self.send_error(403, "this page is for this machine only")
                return
            address = urlsplit(self.path)
            if address.path != "/":
                self.send_error(404)
                return
            body = page(graph, parse_qs(address.query).get("closed", [])).encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Content-Security-Policy", policy())
            self.send_header("Referrer-Policy", "no-referrer")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing about requests."""

    return ThreadingHTTPServer((ADDRESS, port), Handler)
