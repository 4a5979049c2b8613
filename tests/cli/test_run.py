"""``aloft run``: metrics, JSON, exit codes, seeds, recordings, signals."""

import json
import signal
import sys
import time
from pathlib import Path

import pytest

from .conftest import Call, CallJson, Start


def test_run_prints_metrics_times_and_verdict(folder: Path, call: Call) -> None:
    done = call("run", "count.yaml")
    for text in (
        "counter.last_count",
        "105",
        "100 ticks, 1.000 s",
        "recording: recordings/count.rrd; to see it:",
        "success: ran to its end",
    ):
        assert text in done.stdout
    assert "median [us]" not in done.stdout
    assert "median [us]" in call("run", "count.yaml", "-v", "--no-record").stdout
    assert (folder / "recordings" / "count.rrd").stat().st_size > 0


def test_run_json_has_the_promised_keys(folder: Path, call_json: CallJson) -> None:
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


@pytest.mark.long
def test_the_hash_is_the_same_everywhere(folder: Path, call_json: CallJson, start: Start) -> None:
    here = {
        call_json("run", "count.yaml", "--set", "double.seed=5", *options)["run_hash"]
        for options in (["--no-record"], ["--record", "a.rrd"], ["--quiet", "--no-record"])
    }
    for hash_seed in ("0", "1"):
        options = ("run", "count.yaml", "--json", "--no-record", "--set", "double.seed=5")
        output, _ = start(*options, PYTHONHASHSEED=hash_seed).communicate(timeout=240)
        here.add(json.loads(output)["run_hash"])
    here.add(call_json("run", "count.yaml", "--seeds", "5")["rows"][0]["run_hash"])
    assert len(here) == 1


def test_a_warning_is_printed_even_where_all_else_is_quiet(folder: Path, call: Call) -> None:
    setting = ("--set", "counter.warning=counted by hand")
    done = call("run", "count.yaml", "--quiet", "--no-record", *setting)
    assert "warning: counter: counted by hand" in done.stderr


def test_quiet_prints_the_verdict_only(folder: Path, call: Call) -> None:
    assert call("run", "count.yaml", "--quiet", "--no-record").stdout == "success: ran to its end\n"


def test_duration(folder: Path, call_json: CallJson) -> None:
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
def test_exit_codes_of_a_run(
    folder: Path, setting: str, code: int, reason: str, call: Call, call_json: CallJson
) -> None:
    recorded = "nan_at" in setting  # what failed is what one wants to look at
    options = () if recorded else ("--no-record",)
    result = call_json("run", "count.yaml", "--set", setting, *options, code=code)
    assert result["success"] is (code == 0)
    assert result["exit_code"] == code
    assert result["reason"].startswith(reason)
    assert not recorded or (folder / str(result["recording"])).is_file()
    done = call("run", "count.yaml", "--set", setting, "--no-record", code=code)
    assert f"success: {reason}" in done.stdout + done.stderr


@pytest.mark.long
def test_seeds_give_a_row_each_in_order(folder: Path, call: Call, call_json: CallJson) -> None:
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
def test_seeds_that_are_none(folder: Path, seeds: str, call_json: CallJson) -> None:
    assert f"seeds '{seeds}'" in call_json("run", "count.yaml", "--seeds", seeds, code=2)["reason"]


def test_seeds_need_a_parameter_called_seed(folder: Path, call_json: CallJson) -> None:
    (folder / "plain.yaml").write_text(
        "rate: 10 Hz\nduration: 1 s\nblocks:\n  c: {use: blocks.Constant, with: {value: [1]}}\n"
    )
    result = call_json("run", "plain.yaml", "--seeds", "0:2", code=2)
    assert result["reason"] == "graph plain has no parameter called seed"


def test_seeds_are_not_recorded(folder: Path, call: Call, call_json: CallJson) -> None:
    result = call_json("run", "count.yaml", "--seeds", "0:2", "--record", "a.rrd", code=2)
    assert result["reason"].startswith("--record is for one run")
    call("run", "count.yaml", "--seeds", "0")
    assert not (folder / "recordings").exists()


def test_a_recording_that_cannot_be_written_ends_in_an_error(
    folder: Path, call: Call, call_json: CallJson
) -> None:
    (folder / "file").write_text("")
    done = call("run", "count.yaml", "--record", "file/count.rrd", code=4)
    assert "warning: no recording: file/count.rrd cannot be written" in done.stderr
    assert "success: ran to its end" in done.stdout
    last = done.stderr.splitlines()[-1]
    assert last.startswith("error: no recording: file/count.rrd cannot be written (")
    assert last.endswith("; --record FILE writes elsewhere, --no-record writes none")
    result = call_json("run", "count.yaml", "--record", "file/count.rrd", code=4)
    assert result["recording"] is None and result["success"] is True
    assert f"error: {result['recording_problem']}" == last


