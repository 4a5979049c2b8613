"""``aloft language-server``: what it says of a graph, and the protocol over standard input and output."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from aloft.extensions.studio.cli.language_server import (
    GraphText,
    is_graph,
    make_server,
    problems_of,
)
from aloft.runtime.language.errors import AloftError

TEXT = """\
rate: 500 Hz
duration: 1 s
blocks:
  setpoint: {use: blocks.Constant, with: {value: [1 m]}}
  pid:
    use: blocks.PID
    with: {kp: 20, unit: N/m, lower: -5, upper: 5}
    in: {setpoint: setpoint.y, measured: place.y}
  mass: {use: blocks.Gain, with: {gain: 0.5 1/kg}, in: {u: pid.u}}
  speed: {use: blocks.Integrator, in: {u: mass.y}}
  place: {use: blocks.Integrator, in: {u: speed.y}}
"""


def at(word: str, text: str = TEXT) -> tuple[int, int]:
    """Line and column, from one, in the middle of the first place of a word."""
    before, found, _ = text.partition(word)
    assert found
    return before.count("\n") + 1, len(before.rpartition("\n")[2]) + 1 + len(word) // 2


@pytest.fixture
def graph(tmp_path: Path) -> GraphText:
    return GraphText(TEXT, tmp_path / "mass.yaml")


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("blocks.PID", "**blocks.PID**"),
        ("kp", "**kp**"),
        ("place.y", "**place.y**: "),
        ("measured", "**measured**: "),
        ("pid:", "**pid**: blocks.PID"),
        ("duration", ""),
    ],
)
def test_what_is_under_the_cursor(graph: GraphText, word: str, told: str) -> None:
    found = graph.hover(*at(word))
    assert found.startswith(told) and bool(found) == (word != "duration")


def test_units_of_parameters_and_signals_are_shown(tmp_path: Path) -> None:
    text = TEXT.replace(
        "speed:", "hold: {use: blocks.LowPass, with: {cutoff: 8 Hz}, in: {u: mass.y}}\n  speed:"
    )
    graph = GraphText(text, tmp_path / "mass.yaml")
    assert "[Hz]" in graph.hover(*at("cutoff", text))
    robot = "robot: bruce\nblocks:\n  robot: {use: hal.MujocoRobot, in: {command: x.y}}\n  f: {use: blocks.Gain, in: {u: robot.imu.angular_velocity}}\n"
    told = GraphText(robot, tmp_path / "r.yaml").hover(*at("robot.imu.angular_velocity", robot))
    assert "`angular_velocity`" in told and "rad/s" in told


def test_go_to_a_block_its_class_and_an_included_file(graph: GraphText, tmp_path: Path) -> None:
    where = graph.definition(*at("place.y"))
    assert where is not None and where.line == TEXT[: TEXT.index("  place:")].count("\n") + 1
    where = graph.definition(*at("blocks.PID"))
    assert where is not None and Path(where.file).name == "pid.py"
    assert Path(where.file).read_text().splitlines()[where.line - 1].startswith("class PID")
    (tmp_path / "mass.yaml").write_text(TEXT)
    text = "include: [mass.yaml]\nblocks:\n  twice: {use: blocks.Gain, in: {u: place.y}}\n"
    outer = GraphText(text, tmp_path / "outer.yaml")
    where = outer.definition(*at("mass.yaml", text))
    assert where is not None and Path(where.file) == tmp_path / "mass.yaml"
    shipped = "include: [aloft:trials/robust]\n"
    where = GraphText(shipped, tmp_path / "a.yaml").definition(*at("aloft:trials", shipped))
    assert where is not None and where.file.endswith("graphs/trials/robust.yaml")
    where = outer.definition(*at("place.y", text))
    assert where is not None and Path(where.file).name == "mass.yaml"
    assert graph.definition(*at("duration")) is None


def test_a_graph_that_cannot_be_read_yet_is_still_helped_with(tmp_path: Path) -> None:
    broken = TEXT.replace("kp: 20,", "kp: 20, kpp: 3,").replace(
        "use: blocks.Gain", "use: blocks.Gian"
    )
    graph = GraphText(broken, tmp_path / "mass.yaml")
    assert graph.hover(*at("kp", broken)).startswith("**kp**")
    codes = {str(problem.code) for problem in problems_of(broken, tmp_path / "mass.yaml")}
    assert {"unknown-block", "unknown-parameter"} <= codes
    assert problems_of(TEXT, tmp_path / "mass.yaml") == ()
    assert GraphText("blocks: {a: [", tmp_path / "b.yaml").hover(1, 2) == ""


def test_other_yaml_is_left_alone() -> None:
    assert is_graph(TEXT) and not is_graph("name: bruce\nlinks: []\n")


OWN = """\
rate: 500 Hz
blocks:
  own: {use: "of_the_workspace:Own"}
  gain: {use: blocks.Gain, with: {gain: 2, gian: 3}, in: {u: own.y}}
