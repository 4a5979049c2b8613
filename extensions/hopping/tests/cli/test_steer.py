"""``aloft steer`` takes commands from a file, and says what is wrong with one."""

from pathlib import Path

import pytest
from tests.cli.conftest import run_for_json, run_here

from aloft.extensions.hopping.planner import hop_plans, make_samples


@pytest.mark.long
def test_commands_of_a_file_are_followed(tmp_path: Path) -> None:
    file = tmp_path / "course.yaml"
    file.write_text("- {ahead: 10 cm, turn: 15 deg}\n")
    done = run_for_json("steer", "--commands", str(file), "--no-record")
    assert done["metrics"]["jumps"] == 1
    assert done["metrics"]["worst_place_error_m"] < 0.03


@pytest.mark.long
def test_any_robot_is_steered_once_its_hops_are_planned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With Go2 as if none of its hops shipped, and few of them."""
    monkeypatch.setattr(hop_plans, "SHIPPED", tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    monkeypatch.setattr(make_samples, "COUNT", 16)
    file = tmp_path / "course.yaml"
    file.write_text("- {ahead: 6 cm, turn: 10 deg}\n")
    command = ("steer", "--robot", "go2", "--commands", str(file), "--no-record")
    assert (
        "no stored plans of hops for go2"
        in run_here("check", "aloft:hopping/robots/steer", code=2).stderr
    )
    done = run_for_json(*command)
    assert done["metrics"]["jumps"] == 1 and done["metrics"]["plans_planned"] == 1
    assert done["metrics"]["worst_place_error_m"] < 0.03
    (kept,) = (tmp_path / "own").rglob("hops/go2-*/level.npz")
    written = kept.stat().st_mtime_ns
    assert run_for_json(*command)["run_hash"] == done["run_hash"]
    assert kept.stat().st_mtime_ns == written


def test_a_graph_and_a_robot_contradict_each_other() -> None:
    shown = run_here("steer", "mine.yaml", "--robot", "go2", "--no-record", code=2).stderr
    assert "mine.yaml names its robot: leave out --robot, or --set robot=go2" in shown


def test_what_is_no_list_of_commands_is_refused(tmp_path: Path) -> None:
    def reason(text: str | None) -> str:
        file = tmp_path / "course.yaml"
        file.unlink(missing_ok=True)
        if text is not None:
            file.write_text(text)
        return run_here("steer", "--commands", str(file), "--no-record", code=2).stderr

    assert "cannot read" in reason(None)
    assert "has no list of commands" in reason("ahead: 10 cm")
    assert "is no YAML" in reason("[{ahead: 1")
    wrong = reason("[{ahed: 10 cm}]")
    assert "ahed" in wrong and "ahead" in wrong
    assert "500 m" in reason("[{ahead: 500 m}]")


@pytest.mark.long
def test_without_a_terminal_it_asks_for_a_file() -> None:
    shown = run_here("steer", "--no-record", code=3).stderr
    assert "standard input is no terminal" in shown
    assert "--commands FILE" in shown
