"""The diagram of a recording: the values of a tick, the times of blocks, and the page that asks."""

import json
import shutil
import subprocess
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.extensions.studio.diagram.page import page_server
from aloft.logs.recording.recorder import Recorder
from aloft.logs.replay.opened_run import OpenedRun, TickValues
from aloft.logs.viewing.signal_names import value_text
from aloft.runtime.running.run_result import RunResult

GRAPH = """\
rate: 100 Hz
duration: 0.5 s
blocks:
  wave: {use: blocks.SineWave, with: {n: 2, amplitude: 3 m, frequency: 2 Hz}}
  plain: {use: blocks.Constant, with: {value: [7], unit: unchecked}}
  twice: {use: blocks.Gain, with: {n: 2, gain: 2}, in: {u: wave.y}}
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunResult, OpenedRun]:
    folder = tmp_path_factory.mktemp("run")
    result = aloft.load(GRAPH, path=folder / "waves.yaml").run(sinks=[Recorder(folder / "r.rrd")])
    assert result.success
    return result, OpenedRun.of(folder / "r.rrd")


@pytest.fixture
def base(ran: tuple[RunResult, OpenedRun]) -> Iterator[str]:
    _, opened = ran
    server = page_server(opened.graph, values=TickValues(opened.file))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


def test_values_are_those_of_the_run(ran: tuple[RunResult, OpenedRun]) -> None:
    result, opened = ran
    values = TickValues(opened.file)
    assert (values.ticks, values.period) == ((0, 49), 0.01)
    for tick in (0, 17, 49, 1000):
        expected = result.signal("twice.y.value")[min(tick, 49)]
        text = values.at(tick)["twice.y.value"]
        assert text.startswith(f"[{expected[0]:.6g}, {expected[1]:.6g}]")
    assert values.at(0)["plain.y.value"] == "7"
    assert values.times["twice"].startswith("50 runs, median ")
    assert values.times["twice"].endswith("0 deadlines missed")


def test_the_page_asks_for_the_values_of_a_tick(
    base: str, ran: tuple[RunResult, OpenedRun]
) -> None:
    with urllib.request.urlopen(f"{base}/", timeout=60) as answer:
        text = answer.read().decode()
    assert '<input type="range" id="tick" min="0" max="49" value="0">' in text
    data = json.loads(text.partition('id="data">')[2].partition("</script>")[0])
    assert data["blocks"]["twice"]["sources"] == {"u": "wave.y"}
    assert data["recorded"]["times"].keys() == {"wave", "plain", "twice"}
    with urllib.request.urlopen(f"{base}/at?tick=17", timeout=60) as answer:
        assert json.loads(answer.read()) == TickValues(ran[1].file).at(17)
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"{base}/at?tick=x", timeout=60)


def test_a_page_without_a_run_has_no_slider(ran: tuple[RunResult, OpenedRun]) -> None:
    server = page_server(ran[1].graph)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    base = f"http://127.0.0.1:{server.server_address[1]}"
    try:
        with urllib.request.urlopen(f"{base}/", timeout=60) as answer:
            assert b'id="tick"' not in answer.read()
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"{base}/at?tick=1", timeout=60)
    finally:
        server.shutdown()
        server.server_close()


def test_a_browser_shows_the_values(base: str, tmp_path: Path) -> None:
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("chromium is not installed")
    done = subprocess.run(
        [program, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}",
         "--virtual-time-budget=5000", "--dump-dom", f"{base}/"],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert '<output id="time">0.0000 s, tick 0</output>' in done.stdout, done.stderr


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.array([1.5]), "1.5 m"),
        (np.array(True), "True m"),
        (np.arange(3), "[0, 1, 2] m"),
        (np.zeros((3, 6)), "[" + "0, " * 16 + "... (18 in all)] m"),
    ],
)
def test_how_numbers_are_shown(value: np.ndarray, text: str) -> None:
    assert value_text(value, "m") == text
