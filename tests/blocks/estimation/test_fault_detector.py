"""Measurements that disagree: each law on exact statics and kinematics, with each sensor and motor at fault."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.estimation.fault_detector import FaultDetector
from aloft.blocks.estimation.fault_detector_state import Stop, Suspect
from aloft.blocks.signals import CommandMode, Phase
from aloft.mathematics.constants import GRAVITY
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench


class Standing:
    """A robot that stands under its weight, and all that its sensors say of it."""

    def __init__(self, name="bruce", tilt=0.0, **params):
        self.robot = find_robot(name)
        self.bench = BlockBench(FaultDetector, params, robot=self.robot)
        dynamics = BlockBench(Dynamics, {}, robot=self.robot)
        orientation = [0.0, np.sin(tilt / 2), 0.0, np.cos(tilt / 2)]
        dynamics.set("base", position=[0, 0, 0.4], orientation=orientation)
        dynamics.set("joints", position=self.robot.standing_position)
        dynamics.step()
        self.terms = {name: array.copy() for name, array in dynamics.get("terms")}
        points, feet = len(self.robot.contacts), len(self.robot.feet)
        jacobian = self.terms["contact_jacobian"].reshape(3 * points, -1)
        self.jacobian = jacobian
        # Forces on the points that carry the weight where it is.
        balance = np.linalg.lstsq(
            jacobian[:, :6].T, self.terms["nonlinear_effects"][:6], rcond=None
        )
        self.torque = self.terms["nonlinear_effects"][6:] - jacobian[:, 6:].T @ balance[0]
        self.gravity = self.terms["base_rotation"].T @ [0, 0, GRAVITY]
        self.bench.set("terms", **self.terms)
        self.bench.set("load", force=np.full(feet, self.robot.weight / feet))
        self.bench.set("contacts", active=True)
        self.bench.set("switches", closed=True)
        self.bench.set("phase", phase=Phase.STAND, stance=True)
        self.bench.set("command", mode=CommandMode.ACTIVE, torque=self.torque)
        self.bench.set("joints", position=self.robot.standing_position, torque=self.torque)
        self.bench.set("imu", angular_velocity=0.0, specific_force=self.gravity)

    def run(self, ticks=500):
        """The first suspect, and after how many ticks."""
        for tick in range(ticks):
            self.bench.step()
            if self.state.suspect != Suspect.NONE:
                return Suspect(int(self.state.suspect)), tick
        return Suspect.NONE, ticks

    @property
    def state(self):
        return self.bench.get("state")

    def joint(self, values, number, change):
        changed = np.array(values, dtype=float)
        changed[number] += change
        return changed


@pytest.mark.parametrize("name", ["bruce", "go2", "g1", "solo12"])
def test_what_agrees_is_not_suspected_whatever_the_robot(name):
    stand = Standing(name)
    assert stand.run() == (Suspect.NONE, 500)
    metrics = stand.bench.block.metrics()
    assert "suspect" not in metrics and metrics["largest_disagreement"] < 0.1
    assert not stand.bench.block.warnings()


def test_a_biased_gyroscope_is_found_as_its_sum_reaches_the_limit():
    stand = Standing()
    stand.bench.set("imu", angular_velocity=[0.0, 0.3, 0.0])
    found, tick = stand.run()
    # x' = 0.3 - x / T reaches 0.08 T, once the points have stood for settle_time
    expected = 0.03 - 0.2 * np.log(1.0 - 0.08 / 0.3)
    assert found == Suspect.GYROSCOPE and tick / 500 == pytest.approx(expected, abs=0.006)
    assert stand.state.place == 1
    (text,) = stand.bench.block.warnings()
    assert "the gyroscope's axis y turns by +0.08 rad/s otherwise" in text
    assert stand.bench.block.metrics()["suspect"] == "gyroscope"


@pytest.mark.parametrize("name", ["bruce", "go2", "g1"])
def test_a_base_that_turns_over_its_feet_agrees_with_its_gyroscope(name):
    stand = Standing(name)
    _, values, rows = np.linalg.svd(stand.jacobian)
    rank = int((values > 1e-9 * values[0]).sum())
    free = rows[rank:]
    velocity = free.T @ free[:, 4]  # motions of the robot that leave all points where they are
    velocity *= 2.0 / velocity[4]
    stand.bench.set("joints", velocity=velocity[6:])
    stand.bench.set("imu", angular_velocity=velocity[3:6])
    position = np.array(stand.robot.standing_position)
    for _ in range(200):
        stand.bench.set("joints", position=position)
        stand.bench.step()
        position = position + velocity[6:] / 500
    assert stand.state.share[Suspect.GYROSCOPE] < 1e-6
    stand.bench.set("imu", angular_velocity=velocity[3:6] * 0.7)
    assert stand.run()[0] in (Suspect.GYROSCOPE, Suspect.ENCODER)


def test_feet_that_slide_or_are_in_a_line_tell_nothing():
    stand = Standing()
    stand.bench.set("imu", angular_velocity=[0.0, 0.3, 0.0])
    stand.bench.set("switches", closed=[True, False, True, False])  # the toes, in a line
    assert stand.run(200)[0] == Suspect.NONE
    stand.bench.set("switches", closed=True)
    names = [joint.name for joint in stand.robot.joints]
    stand.bench.set(
        "joints", velocity=stand.joint(np.zeros(10), names.index("left_hip_pitch"), 2.0)
    )
    stand.bench.step()
    assert stand.state.standing == 0


@pytest.mark.parametrize("tilt", [-0.1, 0.0, 0.1])
def test_a_biased_accelerometer_is_found_on_a_slope_too(tilt):
    assert Standing(tilt=tilt).run()[0] == Suspect.NONE
    stand = Standing(tilt=tilt)
    stand.bench.set("imu", specific_force=[stand.gravity[0] + 1.0, *stand.gravity[1:]])
    found, tick = stand.run()
    assert found == Suspect.ACCELEROMETER and stand.state.place == 0 and 0.15 < tick / 500 < 0.6
    assert "+0.49 m/s^2 off the force of the legs" in stand.bench.block.warnings()[0]


def test_a_weak_motor_is_found():
    stand = Standing()
    knee = [joint.name for joint in stand.robot.joints].index("left_knee")
    stand.bench.set("joints", torque=stand.joint(stand.torque, knee, -0.3 * stand.torque[knee]))
    found, tick = stand.run()
    assert found == Suspect.TORQUE and stand.state.place == knee and tick / 500 < 0.5
    assert "joint left_knee: its torque is" in stand.bench.block.warnings()[0]


def test_torques_in_flight_are_not_judged():
    stand = Standing()
    stand.bench.set("phase", phase=Phase.FLIGHT, stance=False)
    stand.bench.set("joints", torque=0.0)
    assert stand.run()[0] == Suspect.NONE


def test_an_encoder_that_slips_is_found_at_once_and_a_slow_one_too():
    stand = Standing()
    stand.run(10)
    position = stand.robot.standing_position
    stand.bench.set("joints", position=stand.joint(position, 3, 0.05))
    assert stand.run() == (Suspect.ENCODER, 0) and stand.state.place == 3
    stand = Standing()
    for tick in range(200):
        stand.bench.set("joints", position=stand.joint(position, 3, 0.2 * tick / 500))
        if stand.run(1)[0] != Suspect.NONE:
            break
    assert tick / 500 == pytest.approx(0.2 * np.log(2.0), abs=0.01)


def test_a_joint_that_moves_as_its_late_speed_says_is_not_suspected():
    stand, position = Standing(), np.array(find_robot("bruce").standing_position)
    for tick in range(300):
        time, late = tick / 500, tick / 500 - 0.003
        angle = 0.5 * (1.0 - np.cos(20.0 * time))
        speed = 10.0 * np.sin(20.0 * max(late, 0.0))
        stand.bench.set("joints", position=stand.joint(position, 3, angle))
        stand.bench.set("joints", velocity=stand.joint(np.zeros(10), 3, speed))
        stand.bench.step()
    assert 0.1 < stand.state.share[Suspect.ENCODER] < 1.0


def test_switches_that_all_stay_open_under_load_are_found():
    stand = Standing()
    stand.bench.set("switches", closed=False)
    assert stand.run() == (Suspect.SWITCHES, 75)
    assert "no foot switch has been closed for 150 ms" in stand.bench.block.warnings()[0]
    stand = Standing()
    stand.bench.set("switches", closed=[True, False, False, False])
    assert stand.run()[0] == Suspect.NONE


def test_a_limit_of_zero_is_not_judged():
    stand = Standing(
        gyroscope_error=0.0,
        acceleration_error=0.0,
        torque_error=0.0,
        encoder_error=0.0,
        open_time=0.0,
    )
    stand.run(5)
    stand.bench.set("imu", angular_velocity=1.0, specific_force=0.0)
    stand.bench.set("joints", position=1.0, torque=0.0)
    stand.bench.set("switches", closed=False)
    assert stand.run()[0] == Suspect.NONE


def test_the_first_suspect_stays():
    stand = Standing()
    stand.bench.set("switches", closed=False)
    stand.run()
    tick = int(stand.state.tick)
    stand.bench.set("joints", position=2.0)
    stand.run(3)
    assert stand.state.suspect == Suspect.SWITCHES and stand.state.tick == tick


# Gross errors before lift-off: units, signs, axes


def ended_by(standing, ticks=50):
    """How many ticks the run lasted, and the reason for which the block ended it."""
    for tick in range(ticks):
        standing.bench.step()
        if standing.state.stop != Stop.NONE:
            assert standing.bench.stop_reason == standing.bench.block._stop_reason()
            return tick, str(standing.bench.block.metrics()["reason"])
    return ticks, ""


GRAVITY_ERRORS = {
    "0.102": (lambda a: 0.102 * a, "it looks like g in place of m/s^2"),
    "-z": (lambda a: a * [1, 1, -1], "the sign of z looks wrong"),
    "-all": (lambda a: -a, "the sign of all axes"),
    "x and z": (lambda a: a[[2, 1, 0]], "the order of x and z looks wrong"),
    "y and z": (lambda a: a[[0, 2, 1]], "the order of y and z looks wrong"),
    "2 g": (lambda a: 2.0 * a, "its length is 2.00 g"),
    "nan": (lambda a: a * np.nan, ""),
}


@pytest.mark.parametrize("error", GRAVITY_ERRORS)
@pytest.mark.parametrize("name", ["bruce", "go2"])
def test_an_accelerometer_that_does_not_read_gravity_at_rest_ends_the_run(name, error):
    change, looks = GRAVITY_ERRORS[error]
    standing = Standing(name, tilt=0.05)
    standing.bench.set("imu", specific_force=change(standing.gravity))
    ticks, reason = ended_by(standing)
    assert ticks <= 2 and "m/s^2 at rest, where the legs say (" in reason
    assert looks in reason and "correct the driver or the IMU's mounting" in reason


@pytest.mark.parametrize("tilt", [-0.25, 0.25])
def test_a_slope_and_a_bump_are_no_gross_error(tilt):
    standing = Standing()
    # The base is level on a slope by its estimate, so the reading leans against the soles.
    leaning = GRAVITY * np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    standing.bench.set("imu", specific_force=leaning)
    assert ended_by(standing) == (50, "")
    standing.bench.set("imu", specific_force=3.0 * leaning)
    standing.bench.step(2)
    standing.bench.set("imu", specific_force=leaning)
    assert ended_by(standing) == (50, "")


def test_gravity_is_judged_in_the_stand_and_at_rest_only():
    standing = Standing(gross_rate=0.0, gross_push=0.0, suspects_end=False)
    standing.bench.step(3)
    standing.bench.set("imu", specific_force=0.0)
    for phase in (Phase.SQUAT, Phase.FLIGHT, Phase.RECOVER):
        standing.bench.set("phase", phase=phase, stance=True)
        assert ended_by(standing) == (50, "")
    standing.bench.set("phase", phase=Phase.STAND, stance=True)
    standing.bench.set("joints", velocity=1.5)
    assert ended_by(standing) == (50, "")


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("factor", "looks"),
    [(-1.0, ": its sign looks wrong"), (180.0 / np.pi, ": it looks like degrees per second")],
)
def test_a_gyroscope_that_turns_otherwise_than_the_base_ends_the_run(axis, factor, looks):
    standing = Standing()
    rate = np.zeros(3)
    rate[axis] = 0.3
    first = standing.jacobian.shape[1] - len(standing.robot.joints)
    base = np.concatenate([np.zeros(3), rate])
    # the joints' speeds with which points stay where they are
    speed = np.linalg.lstsq(
        standing.jacobian[:, first:], -standing.jacobian[:, :6] @ base, rcond=None
    )[0]
    slip = standing.jacobian[:, :6] @ base + standing.jacobian[:, first:] @ speed
    assert np.abs(slip).max() < 0.1, "or feet slide"
    standing.bench.set("joints", velocity=speed)
    standing.bench.set("imu", angular_velocity=rate)
    assert ended_by(standing, 6) == (6, "")
    standing.bench.set("imu", angular_velocity=factor * rate)
    ticks, reason = ended_by(standing)
    assert ticks == 4, "lateness and gross_time are borne"
    assert reason.startswith(f"{standing.bench.block.context.path}: the gyroscope's axis")
    assert looks in reason


def test_in_the_thrust_five_times_as_much_is_borne_and_in_flight_anything():
    for phase, rate, ends in (
        (Phase.THRUST, 1.9, False), (Phase.THRUST, 2.1, True), (Phase.FLIGHT, 9.0, False),
        (Phase.SQUAT, 0.45, True), (Phase.SQUAT, 0.35, False),
    ):  # fmt: skip
        standing = Standing(gyroscope_error=0.0)
        standing.bench.set("phase", phase=phase, stance=True)
        standing.bench.set("imu", angular_velocity=[0.0, rate, 0.0])
        assert bool(ended_by(standing)[1]) == ends, (phase, rate)


def test_gross_errors_are_not_judged_where_their_limit_is_zero():
    standing = Standing(gross_gravity=0.0, gross_rate=0.0, gyroscope_error=0.0)
    standing.bench.set("imu", specific_force=-standing.gravity, angular_velocity=5.0)
    assert ended_by(standing) == (50, "")


@pytest.mark.parametrize("phase", [Phase.SQUAT, Phase.THRUST, Phase.LANDING, Phase.RECOVER])
@pytest.mark.parametrize(
    ("factor", "looks"),
    [(0.102, "it looks like g in place of m/s^2"), (-1.0, "its sign looks wrong")],
)
@pytest.mark.parametrize("name", ["bruce", "go2"])
def test_an_accelerometer_that_goes_wrong_under_load_ends_the_run(name, phase, factor, looks):
    standing = Standing(name)
    standing.bench.set("phase", phase=phase)
    assert ended_by(standing) == (50, "")
    # the legs push twice the weight, and the base is that much heavier
    standing.bench.set("load", force=2.0 * standing.robot.weight / len(standing.robot.feet))
    standing.bench.set("imu", specific_force=2.0 * standing.gravity)
    assert ended_by(standing, 5) == (5, "")
    standing.bench.set("imu", specific_force=factor * 2.0 * standing.gravity)
    ticks, reason = ended_by(standing)
    assert ticks == 4 and "m/s^2 while the legs push (" in reason and looks in reason
    assert standing.bench.block.metrics()["stopped_for"] == "push"


def test_light_feet_and_the_stand_are_not_judged_by_their_push():
    for phase, load in ((Phase.THRUST, 0.4), (Phase.STAND, 1.0)):
        standing = Standing(gross_gravity=0.0, acceleration_error=0.0)
        standing.bench.set("phase", phase=phase)
        standing.bench.set("load", force=load * standing.robot.weight / 2)
        standing.bench.set("imu", specific_force=0.102 * standing.gravity)
        assert ended_by(standing) == (50, "")


@pytest.mark.parametrize("phase", [Phase.SQUAT, Phase.THRUST])
def test_no_jump_is_made_with_a_suspect_but_an_encoder(phase):
    standing = Standing()
    standing.bench.set("joints", torque=1.3 * standing.torque)
    assert standing.run()[0] == Suspect.TORQUE
    assert ended_by(standing) == (50, "")  # it stands
    standing.bench.set("phase", phase=phase)
    ticks, reason = ended_by(standing)
    assert ticks == 0 and "ended for what is suspected: joint" in reason
    assert standing.bench.block.metrics()["stopped_for"] == "suspect"


@pytest.mark.parametrize("phase", [Phase.STAND, Phase.SQUAT, Phase.LANDING, Phase.RECOVER])
def test_a_robot_whose_gyroscope_is_suspected_does_not_go_on_standing(phase):
    standing = Standing()
    standing.bench.set("phase", phase=phase, time_since_touchdown=1.0)
    assert ended_by(standing) == (50, "")
    standing.bench.set("imu", angular_velocity=[0.0, 0.3, 0.0])
    ticks, reason = ended_by(standing, 100)
    assert ticks < 100 and "ended for what is suspected: the gyroscope's axis y" in reason
    standing = Standing(suspects_end=False)
    standing.bench.set("phase", phase=phase, time_since_touchdown=1.0)
    standing.bench.set("imu", angular_velocity=[0.0, 0.3, 0.0])
    assert standing.run()[0] == Suspect.GYROSCOPE
    assert ended_by(standing) == (50, "")


def test_a_robot_whose_switches_are_open_stands_on_after_a_landing_only():
    for phase, ends in ((Phase.STAND, True), (Phase.RECOVER, False)):
        standing = Standing()
        standing.bench.set("phase", phase=phase, time_since_touchdown=1.0)
        standing.bench.set("switches", closed=False)
        ticks, reason = ended_by(standing, 100)
        assert ticks == (76 if ends else 100) and standing.state.suspect == Suspect.SWITCHES
        assert (
            "ended for what is suspected: no foot switch has been closed for 150 ms" in reason
        ) == ends


def turned(standing, angle):
    """The model's terms where the estimate leans by ``angle`` more [rad], and the feet with it."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    terms, base = dict(standing.terms), standing.terms["base_position"]
    terms["contact_position"] = (terms["contact_position"] - base) @ turn.T + base
    terms["base_rotation"] = turn @ terms["base_rotation"]
    return terms


