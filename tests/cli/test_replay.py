"""``aloft replay``: the verdict, the exit code, what differs, and both runs in one file."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import Call, CallJson, Start

GRAPH = """
rate: 100 Hz
duration: 3 s
blocks:
  wave: {use: blocks.SineWave, with: {n: 2, frequency: 3.0}}
  gain: {use: "gains:Gain", with: {n: 2, gain: 1.5}, in: {u: wave.y}}
  total: {use: blocks.Integrator, with: {n: 2}, in: {u: gain.y}}
"""
GAINS = """
import math
from aloft.blocks.general import arithmetic


class Gain(arithmetic.Gain):
    '''A gain.'''


class OneUlp(Gain):
    '''A gain that is wrong by one unit in the last place in tick 123.'''

    def step(self) -> None:
        super().step()
        if self.tick == 123:
            self.y.value[1] = math.nextafter(float(self.y.value[1]), math.inf)
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recording, made in a process with a hash seed of its own."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "wave.yaml").write_text(GRAPH)
    (folder / "gains.py").write_text(GAINS)
    subprocess.run(
        [sys.executable, "-m", "aloft", "run", "wave.yaml", "--quiet"],
        cwd=folder, check=True, timeout=240, env={**os.environ, "PYTHONHASHSEED": "7"},
    )  # fmt: skip
    return folder


@pytest.fixture
def recording(made: Path, folder: Path) -> Path:
    """The recording, in a folder that the test may change."""
    shutil.copytree(made, folder, dirs_exist_ok=True)
    return folder / "recordings" / "wave.rrd"


def test_the_same_bytes(recording: Path, call: Call, call_json: CallJson) -> None:
    done = call("replay", str(recording), "--check")
    assert "identical: every byte of 300 ticks from 0 on" in done.stdout
    for inputs in ("seed", "recorded"):  # above by what suits the recording
        answer = call_json("replay", str(recording), "--check", "--inputs", inputs)
        assert answer["success"] and answer["ticks"] == 300
        assert answer["first_difference"] is None and answer["fields"] == {}
    assert answer["keyframes"] == 3
    answer = call_json("replay", str(recording), "--check", "--from-tick", "250")
    assert answer["first_tick"] == 200 and answer["ticks"] == 100
    answer = call_json("replay", str(recording), "--until-tick", "50")
    assert answer["ticks"] == 50 and answer["success"]


def test_a_recording_that_was_cut_off_is_said_to_be(recording: Path, call: Call) -> None:
    from aloft.logs.file.reader import read
    from aloft.logs.file.records import Content

    rows = read(recording).scan.of(Content.ROWS)
    recording.write_bytes(recording.read_bytes()[: rows[-1].end + 20])
    last = rows[-1].last
    text = call("replay", str(recording), "--check").stdout
    assert f"every byte of {last + 1} ticks" in text.replace("\n", " ")
    assert f"the recording was cut off after tick {last}" in text.replace("\n", " ")


@pytest.mark.long
def test_code_that_changed_by_one_ulp(recording: Path, call: Call, start: Start) -> None:
    source = recording.parent.parent / "gains.py"
    swapped = GAINS.replace("class Gain", "class Base").replace("(Gain)", "(Base)")
    source.write_text(swapped.replace("class OneUlp", "class Gain"))
    process = start("replay", str(recording), "--check", "--trust", PYTHONHASHSEED="8")
    output, errors = process.communicate(timeout=240)
    assert process.returncode == 1
    assert "differs first at tick 123: block 'gain': gain.y.value[1] was " in errors
    assert ", 1 ULP apart" in errors
    assert "gain.y.value" in output and "wave.y.value" not in output


def test_a_swapped_block_beside_the_recorded_one(
    recording: Path, call: Call, call_json: CallJson
) -> None:
    answer = call_json("replay", str(recording), "--check", "--swap", "gain=gains:OneUlp", code=1)
    first = answer["first_difference"]
    assert (first["tick"], first["block"], first["place"]) == (123, "gain", "gain.y.value[1]")
    assert first["ulps"] == 1 and answer["differing_elements"] == 1 and answer["ran"] == ["gain"]
    assert Path(answer["output"]) == recording.with_name("wave-replay.rrd")
    assert recording.with_name("wave-replay.rrd").stat().st_size > 0
    done = call("replay", str(recording), "--set", "gain.gain=1.75", "--out", "both.rrd")
    assert "recorded and replayed side by side: both.rrd" in done.stdout
    row = next(line.split() for line in done.stdout.splitlines() if "gain.y.value" in line)
    assert row[1] == "0.25"  # the wave's peak is one
    assert "differs first at tick 1: block 'gain'" in done.stdout


def test_what_is_refused(recording: Path, folder: Path, call_json: CallJson) -> None:
    def reason(*arguments: str) -> str:
        return str(call_json("replay", *arguments, code=2)["reason"])

    name = str(recording)
    assert reason("none.rrd") == "there is no recording none.rrd"
    assert reason(name, "--swap", "gian=gains:OneUlp") == (
        "the recorded graph has no block 'gian'; it has total, wave, gain"
    )
    assert reason(name, "--swap", "gain") == (
        "'gain' changes nothing; write --swap block=mypkg:MyBlock"
    )
    assert reason(name, "--set", "rate=3") == (
        "'rate=3' changes nothing; write --set block.parameter=value"
    )
    assert "has no class 'Gian'" in reason(name, "--swap", "gain=gains:Gian")
    assert "1 problem" in reason(name, "--set", "gain.gain=high")
    assert "tick 300 is not in the recording" in reason(name, "--from-tick", "300")
    assert (
        "--from-tick 70 --until-tick 60 is no stretch of the run: the end must lie behind"
        in reason(name, "--from-tick", "70", "--until-tick", "60")
    )
    (folder / "other.rrd").write_bytes(b"RRF2 nothing")
    assert "other.rrd is not a recording: Rerun cannot read it" in reason("other.rrd")
