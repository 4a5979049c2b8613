"""The command line: what it prints, in words and as JSON, and the exit code it leaves with."""

import io
import json
import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

import aloft.benchmarks
from aloft.cli import main

ROOT = Path(__file__).parent.parent

COUNTER = '''
"""Blocks for tests of the command line."""

from aloft import Block, BlockError, Field, Output, Parameters, Signal, State, parameter


class Number(Signal):
    value = Field(text="a number")


class Counter(Block):
    """Counts up from its seed, and fails or ends the run when told to."""

    class Params(Parameters):
        seed: int = parameter(0, ge=0, text="where it starts")
        goal: float = parameter(1e9, text="the metric must not exceed this")
        fail_at: int = parameter(-1, text="the tick at which it raises")
        stop_at: int = parameter(-1, text="the tick at which it ends the run")
        nan_at: int = parameter(-1, text="the tick at which its output is not a number")

    params: Params
    y = Output(Number)
    count = State(Number)

    def start(self) -> None:
        self.count.value[()] = self.params.seed

    def step(self) -> None:
        if self.tick == self.params.fail_at:
            raise BlockError("the spring broke")
        if self.tick == self.params.stop_at:
            self.request_stop("counted enough")
        self.count.value += 1.0
        self.y.value[()] = float("nan") if self.tick == self.params.nan_at else self.count.value

    def metrics(self) -> dict[str, float | bool | str]:
        value = float(self.count.value)
        good = value <= self.params.goal
        return {"last_count": value, "success": good, "reason": "" if good else "counted too far"}
'''

