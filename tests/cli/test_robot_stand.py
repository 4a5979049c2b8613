"""``aloft robot stand``: any robot stands or squats in its trial, straight from its file."""

from pathlib import Path

import pytest

from .conftest import Call, CallJson
from .test_jump import STICKS


@pytest.mark.long
def test_bruce_squats_and_is_recorded(folder: Path, call_json: CallJson) -> None:
    found = call_json("robot", "stand", "--squat", "5cm", "--seed", "3")
    assert found["success"] is True
    assert found["asked"] == {"squat_depth": 0.05, "push_speed": 0.0}
    assert found["metrics"]["squat_depth_m"] == pytest.approx(0.05, abs=0.01)
    assert (folder / "recordings" / "stand.rrd").stat().st_size > 100_000


@pytest.mark.long
def test_a_push_moves_it(folder: Path, call_json: CallJson) -> None:
    words = ("robot", "stand", "--no-record", "--trial", "nominal")
    still, pushed = (call_json(*words, *more) for more in ((), ("--push", "0.1m/s")))
    assert still["success"] and pushed["success"]
    assert still["run_hash"] != pushed["run_hash"]
    assert pushed["metrics"]["peak_tilt_deg"] > 2.0 * still["metrics"]["peak_tilt_deg"]


def test_what_keeps_a_robot_from_standing_is_said(folder: Path, call_json: CallJson) -> None:
    (folder / "stick.xml").write_text(STICKS.replace("<freejoint/>", ""))
    found = call_json("robot", "stand", "stick.xml", code=2)
    assert found["reason"].startswith("sticks cannot stand: its base is fixed")


def test_wrong_words_leave_with_exit_code_2(folder: Path, call: Call, call_json: CallJson) -> None:
    assert "the unit is missing" in call("robot", "stand", "--squat", "5", code=2).stderr
    assert (
        "expected such as --push 0.1m/s" in call("robot", "stand", "--push", "3 m", code=2).stderr
    )
    assert "no robot called" in call_json("robot", "stand", "--robot", "nobody", code=2)["reason"]
    assert call_json("robot", "stand", "a1", "--robot", "go2", code=2)["reason"] == (
        "two robots: a1 and --robot go2; name one"
    )
    assert (
        "leave out --seed" in call("robot", "stand", "--seeds", "0:2", "--seed", "3", code=2).stderr
    )
