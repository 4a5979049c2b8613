"""The files that ``aloft new`` writes."""

from __future__ import annotations

BLOCK = '''\
"""{title}."""

from __future__ import annotations

from aloft import (
    Block,
    Field,
    Input,
    Output,
    Parameters,
    Signal,
    State,
    kernel,
    live_parameter,
    parameter,
)


class {name}Signal(Signal):
    """A vector; give it the unit and the frame of your numbers."""

    value = Field("n", unit="", text="the numbers")


class {name}(Block):
    """A low-pass filter of the first order, as a start: y[k] = y[k-1] + share (u[k] - y[k-1])."""

    class Params(Parameters):
        n: int = parameter(1, ge=1, text="elements")
        share: float = live_parameter(0.1, gt=0.0, le=1.0, text="of the way to the input per run")

    params: Params
    u = Input({name}Signal, text="the signal to filter")
    y = Output({name}Signal, text="the filtered numbers")
    x = State({name}Signal, text="the output of the run before")

    @kernel  # runs as machine code; plain Python, for libraries, takes self instead
    @staticmethod
    def step(u: {name}Signal, y: {name}Signal, x: {name}Signal, params: Params) -> None:
        """Go a share of the way to the input."""
        x.value[:] = x.value + params.share * (u.value - x.value)
        y.value[:] = x.value
'''

TEST_BLOCK = '''\
"""{name} by itself: its values, and what every block promises."""

import pytest
from {module} import {name}

from aloft.runtime.testing import BlockBench
from aloft.runtime.testing.conformance import check_block


def test_values() -> None:
    bench = BlockBench({name}, {{"n": 2, "share": 0.5}})
    bench.set("u", value=[1.0, -2.0])
    bench.step()
    assert bench.get("y").value == pytest.approx([0.5, -1.0])
    bench.step()
    assert bench.get("y").value == pytest.approx([0.75, -1.5])


def test_what_every_block_promises() -> None:
    check_block({name})
'''

GRAPH = """\
# yaml-language-server: $schema=graph.schema.json
#
#   aloft check {file}
#   aloft graph {file} --web
#   aloft run {file} --set loop_rate.gain=3
rate: 100 Hz
duration: 3 s
blocks:
  setpoint:  {{use: blocks.Step, with: {{at: 0.5 s, after: 1 m}}}}
  error:     {{use: blocks.Sum, with: {{weights: [1, -1]}}, in: {{a: setpoint.y, b: position.y}}}}
  loop_rate: {{use: blocks.Gain, with: {{gain: 4.0, unit: 1/s}}, in: {{u: error.y}}}}
  position:  {{use: blocks.Integrator, in: {{u: loop_rate.y}}}}
"""

PROJECT_GRAPH = """\
# yaml-language-server: $schema=graph.schema.json
#
#   aloft run graph.yaml
rate: 100 Hz
duration: 3 s
blocks:
  wave:   {{use: blocks.SineWave, with: {{amplitude: 1.0, frequency: 0.5}}}}
  smooth: {{use: "{module}:{name}", with: {{share: 0.2}}, in: {{u: wave.y}}}}
  watch:  {{use: blocks.Assertion, with: {{lower: -1.0, upper: 1.0}}, in: {{u: smooth.y}}}}
"""

TEST_GRAPH = '''\
"""The graph runs to its end, and the wave is smaller behind the filter."""

from pathlib import Path

import numpy as np

import aloft


def test_graph() -> None:
    result = aloft.load(Path(__file__).parent / "graph.yaml").run()
    assert result.success, result.reason
    before, behind = (result.signal(f"{name}.y.value") for name in ("wave", "smooth"))
    assert np.abs(behind[100:]).max() < np.abs(before[100:]).max()
'''

README = """\
# {title}

A graph of blocks for aloft.

    aloft check graph.yaml        # everything that is wrong, at once
    aloft graph graph.yaml --web  # the block diagram in the browser
    aloft run graph.yaml          # writes recordings/graph.rrd
    aloft view recordings/graph.rrd
    pytest                        # the tests; pip install pytest

| file | what it is |
|---|---|
| `graph.yaml` | the graph; `graph.schema.json` lets editors complete it, `.vscode/settings.json` tells VS Code so |
| `{module}.py` | a block of your own |
| `test_{module}.py`, `test_graph.py` | the tests of both |

`aloft new block Name` adds a block with its test; `aloft blocks` lists those that are there.
"""

EDITOR = """\
{
  "yaml.schemas": {"./graph.schema.json": ["graph.yaml"]}
}
"""

IGNORE = "recordings/\n__pycache__/\n.pytest_cache/\n"

ROBOT_MODEL = """\
<mujoco model="{name}">
  <!-- A pendulum of half a metre with a motor in its hinge. Joint angle zero hangs down. -->
  <compiler angle="radian"/>
  <worldbody>
    <body name="stand">
      <geom type="box" size="0.1 0.1 0.02" mass="2.0"/>
      <body name="arm">
        <joint name="hinge" type="hinge" axis="0 1 0" range="-2 2" damping="0.02"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.015" mass="0.4"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="hinge" ctrlrange="-4 4"/>
  </actuator>
</mujoco>
"""

ROBOT = """\
# What {name}.xml cannot say: which sensors there are, and how fast the motor turns [rad/s].
# `aloft robot show {name}.xml` prints the robot and what is missing.
sensors: {{imu: false, switches: false}}
profiles:
  motor: {{corner_speed: 15.0, no_load_speed: 25.0}}
standing: {{hinge: 0.3}}
"""

ROBOT_GRAPH = """\
# The drives hold the hinge at 0.5 rad: stiffness and damping in the motor, gravity in the model.
rate: 500 Hz
duration: 3 s
robot: {name}.xml
blocks:
  robot:
    use: hal.MujocoRobot
    with: {{ground: {{scene: none}}}}
    in:
      command: {{{command}}}
"""

TEST_ROBOT = '''\
"""The robot is read without faults, and its drives bring the hinge near 0.5 rad."""

from pathlib import Path

import pytest

import aloft


def test_the_hinge_is_held() -> None:
    result = aloft.load(Path(__file__).parent / "{name}_hold.yaml").run()
    assert result.success, result.reason
    assert result.signal("robot.joints.position")[-1] == pytest.approx([0.5], abs=0.05)
'''
