"""Server of the page of Rerun's web viewer, which makes no browser call another machine.

Rerun's page asks for fonts from Google, and the viewer in it for usage statistics and the newest
version. This server hands the page on without those links, and with a Content-Security-Policy that
makes the browser refuse every address but those of the viewer on this machine. It is a process of
its own, so that a run in real time has no part in it::

    python page_server.py PORT PORT_OF_RERUNS_PAGE PORT_OF_THE_DATA

It ends when Rerun's own server is gone.
"""

from __future__ import annotations

import re
import sys
import threading
import time
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

ADDRESS = "127.0.0.1"
OUTSIDE = re.compile(rb"<link\b[^>]*https?://[^>]*>")
"""A link of the page to another machine."""
LOOK_EVERY = 2.0
"""Period of the server's checks that Rerun's is still there [s]."""


def policy(data_port: int) -> str:
    """Return the policy: everything from this server, data from the viewer's port, nothing else."""
    own = f"'self' data: blob: http://{ADDRESS}:{data_port}"
    code = "'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob:"
    return (
        f"default-src 'none'; script-src {code}; worker-src 'self' blob:; connect-src {own}; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:"
    )


def without_links_outside(page: bytes) -> bytes:
    """Return the page without its links to other machines."""
    return OUTSIDE.sub(b"", page)


def page_server(port: int, page_port: int, data_port: int) -> ThreadingHTTPServer:
    """Make the server, which listens but does not serve yet."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            connection = HTTPConnection(ADDRESS, page_port, timeout=30)
            try:
                connection.request("GET", self.path)
                answer = connection.getresponse()
                body = answer.read()
            except OSError:
                self.send_error(502, "the viewer has ended")
                return
            finally:
                connection.close()
            if "html" in (answer.getheader("Content-Type") or ""):
                body = without_links_outside(body)
            self.send_response(answer.status)
            for name, value in answer.getheaders():
                if name.lower() in ("content-type", "content-encoding", "cache-control"):
                    self.send_header(name, value)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("rerun-final-length", str(len(body)))  # for its bar while loading
            self.send_header("Content-Security-Policy", policy(data_port))
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing about requests."""

    return ThreadingHTTPServer((ADDRESS, port), Handler)


def end_with_the_viewer(page_port: int) -> None:
    """Return when nothing listens on the port any more."""
    while True:
        time.sleep(LOOK_EVERY)
        connection = HTTPConnection(ADDRESS, page_port, timeout=30)
        try:
            connection.connect()
        except ConnectionRefusedError:
            return
        except OSError:
            continue
        finally:
            connection.close()


def main() -> None:
    """Serve until Rerun's own server has ended."""
    ports = [int(text) for text in sys.argv[1:4]]
    server = page_server(*ports)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    end_with_the_viewer(ports[1])


if __name__ == "__main__":
    main()
