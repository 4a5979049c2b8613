"""Motion capture measures late, seldom and with noise; its measurements take the drift off an estimate."""

import math

import numpy as np
import pytest

from aloft.blocks.estimation.motion_capture import MotionCapture, PoseCorrection
from aloft.mathematics.rotations import yaw
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

PERIOD = 0.002


def turned(heading: float) -> list[float]:
    return [0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading)]


def show(bench: BlockBench, x: float, heading: float = 0.0):
    bench.set("truth", base_position=[x, 2.0 * x, 0.5], base_orientation=turned(heading))
    bench.step()
    place = bench.get("pose")
    return int(place.number), float(place.time), np.array(place.position), float(place.heading)


def test_a_measurement_appears_after_its_latency() -> None:
    bench = BlockBench(
        MotionCapture, {"latency": 3 * PERIOD, "noise": 0.0, "heading_noise": 0.0}, robot="bruce"
    )
    seen = [show(bench, 0.1 * run, 0.2 * run) for run in range(6)]
    assert [number for number, *_ in seen] == [0, 0, 0, 1, 2, 3]
    _, time, position, heading = seen[-1]
    assert time == pytest.approx(2 * PERIOD)
    assert position == pytest.approx([0.2, 0.4, 0.5])
    assert heading == pytest.approx(0.4)


def test_noise_and_lost_measurements_are_those_asked_for_and_repeat() -> None:
    given = {"latency": 0.0, "noise": 0.01, "heading_noise": 0.1, "dropout": 0.3, "seed": 7}
    runs = []
    for _ in range(2):
        bench = BlockBench(MotionCapture, given, robot="bruce")
        runs.append([show(bench, 0.0) for _ in range(2000)])
    numbers = [number for number, *_ in runs[0]]
    assert len(set(numbers)) / 2000 == pytest.approx(0.7, abs=0.04)
    fresh = [one for one, before in zip(runs[0][1:], runs[0], strict=False) if one[0] != before[0]]
    assert np.std([position[1] for _, _, position, _ in fresh]) == pytest.approx(0.01, rel=0.1)
    assert np.std([heading for *_, heading in fresh]) == pytest.approx(0.1, rel=0.1)
    assert [(a, b, c.tolist(), d) for a, b, c, d in runs[0]] == [
        (a, b, c.tolist(), d) for a, b, c, d in runs[1]
    ]


def test_a_latency_of_too_many_runs_is_refused() -> None:
    with pytest.raises(BlockError, match="the latency is 400 runs of the block, at most 255"):
        BlockBench(MotionCapture, {"latency": 0.2}, robot="bruce", rate=2000.0)


def test_a_drift_of_place_and_heading_is_taken_off() -> None:
    """The robot walks in a circle; its estimate lies 0.3 m off, turned by 0.4 rad, and tilts."""
    bench = BlockBench(PoseCorrection)
    late, truths = 20, []
    for tick in range(1500):
        angle = 0.002 * tick
        truth = np.array([math.cos(angle), math.sin(angle)]), angle
        truths.append(truth)
        turn = np.array([[math.cos(0.4), math.sin(0.4)], [-math.sin(0.4), math.cos(0.4)]])
        place = turn @ (truth[0] - [0.3, -0.1])
        speed = turn @ [-math.sin(angle), math.cos(angle)]
        bench.set(
            "state", position=[*place, 0.5], orientation=turned(angle - 0.4),
            linear_velocity=[*speed, 0.2], angular_velocity=[0.1, 0.2, 1.0],
        )  # fmt: skip
        if tick >= late and tick % 5 == 0 and tick < 1200:
            (x, y), heading = truths[tick - late]
            bench.set(
                "pose", number=tick, time=PERIOD * (tick - late), position=[x, y, 0.7],
                heading=heading,
            )  # fmt: skip
        bench.step()
        base = bench.get("base")
        if tick > late + 5:
            assert base.position == pytest.approx([*truth[0], 0.5], abs=1e-9)
            assert math.remainder(yaw(np.array(base.orientation)) - angle, 2 * math.pi) == (
                pytest.approx(0.0, abs=1e-9)
            )
            assert base.linear_velocity == pytest.approx(
                [-math.sin(angle), math.cos(angle), 0.2], abs=1e-9
            )
    assert base.angular_velocity == pytest.approx([0.1, 0.2, 1.0])


def test_noise_is_averaged() -> None:
    rng, errors = np.random.default_rng(3), []
    bench = BlockBench(PoseCorrection, {"gain": 0.02})
    for tick in range(3000):
        bench.set("state", position=[0.1, 0.2, 0.5], orientation=turned(0.3))
        bench.set(
            "pose", number=tick + 1, time=PERIOD * tick, heading=0.3 + 0.01 * rng.normal(),
            position=[0.1 + 0.005 * rng.normal(), 0.2 + 0.005 * rng.normal(), 0.0],
        )  # fmt: skip
        bench.step()
        errors.append(np.array(bench.get("base").position)[:2] - [0.1, 0.2])
    assert np.std(errors[500:]) == pytest.approx(0.005 * math.sqrt(0.02 / 2.0), rel=0.3)


def test_a_system_that_begins_again_is_used_again() -> None:
    bench = BlockBench(PoseCorrection, {"gain": 1.0})
    for tick in range(20):
        number = tick + 1 if tick < 10 else tick - 8  # from 10 back to 2
        bench.set("state", orientation=turned(0.0))
        bench.set("pose", number=number, time=PERIOD * tick, position=[0.1 * tick, 0.0, 0.0])
        bench.step()
        assert bench.get("base").position[0] == pytest.approx(0.1 * tick)
    bench.set("pose", number=3, time=PERIOD * 5, position=[9.0, 0.0, 0.0])  # one that comes late
    bench.step()
    assert bench.get("base").position[0] == pytest.approx(1.9)
