"""The landing law to the letter, its signs, and where the feet go in flight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.jumping.landing_heuristic import LandingHeuristic
from aloft.blocks.signals import Phase
from aloft.mathematics.landing_law import (
    apply_lead,
    keep_within,
    landing_position,
    retraction,
    swing,
)
from aloft.mathematics.rotations import exponential, multiply, rotate, to_matrix
from aloft.robots.description import find_robot
from aloft.robots.kinematics import foot_sides, standing_feet
from aloft.runtime.language.context import Clock, Context
from aloft.runtime.testing import BlockBench

from ...robots.limbed_robots import quadruped

ROBOT = find_robot("bruce")
MASS = ROBOT.total_mass
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
FEET = np.array([[0.01, -0.08, 0.0], [0.01, 0.08, 0.0]])
COM = np.array([0.0, 0.0, 0.32])
GAINS = {"w_l": [0.03, 0.04], "w_k": [0.3, -0.1], "w_c": 0.05}


def place(
    nominal,
    side,
    linear,
    angular,
    w_l=(0.03, 0.04),
    w_k=(0.3, -0.1),
    w_c=0.05,
    centre=(0.0, 0.0, 0.0),
):
    out = np.zeros(3)
    landing_position(
        np.array(nominal), side, np.array(linear), np.array(angular), np.array(w_l),
        np.array(w_k), w_c, np.array([0.15, 0.16]), np.asarray(centre), out,
    )  # fmt: skip
    return out


def rotation_vector(vector):
    out = np.zeros(4)
    exponential(np.array(vector, dtype=float), out)
    return out


def make(**params):
    """In flight on the plan: planned and measured state agree."""
    bench = BlockBench(LandingHeuristic, {"retraction": 0.0, **params}, robot=ROBOT)
    bench.set("reference", phase=Phase.FLIGHT, com=COM, foot_position=FEET, orientation=LEVEL)
    bench.set(
        "terms", com=COM, foot_position=FEET, base_rotation=np.eye(3), base_position=[0, 0, 0.37]
    )
    bench.set("phase", phase=Phase.FLIGHT, time_in_phase=0.0, time_to_touchdown=0.3)
    return bench


def fly(bench, time_in_phase, left):
    bench.set("phase", time_in_phase=time_in_phase, time_to_touchdown=left)
    bench.step()
    return bench.get("feet")


# The law.


def test_x_equation():
    found = place([0.02, 0.08, -0.3], 1.0, [0.5, 0.0, 0.0], [0.0, 0.06, 0.0])
    assert found == pytest.approx([0.02 + 0.03 * 0.5 + 0.3 * 0.06, 0.08, -0.3], abs=1e-15)


def test_y_equation_with_clearance_for_either_foot():
    linear, angular = [0.0, 0.4, 0.0], [-0.05, 0.0, 0.0]
    common = 0.04 * 0.4 + -0.1 * -0.05
    left = place([0.0, 0.08, -0.3], 1.0, linear, angular)
    right = place([0.0, -0.08, -0.3], -1.0, linear, angular)
    assert left[1] == pytest.approx(0.08 + common + 0.05 * 0.4, abs=1e-15)
    assert right[1] == pytest.approx(-0.08 + common - 0.05 * 0.4, abs=1e-15)


def test_clearance_widens_whichever_way_the_push():
    for lateral in (0.5, -0.5):
        left = place([0.0, 0.08, 0.0], 1.0, [0.0, lateral, 0.0], [0.0] * 3, w_l=(0, 0))
        assert left[1] == pytest.approx(0.08 + 0.05 * 0.5, abs=1e-15)


@given(st.floats(-50, 50), st.floats(-50, 50), st.sampled_from([-1.0, 1.0]))
def test_saturation(along, aside, side):
    found = place([0.0, 0.08 * side, -0.3], side, [along, aside, 0.0], [0.0] * 3)
    x = 0.03 * along
    y = 0.08 * side + 0.04 * aside + side * 0.05 * abs(aside)
    assert found[0] == (x if abs(x) <= 0.15 else math.copysign(0.15, x))
    assert found[1] == pytest.approx(y if abs(y) <= 0.16 else math.copysign(0.16, y), abs=1e-15)


@given(*[st.floats(-1.0, 1.0)] * 5)
def test_the_law_is_mirror_symmetric(along, aside, roll, pitch, lateral):
    """Mirrored in the x-z plane: y, l^y and k^x change sign, and left becomes right."""
    left = place([along, 0.08, 0.0], 1.0, [along, aside, 0.0], [roll, pitch, lateral])
    right = place([along, -0.08, 0.0], -1.0, [along, -aside, 0.0], [-roll, pitch, lateral])
    assert left == pytest.approx(right * [1.0, -1.0, 1.0], abs=1e-15)


def test_sides_of_the_feet_are_those_of_the_paper():
    assert [foot.name for foot in ROBOT.feet] == ["right_foot", "left_foot"]
    assert foot_sides(standing_feet(ROBOT)) == (-1.0, 1.0)


def test_sides_of_any_number_of_feet():
    assert foot_sides(standing_feet(quadruped())) == (1.0, -1.0, 1.0, -1.0)
    assert foot_sides(np.array([[0.1, 0.0, -0.3], [0.0, 0.2, -0.3]])) == (0.0, 1.0)


def test_limits_are_about_the_stance_of_each_foot_where_asked_for():
    far = place([0.3, 0.2, 0.0], 1.0, [0.0] * 3, [0.0] * 3, centre=(0.2, 0.15, 0.0))
    assert far == pytest.approx([0.3, 0.2, 0.0], abs=1e-15)
    beyond = place([0.4, -0.2, 0.0], 1.0, [0.0] * 3, [0.0] * 3, centre=(0.2, 0.15, 0.0))
    assert beyond == pytest.approx([0.35, -0.01, 0.0], abs=1e-15)


@pytest.mark.parametrize(
    ("planned", "place", "kept"),
    [
        (0.1, 0.3, 0.15),  # as far as p_max,
        (0.2, 0.3, 0.2),  # or as the plan where that is farther,
        (0.2, 0.18, 0.18),
        (-0.2, 0.3, 0.15),  # on its side only
        (-0.2, -0.3, -0.2),
    ],
)
def test_limits_hold_no_foot_back_from_its_planned_place(planned, place, kept):
    found = np.array([1.0 + place, 2.0, 0.0])
    keep_within(
        np.array([0.15, 0.16]),
        np.array([1.0, 2.0, 0.0]),
        np.array([1.0 + planned, 2.0, 0.0]),
        found,
    )
    assert found == pytest.approx([1.0 + kept, 2.0, 0.0])


def test_limits_in_which_a_robot_cannot_stand_are_in_the_load_report():
    Params = LandingHeuristic.Params
    assert not list(
        LandingHeuristic.requires(Params(), Context("block", Clock(0.002), robot=ROBOT))
    )
    (unmet,) = LandingHeuristic.requires(
        Params(), Context("block", Clock(0.002), robot=quadruped())
    )
    assert unmet.message.startswith("front_left of quadruped stands 0.")
    assert unmet.message.endswith("beside the centre of mass, which is beyond p_max")
    assert (unmet.parameter, unmet.fix) == ("p_max", "limits_about: stance")
    assert not list(
        LandingHeuristic.requires(
            Params(limits_about="stance"), Context("block", Clock(0.002), robot=quadruped())
        )
    )


def test_four_feet_land_where_planned_and_spread_when_pushed_aside():
    robot = quadruped()
    feet = standing_feet(robot)
    bench = BlockBench(LandingHeuristic, {"limits_about": "stance"}, robot=robot)
    com = np.array([0.0, 0.0, 0.3])
    bench.set("reference", com=com, orientation=LEVEL, foot_position=feet + com)
    bench.set("terms", com=com, foot_position=feet + com, base_rotation=np.eye(3))
    bench.set("phase", phase=Phase.FLIGHT, time_to_touchdown=0.2)
    bench.step()
    assert bench.get("feet").landing == pytest.approx(feet, abs=1e-12)
    bench.set("terms", linear_momentum=[0.0, 0.5, 0.0])
    bench.step()
    moved = bench.get("feet").landing - feet
    expected = 0.04 * 0.5 + np.array([1.0, -1.0, 1.0, -1.0]) * 0.04 * 0.5
    assert moved[:, 1] == pytest.approx(expected, abs=1e-12)
    assert np.abs(moved[:, 0]).max() < 1e-12


# Which momentum.


def test_without_deviation_the_feet_land_where_planned():
    bench = make(**GAINS)
    motion = np.array([0.3, 0.1, 0.5])
    bench.set("reference", com_velocity=motion, angular_momentum=[0.0, 0.02, 0.0])
    bench.set("terms", linear_momentum=MASS * motion, angular_momentum=[0.0, 0.02, 0.0])
    assert fly(bench, 0.0, 0.3).landing == pytest.approx(FEET - COM, abs=1e-12)


def test_the_papers_law_answers_all_momentum_the_deviation_what_was_not_planned():
    planned, measured = np.array([0.2, 0.0, 0.0]), np.array([0.3, 0.0, 0.0])
    for law, felt in (("paper", MASS * 0.3), ("deviation", MASS * 0.1)):
        bench = make(law=law, **GAINS)
        bench.set("reference", com_velocity=planned)
        bench.set("terms", linear_momentum=MASS * measured)
        landing = fly(bench, 0.0, 0.3).landing
        assert landing[:, 0] == pytest.approx(FEET[:, 0] + 0.03 * felt, abs=1e-12)


@pytest.mark.parametrize(
    ("axis", "push"), [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)], ids=["+x", "-x", "+y", "-y"]
)
def test_a_push_on_the_torso_moves_the_feet_the_way_it_pushes(axis, push):
    """The momenta of an impulse 0.1 m above the centre of mass: k = r x l."""
    bench = make(**GAINS)
    linear = np.zeros(3)
    linear[axis] = push * 0.7
    angular = np.cross([0.0, 0.0, 0.1], linear)
    bench.set("terms", linear_momentum=linear, angular_momentum=angular)
    moved = fly(bench, 0.0, 0.3).landing - (FEET - COM)
    assert (moved[:, axis] * push).min() > 0.0 if axis == 0 else moved[:, 1].sum() * push > 0.0


@pytest.mark.parametrize("limits_about", ["com", "stance"])
@pytest.mark.parametrize("law", ["paper", "deviation", "predicted"])
def test_machine_code_computes_the_bytes_of_plain_python(law, limits_about):
    """From the thrust through a flight that is longer than planned to the ground, all at random."""
    params = {"law": law, "limits_about": limits_about, "alpha": [0.3, 0.8, 1.0], **GAINS}
    benches = [
        BlockBench(LandingHeuristic, params, robot=ROBOT, plain=plain) for plain in (False, True)
    ]
    random, seen = np.random.default_rng(4), []
    for phase, planned, left in (
        *[(Phase.THRUST, Phase.THRUST, 0.0)] * 2,
        *[(Phase.FLIGHT, Phase.FLIGHT, 0.3 - 0.1 * k) for k in range(4)],
        (Phase.FLIGHT, Phase.LANDING, 0.0),
        (Phase.LANDING, Phase.LANDING, 0.0),
    ):
        turn = np.zeros((3, 3))
        to_matrix(rotation_vector(0.1 * random.standard_normal(3)), turn)
        noise = {
            "reference": {
                "foot_position": (2, 3), "foot_velocity": (2, 3), "foot_yaw": 2, "com": 3,
                "com_velocity": 3, "angular_velocity": 3, "angular_momentum": 3,
            },
            "terms": {
                "velocity": 16, "contact_position": (4, 3), "contact_jacobian": (4, 3, 16), "com": 3,
                "com_velocity": 3, "linear_momentum": 3, "angular_momentum": 3,
                "centroidal_matrix": (6, 16), "base_position": 3, "foot_position": (2, 3),
            },
        }  # fmt: skip
        for port, shapes in noise.items():
            values = {name: 0.1 * random.standard_normal(shape) for name, shape in shapes.items()}
            for bench in benches:
                bench.set(port, **values)
        for bench in benches:
            bench.set("reference", phase=planned, orientation=rotation_vector([0.0, 0.1, 0.2]))
            bench.set("terms", base_rotation=turn)
            bench.set("phase", phase=phase, time_in_phase=0.3 - left, time_to_touchdown=left)
            bench.step()
        machine, plain = (bench.get("feet") for bench in benches)
        for name in ("position", "velocity", "rotation", "landing"):
            np.testing.assert_array_equal(getattr(machine, name), getattr(plain, name))
        seen.append(machine.landing.copy())
    assert np.abs(np.diff(seen[:-2], axis=0)).max(axis=(1, 2)).min() > 1e-3


# On the way there.


def test_the_foot_starts_where_it_is_and_arrives_in_time():
    bench = make(reach_share=0.7, **GAINS)
    off = np.array([[0.004, 0.002, -0.003], [0.001, -0.002, 0.002]])
    bench.set("terms", foot_position=FEET + off, linear_momentum=[0.5, 0.3, 0.0])
    to_base = COM - [0.0, 0.0, 0.37]
    first = fly(bench, 0.0, 0.3).position
    assert first == pytest.approx(FEET + off - COM + to_base, abs=1e-12)
    arrived = fly(bench, 0.21, 0.09)
    assert arrived.position == pytest.approx(arrived.landing + to_base, abs=1e-12)
    assert arrived.velocity == pytest.approx(np.zeros((2, 3)), abs=1e-12)


def test_the_target_velocity_is_the_rate_of_the_position():
    """The target moves in the body's frame as the base falls and turns."""
    bench, step = make(alpha=0.6, **GAINS), 1e-5
    rate, speed, com_speed = np.array([0.4, -1.0, 0.3]), np.array([0.2, 0.1, -0.5]), [0.1, 0, -1.0]
    planned_rate = np.array([0.1, -0.5, 0.0])
    bench.set("terms", linear_momentum=[0.5, 0.3, 0.0])
    seen = []
    for time in (0.0, 0.1 - step, 0.1, 0.1 + step):
        shift = time - 0.1 if time else 0.0
        turned, planned = np.zeros(4), np.zeros(4)
        multiply(rotation_vector([0.0, 0.2, 0.0]), rotation_vector(rate * shift), turned)
        multiply(rotation_vector([0.0, 0.2, 0.0]), rotation_vector(planned_rate * shift), planned)
        matrix = np.zeros((3, 3))
        to_matrix(turned, matrix)
        world_speed = np.zeros(3)
        rotate(turned, speed, world_speed)
        bench.set(
            "terms",
            base_rotation=matrix,
            base_position=np.array([0.0, 0.0, 0.37]) + shift * world_speed,
            velocity=np.concatenate([speed, rate, np.zeros(10)]),
            com=COM + shift * np.array(com_speed),
            com_velocity=com_speed,
        )
        bench.set("reference", orientation=planned, angular_velocity=planned_rate)
        feet = fly(bench, time, 0.3 - time)
        seen.append((feet.position.copy(), feet.velocity.copy()))
    found = (seen[3][0] - seen[1][0]) / (2 * step)
    # The deviating momentum is held, so the correction itself does not move.
    assert seen[2][1] == pytest.approx(found, abs=1e-5)


