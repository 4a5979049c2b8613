"""``aloft study``: rows, table, goals, exit codes, resuming after a kill, workers."""

import json
import os
import signal
import time
from pathlib import Path

import pytest
from pyarrow import parquet

from .conftest import Call, CallJson, Start

STUDY = """
graph: count.yaml
seeds: 1000:1004
arms: {low: {}, high: {counter.goal: 1101}}
grid: {stop: {counter.stop_at: [50, 100], shown: [0.5 s, 1 s]}}
goals: [{rate: 0.9, where: {arm: low}}, {rate: 0.5, where: {arm: high}}]
"""


@pytest.fixture
def study(folder: Path) -> Path:
    path = folder / "grid.yaml"
    path.write_text(STUDY)
    return path


def table_bytes(path: Path, folder: Path) -> bytes:
    """The table's file without the times that runs took."""
    table = parquet.read_table(path).drop_columns(["wall_time_s"])
    parquet.write_table(table, folder / "without.parquet")
    return (folder / "without.parquet").read_bytes()


def test_rows_goals_and_table(study: Path, folder: Path, call_json: CallJson) -> None:
    result = call_json("study", "grid.yaml", "--workers", "1")
    assert result["success"] is True
    assert result["reason"] == "14 of 16 runs succeeded; 4 of 4 goals met"
    assert result["seeds"] == [1000, 1001, 1002, 1003] and result["tuning_seeds"] == []
    last = result["rows"][-1]
    assert {"task": "count", "arm": "high", "stop_s": 1.0}.items() <= last.items()
    assert (last["n"], last["successes"], last["rate"], last["errors"]) == (4, 2, 0.5, 0)
    assert (last["goal"], last["met"], last["reasons"]) == (0.5, True, {"counted too far": 2})
    assert last["ci_low"] == pytest.approx(0.15004, abs=1e-4)
    assert last["ci_high"] == pytest.approx(0.84996, abs=1e-4)
    assert last["metrics"]["counter.last_count"]["median"] == 1101.5
    assert json.loads((folder / "results/grid/summary.json").read_text()) == result
    table = parquet.read_table(folder / "results/grid/runs.parquet")
    assert table.num_rows == 16
    assert table.column_names == [
        "task", "arm", "stop_s", "seed", "tuning_seed", "success", "reason", "error", "run_hash",
        "counter.last_count", "double.last_count", "wall_time_s",
    ]  # fmt: skip
    rows = table.to_pylist()
    assert [row["seed"] for row in rows[:5]] == [1000, 1001, 1002, 1003, 1000]
    assert rows[0]["counter.last_count"] == 1051.0 and len(rows[0]["run_hash"]) == 32


@pytest.mark.long
def test_arms_are_compared_over_equal_seeds(study: Path, call: Call, call_json: CallJson) -> None:
    result = call_json("study", "grid.yaml", "--workers", "1", "--detect", "10%")
    success, count = (each for each in result["comparisons"] if "double" not in each["metric"])
    assert {
        "axis": "arm", "base": "low", "other": "high", "metric": "success", "n": 4, "pairs": 8,
        "difference": -0.25, "p": 0.5, "only_base": 2, "only_other": 0, "detect": 0.1,
    }.items() <= success.items()  # fmt: skip
    assert success["ci_low"] < -0.25 < success["ci_high"] and success["seeds_needed"] > 50
    assert (count["metric"], count["difference"], count["p"]) == ("counter.last_count", 0.0, 1.0)
    said = call("study", "grid.yaml", "--compare", "stop").stdout
    assert "compared with 0.5 s, seed by seed" in said
    assert "counter.last_count" in said and "2 : 0" in said and "in the summary" not in said
    wrong = call_json("study", "grid.yaml", "--compare", "arms", code=2)
    assert wrong["reason"].endswith("axes of several values: arm, stop; did you mean arm?")
    wrong = call_json("study", "grid.yaml", "--detect", "a=b", code=2)
    assert "expected a difference of success rates" in wrong["reason"]


@pytest.mark.long
def test_a_missed_goal_a_broken_run_and_tuning_seeds(
    study: Path, call: Call, call_json: CallJson
) -> None:
    study.write_text(STUDY.replace("0.5, where", "0.6, where"))
    missed = call_json("study", "grid.yaml", code=1)
    assert missed["success"] is False and missed["rows"][-1]["met"] is False
    study.write_text(STUDY.replace("stop_at: [50", "fail_at: [50").replace("1004", "1001"))
    broken = call_json("study", "grid.yaml", code=3)
    assert broken["reason"].endswith("2 runs broke")
    assert "the spring broke" in next(iter(broken["rows"][0]["reasons"]))
    study.write_text(STUDY)
    quick = call("study", "grid.yaml", "--seeds", "999:1001")
    assert "1 of 2 seeds are tuning seeds (below 1000): no result to report" in quick.stderr
    assert "56.6%" not in quick.stdout and "34.2% to 100.0%" in quick.stdout


