"""What of a log would be wrong without a word: stamps, rows that are none, turns, clocks; played right, refused, or warned of."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from aloft.hal.log.log_file import LogFile
from aloft.hal.log.log_robot import LogRobot
from aloft.hal.log.played_log import play
from aloft.robots.description import find_robot

COUNT = 101
TIMES = 0.01 * np.arange(COUNT)
REST = np.tile([0.0, 0.0, 9.81], (COUNT, 1))
GYRO = np.stack([TIMES, 2.0 * TIMES, np.sin(TIMES)], axis=1)
IMU = {"angular_velocity": "gyro", "specific_force": "force"}
CLOCK = {"stamps": "t"}
FOUR = np.stack([np.sin(TIMES), 0 * TIMES, 0 * TIMES, np.cos(TIMES)], axis=1)


def log_of(units=None, **arrays):
    log = LogFile(Path("log.npz"))
    for name, values in {"t": TIMES, "gyro": GYRO, "force": REST, **arrays}.items():
        log.put(name, values, unit=(units or {}).get(name))
    return log


def played(log, robot="bruce", period=0.01, **given):
    params = {"file": "log.npz", "clock": CLOCK, "imu": IMU, **given}
    robot = find_robot(robot) if isinstance(robot, str) else robot
    return play(log, LogRobot.Params.model_validate(params), robot, period)


def said(*log, **given):
    """Return the problems as one text."""
    return "\n".join(f"{each.parameter}: {each.message} | {each.found} | {each.fix}" for each in played(*log, **given).problems)  # fmt: skip


def test_stamps_have_the_unit_that_the_file_says():
    counts = np.round(1000.0 * TIMES).astype(int)
    by_file = played(log_of(units={"t": "ms"}, t=counts))
    assert by_file.duration == pytest.approx(1.0)
    given = played(log_of(t=counts), clock={"stamps": "t", "unit": "ms"})
    assert given.duration == pytest.approx(1.0)


def test_stamps_that_are_hardly_seconds_are_refused_with_a_unit_that_fits():
    for scale, unit in ((1e3, "ms"), (1e6, "us"), (1e9, "ns")):
        text = said(log_of(t=np.round(scale * TIMES)))
        assert "clock.unit: t has steps of " in text and f"expected one, such as {unit}" in text
    assert not said(log_of(t=1000.0 * TIMES), clock={"stamps": "t", "unit": "s"})


def test_nanoseconds_since_1970_are_not_rounded():
    stamps = 1_764_414_300_000_000_000 + np.round(1e9 * TIMES).astype(np.int64)
    result = played(log_of(t=stamps), clock={"stamps": "t", "unit": "ns"}, between="hold")
    assert np.array_equal(result.rows.imu[:, :3], GYRO)  # floats are 256 ns apart there
    late = played(log_of(t=1_764_414_300.0 + TIMES), between="hold")
    assert np.array_equal(late.rows.imu[:, :3], GYRO)


@pytest.mark.parametrize("kind", [np.uint32, np.float64])
def test_a_counter_of_32_bits_begins_again(kind):
    counts = ((2**32 - 400_000 + np.round(1e6 * TIMES).astype(np.int64)) % 2**32).astype(kind)
    result = played(log_of(t=counts), clock={"stamps": "t", "unit": "us"})
    assert result.duration == pytest.approx(1.0)
    assert result.rows.imu[:, :3] == pytest.approx(GYRO)
    assert "the stamps begin again 1 times" in result.warnings[0]


def test_rows_out_of_order_are_refused_and_sorted_where_that_is_asked():
    order = np.arange(COUNT)
    order[[50, 51]] = [51, 50]
    mixed = log_of(t=TIMES[order], gyro=GYRO[order])
    assert "row 51 is 0.01 s before row 50, the first of 1 that go back" in said(mixed)
    assert "clock.sort: true" in said(mixed)
    result = played(mixed, clock={"stamps": "t", "sort": True})
    assert result.rows.imu[:, :3] == pytest.approx(GYRO)
    assert "all are the same" in said(log_of(t=0 * TIMES))
    assert "row 3 has nan" in said(log_of(t=np.where(np.arange(COUNT) == 3, np.nan, TIMES)))


def test_rows_that_are_no_numbers_are_gaps_and_said():
    gyro = GYRO.copy()
    gyro[20, 1], gyro[40:48] = np.nan, np.inf
    force = REST + 0.01 * TIMES[:, None]
    result = played(log_of(gyro=gyro, force=force))
    assert result.rows.imu[20, :3] == pytest.approx(0.5 * (GYRO[19] + GYRO[21]))
    assert np.flatnonzero(~result.rows.imu_valid).tolist() == list(range(40, 48))
    assert result.gaps == 1
    assert "imu.angular_velocity: 9 of 101 rows are no numbers, and left out" in result.warnings
    text = said(log_of(gyro=np.full_like(GYRO, np.nan)))
    assert "0 of 101 rows of it are numbers, expected at least 2; row 0 has nan, nan, nan" in text


def test_of_rows_with_one_stamp_the_last_counts():
    stamps = TIMES.copy()
    stamps[30] = stamps[29]
    result = played(log_of(t=stamps, q=np.stack([TIMES, TIMES], 1)), joints={"names": ["left_knee", "right_knee"], "position": "q"})  # fmt: skip
    assert result.rows.imu[29, :3] == pytest.approx(GYRO[30])
    assert np.isfinite(result.rows.velocity.at_ticks()).all()  # a difference by a step of zero
    assert any("1 of 101 rows have the stamp of the next one, which counts" in w for w in result.warnings)  # fmt: skip


def test_a_sensor_that_reads_the_same_and_another_that_does_not_is_renewed():
    noisy = REST + 0.01 * np.sin(1e3 * np.arange(COUNT))[:, None]
    still = played(log_of(gyro=0 * GYRO, force=noisy))
    assert still.imu_repeats == 0.0 and still.rows.imu_valid.all()
    assert played(log_of(gyro=0 * GYRO)).imu_repeats == pytest.approx(1.0 - 1.0 / COUNT)


def test_what_the_log_does_not_have_is_not_valid():
    result = played(log_of(), imu=None, contacts={"left_foot": {"closed": "gyro[0]"}})
    assert result.rows.contacts_valid.all()
    assert not result.rows.imu_valid.any() and not result.rows.joints_valid.any()
    assert "no contact of right_foot is given: they never touch" in result.warnings
    assert not played(log_of()).rows.contacts_valid.any()


def test_a_walk_without_contacts_is_warned_of():
    q = {"joints": {"names": ["left_knee"], "position": "q"}}
    assert "contacts are not given: the feet never touch" in played(log_of(q=TIMES), **q).warnings


def test_quaternions_in_either_order_and_those_that_are_none():
    truth = {"position": "force", "quaternion": "four"}
    lost = FOUR.copy()
    lost[60] = 0.0
    result = played(log_of(four=lost), truth=truth)
    assert result.rows.pose[:, 3:] == pytest.approx(FOUR, abs=1e-4)
    assert any("truth.quaternion: 1 of 101 rows are no numbers" in each for each in result.warnings)
    turned = played(log_of(four=FOUR[:, [3, 0, 1, 2]]), truth={**truth, "order": "wxyz"})
    assert turned.rows.pose[:, 3:] == pytest.approx(FOUR)
    assert "no quaternions: their norm is 2, expected 1" in said(log_of(four=2 * FOUR), truth=truth)


def test_a_turn_that_holds_does_not_move_between_rows_and_turns_as_fast():
    result = played(log_of(four=FOUR), period=0.002, between="hold", truth={"position": "force", "quaternion": "four"})  # fmt: skip
    assert result.rows.pose[52, 3:] == pytest.approx(FOUR[10])
    assert result.rows.twist[50:400, 3] == pytest.approx(2.0, rel=1e-3)


def test_clocks_that_are_not_the_same_are_named():
    log = log_of(place=np.zeros((COUNT, 3)), turn=np.zeros((COUNT, 3)))
    for name, start in {"gyro": 0.0, "force": 0.0, "place": 50.0, "turn": 50.0}.items():
        log.arrays[name] = dataclasses.replace(log.arrays[name], stamps=start + TIMES)
    text = said(log, clock={}, truth={"position": "place", "rpy": "turn"})
    assert "truth.position begins 49 s after imu.angular_velocity ends: their clocks are not the same" in text  # fmt: skip
    text = said(log, clock={}, imu={"angular_velocity": ["gyro[0]", "gyro[1]", "place[0]"], "specific_force": "force"})  # fmt: skip
    assert "the columns gyro[0], gyro[1], place[0] have clocks of their own" in text


def test_one_rate_for_columns_of_different_lengths_is_refused():
    text = said(log_of(gyro=GYRO[:50]), clock={"rate": 100.0})
    assert "columns of different lengths cannot all have one rate | 50 and 101" in text


def test_an_end_beyond_the_log_is_refused():
    assert "end: the log ends before end | 2 s | 1 s" in said(log_of(), end=2.0)
    assert not said(log_of(), end=1.0)


def test_an_even_grid_where_rows_are_missing_is_warned_of():
    keep = (TIMES < 0.3) | (TIMES > 0.7)
    log = log_of(t=TIMES[keep], gyro=GYRO[keep], force=REST[keep])
    result = played(log, clock={"stamps": "t", "even": True})
    assert any("off their stamps, so rows are missing" in each for each in result.warnings)
    stamped = played(log).warnings
    assert "the log has 1 gaps" in stamped[0] and "arrival" not in " ".join(stamped)
    assert not played(log_of(), clock={"stamps": "t", "even": True}).warnings


def test_names_of_joints():
    two = np.stack([TIMES, 2 * TIMES], axis=1)
    text = said(log_of(q=two), joints={"names": ["left_knee", "left_knee"], "position": "q"})
    assert "joint left_knee has 2 columns" in text
    # one that is like a joint that has a column of its own is another one, of a robot with more
    more = played(log_of(q=two), joints={"names": ["left_knee", "left_knee_2"], "position": "q"})
    assert not more.problems or "left_knee_2" not in more.problems[0].fix
    assert "has no joint lft_ankle" in said(log_of(q=two), joints={"names": ["left_knee", "lft_ankle"], "position": "q"})  # fmt: skip


def test_a_slide_is_in_metres():
    bruce = find_robot("bruce")
    joints = [joint.model_copy(update={"kind": "slide"}) if joint.name == "left_knee" else joint for joint in bruce.joints]  # fmt: skip
    robot = bruce.model_copy(update={"joints": type(bruce.joints)(joints)})
    spec = {"columns": ["x", "x"], "unit": "mm"}
    given = {"imu": None, "joints": {"names": ["left_knee", "gripper"], "position": spec}}
    result = played(log_of(x=1000.0 * TIMES), robot, **given)
    index = [joint.name for joint in robot.joints].index("left_knee")
    assert result.rows.position.at_ticks()[-1, index] == pytest.approx(1.0)
    spec["unit"] = "deg"
    assert "x is in deg, expected a unit like m" in said(log_of(x=TIMES), robot=robot, **given)


@pytest.mark.parametrize(
    ("changed", "given", "warning"),
    [
        ({"force": REST / 9.81}, {}, "the specific force has a median of 1 m/s^2"),
        ({"force": -REST}, {}, "the specific force points down while the robot stands"),
        ({"load": -50.0 + 0 * TIMES}, {"contacts": {"left_foot": {"force": "load"}, "right_foot": {"force": "load"}}},
         "left_foot never touches: look at sign and thresholds"),
        ({"q": 60.0 + TIMES}, {"joints": {"names": ["left_knee"], "position": "q"}},
         "left_knee goes from 60 to 61 rad, and its limits are"),
    ],
)  # fmt: skip
def test_what_is_likely_wrong_is_warned_of(changed, given, warning):
    assert not [each for each in played(log_of()).warnings if "median" in each]
    assert any(warning in each for each in played(log_of(**changed), **given).warnings)


SWING = {"q": 0.5 * np.sin(9 * TIMES), "v": 4.5 * np.cos(9 * TIMES)}
SWINGS = {"joints": {"names": ["left_knee"], "position": "q", "velocity": "v"}}


@pytest.mark.parametrize(
    "changed", [np.degrees(SWING["v"]), -SWING["v"], SWING["v"][::-1] ** 2, SWING["v"] / 9]
)
def test_speeds_that_are_not_those_of_the_angles_are_warned_of(changed):
    assert not any("speeds say" in each for each in played(log_of(**SWING), **SWINGS).warnings)
    wrong = played(log_of(q=SWING["q"], v=changed), **SWINGS).warnings
    assert any(
        "left_knee moves" in each and "times as fast as its speeds say" in each for each in wrong
    )


def test_a_truth_that_is_not_the_imus_is_warned_of():
    """A base that rolls by 0.4 rad with a heading of 1 rad, and what its IMU reads."""
    scipy = pytest.importorskip("scipy.spatial.transform")
    roll = 0.4 * np.sin(9 * TIMES)
    turns = scipy.Rotation.from_euler("xyz", np.stack([roll, 0 * roll, 1.0 + 0 * roll], axis=1))
    right = {"gyro": np.stack([3.6 * np.cos(9 * TIMES), 0 * roll, 0 * roll], axis=1),
             "force": turns.inv().apply(REST), "place": np.zeros((COUNT, 3)), "turn": turns.as_quat()}  # fmt: skip
    truth = {"position": "place", "quaternion": "turn"}

    def warned(truth=truth, **changed):
        return " ".join(played(log_of(**right | changed), truth=truth).warnings)

    assert "truth" not in warned()
    assert "rad off the vertical: look at unit and order of truth" in warned(
        {**truth, "order": "wxyz"}
    )
    inverse = turns.inv().as_quat()
    assert "the truth turns" in warned(turn=inverse)
    assert "the truth turns 0.017 times as fast" in warned(gyro=np.degrees(right["gyro"]))
    assert "the truth turns -1" in warned(gyro=-right["gyro"])


def test_a_file_that_has_the_joints_in_another_order_is_not_taken_for_the_robots():
    names = [joint.name for joint in find_robot("bruce").joints]
    log = log_of(q=np.zeros((COUNT, len(names))))
    log.texts["order"] = names[::-1]
    text = said(log, joints={"position": "q"})
    assert "the file has the joints in another order than the robot | no names | order" in text
    assert not said(log, joints={"position": "q", "names": "order"})


def test_gravities_and_units_that_are_none():
    result = played(log_of(force=REST / 9.80665, units={"force": "g"}))
    assert result.rows.imu[:, 3:] == pytest.approx(REST)
    text = said(log_of(units={"gyro": "furlongs"}))
    assert "unit of gyro: cannot read unit 'furlongs'" in text
    assert "`unit: rad/s` beside `columns` says otherwise" in text


def test_a_column_that_is_not_there_gets_the_one_that_was_meant():
    text = said(log_of(), imu={"angular_velocity": ["gyro[0]", "gyroo[1]", "gyro[2]"], "specific_force": "forc"})  # fmt: skip
    assert "has no column 'gyroo[1]'" in text and "| gyro[1]\n" in text
    assert text.endswith("| force")


def test_a_foot_that_the_robot_lacks_has_its_columns_looked_at_too():
    text = said(log_of(), contacts={"left_fot": {"force": "odd"}})
    assert "contacts: bruce has no foot left_fot | left_fot | left_foot" in text
    assert "contacts.left_fot: log.npz has no column 'odd'" in text


def test_a_foot_is_in_contact_where_one_of_its_switches_is():
    flags = np.stack([TIMES > 0.5, TIMES < 0.2], axis=1)
    rows = played(log_of(heel_toe=flags), contacts={"left_foot": {"closed": "heel_toe"}}).rows
    own = np.array(find_robot("bruce").foot_of_contact()) == [f.name for f in find_robot("bruce").feet].index("left_foot")  # fmt: skip
    assert np.array_equal(rows.closed[:, own].all(axis=1), flags.any(axis=1))
