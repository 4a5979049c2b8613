"""``aloft falsify``: the search, the simplest failure as a graph, the test that is kept, errors."""

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.needed import needs

import aloft

needs("optuna")

Call = Callable[..., subprocess.CompletedProcess[str]]
CallJson = Callable[..., dict[str, Any]]

STUDY = """
graph: count.yaml
seeds: 1000
set: {counter.goal: 5000}
falsify:
  draws: 20
  margin: {counter.last_count: [0, 1100]}
  ranges: {counter.goal: [1090, 5000], double.goal: [1090, 5000]}
"""


@pytest.fixture
def study(folder: Path) -> Path:
    path = folder / "count_far.yaml"
    path.write_text(STUDY)
    return path


@pytest.mark.long
def test_a_failure_is_found_made_simple_kept_and_found_again(
    study: Path, folder: Path, call: Call, call_json: CallJson
) -> None:
    (folder / "tests").mkdir()
    said = call_json(
        "falsify", "count_far.yaml", "--workers", "2", "--draws", "40", "--keep", code=1
    )
    assert (said["success"], said["method"], said["draws"]) == (False, "tpe", 40)
    assert said["reason"] == f"{said['failures']} of 40 draws failed" and said["failures"] >= 1
    assert said["runs"] == 40 and said["runs_to_simplify"] > 0
    assert said["progress"][-1]["draw"] == said["worst"]["draw"] >= said["first_failure"] > 0
    simplest = said["simplest"]
    (key,) = simplest["set"]  # one of the two goals is enough, and the other is the graph's
    assert 1040 < simplest["set"][key] < 1100 and simplest["reason"] == "counted too far"
    assert simplest["same_bytes"] is True and simplest["seed"] == 1000
    kept = folder / simplest["graph_file"]
    assert kept == folder / "tests/count_far_falsified.yaml"
    result = aloft.load(kept).run(log=False)
    assert not result.success and result.run_hash == simplest["run_hash"]
    tested = call_json("test", simplest["test"], code=1)
    assert tested["pytest_exit_code"] == 1
    journal = folder / "results/count_far/falsify.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:7]))
    again = call_json("falsify", "count_far.yaml", "--workers", "1", "--draws", "40", code=1)
    assert again["worst"] == said["worst"]
    assert again["simplest"]["set"] == simplest["set"]
    assert len(journal.read_bytes().splitlines()) == len(lines)
    there = call("falsify", "count_far.yaml", "--draws", "40", "--keep", code=2).stderr
    assert "test_count_far_falsified.py is there already" in there


@pytest.mark.long
def test_nothing_fails(study: Path, call: Call, call_json: CallJson) -> None:
    study.write_text(STUDY.replace("1090", "1200").replace("20", "4", 1))
    said = call_json("falsify", "count_far.yaml", "--random", "--seed", "3", "--workers", "1")
    assert (said["success"], said["method"], said["seed"]) == (True, "random", 3)
    assert said["reason"] == "0 of 4 draws failed; the least margin is 1e-06"
    assert said["simplest"] is None and said["first_failure"] is None
    study.write_text(STUDY.replace("5000}", "1000}", 1))
    said = call_json("falsify", "count_far.yaml", "--workers", "1", code=1)
    assert said["reason"] == "the graph fails as it is written" and said["draws"] == 1
    assert said["simplest"]["set"] == {}


def test_what_is_refused(study: Path, folder: Path, call_json: CallJson) -> None:
    def reason(*options: str) -> str:
        return str(call_json("falsify", "count_far.yaml", *options, code=2)["reason"])

    assert reason("--test", "test_a.py") == "--test goes with --keep"
    study.write_text(STUDY.replace("falsify:\n", "falsify:\n  where: {task: []}\n"))
    problems = call_json("falsify", "count_far.yaml", code=2)["problems"]
    assert problems[0]["expected"] == "at least one value"
    study.write_text(STUDY.partition("falsify:")[0])
    assert reason().endswith("count_far.yaml has no section 'falsify'")
    study.write_text(STUDY.replace("double.goal", "double.gaol"))
    problems = call_json("falsify", "count_far.yaml", code=2)["problems"]
    assert problems[0]["nearest"] == ["goal"]
    assert not (folder / "results").exists()
