"""What every page has in common that is served to browsers of this machine only."""

from __future__ import annotations

from http.server import BaseHTTPRequestHandler

ADDRESS = "127.0.0.1"


class LoopbackHandler(BaseHTTPRequestHandler):
    """Answers requests that were made to the loopback address by its name."""

    content_policy = "default-src 'none'"

    def is_ours(self) -> bool:
        """Whether the request was made to this machine; if not, it is refused.

        A page of another site whose name was made to point here (DNS rebinding) still says its name
        in ``Host``.
        """
        host, _, port = (self.headers.get("Host") or "").rpartition(":")
        server_port = str(self.connection.getsockname()[1])
        if host in (ADDRESS, "localhost") and port == server_port:
            return True
        self.send_error(403, "this page is for this machine only")
        return False

    def answer(self, text: str, kind: str, status: int = 200) -> None:
        """Send a text; no other page may read or embed it."""
        body = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", self.content_policy)
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing about requests."""
