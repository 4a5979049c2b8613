"""A graph that talks to ROS 2: it is recorded, and replayed without a network with the same bytes."""

from pathlib import Path
from typing import Any

import pytest
from tests.cli.conftest import run_here
from tests.needed import needs

import aloft

needs("rosbags")
GRAPH = """
rate: 100 Hz
duration: 1 s
clock: {{kind: paced}}
blocks:
  wave: {{use: blocks.SineWave, with: {{n: 3, unit: m/s}}}}
  turn: {{use: blocks.Constant, with: {{value: [0.0, 0.0, 0.2], unit: rad/s}}}}
  out:
    use: ros2.Publish
    with: {{topic: cmd_vel, type: geometry_msgs/msg/Twist, router: "{0}"}}
    in: {{message: {{linear: {{from: wave.y.value, frame: body}}, angular: {{from: turn.y.value, frame: body}}}}}}
  back:
    use: ros2.Subscribe
    with: {{topic: cmd_vel, type: geometry_msgs/msg/Twist, router: "{0}"}}
  gain: {{use: blocks.Gain, with: {{n: 3, gain: 2.0}}, in: {{u: back.message.angular}}}}
"""


@pytest.mark.long
def test_there_and_back_and_replayed(
    router: tuple[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = GRAPH.format(router[0]).replace("{from: wave.y.value, frame: body}", "wave.y.value")
    text = text.replace("{from: turn.y.value, frame: body}", "turn.y.value")
    (tmp_path / "graph.yaml").write_text(text)
    result = aloft.load("graph.yaml").run()
    assert result.success, result.reason
    received = result.signal("back.health.received")
    assert 5 < received[-1] <= 100
    assert result.signal("gain.y.value")[-1].tolist() == [0.0, 0.0, 0.4]
    assert result.metrics["sent"] >= received[-1]
    aloft.write_recording("run.rrd", result)
    router[1].close()
    assert "identical" in run_here("replay", "--check", "run.rrd").stdout