GRAPH = """
rate: 100 Hz
duration: 1 s
blocks:
  counter: {use: "counter:Counter", with: {seed: 5}}
  double: {use: "counter:Counter"}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a graph and its block, which is where commands run."""
    (tmp_path / "counter.py").write_text(COUNTER)
    (tmp_path / "count.yaml").write_text(GRAPH)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*arguments: str, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the command line in this process and check how it would leave."""
    output, errors = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        redirect_stdout(output),
        redirect_stderr(errors),
        pytest.raises(SystemExit) as left,
    ):
        patch.setattr(sys, "argv", ["aloft", *arguments])
        patch.setenv("COLUMNS", "160")
        main()
    assert left.value.code == code, output.getvalue() + errors.getvalue()
    return subprocess.CompletedProcess(arguments, code, output.getvalue(), errors.getvalue())


def start(*arguments: str, before: str = "", **environment: str) -> subprocess.Popen[str]:
    """Start the command line in a process of its own, after the statement ``before``."""
    code = f"{before}\nfrom aloft.cli import main\nmain()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **environment},
    )


def call_json(*arguments: str, code: int = 0) -> dict[str, Any]:
    """As ``call``; standard output must be one JSON object on its last line and nothing else."""
    lines = call(*arguments, "--json", code=code).stdout.splitlines()
    assert len(lines) == 1
    value = json.loads(lines[0])
    assert isinstance(value, dict)
    return value


def test_run_prints_metrics_times_and_verdict(folder: Path) -> None:
    done = call("run", "count.yaml")
    for text in (
        "counter.last_count",
        "105",
        "median [us]",
        "100 ticks, 1.000 s",
        "recording: recordings/count.rrd; to see it:",
        "success: ran to its end",
    ):
        assert text in done.stdout
    assert (folder / "recordings" / "count.rrd").stat().st_size > 0


def test_run_json_has_the_promised_keys(folder: Path) -> None:
    result = call_json("run", "count.yaml", "--record", "here.rrd", "--set", "counter.seed=7")
    assert result["success"] is True
    assert result["reason"] == "ran to its end"
    assert len(result["run_hash"]) == 32
    assert result["metrics"] == {"counter.last_count": 107.0, "double.last_count": 100.0}
    assert result["blocks"]["counter"]["calls"] == 100
    assert result["recording"] == "here.rrd"
    assert result["overrides"] == {"counter.seed": 7}
    assert result["ticks"] == 100
    assert (folder / "here.rrd").is_file()


def test_the_hash_is_the_same_everywhere(folder: Path) -> None:
    here = {
        call_json("run", "count.yaml", "--set", "double.seed=5", *options)["run_hash"]
        for options in (["--no-record"], ["--record", "a.rrd"], ["--quiet", "--no-record"])
    }
    for hash_seed in ("0", "1"):
        options = ("run", "count.yaml", "--json", "--no-record", "--set", "double.seed=5")
        output, _ = start(*options, PYTHONHASHSEED=hash_seed).communicate(timeout=60)
        here.add(json.loads(output)["run_hash"])
    here.add(call_json("run", "count.yaml", "--seeds", "5")["rows"][0]["run_hash"])
    assert len(here) == 1


def test_quiet_prints_the_verdict_only(folder: Path) -> None:
    assert call("run", "count.yaml", "--quiet", "--no-record").stdout == "success: ran to its end\n"


def test_duration(folder: Path) -> None:
    assert call_json("run", "count.yaml", "--duration", "250 ms", "--no-record")["ticks"] == 25
    result = call_json("run", "count.yaml", "--duration", "-1", code=2)
    assert "duration" in result["problems"][0]["message"]


@pytest.mark.parametrize(
    ("setting", "code", "reason"),
    [
        ("counter.stop_at=10", 0, "counted enough"),
        ("counter.goal=50", 1, "counted too far"),
        ("counter.fail_at=10", 3, "block 'counter' failed at tick 10 (0.100 s): the spring broke"),
        ("double.nan_at=3", 3, "block 'double' wrote a value that is not finite at tick 3"),
    ],
)
def test_exit_codes_of_a_run(folder: Path, setting: str, code: int, reason: str) -> None:
    result = call_json("run", "count.yaml", "--set", setting, code=code)
    assert result["success"] is (code == 0)
    assert result["exit_code"] == code
    assert result["reason"].startswith(reason)
    # what failed is what one wants to look at
    assert (folder / str(result["recording"])).is_file()
    done = call("run", "count.yaml", "--set", setting, "--no-record", code=code)
    assert f"success: {reason}" in done.stdout + done.stderr


def test_a_wrong_graph_is_reported_whole(folder: Path) -> None:
    (folder / "wrong.yaml").write_text(
        GRAPH.replace("seed: 5", "sed: 5").replace("100 Hz", "100 m") + "extra: 1\n"
    )
    result = call_json("run", "wrong.yaml", code=2)
    assert result["success"] is False
    assert result["reason"] == "wrong.yaml: 3 problems"
    assert [problem["line"] for problem in result["problems"]] == [2, 5, 7]
    assert call_json("check", "wrong.yaml", code=2)["problems"] == result["problems"]
    done = call("check", "wrong.yaml", code=2)
    assert done.stdout == ""
    assert "wrong.yaml:5:" in done.stderr
    assert "wrong.yaml: 3 problems" in done.stderr


def test_check_says_that_a_graph_may_run(folder: Path) -> None:
    assert call("check", "count.yaml").stdout == "count.yaml: no problems; 2 blocks at 100 Hz\n"
    assert call_json("check", "count.yaml")["ok"] is True
    result = call_json("check", "count.yaml", "--set", "counter.seed=-1", code=2)
    assert result["problems"][0]["at"] == "counter.seed"


def test_a_missing_graph_is_an_input_error(folder: Path) -> None:
    assert "cannot read nowhere.yaml" in call("run", "nowhere.yaml", code=2).stderr
    assert call_json("run", "nowhere.yaml", code=2)["problems"][0]["code"] == "file"


def test_a_wrong_command_line_is_an_input_error(folder: Path) -> None:
    assert "No such command 'rnu'" in call_json("rnu", code=2)["reason"]
    assert "--sett" in call_json("run", "count.yaml", "--sett", "a=1", code=2)["reason"]
    done = call("run", code=2)
    assert "Missing argument" in done.stderr
    assert done.stdout == ""


def test_seeds_give_a_row_each_in_order(folder: Path) -> None:
    options = ("--seeds", "3:6,0", "--set", "counter.goal=104")
    result = call_json("run", "count.yaml", *options, code=1)
    assert [row["seed"] for row in result["rows"]] == [3, 4, 5, 0]
    assert [row["success"] for row in result["rows"]] == [True, True, False, True]
    assert result["rows"][1]["metrics"] == {"counter.last_count": 104.0, "double.last_count": 104.0}
    assert result["rows"][2]["reason"] == "counted too far"
    assert result["summary"] == {"n": 4, "successes": 3, "seeds": [3, 4, 5, 0]}
    assert result["success"] is False
    single = call_json("run", "count.yaml", "--no-record", "--set", "counter.seed=3",
                       "--set", "double.seed=3")  # fmt: skip
    assert single["run_hash"] == result["rows"][0]["run_hash"]
    done = call("run", "count.yaml", *options, code=1)
    assert "3 of 4 seeds succeeded" in done.stdout
    assert "counted too far" in done.stdout


@pytest.mark.parametrize("seeds", ["a", "5:5", "1,1", "-3", "1:2:3"])
def test_seeds_that_are_none(folder: Path, seeds: str) -> None:
    assert f"seeds '{seeds}'" in call_json("run", "count.yaml", "--seeds", seeds, code=2)["reason"]


def test_seeds_need_a_parameter_called_seed(folder: Path) -> None:
    (folder / "plain.yaml").write_text(
        "rate: 10 Hz\nduration: 1 s\nblocks:\n  c: {use: runtime.Constant, with: {value: [1]}}\n"
    )
    result = call_json("run", "plain.yaml", "--seeds", "0:2", code=2)
    assert result["reason"] == "graph plain has no parameter called seed"


def test_seeds_are_not_recorded(folder: Path) -> None:
    result = call_json("run", "count.yaml", "--seeds", "0:2", "--record", "a.rrd", code=2)
    assert result["reason"].startswith("--record is for one run")
    call("run", "count.yaml", "--seeds", "0:2")
    assert not (folder / "recordings").exists()


def test_a_recording_that_cannot_be_written_is_a_warning(folder: Path) -> None:
    (folder / "file").write_text("")
    done = call("run", "count.yaml", "--record", "file/count.rrd")
    assert "warning: no recording: file/count.rrd cannot be written" in done.stderr
    assert "success: ran to its end" in done.stdout
    assert call_json("run", "count.yaml", "--record", "file/count.rrd")["recording"] is None


def test_without_rerun_a_run_goes_on(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    done = call("run", "count.yaml")
    assert "warning: no recording: Rerun cannot be imported" in done.stderr
    assert "success: ran to its end" in done.stdout


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_stop_a_run_cleanly(folder: Path, number: signal.Signals, code: int) -> None:
    graph = GRAPH.replace("duration: 1 s\n", "clock: {kind: paced}\n")
    (folder / "endless.yaml").write_text(graph)
    (folder / "counter.py").write_text(COUNTER.replace(
        "        self.count.value += 1.0", "        open('running', 'w').close()\n"
        "        self.count.value += 1.0"
    ))  # fmt: skip
    process = start("run", "endless.yaml", "--json")
    deadline = time.monotonic() + 30.0
    while not (folder / "running").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(number)
    output, errors = process.communicate(timeout=30)
    assert process.returncode == code, output + errors
    result = json.loads(output)
    assert result["success"] is False
    assert result["reason"] == f"stopped by {number.name}"
    assert result["ticks"] > 0
    assert (folder / result["recording"]).is_file()


def test_blocks_lists_and_describes() -> None:
    listing = call("blocks").stdout
    assert "runtime.Gain" in listing
    gain = call("blocks", "runtime.Gain").stdout
    for text in ("y = gain u", "Inputs", "gain times u", "Parameters", "the factor", "(Mealy)"):
        assert text in gain
    data = call_json("blocks", "runtime.Gain")
    assert data["parameters"][1]["name"] == "gain"
    assert data["parameters"][1]["default"] == "1.0"
    assert len(call_json("blocks")["blocks"]) > 5


def test_blocks_names_what_is_alike() -> None:
    done = call("blocks", "runtime.Gian", code=2)
    assert "there is no block called 'runtime.Gian'; the nearest are runtime.Gain" in done.stderr


def test_a_block_beside_the_graph_is_described(folder: Path) -> None:
    assert "Counts up from its seed" in call("blocks", "counter:Counter").stdout


def test_graph_prints_order_rates_and_wires(folder: Path) -> None:
    (folder / "ring.yaml").write_text("""
