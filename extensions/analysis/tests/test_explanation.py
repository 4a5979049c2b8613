"""Why a run failed: every injected cause must be the first that is named."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.extensions.analysis import Explanation, explain
from aloft.extensions.analysis.deviations import Deviation, mean, stretches
from aloft.extensions.analysis.explanation import chain_to
from aloft.logs.replay.replay import KeptRun, Keyframes
from aloft.runtime.language.errors import AloftError

JUMP, AHEAD, PUSH = "graphs/jump.yaml", "graphs/forward_20cm.yaml", "graphs/push.yaml"
Settings = Mapping[str, Any]


def explained(graph: str, settings: Settings) -> Explanation:
    keyframes = Keyframes(250)
    result = aloft.load(graph, dict(settings)).run(sinks=[keyframes], log=True)
    return explain(KeptRun.of(result, keyframes), result.to_json())


def box(x: float, y: float, top: float) -> Settings:
    """A box as high as ``top`` from ``x`` and from ``y`` on."""
    return {"robot.ground.scene": {"boxes": [{"x": [x, 0.6], "y": [y, 0.5], "top": top}]}}


def link(kind: str, name: str, begin: float, end: float) -> Deviation:
    return Deviation(kind, name, begin, end, "", 1.0, begin, 0.5, "mm")  # type: ignore[arg-type]


def test_the_chain_goes_back_from_the_end_and_leaves_out_what_was_over_long_before() -> None:
    old, cause = link("world", "old", 0.0, 0.1), link("world", "push", 1.0, 1.1)
    later, last = link("estimate", "tilt", 1.2, 2.0), link("body", "fall", 1.9, 2.1)
    assert chain_to(2.1, [old, cause, later, last]) == [cause, later, last]
    assert chain_to(2.1, [old, later, last]) == [later, last]


def test_of_what_begins_together_the_disturbance_is_the_cause() -> None:
    links = (link("estimate", "tilt", 1.0, 2.0), link("world", "ground", 1.015, 2.0),
             link("world", "late", 1.5, 2.0))  # fmt: skip
    found = Explanation(False, "", 2.0, links, (), ())
    assert found.cause is not None
    assert found.cause.name == "ground"


def test_stretches_and_means() -> None:
    beyond = np.array([0, 1, 1, 0, 1, 0, 0, 0, 1], bool)
    assert list(stretches(beyond)) == [(1, 2), (4, 4), (8, 8)]
    assert list(stretches(beyond, gap=1)) == [(1, 4), (8, 8)]
    assert mean(np.array([0.0, 3.0, 6.0, 0.0]), 3).tolist() == [1.5, 3.0, 3.0, 3.0]


def test_a_run_without_truth_is_refused(tmp_path: Path) -> None:
    text = "rate: 100 Hz\nduration: 0.1 s\nblocks:\n  r: {use: blocks.Constant, with: {value: [1.0]}}\n"
    keyframes = Keyframes(10)
    (tmp_path / "graph.yaml").write_text(text)
    result = aloft.load(tmp_path / "graph.yaml").run(sinks=[keyframes], log=True)
    with pytest.raises(AloftError, match="no output of the type RobotTruth"):
        explain(KeptRun.of(result, keyframes), result.to_json())


@pytest.mark.long
def test_a_push_is_named_and_what_it_did() -> None:
    found = explained(PUSH, {"push.force": 200.0})
    assert found.cause is not None
    assert (found.cause.kind, found.cause.name, found.cause.size) == ("world", "push", 200.0)
    assert found.cause.begin == pytest.approx(1.19, abs=0.01)
    assert [d.kind for d in found.chain[:3]] == ["world", "plan", "body"]
    # the same jump with less passes, and so does the push
    found = explained(PUSH, {"push.force": 70.0})
    assert (found.success, found.cause, [d.name for d in found.passed]) == (True, None, ["push"])


@pytest.mark.long
@pytest.mark.parametrize(("graph", "seed"), [(JUMP, 31), (AHEAD, 32), ("graphs/up_8cm.yaml", 33)])
def test_nothing_is_named_where_nothing_is_wrong(graph: str, seed: int) -> None:
    found = explained(graph, {"robot.seed": seed})
    assert found.success
    assert not found.passed


FAILURES: list[tuple[str, str, Settings, str, str]] = [
    # what is told to the robot's sensors
    ("accelerometer", JUMP, {"robot.sensors.accelerometer_bias": 4.0}, "sensor", "accelerometer along"),
    ("switches", JUMP, {"robot.sensors.switch_threshold": [25.0, 30.0]}, "sensor", "switch of"),
    # what the controller does not know
    ("latency", JUMP, {"robot.latency": 0.02, "delay.nominal": 0.002, "delay.follow": "nominal"},
     "estimate", "measured delay off the one"),
    ("com", JUMP, {"robot.body.base_com_offset": [0.06, 0.0, 0.0]}, "estimate", "estimated centre of mass"),
    ("heavy", JUMP, {"robot.body.mass_scale": 1.6}, "estimate", "felt mass off the truth"),
    ("weak", JUMP, {"robot.actuators.motors": {"torque_constant": 0.7}}, "estimate", "felt mass off the truth"),
    ("floor", AHEAD, {"robot.ground.friction": 0.05}, "world", "_toe slides"),
    ("edge", AHEAD, {"robot.ground.scene": {"boxes": [
        {"x": [0.1, 0.2], "y": [-0.5, 0.5], "top": 0.01}]}},
     "world", "upward force beside the contact points"),
    # jumps and pushes beyond what the robot can do, as they are
    ("pushed left", PUSH, {"push.force": 160.0, "push.angle": np.pi / 2}, "world", "push"),
    ("pushed back", PUSH, {"push.force": 130.0, "push.angle": np.pi}, "world", "push"),
    ("weak and far", "graphs/forward_38cm.yaml",
     {"robot.actuators.motors": {"saturation": 0.35}, "robot.ground.friction": 0.3}, "world", "_toe slides"),
    ("tiles", AHEAD, {"robot.seed": 8, "estimator.level_ground": True, "step.seek_speed": 0.0, "robot.ground.uneven": {
        "size": [0.1, 0.2], "height": 0.02, "slope": 0.087, "friction": [0.4, 1.0]}},
     "world", "ground under"),
]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(
    ("graph", "settings", "kind", "name"),
    [failure[1:] for failure in FAILURES],
    ids=[failure[0] for failure in FAILURES],
)
def test_failures_are_named(graph: str, settings: Settings, kind: str, name: str) -> None:
    found = explained(graph, settings)
    assert not found.success
    assert found.cause is not None
    assert found.cause.kind == kind
    assert name in found.cause.name


@pytest.mark.long
def test_soles_taken_for_level() -> None:
    """The filter takes soles on 5 mm for level: the tilt of the estimate follows the ground, the fall that."""
    toes = box(0.2, -0.5, 0.005)
    found = explained(AHEAD, toes | {"estimator.level_ground": True})
    named = [d.name for d in found.chain]
    assert found.cause is not None
    assert found.cause.name.startswith("ground under")
    assert found.cause.size == pytest.approx(5.0, abs=0.1)
    assert "estimated tilt off the truth" in named[1:]
    # without that assumption there is the ground, and no wrong tilt
    found = explained(AHEAD, toes | {"estimator.level_ground": False})
    assert {d.name.partition(" under ")[0] for d in found.chain} == {"ground"}


@pytest.mark.long
def test_a_foot_that_stops_in_the_air() -> None:
    """The left foot stands on 1 cm; the right one hangs above the ground until the robot has lost its balance."""
    left = box(0.1, 0.0, 0.01)
    found = explained(AHEAD, left | {"step.seek_speed": 0.0})
    named = [d.name for d in found.chain]
    assert named[0].startswith("ground under left_")
    hangs = named.index("right_foot hangs above the ground while another stands")
    assert hangs < named.index("capture point outside the support")
    assert 1.0 < found.chain[hangs].size < 10.0  # mm; the box is 1 cm high
    found = explained(AHEAD, left)
    assert not any("hangs" in d.name for d in found.chain)


@pytest.mark.long
def test_contacts_are_named_one_by_one_with_what_they_did() -> None:
    found = explained(JUMP, {"robot.sensors.switch_threshold": [25.0, 30.0]})
    missed = [c for c in found.contacts if not c.false and c.begin > 0.5]
    assert {c.point for c in missed} == {"left_toe", "left_heel", "right_toe", "right_heel"}
    assert all(c.load > 10.0 for c in missed)
    worst = max(missed, key=lambda c: abs(c.height))
    assert worst.matters
    assert 1e-3 < abs(worst.height) < 5e-3  # m
    assert "height" in worst.effect