def test_without_rerun_a_run_goes_on(
    folder: Path, monkeypatch: pytest.MonkeyPatch, call: Call
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    done = call("run", "count.yaml", code=4)
    assert "error: no recording: Rerun cannot be imported; pip install rerun-sdk" in done.stderr
    assert "success: ran to its end" in done.stdout
    assert call("run", "count.yaml", "--no-record").stderr == ""


def test_a_signal_stops_a_run_cleanly(folder: Path, start: Start) -> None:
    graph = (folder / "count.yaml").read_text()
    graph = graph.replace("duration: 1 s\n", "clock: {kind: paced}\n")
    (folder / "endless.yaml").write_text(graph)
    leave_a_sign(folder)
    process = start("run", "endless.yaml", "--json")
    wait_for_the_sign(folder)
    process.send_signal(signal.SIGTERM)
    output, errors = process.communicate(timeout=240)
    assert process.returncode == 143, output + errors
    result = json.loads(output)
    assert result["success"] is False
    assert result["reason"] == "stopped by SIGTERM"
    assert result["ticks"] > 0
    assert (folder / result["recording"]).is_file()


def leave_a_sign(folder: Path) -> None:
    """Let the counter write a file when it runs."""
    block = (folder / "counter.py").read_text()
    sign = "        open('running', 'w').close()\n        self.count.value += 1.0"
    (folder / "counter.py").write_text(block.replace("        self.count.value += 1.0", sign))


def wait_for_the_sign(folder: Path) -> None:
    deadline = time.monotonic() + 240.0
    while not (folder / "running").exists() and time.monotonic() < deadline:
        time.sleep(0.01)


@pytest.mark.long
def test_a_signal_stops_all_seeds(folder: Path, start: Start) -> None:
    graph = (folder / "count.yaml").read_text()
    graph = graph.replace("duration: 1 s\n", "clock: {kind: paced}\n")
    (folder / "endless.yaml").write_text(graph)
    leave_a_sign(folder)
    process = start("run", "endless.yaml", "--seeds", "0:4", "--json")
    wait_for_the_sign(folder)
    process.send_signal(signal.SIGTERM)
    output, errors = process.communicate(timeout=240)  # also ends only when the workers have
    assert process.returncode == 143, output + errors
    assert json.loads(output)["reason"] == "stopped by SIGTERM after 0 of 4 seeds"
    assert "Traceback" not in errors


@pytest.mark.long
def test_a_signal_between_two_runs_stops_all_seeds(folder: Path, start: Start) -> None:
    """Short runs: a worker is then most of the time waiting for work, loading or setting up."""
    leave_a_sign(folder)
    process = start("run", "count.yaml", "--seeds", "0:4000", "--json")
    wait_for_the_sign(folder)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=240)
    assert process.returncode == 130, output + errors
    assert json.loads(output)["reason"].startswith("stopped by SIGINT after ")
    assert "Traceback" not in errors


def test_a_block_that_raises_is_placed_in_the_users_file(
    folder: Path, call: Call, call_json: CallJson
) -> None:
    block = (folder / "counter.py").read_text()
    helper = "\n\ndef look_up():\n    return [1, 2][5]\n"
    changed = block.replace("        self.count.value += 1.0", "        look_up()")
    (folder / "counter.py").write_text(changed + helper)
    line = len((changed + helper).splitlines())
    place = f"{folder / 'counter.py'}:{line}"
    data = call_json("run", "count.yaml", code=3)
    assert data["error"]["where"] == place
    assert data["error"]["block"] == "counter"
    assert "in look_up" in data["error"]["traceback"]
    notes = call_json("log", "info", data["recording"])["notes"]
    (fault,) = [note for note in notes if note["kind"] == "fault"]
    assert fault["text"].endswith(f"IndexError: list index out of range (at {place})")
    short = call("run", "count.yaml", "--no-record", code=3).stderr
    assert f"raised at {place}" in short
    assert "Traceback" not in short
    whole = call("run", "count.yaml", "--no-record", "--traceback", code=3).stderr
    assert "Traceback (most recent call last)" in whole
    assert "return [1, 2][5]" in whole