@pytest.mark.parametrize("tilt", [0.0, 0.1])
@pytest.mark.parametrize("phase", [Phase.STAND, Phase.SQUAT, Phase.THRUST])
def test_ground_that_seems_to_turn_ends_the_run_before_lift_off(phase, tilt):
    standing = Standing(tilt=tilt)
    standing.bench.set("phase", phase=phase)
    standing.bench.set("terms", **turned(standing, 0.04))
    assert ended_by(standing) == (50, ""), "the first plane counts, whatever its slope"
    standing.bench.set("terms", **turned(standing, 0.085))
    assert ended_by(standing) == (50, "")
    standing.bench.set("terms", **turned(standing, 0.1))
    ticks, reason = ended_by(standing)
    assert ticks == 2, "gross_time is borne"
    assert (
        "the ground under the feet seems to have turned by 3.4 deg since the robot stood up"
        in reason
    )


def test_ground_of_another_landing_may_lean_otherwise():
    standing = Standing()
    assert ended_by(standing) == (50, "")
    standing.bench.set("phase", phase=Phase.FLIGHT)
    assert ended_by(standing) == (50, "")
    standing.bench.set("terms", **turned(standing, 0.2))
    for phase in (Phase.LANDING, Phase.SQUAT):
        standing.bench.set("phase", phase=phase)
        assert ended_by(standing) == (50, "")


