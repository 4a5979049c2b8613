"""The diagram as a page for a browser, and the server that shows it to browsers of this machine only.

A click on a block shows its contract, its parameters and its place in the file; one on a box opens it. For a run
the page has the values on the wires at a tick, and the time that each block took.
"""

from __future__ import annotations

import base64
import hashlib
import json
import threading
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Protocol
from urllib.parse import parse_qs, urlsplit

from ....files.nodes import text_of
from ....runtime.language.reference import PortReference, block_reference
from ....runtime.language.stages import BlockSpec, CheckedGraph
from ....runtime.loading.picture import BlockRow, table
from .diagram import diagram, subgraphs
from .layout import draw
from .render import svg

_STYLE = """
:root{color-scheme:light dark} body{margin:0;font:14px/1.45 'DejaVu Sans',Verdana,Arial,sans-serif;
background:Canvas;color:CanvasText;display:flex;height:100vh}
main{flex:1;overflow:auto;padding:8px} aside{width:27em;overflow:auto;padding:12px 16px;
border-left:1px solid GrayText;box-sizing:border-box} .node{cursor:pointer;outline:none}
.node:hover>rect:first-of-type,.node:focus>rect:first-of-type{stroke-width:2.6}
h1{font-size:17px;margin:0 0 2px} h2{font-size:13px;margin:14px 0 4px} p,pre{margin:4px 0}
pre{white-space:pre-wrap;font:inherit} table{border-collapse:collapse;width:100%}
td{vertical-align:top;padding:2px 8px 2px 0;overflow-wrap:anywhere} td:first-child{font-weight:bold;white-space:nowrap} p{overflow-wrap:anywhere}
:not(text).soft{opacity:.72} button{font:inherit} header{display:flex;gap:.8em;align-items:baseline}
.wide{flex-direction:column} .wide main{flex:none;max-height:72vh} .wide aside{flex:1;width:auto;
border-left:0;border-top:1px solid GrayText} .wide #panel{columns:25em;column-gap:2em}
#panel>h1{column-span:all} #panel h2{break-after:avoid} tr,.whole{break-inside:avoid}
@page{size:landscape;margin:8mm}
@media print{aside,header{display:none} body{display:block!important;height:auto} main{overflow:visible;
max-height:none!important;padding:0} svg{width:100%!important;height:auto!important}}
@media (max-width:60em){body{flex-direction:column} aside{width:auto;max-height:45%;border:0;
border-top:1px solid GrayText}}
"""
_SCRIPT = """
"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const panel = document.getElementById("panel"), drawing = document.querySelector("svg");
const make = (tag, text, kind) => { const e = document.createElement(tag);
  e.textContent = text; if (kind) e.className = kind; return e; };
function rows(into, title, found) {
  if (!found.length) return;
  into.append(make("h2", title));
  const table = document.createElement("table");
  for (const row of found) { const tr = document.createElement("tr");
    row.forEach((cell, k) => tr.append(make("td", cell, k > 2 ? "soft" : ""))); table.append(tr); }
  into.append(table);
}
function toggle(path) {
  const closed = new Set(data.closed);
  if (!closed.delete(path)) closed.add(path);
  const asked = new URLSearchParams(location.search);
  asked.delete("closed");
  closed.forEach(p => asked.append("closed", p));
  location.search = asked;
}
let chosen = "", now = {}, times = data.recorded ? data.recorded.times : {};
const at = data.recorded ? "at this tick" : "now", shown = [];
function values(into, title, ports) {
  rows(into, title, ports.flatMap(([name, port]) => Object.keys(now).filter(
    key => key.slice(0, key.lastIndexOf(".")) === port).map(
    key => [name + "." + key.slice(key.lastIndexOf(".") + 1), now[key]])));
}
function moment() {
  const place = panel.querySelector(".moment"), block = data.blocks[chosen];
  if (!place || !block) return;
  place.replaceChildren();
  values(place, "Inputs " + at, Object.entries(block.sources));
  values(place, "Outputs " + at, block.outputs.map(row => [row[0], chosen + "." + row[0]]));
  if (times[chosen]) rows(place, "Time", [["took", times[chosen]]]);
}
function show(path) {
  chosen = path;
  panel.replaceChildren();
  const block = data.blocks[path];
  panel.append(make("h1", path));
  if (!block) {
    const button = make("button", data.closed.includes(path) ? "open" : "close");
    button.onclick = () => toggle(path);
    panel.append(make("p", "sub-graph", "soft"), button);
    return;
  }
  const on = block.machine ? ", on " + block.machine : "";
  panel.append(make("p", block.use + ", " + block.rate + ", number " + block.order +
    " in a tick" + on, "soft"));
  if (block.place) panel.append(make("p", block.place));
  panel.append(make("div", "", "moment"));
  moment();
  shown.forEach(also => also(path));
  rows(panel, "Parameters", block.parameters);
  rows(panel, "Inputs", block.inputs);
  rows(panel, "Outputs", block.outputs);
  panel.append(make("h2", "Contract"), make("pre", block.text));
}
if (data.recorded) {
  const slider = document.getElementById("tick"), said = document.getElementById("time");
  let asking = false, asked = "";
  const ask = async () => {
    said.textContent = (slider.value * data.recorded.period).toFixed(4) + " s, tick " + slider.value;
    if (asking || asked === slider.value) return;
    asking = true; asked = slider.value;
    try { now = await (await fetch("at?tick=" + asked)).json(); moment(); }
    finally { asking = false; if (asked !== slider.value) ask(); }
  };
  slider.oninput = ask; ask();
}
const nodeOf = event => event.target.closest(".node");
drawing.addEventListener("click", e => { const n = nodeOf(e); if (n) show(n.dataset.path); });
drawing.addEventListener("dblclick", e => { const n = nodeOf(e);
  if (n && !data.blocks[n.dataset.path]) toggle(n.dataset.path); });
drawing.addEventListener("keydown", e => { const n = nodeOf(e);
  if (n && e.key === "Enter") show(n.dataset.path); });
const width = drawing.viewBox.baseVal.width;
let scale = 1;
// a drawing that is wide has the whole width of the screen, and what is chosen stands below it
document.body.classList.toggle("wide", width > 2 * drawing.viewBox.baseVal.height);
function zoom(to) { scale = Math.min(4, Math.max(0.2, to));
  drawing.setAttribute("width", width * scale);
  drawing.setAttribute("height", drawing.viewBox.baseVal.height * scale); }
const fit = () => zoom((document.querySelector("main").clientWidth - 20) / width);
document.getElementById("fit").onclick = fit;
document.getElementById("in").onclick = () => zoom(scale * 1.25);
document.getElementById("out").onclick = () => zoom(scale / 1.25);
fit();
"""


