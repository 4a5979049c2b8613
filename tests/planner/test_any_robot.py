"""The planner plans for a quadruped and a humanoid made of a few numbers, without a compiler."""

from functools import lru_cache

import numpy as np
import pytest
from tests.robots.limbed_robots import CORNERS, HUMANOID, STANDING, TWO, legged_robot, quadruped

from aloft.planner.checking.validity import check_plan
from aloft.planner.library.reference_table import reference_table
from aloft.planner.models.coordinates import full_coordinates
from aloft.planner.models.euler_angles import pose_of
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.models.robot_model import model_of
from aloft.planner.problem.structure import ContactRows
from aloft.planner.solving.solve import solve_jump
from aloft.planner.task.contact_groups import contact_points
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.task import make_task
from aloft.robots.description import RobotDescription

KNOTS = {"squat": 5, "thrust": 8, "flight": 10, "landing": 8}
FINER = {"squat": 8, "thrust": 14, "flight": 20, "landing": 14}
QUADRUPED = quadruped()
ARMS = [("neck", [0.0, 0.0, 0.2], [0.0, 1.0, 0.0], [-1.0, 1.0])]
BIPED = legged_robot(
    "biped", HUMANOID, [0.03, 0.0, -0.03], CORNERS, STANDING[1], TWO, ARMS, held={"neck": 0.2}
)


@lru_cache(maxsize=2)
def planned(robot_name: str) -> PlannedJump:
    robot = {"quadruped": QUADRUPED, "biped": BIPED}[robot_name]
    asked = {
        "recipe": "paper",
        "name": "jump",
        "rise": 0.08,
        "distance_x": 0.1,
        "impact": True,
        "effort": 0.9,
    }
    more = {"knots": KNOTS if robot is QUADRUPED else FINER}
    return solve_jump(make_task({**asked, **more}), robot)


@pytest.mark.long
@pytest.mark.parametrize("robot", [QUADRUPED, BIPED], ids=["quadruped", "biped"])
def test_a_jump_ahead(robot: RobotDescription) -> None:
    """Forces and motion are exact dynamics', and the task is done; the coarse grid alone may cost
    a little more than the check allows."""
    plan = planned(robot.name)
    assert plan.statistics["coordinates"] == "sagittal"
    report = check_plan(plan, robot)
    coarse = {"foot_slip", "foot_on_ground", "foot_below_ground", "joint_torque", "foot_clearance",
              "flight_position"}  # fmt: skip
    assert {test.name for test in report.failed} <= coarse, report.explain()
    assert report.figures["flight_error_mm"] < 4.0
    assert report.figures["rise_m"] == pytest.approx(0.08, abs=1e-3)
    moved = plan.com[-1, 0] - plan.com[0, 0]
    assert moved == pytest.approx(0.1, abs=0.05)


def test_held_joints_keep_their_angle_in_the_plan() -> None:
    plan = planned("biped")
    neck = [joint.name for joint in BIPED.joints].index("neck")
    assert (plan.position[:, 7 + neck] == 0.2).all()
    assert (plan.velocity[:, 6 + neck] == 0.0).all()
    assert np.abs(plan.joint_torque[:, neck]).max() > 0.0


@pytest.mark.parametrize("robot", [QUADRUPED, BIPED], ids=["quadruped", "biped"])
def test_the_reference_has_the_rates_of_its_places(robot: RobotDescription) -> None:
    table = reference_table(planned(robot.name), robot, 0.1)
    time = table.time
    flying = np.flatnonzero((time > table.lift_off_time) & (time < table.touchdown_time))[1:-1]
    for place, rate in (("foot_position", "foot_velocity"), ("com", "com_velocity")):
        moved = table.columns[place][flying + 1] - table.columns[place][flying - 1]
        span = (time[flying + 1] - time[flying - 1]).reshape(-1, *[1] * (moved.ndim - 1))
        assert np.abs(moved / span - table.columns[rate][flying]).max() < 0.05
    assert table.columns["foot_yaw"].shape == (len(time), len(robot.feet))
    assert np.abs(table.columns["foot_yaw"]).max() < 1e-6


@pytest.mark.parametrize("robot", [QUADRUPED, BIPED], ids=["quadruped", "biped"])
def test_contact_rows_are_independent(robot: RobotDescription) -> None:
    """Three rows for a ball, six for a flat foot, of full rank in all coordinates."""
    model, finder = model_of(robot)
    stance = finder.place(robot.standing_position[: model.n_joints])
    coordinates = full_coordinates(model)
    rows = ContactRows(model.robot, coordinates, stance.points)
    everything = set(range(len(robot.contacts)))
    kept = rows.velocities(everything)
    jacobian = ExactDynamics(model.robot).contact_jacobians(pose_of(stance.coordinates))[1]
    assert len(kept) == 12 == np.linalg.matrix_rank(jacobian[kept])
    assert np.linalg.matrix_rank(jacobian) == 12
    few = {k for k, contact in enumerate(robot.contacts) if contact.name.endswith(("0", "1"))}
    line = rows.velocities(few)
    assert len(line) == np.linalg.matrix_rank(jacobian[line])
    # A foot that stands on two of its points already turns about their line only.
    assert len(rows.places(everything, few)) == 12 - len(line)


@pytest.mark.long
def test_fore_feet_leave_first_and_hind_feet_land_last() -> None:
    """Raised points have no force and are above the ground, and exact dynamics of the motion with the forces left agree."""
    turns = {"take_off": {"fore": 0.06}, "touchdown": {"hind": 0.06}}
    values = {"recipe": "paper", "name": "bound", "rise": 0.08, "distance_x": 0.1, **turns}
    task = make_task({**values, "knots": {**KNOTS, "landing": 10}, "impact": True})
    plan = solve_jump(task, QUADRUPED)
    report = check_plan(plan, QUADRUPED)
    exact = {"force_without_contact", "force_balance", "violation", "pull", "friction", "rise"}
    assert not exact & {test.name for test in report.failed}, report.explain()
    fore = list(contact_points(QUADRUPED, "fore"))
    hind = [k for k in range(4) if k not in fore]
    at = {when: plan.knot_at(t) for when, t in (("before", plan.lift_off_time - 0.03),
                                                ("after", plan.touchdown_time + 0.03))}  # fmt: skip
    assert not plan.contact[at["before"], fore].any() and plan.contact[at["before"], hind].all()
    assert plan.contact[at["after"], fore].all() and not plan.contact[at["after"], hind].any()
    points = ExactDynamics(QUADRUPED)
    for when, raised in (("before", fore), ("after", hind)):
        assert points.points(plan.position[at[when]])[raised, 2].min() > 0.0