def test_switches_that_open_under_load_end_squat_and_thrust():
    for phase, load, ends in (
        (Phase.SQUAT, 1.0, True), (Phase.THRUST, 1.0, True), (Phase.THRUST, 0.4, False), (Phase.STAND, 1.0, False),
    ):  # fmt: skip
        standing = Standing()
        standing.bench.set("phase", phase=phase)
        standing.bench.set("load", force=load * standing.robot.weight / 2)
        standing.bench.set("switches", closed=False)
        ticks, reason = ended_by(standing)
        assert ticks == (10 if ends else 50)
        assert ("no foot switch has been closed for 20 ms" in reason) == ends


def test_a_landing_that_no_switch_tells_of_ends_the_flight():
    for due, closed, ends in (
        (0.0, False, True),
        (-0.1, False, True),
        (0.2, False, False),
        (0.0, True, False),
    ):
        standing = Standing()
        standing.bench.set("phase", phase=Phase.FLIGHT, stance=False, time_to_touchdown=due)
        standing.bench.set("switches", closed=[closed, False, False, False])
        standing.bench.set("imu", specific_force=1.4 * standing.gravity)
        assert ended_by(standing) == (50, "")
        standing.bench.set("imu", specific_force=1.6 * standing.gravity)
        ticks, reason = ended_by(standing)
        assert ticks == (4 if ends else 50)
        assert ("the robot has landed, and no foot switch is closed" in reason) == ends


