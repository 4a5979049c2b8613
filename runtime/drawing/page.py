"""The diagram as a page for a browser: a click on a block shows its details, one on a box opens it."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any

from ..language.stages import CheckedGraph
from .details import details
from .diagram import diagram, subgraphs
from .placing import draw
from .svg import svg
from .values import Values

_STYLE = """
:root{color-scheme:light dark} body{margin:0;font:14px/1.45 'DejaVu Sans',Verdana,Arial,sans-serif;
background:Canvas;color:CanvasText;display:flex;height:100vh}
main{flex:1;overflow:auto;padding:8px} aside{width:27em;overflow:auto;padding:12px 16px;
border-left:1px solid GrayText;box-sizing:border-box} .node{cursor:pointer;outline:none}
.node:hover>rect:first-of-type,.node:focus>rect:first-of-type{stroke-width:2.6}
h1{font-size:17px;margin:0 0 2px} h2{font-size:13px;margin:14px 0 4px} p,pre{margin:4px 0}
pre{white-space:pre-wrap;font:inherit} table{border-collapse:collapse;width:100%}
td{vertical-align:top;padding:2px 8px 2px 0;overflow-wrap:anywhere} td:first-child{font-weight:bold;white-space:nowrap} p{overflow-wrap:anywhere}
.soft{opacity:.72} button{font:inherit} header{display:flex;gap:.8em;align-items:baseline}
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
class Addition:
    """What a page has besides the diagram: data, controls, and the style and script for them."""

    name: str
    data: Mapping[str, Any]
    controls: str
    style: str
    script: str


def page(
    graph: CheckedGraph,
    closed: Collection[str] = (),
    values: Values | None = None,
    addition: Addition | None = None,
) -> str:
    """The page's text. It asks no other machine for anything.

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
    """The Content-Security-Policy of the page: its own script and style, that of an addition, and
    nothing else."""
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