rate: 100 Hz
duration: 2 s
blocks:
  wish: {use: runtime.SineWave, rate: 50 Hz}
  error: {use: runtime.Sum, with: {weights: [1, -1]}, in: {a: wish.y, b: position.y}}
  position: {use: runtime.Integrator, in: {u: error.y}}
""")
    text = call("graph", "ring.yaml").stdout
    assert text.startswith("ring: base rate 100 Hz, 200 ticks\n")
    order = [text.index(f" {name} ") for name in ("position", "wish", "error")]
    assert order == sorted(order)
    assert "a <- wish.y (Vector, holds 50 Hz)" in text
    data = call_json("graph", "ring.yaml")
    assert [row["path"] for row in data["blocks"]] == ["position", "wish", "error"]
    assert call("graph", "ring.yaml", "--mermaid").stdout.startswith("flowchart LR\n")
    flat = call("graph", "ring.yaml", "--flat", "--set", "position.initial=0.5").stdout
    (folder / "flat.yaml").write_text(flat)
    assert "initial: 0.5" in flat
    runs = [
        call_json("run", *arguments, "--no-record")["run_hash"]
        for arguments in (["flat.yaml"], ["ring.yaml", "--set", "position.initial=0.5"])
    ]
    assert runs[0] == runs[1]


def test_graph_wants_one_form(folder: Path) -> None:
    assert "choose one of" in call("graph", "count.yaml", "--flat", "--mermaid", code=2).stderr


def test_check_prints_the_schema() -> None:
    schema = json.loads(call("check", "--schema").stdout)
    assert {"rate", "blocks"} <= set(schema["properties"])
    assert "a graph file is needed" in call("check", code=2).stderr


def test_bench_refuses_an_unknown_name() -> None:
    result = call_json("bench", "sheduler", code=2)
    assert result["reason"].startswith("there is no benchmark 'sheduler'; there is scheduler")


def test_bench_prints_rows_and_exits_by_the_goals(monkeypatch: pytest.MonkeyPatch) -> None:
    row = {"name": "tick", "value": 1.5, "unit": "us", "ratio": 1.2, "peer": "hand loop"}
    machine = {"processor": "abacus", "cores": 2, "python": "3"}
    results = {"machine": machine, "load": {"before": [0.1], "after": [0.2]}}
    for met, code in ((True, 0), (None, 0), (False, 1)):
        rows = [{**row, "goal": 1.1, "met": met, "note": ""}]
        monkeypatch.setattr(
            aloft.benchmarks, "run_benchmarks", lambda _, r=rows: {**results, "rows": r}
        )
        assert call_json("bench", "scheduler", code=code)["rows"] == rows
        text = call("bench", code=code).stdout
        assert "hand loop" in text
        assert "abacus" in text


def complete(words: str) -> list[str]:
    """What bash would be offered behind these words."""
    position = str(len(words.split(" ")) - 1)
    process = start(_ALOFT_COMPLETE="complete_bash", COMP_WORDS=words, COMP_CWORD=position,
                    before="import sys; sys.argv = ['aloft']")  # fmt: skip
    return process.communicate(timeout=60)[0].split()


def test_the_tab_key_completes(folder: Path) -> None:
    assert complete("aloft r") == ["run"]
    assert "--seeds" in complete("aloft run --se")
    assert complete("aloft blocks runtime.Ga") == ["runtime.Gain"]
    assert complete("aloft run count.yaml --set counter.s") == ["counter.seed=", "counter.stop_at="]
    assert complete("aloft run nowhere.yaml --set counter.s") == []


def test_help_documents_the_exit_codes() -> None:
    for arguments in (("--help",), ("run", "--help")):
        text = call(*arguments).stdout
        for code in (0, 1, 2, 3, 130, 143):
            assert f"\n    {code} " in text
    assert call("--version").stdout.startswith("aloft ")


def test_check_answers_at_once() -> None:
    # The promise is half a second. Processor time, as other tests run beside this one, and the
    # best of three.
    times = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        output, _ = start("check", str(ROOT / "graphs" / "jump.yaml")).communicate(timeout=60)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        assert "no problems" in output
    assert min(times) < 0.75