def test_alpha_decides_what_the_target_is_fixed_in():
    """The torso has pitched by 0.3 rad more than planned."""
    turned = np.zeros((3, 3))
    to_matrix(rotation_vector([0.0, 0.3, 0.0]), turned)
    for alpha in (0.0, 0.5, 1.0):
        bench = make(alpha=[0.3, alpha, 0.7])
        fly(bench, 0.0, 0.3)
        bench.set("terms", base_rotation=turned)
        feet = fly(bench, 0.25, 0.05)
        frame = np.zeros((3, 3))
        to_matrix(rotation_vector([0.0, 0.3 * alpha, 0.0]), frame)
        to_com = turned.T @ (COM - [0.0, 0.0, 0.37])
        assert feet.position[1] == pytest.approx(to_com + frame.T @ feet.landing[1], abs=1e-12)
        assert feet.rotation[1] == pytest.approx(frame.T, abs=1e-12)


def test_where_the_toes_land_first_the_legs_compensate_less_and_draw_nothing_in():
    turned = np.zeros((3, 3))
    to_matrix(rotation_vector([0.0, 0.3, 0.0]), turned)
    landed = []
    for toes_first in (False, True):
        bench = make(toes_alpha=[1.0, 0.25, 1.0], retraction=0.5, retraction_time=0.1)
        bench.set("reference", toes_first=toes_first)
        fly(bench, 0.0, 0.3)
        bench.set("terms", base_rotation=turned)
        landed.append(fly(bench, 0.25, 0.05))
    flat, toes = landed
    frame = np.zeros((3, 3))
    to_matrix(rotation_vector([0.0, 0.3 * 0.25, 0.0]), frame)
    assert toes.rotation[1] == pytest.approx(frame.T, abs=1e-12)
    assert flat.rotation[1] == pytest.approx(turned.T, abs=1e-12)
    heights = [
        float((turn @ feet.position[1])[2]) for turn, feet in ((turned, flat), (frame, toes))
    ]
    reached_down = retraction(0.05, 0.5, 0.1)[0]
    to_com = turned.T @ (COM - [0.0, 0.0, 0.37])
    lifted = heights[1] - float((frame @ to_com)[2]) - heights[0] + float((turned @ to_com)[2])
    assert lifted == pytest.approx(-reached_down, abs=1e-12)