def test_a_robot_that_leans_over_fast_after_touchdown_falls():
    for rate, since, phase, ends in (
        (4.2, 0.1, Phase.LANDING, True), (4.2, 0.1, Phase.RECOVER, True), (4.2, 0.03, Phase.LANDING, False),
        (3.8, 0.1, Phase.LANDING, False), (-4.2, 0.1, Phase.LANDING, False),  # it rises
    ):  # fmt: skip
        standing = Standing(tilt=0.2)
        standing.bench.set("phase", phase=phase, stance=False, time_since_touchdown=since)
        standing.bench.set("contacts", active=False)
        standing.bench.set("imu", angular_velocity=[0.0, rate, 0.0])
        ticks, reason = ended_by(standing)
        assert ticks == (10 if ends else 50), (rate, since, phase)
        assert (
            "the robot falls: its gyroscope reads (+0.00, +4.20, +0.00) rad/s" in reason
        ) == ends


@pytest.mark.parametrize("axis", [0, 1])
def test_the_sign_of_a_force_across_is_seen_in_the_thrust(axis):
    read = np.zeros(3)
    read[axis] = 0.8 * GRAVITY
    for phase, sign, ends in (
        (Phase.THRUST, -1.0, True), (Phase.SQUAT, -1.0, True), (Phase.THRUST, 1.0, False), (Phase.LANDING, -1.0, False),
    ):  # fmt: skip
        standing = Standing(gross_push=0.0)
        standing.bench.set("phase", phase=phase)
        # the legs push across what the base feels, as inverse dynamics without motion have it
        felt = standing.gravity + read
        mass = standing.terms["mass_matrix"]
        jacobian = standing.jacobian
        force = np.linalg.lstsq(jacobian[:, :6].T, mass[:6, :3] @ felt, rcond=None)[0]
        torque = mass[6:, :3] @ felt - jacobian[:, 6:].T @ force
        standing.bench.set("joints", torque=torque)
        standing.bench.set("command", torque=torque)
        standing.bench.set("load", force=standing.robot.weight / 2)
        standing.bench.set("imu", specific_force=standing.gravity + sign * read)
        ticks, reason = ended_by(standing)
        assert ticks == (4 if ends else 50), (phase, sign, reason)
        assert (f"the sign of {'xyz'[axis]} looks wrong" in reason) == ends