@dataclass(frozen=True)
class PageAddition:
    """Addition of a page to the diagram: data, controls, and the style and script for them."""

    name: str
    data: Mapping[str, Any]
    controls: str
    style: str
    script: str


def page(
    graph: CheckedGraph,
    closed: Collection[str] = (),
    values: Values | None = None,
    addition: PageAddition | None = None,
) -> str:
    """Return the page's text. It makes no request to any other machine.

    With ``values`` it has a slider over the ticks of a run, and shows what a chosen block reads and
    writes there, and the time it took. The script of an ``addition`` runs after the page's own.
    """
    known = subgraphs(graph)
    shut = [path for path in known if path in closed]
    recorded, slider = None, ""
    if values is not None:
        first, last = values.ticks
        recorded = {"period": values.period, "times": dict(values.times)}
        slider = (
            f'<label>time <input type="range" id="tick" min="{first}" max="{last}" value="{first}">'
            '</label><output id="time"></output>'
        )
    about: dict[str, Any] = {"blocks": details(graph), "closed": shut, "recorded": recorded}
    style, controls, also = _STYLE, slider, ""
    if addition is not None:
        about[addition.name] = dict(addition.data)
        style += addition.style
        controls += addition.controls
        also = f"<script>{addition.script}</script>"
    data = json.dumps(about)
    name = escape(graph.name)
    body = data.replace("<", "\\u003c")
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{name}</title>'
        f"<style>{style}</style></head><body><main><header><h1>{name}</h1>"
        '<button id="fit">fit</button><button id="in">+</button><button id="out">−</button>'
        f"{controls}"
        '<span class="soft">a click on a block shows what it does</span></header>'
        f"{svg(draw(diagram(graph, shut)), graph.name)}</main>"
        '<aside><div id="panel"><p class="soft">Nothing is chosen.</p></div></aside>'
        f'<script type="application/json" id="data">{body}</script>'
        f"<script>{_SCRIPT}</script>{also}</body></html>\n"
    )