"""


def test_no_module_of_the_workspace_is_imported(tmp_path: Path) -> None:
    marker = tmp_path / "marker"
    (tmp_path / "of_the_workspace.py").write_text(
        f'from pathlib import Path\nPath({str(marker)!r}).touch()\n\nclass Own:\n    """My block."""\n'
    )
    path = tmp_path / "graph.yaml"
    found = problems_of(OWN, path)
    assert [p.message.split(":")[0] for p in found] and all("gian" in p.message for p in found)
    graph = GraphText(OWN, path)
    assert graph.hover(*at("of_the_workspace:Own", OWN)) == "**of_the_workspace:Own**\n\nMy block."
    where = graph.definition(*at("of_the_workspace:Own", OWN))
    assert where is not None and (Path(where.file).name, where.line) == ("of_the_workspace.py", 4)
    assert not marker.exists() and "of_the_workspace" not in sys.modules


def test_a_missing_extra_is_one_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "lsprotocol", None)
    with pytest.raises(AloftError, match=r"needs pygls: pip install 'pygls"):
        make_server()


class Editor:
    """The least of an editor: requests and notifications over the pipes of a server."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "aloft", "language-server"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        self.number = 0

    def send(self, method: str, params: Any, *, answered: bool = False) -> Any:
        message = {"jsonrpc": "2.0", "method": method, "params": params}
        if answered:
            self.number += 1
            message["id"] = self.number
        data = json.dumps(message).encode()
        assert self.process.stdin is not None
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(data), data))
        self.process.stdin.flush()
        return (
            self.until(lambda found: found.get("id") == self.number)["result"] if answered else None
        )

    def until(self, wanted: Any) -> dict[str, Any]:
        assert self.process.stdout is not None
        while True:
            size = 0
            while (line := self.process.stdout.readline()) not in (b"\r\n", b""):
                if line.lower().startswith(b"content-length"):
                    size = int(line.split(b":")[1])
            found = json.loads(self.process.stdout.read(size))
            if wanted(found):
                return dict(found)

    def problems(self) -> list[dict[str, Any]]:
        found = self.until(lambda m: m.get("method") == "textDocument/publishDiagnostics")
        return list(found["params"]["diagnostics"])


@pytest.mark.long
def test_an_editor_over_standard_input_and_output(tmp_path: Path) -> None:
    editor = Editor()
    try:
        known = editor.send(
            "initialize", {"capabilities": {}, "processId": None, "rootUri": None}, answered=True
        )
        assert (
            known["capabilities"]["hoverProvider"] and known["capabilities"]["definitionProvider"]
        )
        editor.send("initialized", {})
        uri = (tmp_path / "mass.yaml").as_uri()
        document = {
            "uri": uri,
            "languageId": "yaml",
            "version": 1,
            "text": TEXT.replace("speed.y", "sped.y"),
        }
        editor.send("textDocument/didOpen", {"textDocument": document})
        problem = next(p for p in editor.problems() if p["code"] == "unknown-source")
        line = TEXT[: TEXT.index("  place:")].count("\n")
        assert problem["range"]["start"]["line"] == line and problem["source"] == "aloft"
        assert "speed" in problem["message"]
        editor.send(
            "textDocument/didChange",
            {"textDocument": {"uri": uri, "version": 2}, "contentChanges": [{"text": TEXT}]},
        )
        assert editor.problems() == []
        row, column = at("place.y")
        asked = {
            "textDocument": {"uri": uri},
            "position": {"line": row - 1, "character": column - 1},
        }
        assert (
            "place.y"
            in editor.send("textDocument/hover", asked, answered=True)["contents"]["value"]
        )
        found = editor.send("textDocument/definition", asked, answered=True)
        assert found["uri"] == uri and found["range"]["start"]["line"] == line
        editor.send("shutdown", None, answered=True)
        editor.send("exit", None)
        assert editor.process.wait(60.0) == 0
    finally:
        editor.process.kill()