def test_a_wrong_study_is_refused_before_anything_runs(
    study: Path, folder: Path, call: Call, call_json: CallJson
) -> None:
    assert call_json("study", "grid.yaml", "--dry-run")["runs"] == 16
    study.write_text(STUDY.replace("counter.goal", "counter.gaol"))
    result = call_json("study", "grid.yaml", code=2)
    assert result["problems"][0]["nearest"] == ["goal"]
    assert (result["problems"][0]["file"], result["problems"][0]["line"]) == ("grid.yaml", 4)
    assert "grid.yaml:4:24" in call("study", "grid.yaml", code=2).stderr
    assert not (folder / "results").exists()


@pytest.mark.long
def test_killed_and_resumed_with_nothing_lost_or_made_twice(
    study: Path, folder: Path, call_json: CallJson, start: Start
) -> None:
    # enough runs that some are left when a busy machine lets this process see the third
    study.write_text(STUDY.replace("1000:1004", "1000:1015"))
    journal = folder / "results" / "grid" / "runs.jsonl"
    process = start("study", "grid.yaml", "--workers", "1")
    end = time.monotonic() + 240.0
    while time.monotonic() < end and process.poll() is None:
        if journal.is_file() and journal.read_bytes().count(b"\n") >= 3:
            break
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=240)
    # as if the kill had come in the middle of a line
    kept = journal.read_bytes().rpartition(b"\n")[0] + b"\n"
    journal.write_bytes(kept + kept[:40])
    before = kept.count(b"\n")
    assert 3 <= before < 60
    result = call_json("study", "grid.yaml", "--workers", "2", code=1)
    assert result["n"] == 60
    lines = journal.read_text().splitlines()
    assert len(lines) == 60 == len({json.loads(line)["key"] for line in lines})
    assert journal.read_bytes().startswith(kept)
    again = call_json("study", "grid.yaml", "--out", "fresh", "--workers", "1", code=1)
    assert {**again, "table": "", "worst": ""} == {**result, "table": "", "worst": ""}
    first, second = (folder / name / "runs.parquet" for name in ("results/grid", "fresh"))
    assert table_bytes(first, folder) == table_bytes(second, folder)
    assert table_bytes(first, folder) != table_bytes(first, folder)[:-1]


@pytest.mark.long
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_it_cleanly(
    study: Path, folder: Path, start: Start, number: signal.Signals, code: int
) -> None:
    study.write_text(STUDY.replace("1000:1004", "1000:1400"))
    process = start("study", "grid.yaml", "--workers", "1", "--json")
    journal = folder / "results" / "grid" / "runs.jsonl"
    end = time.monotonic() + 240.0
    while time.monotonic() < end and process.poll() is None:
        if journal.is_file() and journal.stat().st_size:
            break
        time.sleep(0.01)
    process.send_signal(number)
    output, errors = process.communicate(timeout=240)
    assert process.returncode == code, errors
    said = json.loads(output)
    assert said["done"] == journal.read_text().count("\n")
    assert said["reason"].startswith(f"stopped by {number.name} after {said['done']} of 1600 runs")


def test_two_at_once_do_not_share_a_folder(study: Path, folder: Path, call: Call) -> None:
    import fcntl

    (folder / "results" / "grid").mkdir(parents=True)
    with (folder / "results" / "grid" / "runs.jsonl").open("ab") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        text = call("study", "grid.yaml", code=2).stderr
    assert "another process works on results/grid; wait for it or give another --out" in text


TUNED = """
tune: {seeds: 5:7, draws: 6, where: {stop: 1 s}, set: {counter.goal: 108}}
"""


@pytest.mark.long
def test_tuning_writes_a_file_that_the_runs_take(
    study: Path, folder: Path, call: Call, call_json: CallJson
) -> None:
    ranges = "{set: {counter.goal: 1101}, tune: {double.goal: [1000, 1200]}}"
    text = STUDY.replace("{counter.goal: 1101}", ranges).replace("{}", "{counter.goal: 90}")
    study.write_text(text + TUNED)
    assert "run aloft tune grid.yaml" in call("study", "grid.yaml", code=2).stderr
    pytest.importorskip("optuna")
    said = call_json("tune", "grid.yaml", "--workers", "1")
    assert (said["draws_per_arm"], said["seeds"], said["errors"]) == (6, [5, 6], 0)
    assert said["arms"]["low"] == {"draw": 0, "successes": 0, "n": 2, "set": {}}
    assert said["arms"]["high"] == {"draw": 0, "successes": 2, "n": 2, "set": {}}
    # a part that was lost is made again, the rest is not, and the outcome is the same
    journal = folder / "results" / "grid" / "tuning.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    assert len(lines) == 2 + 6 * 2
    journal.write_bytes(b"".join(lines[:5]))
    text = (folder / "grid.tuned.yaml").read_text()
    assert call_json("tune", "grid.yaml", "--workers", "1") == said
    assert (folder / "grid.tuned.yaml").read_text() == text
    assert len(journal.read_bytes().splitlines()) == len(lines)
    result = call_json("study", "grid.yaml", "--workers", "1", code=1)
    assert result["tuned"] == {arm: found["set"] for arm, found in said["arms"].items()}