def test_a_jump_goes_on_with_an_encoder_that_slipped():
    standing = Standing()
    standing.bench.set("phase", phase=Phase.SQUAT)
    standing.bench.step()
    position = np.array(standing.robot.standing_position)
    position[3] += 0.1
    standing.bench.set("joints", position=position)
    assert ended_by(standing) == (50, "") and standing.state.suspect == Suspect.ENCODER
    standing.bench.set("terms", **turned(standing, 0.1))  # as the encoder has it
    assert ended_by(standing) == (50, "")


@pytest.mark.parametrize("phase", [Phase.STAND, Phase.THRUST, Phase.FLIGHT, Phase.LANDING])
def test_a_rate_that_no_gyroscope_reads_ends_the_run_at_once(phase):
    standing = Standing()
    standing.bench.set("phase", phase=phase)
    standing.bench.set("imu", angular_velocity=[0.0, 155.6, 0.0])
    ticks, reason = ended_by(standing)
    assert ticks == 0 and "the gyroscope's axis y reads +155.60 rad/s" in reason
    standing = Standing(largest_rate=0.0, gross_rate=0.0)
    standing.bench.set("phase", phase=phase)
    standing.bench.set("imu", angular_velocity=[0.0, 155.6, 0.0])
    assert standing.state.stop == Stop.NONE
