"""``aloft run`` of a graph with a block that hangs: the end is bounded, named and recorded."""

import json
import re
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from .conftest import Start

HERE = Path(__file__).parent
GRAPH = """\
rate: 100 Hz
clock: {hangs_after: 500 ms}
blocks:
  arm: {use: "hanging:Hanging", with: {compiled: COMPILED}}
"""


@pytest.fixture
def graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], str]:
    """Writes the graph; Python or compiled code hangs."""
    shutil.copy(HERE / "hanging.py", tmp_path)
    monkeypatch.chdir(tmp_path)

    def write(compiled: bool) -> str:
        Path("hang.yaml").write_text(GRAPH.replace("COMPILED", str(compiled).lower()))
        return "hang.yaml"

    return write


def line_of(text: str) -> int:
    lines = (HERE / "hanging.py").read_text().splitlines()
    return 1 + next(i for i, line in enumerate(lines) if text in line)


@pytest.mark.long
def test_a_loop_in_python(graph: Callable[[bool], str], call_json: Any) -> None:
    result = call_json("run", graph(False), code=3)
    assert result["reason"] == (
        "block 'arm' hung at tick 3 (0.030 s): it did not return within 0.5 s "
        "(clock.hangs_after allows longer)"
    )
    file, _, line = result["error"]["where"].rpartition(":")
    assert file.endswith("/hanging.py")
    assert int(line) - line_of("while True") in (0, 1)
    recording = call_json("log", "info", result["recording"])
    assert any("'arm' hung" in note["text"] for note in recording["notes"])


def test_the_line_is_printed(graph: Callable[[bool], str], call: Any) -> None:
    done = call("run", graph(False), "--no-record", code=3)
    assert "no success: block 'arm' hung at tick 3" in done.stderr
    assert f"raised at {Path.cwd()}/hanging.py:" in done.stderr


def test_code_that_keeps_the_interpreter(
    graph: Callable[[bool], str], start: Start, call_json: Any
) -> None:
    output, _ = start("run", graph(True), "--json").communicate(timeout=240)
    result = json.loads(output.splitlines()[-1])
    assert result["reason"] == (
        "block 'arm' hangs in compiled code that lets nothing else run: no sign of life for 0.5 s "
        "(clock.hangs_after allows longer); the process is killed"
    )
    assert result["exit_code"] == 128 + signal.SIGKILL
    assert (result["success"], result["error"]["block"]) == (False, "arm")
    assert result["error"]["where"] == f"{Path.cwd()}/hanging.py:{line_of('self._wait(')}"


@pytest.mark.long
@pytest.mark.parametrize("options", [[], ["--no-fuse"]])
def test_a_kernel_that_does_not_end(
    graph: Callable[[bool], str], start: Start, options: list[str]
) -> None:
    graph(False)
    use = '{use: "hanging:Turning"'
    blocks = f"  leg: {use}}}\n  arm: {use}, with: {{at: 4}}}}\n  hand: {use}}}\n"
    text = GRAPH[: GRAPH.index("  arm")] + blocks
    Path("turn.yaml").write_text(text)
    output, _ = start("run", "turn.yaml", "--json", *options).communicate(timeout=240)
    result = json.loads(output.splitlines()[-1])
    assert result["exit_code"] == 128 + signal.SIGKILL
    found = re.match(r"block (.*) hangs in compiled code", result["reason"])
    assert found is not None, result["reason"]
    # one by one the stack shows the class alone, which three blocks have
    assert found[1] == ("'arm'" if not options else "'leg' or 'arm' or 'hand'")
    assert (
        result["error"]["where"] == f"{Path.cwd()}/hanging.py:{line_of('for _ in range(rounds)')}"
    )


@pytest.mark.long
def test_a_run_that_is_slow_to_close_is_not_killed(
    graph: Callable[[bool], str], start: Start
) -> None:
    slow = (
        "import time; from aloft.logs.recording.recorder import Recorder; finish = Recorder.finish;"
        "Recorder.finish = lambda s, r: (time.sleep(1.5), finish(s, r))[1]"
    )
    process = start("run", graph(False), "--duration", "0.02", "--json", before=slow)
    output, _ = process.communicate(timeout=240)
    assert json.loads(output.splitlines()[-1])["success"] is True
    assert process.returncode == 0
