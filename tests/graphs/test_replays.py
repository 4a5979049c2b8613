"""Every kind of graph, recorded in one process, is the same to the last bit in another one.

The two processes have different hash seeds; recording and replay go through a file.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import aloft
from aloft.logs.replay.replay import KeptRun, Keyframes, replay
from aloft.runtime.running.executor import Executor

from ..shipped import kinds

GRAPHS = Path(aloft.__file__).parent / "graphs"
NEED_DRIVES = ("jump_robot", "bring_up_stand", "bring_up_hop")
NEED_A_TERMINAL = ("steer_by_keys",)
NEED_A_PAD = ("steer_by_gamepad", "steer_by_ros2")
ELSEWHERE = NEED_DRIVES + NEED_A_TERMINAL + NEED_A_PAD
EXAMPLES = [path for path in kinds().values() if path.stem not in ELSEWHERE]
SHORT = 0.1
"""Seconds of each graph: the replay takes another process, and bytes differ early or never."""

RECORD = """
import sys
from pathlib import Path
import aloft

for graph, file in zip(sys.argv[1::2], sys.argv[2::2]):
    result = aloft.load(graph).run({duration})
    aloft.write_recording(file, result)
"""
REPLAY = """
import sys
from pathlib import Path
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import replay

for graph, file in zip(sys.argv[1::2], sys.argv[2::2]):
    for inputs in ("seed", "recorded"):
        done = replay(OpenedRun.of(file), inputs=inputs)
        print(Path(graph).name, inputs, done.identical, done.signals.compared, done.first)
"""


def run_python(code: str, arguments: list[str], hash_seed: str) -> str:
    """Run code in a process with that hash seed; what it prints."""
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=1800, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
def test_every_kind_of_graph_under_another_hash_seed(tmp_path: Path) -> None:
    files = [
        tmp_path / f"{number}.rrd" for number in range(len(EXAMPLES))
    ]  # two may be called alike
    arguments = [str(path) for pair in zip(EXAMPLES, files, strict=True) for path in pair]
    run_python(RECORD.format(duration=SHORT), arguments, "1")
    lines = run_python(REPLAY, arguments, "2").splitlines()
    ticks = [(graph.name, round(SHORT * aloft.load(graph).checked.base_rate)) for graph in EXAMPLES]
    assert lines == [
        f"{name} {inputs} True {count} None"
        for name, count in ticks
        for inputs in ("seed", "recorded")
    ]


@pytest.fixture(scope="module")
def jump() -> KeptRun:
    """The whole jump, with a keyframe in the thrust and one in the landing."""
    keyframes = Keyframes(500)
    result = Executor(aloft.load(GRAPHS / "jump.yaml").checked, sinks=[keyframes]).run()
    return KeptRun.of(result, keyframes)


def test_the_jump_from_a_keyframe_is_the_jump_from_the_beginning(jump: KeptRun) -> None:
    part = replay(jump, first_tick=730, keep=True)
    assert part.first_tick == 500 and part.identical and part.states.compared >= 1
    assert part.rows.tobytes() == jump.all_rows[500:].tobytes()
    alone = replay(jump, run=["wbc", "estimator"], first_tick=1000)
    assert alone.identical and alone.ran == ("estimator", "wbc")
