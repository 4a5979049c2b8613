"""Where a robot stands for given joint angles: on all of its contact points, however many."""

import numpy as np
import pytest
from tests.planner.models.test_symmetry import askew
from tests.robots.limbed_robots import humanoid, quadruped

from aloft.planner.models.coordinates import sagittal_coordinates
from aloft.planner.models.robot_model import Stance, model_of, symmetric_model_of, twin_model_of
from aloft.planner.task.files import PlanError
from aloft.planner.task.sequence import StanceLocation, ground_axes
from aloft.robots.description import RobotDescription, find_robot

AT_ORIGIN = StanceLocation(0.0, 0.0, 0.0, 0.0, 0.0)


def stand(robot: RobotDescription, heading: float = 0.0, **angles: float) -> Stance:
    standing = dict(robot.standing) | angles
    joints = np.array([standing.get(joint.name, 0.0) for joint in robot.joints])
    return model_of(robot)[1].place(joints, heading=heading, at=(0.1, -0.2, 0.05))


def test_a_quadruped_stands_on_four_balls() -> None:
    stance = stand(quadruped())
    assert np.abs(stance.points[:, 2] - 0.05).max() < 1e-12
    assert np.abs(stance.points.mean(axis=0)[:2] - [0.1, -0.2]).max() < 1e-12
    # The shanks lean, so the balls have rolled away from where they touch at the zero pose.
    assert np.abs(stance.footholds - stance.points)[:, 0].max() > 1e-3


def test_the_base_leans_where_the_hind_legs_are_bent_more() -> None:
    robot = quadruped()
    more = {f"{leg}_hip_pitch": 0.95 for leg in ("back_left", "back_right")}
    more |= {f"{leg}_knee": -1.8 for leg in ("back_left", "back_right")}
    stance = stand(robot, **more)
    assert np.abs(stance.points[:, 2] - 0.05).max() < 1e-6
    assert stance.coordinates[3] < -0.05
    turned = stand(robot, heading=0.7, **more)
    assert np.abs(turned.points[:, 2] - 0.05).max() < 1e-6
    assert turned.com[2] == pytest.approx(stance.com[2], abs=1e-9)


def test_one_leg_that_is_too_short_is_said_with_heights() -> None:
    with pytest.raises(PlanError, match=r"do not lie in one plane.*front_left_0 .*mm"):
        stand(quadruped(), front_left_knee=-2.2)
    try:
        stand(quadruped(), front_left_knee=-2.2)
    except PlanError as error:
        assert error.family == "stance"
        assert "choose angles that put all feet on the ground" in str(error)


@pytest.mark.parametrize(
    ("slope", "heading"),
    [((0.2, 0.0), 0.0), ((-0.2, 0.0), 0.0), ((0.0, 0.2), 0.0), ((0.1, 0.15), 0.6)],
)
def test_on_ground_that_leans_only_the_legs_lean(
    slope: tuple[float, float], heading: float
) -> None:
    robot = find_robot("bruce")
    finder = model_of(robot)[1]
    place = StanceLocation(0.1, -0.2, 0.05, heading, 0.0, slope)
    stance = finder.on_ground(robot.standing_position, place)
    level = finder.place(robot.standing_position, heading=heading, at=(0.1, -0.2, 0.05))
    below = place.height(stance.points[:, 0], stance.points[:, 1])
    np.testing.assert_allclose(stance.points[:, 2], below, atol=1e-9)
    assert np.ptp(stance.points[:, 2]) > 0.01
    np.testing.assert_allclose(stance.points.mean(axis=0), (0.1, -0.2, 0.05), atol=1e-9)
    np.testing.assert_allclose(stance.com[:2], level.com[:2], atol=1e-8)
    np.testing.assert_allclose(stance.coordinates[3:6], level.coordinates[3:6], atol=1e-12)
    # Feet are turned with the ground and not bent: their points keep their distances along it.
    axes, flat = ground_axes(slope, heading), ground_axes((0.0, 0.0), heading)
    np.testing.assert_allclose(
        (stance.points - (0.1, -0.2, 0.05)) @ axes,
        (level.points - (0.1, -0.2, 0.05)) @ flat,
        atol=1e-9,
    )


def test_ground_that_the_legs_do_not_reach_is_said() -> None:
    robot = find_robot("bruce")
    steep = StanceLocation(0.0, 0.0, 0.0, 0.0, 0.0, (0.75, 0.0))
    with pytest.raises(
        PlanError,
        match=r"bruce cannot stand upright on ground that rises by 42\.97 deg along x and 0 deg along y: "
        r".*ankle.* would pass its limit; ask for a smaller slope",
    ):
        model_of(robot)[1].on_ground(robot.standing_position, steep)


def test_nothing_to_stand_on() -> None:
    robot = find_robot("bruce").changed(contacts=())
    with pytest.raises(PlanError, match="bruce has no contact points to stand on"):
        stand(robot)


def test_talos_has_a_mirrored_twin_that_stands_in_the_sagittal_plane() -> None:
    """Its pelvis with the arms is heavier on one side, and it leans by 2 mrad to stand over the middle of its soles."""
    robot = find_robot("talos")
    assert symmetric_model_of(robot)[1].pairs == ()
    found = twin_model_of(robot)
    assert found is not None
    model, finder = found
    plane = sagittal_coordinates(model)
    assert plane is not None
    angles = np.array([robot.standing[joint.name] for joint in model.robot.joints])
    stance = finder.on_ground(angles, AT_ORIGIN)
    assert plane.contains(stance.coordinates[None])
    askew_stance = model_of(robot)[1].on_ground(angles, AT_ORIGIN)
    assert np.abs(stance.coordinates - askew_stance.coordinates).max() < 5e-3
    assert {load.joint for load in model.loads} == {load.joint for load in model_of(robot)[0].loads}


def test_only_a_robot_whose_limbs_mirror_each_other_has_a_twin() -> None:
    assert twin_model_of(quadruped()) is None  # is the same left and right by itself
    assert twin_model_of(askew(quadruped(), 0.05)) is not None
    assert twin_model_of(humanoid()) is None