def policy(addition: str = "") -> str:
    """Return the Content-Security-Policy of the page: its own script and style, that of an
    addition, and nothing else."""
    digests = [
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        for script in (_SCRIPT, addition)
        if script
    ]
    scripts = " ".join(f"'sha256-{digest}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; "
        "connect-src 'self'; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    )


def page_server(
    graph: CheckedGraph, port: int = 0, values: Values | None = None
) -> ThreadingHTTPServer:
    """Make the server, which listens on the loopback address but does not serve yet.

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


def details(graph: CheckedGraph) -> dict[str, dict[str, Any]]:
    """Return the details of every block that a user wrote, by path, as plain data."""
    specs = {spec.path: spec for spec in graph.blocks}
    return {row.path: _of(row, specs[row.path]) for row in table(graph) if "~" not in row.path}


def _of(row: BlockRow, spec: BlockSpec) -> dict[str, Any]:
    reference = block_reference(row.use, spec.block_type)
    values = spec.params.model_dump(mode="json")
    when = f", from tick {row.offset_ticks}" if row.offset_ticks else ""
    when += f", in the background with a latency of {row.background}" if row.background else ""
    return {
        "use": row.use,
        "place": str(spec.where) if spec.where is not None else "",
        "rate": f"{row.rate_hz:g} Hz{when}",
        "order": row.order,
        "machine": spec.machine,
        "summary": reference.summary,
        "text": reference.text,
        "inputs": [[item.name, item.text().partition(" <- ")[2]] for item in row.inputs],
        "sources": {name: wire.source for name, wire in spec.wires.items()},
        "outputs": [[port.name, _fields(port, spec)] for port in reference.outputs],
        "parameters": [
            [item.name, _short(values.get(item.name)), item.unit, item.text]
            for item in reference.parameters
        ],
    }


def _fields(port: PortReference, spec: BlockSpec) -> str:
    """Return the fields of an output with what they carry in this graph."""
    found = []
    for field in port.fields:
        quantity = spec.quantities.get(f"{port.name}.{field.name}")
        found.append(f"{field.name}: {field.type}" + (f" {quantity}" if quantity else ""))
    return f"{port.signal}: {', '.join(found)}"


def _short(value: Any) -> str:
    text = "none" if value is None else text_of(value)
    return text if len(text) <= 120 else f"{text[:117]}..."


class Values(Protocol):
    """A run whose values can be asked for."""

    ticks: tuple[int, int]
    """The first and the last tick."""
    period: float
    """The duration of a tick [s]."""
    times: Mapping[str, str]
    """Text on the time that a block took, by the block's path."""

    def at(self, tick: int) -> Mapping[str, str]:
        """Every field of every output at a tick, by ``block.port.field``."""


ADDRESS = "127.0.0.1"


class LoopbackHandler(BaseHTTPRequestHandler):
    """Answers requests that were made to the loopback address by its name."""

    content_policy = "default-src 'none'"

    def is_ours(self) -> bool:
        """Return whether the request was made to this machine; refuse it if not.

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
