"""``aloft explain`` on the command line."""

import pytest
from tests.cli.conftest import run_for_json, run_here


@pytest.fixture(scope="module")
def fall(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = str(tmp_path_factory.mktemp("explain") / "fall.rrd")
    run_here("run", "graphs/push.yaml", "--set", "push.force=200", "--record", path, "-q", code=1)
    return path


@pytest.mark.long
def test_the_first_deviation_of_a_recording(fall: str) -> None:
    told = run_for_json("explain", fall)
    assert told["success"] is False
    assert told["reason"].startswith("fell at")
    assert (told["cause"]["kind"], told["cause"]["text"]) == ("world", "push: 200 N")
    assert told["cause"] == told["chain"][0]
    assert {contact["point"] for contact in told["contacts"]} >= {"left_toe", "right_heel"}
    text = run_here("explain", fall).stdout
    assert "first deviation at 1.188 s: push: 200 N" in text
    assert "False and missed contacts" in text


def test_what_cannot_be_explained() -> None:
    assert "there is no recording none.rrd" in run_here("explain", "none.rrd", code=2).stderr
