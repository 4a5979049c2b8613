"""``python -m pytest`` in this folder."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from geometric_control import FlightMode, GeometricController, allocate, wrenches
from mission import FlightPhase, Mission
from observer import Observer
from score import FlightScore

import aloft
from aloft.robots.description import find_robot
from aloft.robots.importing.package_files import find_file
from aloft.runtime.language.context import Clock, Context
from aloft.runtime.testing.bench import BlockBench
from aloft.runtime.testing.conformance import check_block, conformance_cases

HERE = Path(__file__).parent
ROBOT = find_robot("quadrotor.xml", HERE)
URDF = yaml.safe_load((HERE / "iris.yaml").read_text())["file"]
WEIGHT = 9.81 * ROBOT.total_mass
MATRIX = wrenches(ROBOT)
MOST = np.full(4, 7.0)


def controller(**target) -> np.ndarray:
    """Return the command to the rotors in hover, for a robot that is level at the origin."""
    bench = BlockBench(GeometricController, {"lead": 1.0, "trim_rate": 0.0}, robot=ROBOT)
    bench.set("base", orientation=[0.0, 0.0, 0.0, 1.0])
    bench.set("thrusters", thrust=WEIGHT / 4)
    bench.set("target", **{"mode": FlightMode.TRACK, **target})
    bench.step()
    return bench.get("thrust").thrust


def test_level_at_its_place_it_hovers():
    assert MATRIX @ controller() == pytest.approx([WEIGHT, 0.0, 0.0, 0.0], abs=1e-9)


def test_a_place_ahead_pitches_it_forwards_and_one_above_lifts_it():
    force, roll, pitch, turn = MATRIX @ controller(position=[0.1, 0.0, 0.0])
    assert pitch > 0.05 and (roll, turn) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert force == pytest.approx(WEIGHT)
    force = (MATRIX @ controller(position=[0.0, 0.0, 0.1]))[0]
    assert force == pytest.approx(WEIGHT + ROBOT.total_mass * 2.5**2 * 0.1)


def test_moments_are_lees_for_small_errors():
    half = 0.005
    moments = (MATRIX @ controller(mode=FlightMode.TURN, thrust=9.81, heading=0.0,
               orientation=[math.sin(half), 0.0, 0.0, math.cos(half)],
               angular_acceleration=[0.0, 2.0, 0.0]))[1:]  # fmt: skip
    inertia = ROBOT.links[0].inertia
    wanted = [
        inertia[0] * 14.0**2 * math.sin(2 * half),
        inertia[1] * 2.0,
        inertia[2] * 2.0 * math.sin(2 * half),
    ]
    assert moments == pytest.approx(wanted, rel=1e-3, abs=1e-5)


@pytest.mark.parametrize("wrench", [[30.0, 0, 0, 0], [1.0, 0.5, 0, 0], [20.0, 0.3, -0.4, 0.02],
                                    [10.0, 0.2, 0.1, 9.0], [10.0, 4.0, -3.0, 0.1]])  # fmt: skip
def test_rotors_beyond_their_limits_keep_the_moments_first(wrench):
    thrust, given = np.zeros(4), np.array(wrench, float)
    allocate(given, np.linalg.pinv(MATRIX), MOST, thrust)
    assert (thrust >= -1e-12).all() and (thrust <= 7.0 + 1e-12).all()
    found = MATRIX @ thrust
    if np.hypot(*wrench[1:3]) < 1.0:
        assert found[1:3] == pytest.approx(wrench[1:3])
        assert wrench[3] < 1.0 or found[3] > 0.1  # what is left of the moment about z
    else:
        assert found[1] / found[2] == pytest.approx(wrench[1] / wrench[2], rel=1e-4)
        assert thrust.min() < 1e-4 and thrust.max() > 7.0 - 1e-4


def test_the_observer_finds_tilt_and_bias_that_the_imu_does_not_know():
    bench = BlockBench(Observer, robot=ROBOT)
    bias = np.array([0.01, -0.02, 0.015])
    bench.set("imu", specific_force=[0.0, 0.0, 9.81], angular_velocity=bias)
    for tick in range(5000):
        bench.set("pose", number=tick // 5 + 1, time=0.01 * (tick // 5), position=[1.0, 2.0, 0.5])
        bench.step()
    base = bench.get("base")
    assert base.position == pytest.approx([1.0, 2.0, 0.5], abs=1e-4)
    assert base.angular_velocity == pytest.approx(0.0, abs=1e-4)
    assert base.orientation[:2] == pytest.approx(0.0, abs=1e-4)


def mission(ticks: int, **params):
    bench = BlockBench(Mission, params, robot=ROBOT)
    bench.set(
        "base", position=[1.0, 2.0, 0.1], orientation=[0.0, 0.0, math.sin(0.3), math.cos(0.3)]
    )
    bench.step(ticks)
    return bench.get("target"), bench.get("flown")


def test_the_flight_rises_from_where_it_stands_and_flips_by_its_heading():
    target, flown = mission(251 + 500)
    assert flown.phase == FlightPhase.RISE and target.heading == pytest.approx(0.6)
    assert target.position == pytest.approx([1.0, 2.0, 0.1 + 0.75], abs=2e-3)
    target, flown = mission(251 + 1000 + 1000 + 300 + 150)
    assert flown.phase == FlightPhase.FLIP and target.mode == FlightMode.TURN
    assert abs(target.orientation[3]) < 0.02 and abs(target.orientation[2]) < 0.02  # upside down
    assert target.angular_velocity[0] == pytest.approx(2 * math.pi * 1.875 / 0.6, rel=1e-3)


@pytest.mark.parametrize(("params", "what"), [({"boost": 0.1}, "boost"), ({"flip": 0.2}, "flip")])
def test_what_the_rotors_cannot_do_is_refused(params, what):
    context = Context("block", Clock(0.002), robot=ROBOT)
    unmet = list(Mission.requires(Mission.Params(**params), context))
    assert what in [each.parameter for each in unmet] and "too weak" in unmet[0].message


def test_thrusters_that_cannot_turn_it_are_refused():
    front = {name: each for name, each in ROBOT.thrusters.items() if "front" in name}
    context = Context("block", Clock(0.002), robot=ROBOT.changed(thrusters=front))
    (unmet,) = GeometricController.requires(GeometricController.Params(), context)
    assert "do not lift it" in unmet.message and unmet.found == "2 thrusters"


@pytest.mark.parametrize("block", [GeometricController, Mission, Observer, FlightScore])
@pytest.mark.parametrize("case", conformance_cases())
def test_keeps_every_blocks_promises(block, case):
    check_block(block, robot=ROBOT, cases=[case])


def test_the_flight_succeeds_and_the_score_sees_a_flip_that_is_none():
    result = aloft.load(HERE / "flight.yaml").run(log=False)
    assert result.success, result.reason
    assert result.metrics["turned_deg"] == pytest.approx(360.0, abs=20.0)
    assert result.metrics["hover_error_after_m"] < 0.1
    lame = aloft.load(HERE / "flight.yaml", ["control.attitude_bandwidth=2 rad/s"]).run(log=False)
    assert not lame.success


@pytest.mark.skipif(find_file(URDF, HERE) is None, reason="pip install example-robot-data")
def test_another_quadrotor_flies_the_same_graph():
    assert aloft.load(HERE / "iris_flight.yaml").run(log=False).success
