"""``aloft branch`` on the command line."""

from pathlib import Path

import pytest
from tests.cli.conftest import run_for_json, run_here

TEXT = """
rate: 100 Hz
duration: 2 s
blocks:
  r: {use: blocks.Constant, with: {value: [1.0]}}
  pid: {use: blocks.PID, with: {kp: 2.0, unit: 1/s}, in: {setpoint: r.y, measured: x.y}}
  x: {use: blocks.Integrator, in: {u: pid.u}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A graph and its recording."""
    made = tmp_path_factory.mktemp("branch")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        Path("graph.yaml").write_text(TEXT)
        run_here("run", "graph.yaml", "--record", "run.rrd", "--quiet")
    return made


@pytest.fixture
def recording(folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(folder)
    return "run.rrd"


@pytest.mark.long
def test_the_same_parameters_and_others(recording: str) -> None:
    same = run_for_json("branch", recording, "--at", "0.5")
    assert same["reason"] == "as recorded, every byte of 150 ticks"
    told = run_for_json("branch", recording, "--at", "0.5", "--set", "pid.kp=4", "-o", "both.rrd")
    assert (told["first_tick"], told["first_difference"]["tick"]) == (50, 50)
    assert told["first_difference"]["place"] == "pid.u.value[0]"
    # the error is 0.98^50, and x+ = x + T kp e
    assert told["fields"]["pid.u.value"]["largest"] == pytest.approx(2.0 * 0.98**50)
    assert Path("both.rrd").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["run.rrd", "--at", "9"], "tick 900 lies not within the recording: it has 0 to 199"),
        (["run.rrd", "--at", "0.5", "--set", "pid.kq=1"], "has no parameter 'kq'"),
        (["none.rrd", "--at", "0.5"], "there is no recording none.rrd"),
    ],
)
def test_what_cannot_be_branched(recording: str, arguments: list[str], text: str) -> None:
    assert text in run_here("branch", *arguments, code=2).stderr