@pytest.mark.long
def test_optuna_proposes_and_a_lost_part_is_made_again(
    study: Path, folder: Path, call: Call, call_json: CallJson
) -> None:
    assert "grid.yaml has no section 'tune'" in call("tune", "grid.yaml", code=2).stderr
    pytest.importorskip("optuna")
    ranges = "{set: {counter.goal: 90}, tune: {counter.goal: [80, 120]}}"
    text = STUDY.replace("{counter.goal: 1101}", ranges).replace("{}", "{counter.goal: 90}")
    study.write_text(text + "tune: {seeds: 5:7, draws: 12, where: {stop: 1 s}, ranges: {}}\n")
    said = call_json("tune", "grid.yaml", "--workers", "1")
    assert (said["draws_per_arm"], said["seeds"], said["errors"]) == (12, [5, 6], 0)
    assert said["arms"]["low"] == {"draw": 0, "successes": 0, "n": 2, "set": {}}
    assert said["arms"]["high"]["successes"] == 2
    journal = folder / "results" / "grid" / "tuning.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    assert 20 <= len(lines) <= 2 + 12 * 2  # two draws may be the same
    journal.write_bytes(b"".join(lines[:9]))
    written = (folder / "grid.tuned.yaml").read_text()
    assert written.startswith("# What `aloft tune grid.yaml` found; its runs take it from here.")
    assert call_json("tune", "grid.yaml", "--workers", "1") == said
    assert (folder / "grid.tuned.yaml").read_text() == written
    assert len(journal.read_bytes().splitlines()) == len(lines)
    result = call_json("study", "grid.yaml", "--workers", "1", code=1)
    assert result["tuned"]["high"] == said["arms"]["high"]["set"]


@pytest.mark.long
def test_part_of_a_study_and_plots_that_cannot_be_drawn(
    study: Path, folder: Path, call: Call, call_json: CallJson
) -> None:
    study.write_text(
        f"{STUDY}plots:\n  rates: {{kind: dots}}\n  odd: {{kind: lines, x: stop, y: nothing}}\n"
    )
    options = ("study", "grid.yaml", "--where", "arm=high", "--where", "stop=1", "--workers", "1")
    result = call_json(*options, "--seeds", "1000")
    assert [(row["arm"], row["stop_s"]) for row in result["rows"]] == [("high", 1.0)]
    assert result["plots"] == {"rates": "results/grid/rates.svg"}
    assert (folder / "results/grid/rates.svg").read_text().endswith("</svg>\n")
    done = call(*options, "--seeds", "1000")
    assert "plot 'odd': no run has a metric 'nothing'" in done.stderr
    assert "axis 'arm' has no hgih" in call("study", "grid.yaml", "--where=arm=hgih", code=2).stderr


@pytest.mark.long
def test_the_worst_runs_are_listed_and_any_can_be_recorded(
    study: Path, folder: Path, call_json: CallJson, call: Call
) -> None:
    refused = call("study", "grid.yaml", "--open", "1", "--no-show", code=2)
    assert "run the study first: aloft study grid.yaml" in refused.stderr
    page = Path(call_json("study", "grid.yaml", "--workers", "1")["worst"])
    lines = (folder / page).read_text().splitlines()
    assert lines[2].startswith("2 of 16 runs did not succeed.")
    assert lines[6] == "| 1 | task count, arm high, stop_s 1.0, seed 1002 | counted too far |  |"
    opened = call_json("study", "grid.yaml", "--open", "1", "--no-show")
    assert opened["run"] == "task count, arm high, stop_s 1.0, seed 1002"
    assert (opened["run_succeeded"], opened["same_bytes"]) == (False, True)
    again = call_json("log", "info", opened["recording"])
    assert again["run_hash"] == opened["run_hash"]
    beyond = call("study", "grid.yaml", "--open", "17", "--no-show", code=2)
    assert "there is no run 17 in the list of the worst: it has 1 to 16" in beyond.stderr
    alone = call("study", "grid.yaml", "--no-show", code=2)
    assert "add --open N" in alone.stderr
