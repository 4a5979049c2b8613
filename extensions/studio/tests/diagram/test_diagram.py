"""Diagrams of graphs: ports, wires, sub-graphs open and closed, and the files they are written to."""

import threading
import urllib.error
import urllib.request
from pathlib import Path
from xml.etree import ElementTree

import pytest

from aloft.extensions.studio.diagram.diagram import INTO, OUT, diagram, subgraphs
from aloft.extensions.studio.diagram.layout import draw
from aloft.extensions.studio.diagram.page import page, page_server, policy
from aloft.extensions.studio.diagram.render import save_png, svg
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading import checked_file

INNER = """\
inputs: {wish: required, is: required}
outputs: {u: limit.y, slow: average.y}
blocks:
  error: {use: blocks.Sum, with: {weights: [1, -1]}, in: {a: inputs.wish, b: inputs.is}}
  pid: {use: blocks.PID, with: {kp: 3, unit: 1/s}, in: {setpoint: inputs.wish, measured: inputs.is}}
  limit: {use: blocks.Saturation, with: {upper: 1}, in: {u: pid.u}}
  average: {use: blocks.MovingAverage, in: {u: error.y}}
"""
OUTER = """\
rate: 100 Hz
blocks:
  wish: {use: blocks.SineWave, rate: 50 Hz}
  control: {use: inner.yaml, in: {wish: wish.y, is: plant.y}}
  plant: {use: blocks.Integrator, in: {u: {from: "control.u.value[0]", delay: 2}}}
  watch: {use: blocks.Assertion, rate: 20 Hz, with: {upper: 9}, in: {u: control.slow}}
"""


@pytest.fixture
def graph(tmp_path: Path) -> CheckedGraph:
    (tmp_path / "inner.yaml").write_text(INNER)
    (tmp_path / "outer.yaml").write_text(OUTER)
    return checked_file(tmp_path / "outer.yaml")


def test_what_loading_inserts_is_not_drawn(graph: CheckedGraph) -> None:
    shown = diagram(graph)
    assert list(shown.nodes) == ["plant", "wish", "control", "watch"]
    delayed = next(wire for wire in shown.wires if wire.target == ("plant", "u"))
    assert (delayed.delay, delayed.wire_text) == (2, "control/limit.y.value[0]")
    assert delayed.source == ("control", "control/limit.y")


def test_a_box_has_a_port_for_what_crosses_its_border(graph: CheckedGraph) -> None:
    box = diagram(graph).nodes["control"]
    assert box.inputs == ["plant.y", "wish.y"] or box.inputs == ["wish.y", "plant.y"]
    assert box.inside is not None
    assert sorted(box.inside.nodes[INTO].outputs) == sorted(box.inputs)
    assert sorted(box.inside.nodes[OUT].inputs) == sorted(box.outputs)
    assert subgraphs(graph) == ("control",)
    assert diagram(graph, ["control"]).nodes["control"].inside is None


def test_an_svg_file_is_xml_with_every_block_and_both_schemes(graph: CheckedGraph) -> None:
    text = svg(draw(diagram(graph)), "outer")
    tree = ElementTree.fromstring(text)
    paths = [node.get("data-path") for node in tree.iter() if node.get("data-path")]
    assert {"wish", "plant", "control", "control/pid", "watch"} <= {*paths}
    assert "prefers-color-scheme:dark" in text and "@media print" in text
    for word in ("holds 50 Hz", "samples 100 Hz", "z⁻²", "outputs follow from state", "delayed"):
        assert word in text
    assert svg(draw(diagram(graph)), "outer") == text


def test_a_png_file_is_written_light_and_dark(graph: CheckedGraph, tmp_path: Path) -> None:
    drawing = draw(diagram(graph))
    save_png(drawing, tmp_path / "light.png")
    save_png(drawing, tmp_path / "dark.png", dark=True)
    light, dark = ((tmp_path / f"{n}.png").read_bytes() for n in ("light", "dark"))
    assert light.startswith(b"\x89PNG") and dark.startswith(b"\x89PNG") and light != dark


def test_the_page_holds_contracts_parameters_and_places_and_no_markup_of_theirs(
    graph: CheckedGraph,
) -> None:
    text = page(graph)
    assert "outer.yaml:4" not in text.partition("<script")[0]
    assert "outer.yaml:3:3" in text and "A PID controller" in text
    data = text.partition('id="data">')[2].partition("</script>")[0]
    assert "<" not in data
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")


def test_the_page_is_served_to_this_machine_only(graph: CheckedGraph) -> None:
    server = page_server(graph)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        assert server.server_address[0] == "127.0.0.1"
        base = f"http://127.0.0.1:{server.server_address[1]}"
        with urllib.request.urlopen(f"{base}/?closed=control", timeout=60) as answer:
            assert answer.headers["Content-Security-Policy"] == policy()
            text = answer.read().decode()
        assert 'data-path="control"' in text and 'data-path="control/pid"' not in text
        for request in (
            urllib.request.Request(f"{base}/", headers={"Host": "evil.example"}),
            urllib.request.Request(f"{base}/etc/passwd"),
        ):
            with pytest.raises(urllib.error.HTTPError, match=r"403|404"):
                urllib.request.urlopen(request, timeout=60)
    finally:
        server.shutdown()
        server.server_close()


def test_the_policy_allows_the_pages_own_script_only() -> None:
    assert policy().startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe-eval" not in policy() and "script-src 'unsafe-inline'" not in policy()