def test_the_foot_heads_as_planned():
    bench = make()
    bench.set("reference", foot_yaw=[0.2, -0.1])
    rotation = fly(bench, 0.0, 0.3).rotation
    for foot, yaw in enumerate((0.2, -0.1)):
        assert rotation[foot][:, 0] == pytest.approx([math.cos(yaw), math.sin(yaw), 0.0])


def test_a_late_touchdown_keeps_the_plan_of_the_last_instant():
    bench = make(**GAINS)
    before = fly(bench, 0.299, 0.001)
    wanted = before.position.copy(), before.landing.copy()
    bench.set(
        "reference", phase=Phase.LANDING, com=COM - [0.0, 0.0, 0.05], com_velocity=[0, 0, -1.0]
    )
    late = fly(bench, 0.301, 0.0)
    assert late.position == pytest.approx(wanted[0], abs=1e-4)
    assert late.landing == pytest.approx(wanted[1], abs=1e-12)
    assert late.velocity == pytest.approx(np.zeros((2, 3)), abs=0.5)


def test_a_foot_still_in_the_air_goes_on_to_the_ground():
    bench = make(**GAINS)
    bench.set("terms", linear_momentum=[0.5, 0.0, 0.0])
    goal = fly(bench, 0.3, 0.0).landing[1] + COM
    down = np.array([[0.02, -0.08, 0.001], [0.02, 0.08, 0.012]])
    bench.set("terms", foot_position=down, com=COM - [0.0, 0.0, 0.01])
    bench.set("phase", phase=Phase.LANDING)
    bench.step()
    wanted = np.array([goal[0], goal[1], 0.001]) - [0.0, 0.0, 0.37]
    assert bench.get("feet").position[1] == pytest.approx(wanted, abs=1e-12)


