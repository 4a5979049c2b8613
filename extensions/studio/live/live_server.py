"""Serves the page of a running graph to its user's browser only.

Every request must carry the token that only the printed address has, and must be made to the loopback
address. What changes something is taken only as a POST of JSON from the page itself, so no page of
another site can do it.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Collection, Sequence
from http.server import ThreadingHTTPServer
from pathlib import Path
from typing import Any, Literal, Protocol
from urllib.parse import parse_qs, urlsplit

from ....runtime.language.errors import AloftError
from ....runtime.language.stages import CheckedGraph
from ....runtime.live.tunables import Tunables, write_overlay
from ..diagram.page import ADDRESS, LoopbackHandler, PageAddition, page, policy
from .texts import list_names

Opened = Literal["diagram", "parameters"]
"""Panel that the side of the page shows at first."""
_HERE = Path(__file__).parent
_CONTROLS = (
    '<span id="state" role="status">connecting</span>'
    '<label><input type="checkbox" id="numbers" checked>numbers</label>'
)
_PAUSES = (
    '<span id="control"><button id="pause">pause</button><span id="paused" hidden>'
    '<input type="range" id="back" list="kept" aria-label="go back to"><datalist id="kept"></datalist>'
    '<output id="target"></output><label>for <input id="for" placeholder="no end" '
    'aria-label="go on for"></label></span>{rate}<output id="refused"></output></span>'
)
_RATE = (
    '<select id="rate" aria-label="playback rate">'
    '<option value="100">real time</option><option value="50">half speed</option>'
    '<option value="20">a fifth</option><option value="5">a twentieth</option></select>'
)
"""Playback rates [% of real time] of a run in paced time."""


def live_page(
    graph: CheckedGraph,
    closed: Collection[str],
    token: str,
    *,
    tuning: bool = True,
    pauses: bool = False,
    paced: bool = False,
    save: str = "",
    opened: Opened = "diagram",
) -> str:
    """Return the page's text.

    Args:
        graph: what runs.
        closed: the sub-graphs that are closed.
        token: without which the server answers nothing.
        tuning: whether parameters can be changed.
        pauses: whether the run can be paused and go back.
        paced: whether it runs in paced time, at a playback rate that can be chosen.
        save: the name of the file for changed values, as it is shown.
        opened: what its side shows at first.
    """
    button = '<button id="tune">parameters</button>' if tuning else ""
    data = {
        "token": token, "tuning": tuning, "pauses": pauses, "period": graph.base_period, "save": save,
        "opened": opened,
    }  # fmt: skip
    addition = PageAddition(
        "live",
        data,
        f'{_CONTROLS}{button}{_PAUSES.format(rate=_RATE if paced else "") if pauses else ""}<output id="parts"></output><output id="line"></output>',
        (_HERE / "live.css").read_text(encoding="utf-8"),
        _script(),
    )
    return page(graph, closed, addition=addition)


def live_policy() -> str:
    """Return the Content-Security-Policy of the page."""
    return policy(_script())


def _script() -> str:
    return "".join((_HERE / name).read_text(encoding="utf-8") for name in ("charts.js", "live.js"))


MOST_CHARTS = 8
"""Strip charts on a page."""
LONGEST_BODY = 1 << 16
"""Bytes of one request."""
REQUEST_TIMEOUT = 10.0
"""Seconds that a browser may take to send what it has announced."""


class WatchedRun(Protocol):
    """A running graph that the page shows; see ``LiveRun`` and ``SpreadRun``."""

    graph: CheckedGraph

    @property
    def has_parameters(self) -> bool:
        """True if parameters can be changed."""

    def now(self, charted: Sequence[str] = ()) -> dict[str, Any]:
        """Return the present state, and the numbers of the fields that are ``charted``."""

    def lines(self, name: str) -> dict[str, Any]:
        """Describe the lines of a field in a strip chart."""

    def refresh(self) -> None:
        """Look at the graph that runs now."""

    def close(self) -> None:
        """Look no more."""

    def parameters(self) -> list[dict[str, Any]]:
        """Return the live parameters as they are now."""

    def set(self, settings: list[str]) -> list[dict[str, Any]]:
        """Change parameters."""

    @property
    def can_be_paused(self) -> bool:
        """True if the run can be paused and go back."""

    @property
    def is_paced(self) -> bool:
        """True if ticks begin by wall time, at a playback rate that can be chosen."""

    def control(self, do: str, number: int | None = None) -> dict[str, Any]:
        """Pause it, go back in it, or let it go on."""


class LiveServer(ThreadingHTTPServer):
    """Listens on the loopback address, and serves once ``serve_forever`` is called.

    Args:
        run: what is shown.
        save: the file for changed values.
        opened: what the side of the page shows at first.

    Attributes:
        token: the secret in the address.
    """

    daemon_threads = True

    def __init__(self, run: WatchedRun, save: Path, opened: Opened = "diagram") -> None:
        super().__init__((ADDRESS, 0), _RequestHandler)  # any port that is free
        self.run, self.save, self.opened = run, save, opened
        self.token = secrets.token_urlsafe(24)
        self._tunables: tuple[CheckedGraph, Tunables] | None = None

    @property
    def page(self) -> str:
        """The address of the page."""
        return f"http://{ADDRESS}:{self.server_address[1]}/?token={self.token}"

    def parameters(self) -> list[dict[str, Any]]:
        """Return the live parameters as the page needs them. Raises ``AloftError``."""
        graph = self.run.graph
        if self._tunables is None or self._tunables[0] is not graph:
            self._tunables = graph, Tunables(graph)
        rows = self._tunables[1].rows(self.run.parameters())
        for row in rows:
            if row["kind"] == "numbers":
                row["elements"] = list_names(graph, row["block"], len(row["value"]))
        return rows


class _RequestHandler(LoopbackHandler):
    content_policy = live_policy()
    timeout = REQUEST_TIMEOUT
    server: LiveServer

    def do_GET(self) -> None:
        if not self.is_ours():
            return
        address = urlsplit(self.path)
        asked = parse_qs(address.query)
        if address.path == "/":
            if not self._knows(asked.get("token", [""])[0]):
                return
            run = self.server.run
            run.refresh()
            text = live_page(
                run.graph, asked.get("closed", []), self.server.token,
                tuning=run.has_parameters, pauses=run.can_be_paused,
                paced=run.is_paced, save=str(self.server.save), opened=self.server.opened,
            )  # fmt: skip
            self.answer(text, "text/html")
        elif self._knows(self.headers.get("X-Aloft-Token", "")):
            if address.path == "/now":
                charted = asked.get("chart", [])
                if len(charted) > MOST_CHARTS:
                    self._refuse(400, f"at most {MOST_CHARTS} fields are charted at once")
                    return
                self._tell(lambda: self.server.run.now(charted))
            elif address.path == "/lines":
                self._tell(lambda: self.server.run.lines(asked.get("field", [""])[0]))
            elif address.path == "/parameters":
                self._tell(lambda: {"parameters": self.server.parameters()})
            else:
                self._refuse(404, f"there is no {address.path}")

    def do_POST(self) -> None:
        if not self.is_ours() or not self._knows(self.headers.get("X-Aloft-Token", "")):
            return
        origin = self.headers.get("Origin")
        if origin is not None and origin != f"http://{self.headers['Host']}":
            self._refuse(403, "only the page itself may change something")
            return
        if self.headers.get_content_type() != "application/json":
            self._refuse(415, "a change is asked for in JSON")
            return
        body = self._body()
        if body is None:
            return
        path = urlsplit(self.path).path
        if path == "/set":
            settings = body.get("settings")
            if not isinstance(settings, list) or not all(isinstance(s, str) for s in settings):
                self._refuse(400, 'expected {"settings": ["block.parameter=value", ...]}')
                return
            self._tell(lambda: {"changes": self.server.run.set(settings)})
        elif path == "/control":
            do, number = body.get("do"), body.get("number")
            if not isinstance(do, str) or not (number is None or type(number) is int):
                self._refuse(400, 'expected {"do": "back", "number": 500}')
                return
            self._tell(lambda: self.server.run.control(do, number))
        elif path == "/save":
            self._tell(self._save)
        else:
            self._refuse(404, f"there is no {path}")

    def _save(self) -> dict[str, Any]:
        server = self.server
        written = write_overlay(server.save, server.run.graph, server.parameters())
        return {"file": str(server.save), "count": len(written), "parameters": written}

    def _body(self) -> dict[str, Any] | None:
        """Return the request's JSON object; refuse a request without one."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > LONGEST_BODY:
            self._refuse(413, f"a request has at most {LONGEST_BODY} bytes")
            return None
        try:
            body = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            body = None
        if not isinstance(body, dict):
            self._refuse(400, "the request is no JSON object")
            return None
        return body

    def _knows(self, token: str) -> bool:
        """Return whether the token is right; refuse the request if not."""
        if secrets.compare_digest(token.encode(), self.server.token.encode()):
            return True
        self._refuse(403, "the token is missing or wrong: open the address that aloft printed")
        return False

    def _tell(self, answer: Callable[[], dict[str, Any]]) -> None:
        try:
            found = answer()
        except AloftError as error:
            self._refuse(409, str(error))
            return
        self.answer(json.dumps(found), "application/json")

    def _refuse(self, status: int, text: str) -> None:
        self.close_connection = True
        self.answer(json.dumps({"error": text}), "application/json", status)