def test_retraction_ends_at_zero_height_with_the_asked_speed():
    assert retraction(0.0, 0.4, 0.06) == (0.0, 0.4)
    assert retraction(0.06, 0.4, 0.06) == (0.0, 0.0)
    assert retraction(1.0, 0.4, 0.06) == (0.0, 0.0)
    for left in (0.01, 0.03, 0.05):
        height, rate = retraction(left, 0.4, 0.06)
        later = retraction(left - 1e-7, 0.4, 0.06)[0]
        assert height < 0.0
        assert rate == pytest.approx((later - height) / 1e-7, rel=1e-4, abs=1e-6)


def test_swing_blends_the_offset_out_and_the_correction_in():
    planned, goal, offset = np.zeros(3), np.array([0.1, 0.0, 0.0]), np.array([0.02, 0.0, 0.0])
    for share, wanted in ((0.0, 0.02), (0.5, 0.06), (1.0, 0.1)):
        out, speed = np.zeros(3), np.array([1.0, 0.0, 0.0])
        swing(planned, goal, offset, share, 2.0, out, speed)
        assert out[0] == pytest.approx(wanted)
        assert speed[0] == pytest.approx(1.0 + 2.0 * 0.08)


def test_hastened_feet_are_ahead_of_their_planned_way():
    """The lead itself grows from 0 to 20 ms."""
    swings, step = np.array([1.0, 0.3, 0.3]), 1e-6

    def at(time):
        out, speed = time * swings, swings.copy()
        apply_lead(swings, 0.02 * time / 0.1, 0.02 / 0.1, out, speed)
        return out, speed

    place, speed = at(0.1)
    assert place == pytest.approx([0.12 * 1.0, 0.12 * 0.3, 0.1 * 0.3], abs=1e-12)
    assert speed == pytest.approx((at(0.1 + step)[0] - place) / step, abs=1e-8)


def test_on_the_ground_the_target_is_the_plan():
    bench = make(**GAINS)
    bench.set("phase", phase=Phase.SQUAT)
    bench.set("terms", linear_momentum=[1.0, 1.0, 0.0])
    bench.step()
    assert bench.get("feet").position == pytest.approx(FEET - [0.0, 0.0, 0.37], abs=1e-12)
