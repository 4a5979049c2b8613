"""Arguments for those kernels that a jump does not call, for ``test_kernels_compile``."""

import numpy as np

from aloft.blocks.control import frames
from aloft.blocks.control.leg_tracking import LegSettings, limb_geometry, limb_memory
from aloft.blocks.control.tasks import TaskError, TaskJacobian
from aloft.blocks.control.whole_body_controller import HoldSettings, SolverMemory
from aloft.blocks.scoring.estimator_score import EstimatorRecord
from aloft.blocks.scoring.footing import Footing
from aloft.blocks.scoring.jump_criteria import JumpRecord, JumpSeries
from aloft.blocks.signals import PhaseState, RobotTruth, WholeBodyCommand
from aloft.hal.simulated import external_forces
from aloft.hal.simulated.physics_step import JointResistance
from aloft.mathematics import elementwise
from aloft.mathematics.body_dynamics import BodyMotion, body_motion, composite_inertias
from aloft.mathematics.compiling import numpy_numbers
from aloft.mathematics.compiling.arguments import record_type
from aloft.mathematics.compiling.kernel_registry import arguments_of, is_kernel
from aloft.mathematics.landing_law import LandingCost, flight_map
from aloft.mathematics.pushed_motion import PushedTurns, SeenMotion, Stretches, turn_memory
from aloft.mathematics.whole_body_motion import (
    FixedPoints,
    GivenMotion,
    MotionTerms,
    motion_memory,
    set_poses_and_velocities,
)
from aloft.mathematics.whole_body_qp import RigidBodyTerms
from aloft.planner.library.jump_table import FlightRotation
from aloft.robots.description import find_robot
from aloft.robots.five_joint_leg import read_leg
from aloft.robots.kinematics import body_tree
from aloft.robots.limb import read_limb
from aloft.robots.limb_inverse import limb_scratch
from aloft.robots.terrain import Ground, HeightField, Terrain
from aloft.runtime.language.steps import as_record

from .robots.limbed_robots import quadruped

LEG = read_leg(find_robot("bruce"), 0)
LIMB = read_limb(find_robot("bruce"), 0)
MIDDLE = LIMB.limits.mean(axis=1)
TARGET = np.array([[0.05, -0.08, -0.3], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
POSE = np.array([[0.02, -0.06, -0.3], [1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
CHAIN = (LIMB.links, LIMB.tip, LIMB.limits, TARGET, np.array([1.0, 0.9, 0.3]))
COEFFICIENTS = np.array([0.2, 0.1, 0.05, -0.5, 0.1])
NORMAL = np.random.default_rng(3).standard_normal


def records(*fields):
    """Named tuples of arrays, as kernels get them of signals and parameters."""
    return tuple(
        record_type("Record", tuple(each))(*(np.array(value) for value in each.values()))
        for each in fields
    )


FLIGHT = flight_map(10, 4)._replace(
    drift=NORMAL((3, 3)), carried=NORMAL((12, 3)), turn=NORMAL((2, 12))
)
REGULAR = 3.0 * np.eye(3) + 0.5 * POSE[1:]
"""A matrix whose inverse is computed to the last bits."""
LANDING = LandingCost(
    np.array([0.02, -0.01, 0.03]),
    np.array([1.0, 2.0, 3.0, 1.5, 0.4, 0.3]),
    np.array([[-0.01, 0.02], [-0.03, 0.01]]),
    np.array([-0.02, 0.01]),
)
SOLES = np.array([[0.05, -0.08, 0.0], [-0.04, -0.08, 0.0], [0.05, 0.08, 0.0], [-0.04, 0.08, 0.0]])
MOVING = BodyMotion(*(NORMAL(shape) for shape in ((2, 3, 3), (2, 3), (1, 6), (2, 6), (2, 6))))
STEPPING = records(
    {
        "com": [0.02, 0.01, 0.3], "com_velocity": [-0.4, 0.1, 0.0], "angular_momentum": NORMAL(3),
        "mass_matrix": 4.8 * np.eye(16), "contact_position": SOLES, "contact_velocity": NORMAL((4, 3)),
        "foot_position": [[0.0, -0.08, 0.0], [0.0, 0.08, 0.0]],
        "foot_rotation": np.tile(np.eye(3), (2, 1, 1)),
    },
    {
        "steps": 2, "margin": 0.015, "confirmation": 0.006, "after": 0.08, "turn": 1.0,
        "duration": 0.13, "height": 0.015, "beyond": 0.1, "reach": 0.2, "apart": [0.6, 1.8],
        "settle": 0.35, "flat": 0.0005,
    },
    {
        "foot_of_point": [0, 0, 1, 1], "side": [-1.0, 1.0], "apart": [0.16, 0.16],
        "offset": 0.5 * SOLES, "mass": 4.8, "period": 0.002, "all": [True, True],
    },
    {
        "foot": 1, "elapsed": 0.05, "taken": 0, "outside": 0.0, "last": 0.0, "ground": 0.0,
        "heading": 0.1, "foothold": [[0.0, -0.08, 0.0], [0.0, 0.08, 0.0]],
    },
)  # fmt: skip
STEP_SCRATCH, STEP_PHASE = records(
    {
        "capture": [-0.1, 0.02], "nearest": np.zeros(2), "other": np.zeros(2),
        "middle": np.zeros(3), "standing": np.zeros(4, bool),
    },
    {
        "phase": 4, "time_in_phase": 0.1, "time_to_touchdown": 0.0, "time_since_touchdown": 0.2,
        "stance": [False, False, True, True], "stepping": np.zeros(4, bool),
        "step_acceleration": np.zeros((4, 3)),
    },
)  # fmt: skip
PLACE = records(
    {"time": 0.4, "lift_off_time": 0.5, "touchdown_time": 0.8},
    {"heading": 0.1, "origin": NORMAL(3), "off_place": 0.02 * NORMAL(3)},
    {"com": NORMAL(3), "com_velocity": NORMAL(3), "com_acceleration": NORMAL(3)},
    {"vector": NORMAL(3), "middle": NORMAL(3), "planned_middle": NORMAL(3)},
    {"place_gain": 0.3, "place_limit": 0.3, "place_time": 0.3},
)
LIMB_GEOMETRY = limb_geometry(find_robot("bruce"), 0, 0.05)
LIMB_TICK = records(
    {
        "position": np.tile([0.03, -0.07, -0.28], (2, 1)), "velocity": np.tile([0.5, -0.2, 0.9], (2, 1)),
        "rotation": np.tile(np.eye(3), (2, 1, 1)),
    },
    {"foot_pitch": np.array([0.1, 0.1])},
    {"position": np.tile(MIDDLE, 2)},
    {
        "known": np.array(True), "target": np.tile(TARGET, (2, 1, 1)),
        "position": np.tile(MIDDLE + 0.1, 2),
    },
    {"position": np.zeros(10), "velocity": np.zeros(10), "reachable": np.zeros(2, np.bool_)},
)  # fmt: skip
LEG_SETTINGS = LegSettings(
    *(np.array(value) for value in (0.005, 0.3, 3e-4, 0.3, 30.0)), np.array(False)
)
LIMB_SCRATCH = limb_memory(5)._replace(target=TARGET.copy(), twist=0.1 * NORMAL(6))
DRAW = np.random.default_rng(4).standard_normal
BASE = as_record(RobotTruth.allocate(find_robot("bruce").dimensions))
ROW = tuple(as_record(each.allocate({"n_feet": 2})) for each in (JumpRecord, JumpSeries))
FOLLOWED = records(
    {"rotation": np.tile(np.eye(3), (2, 1, 1))},
    {
        "time": 1.0, "lift_off_time": 0.7, "touchdown_time": 1.05, "phase": 3,
        "orientation": [0.02, 0.2, -0.03, 0.98], "joint_position": DRAW(10),
        "joint_velocity": DRAW(10), "joint_acceleration": DRAW(10),
    },
    {"position": np.zeros(10), "velocity": np.zeros(10), "reachable": np.zeros(2, bool)},
    {"plan_lead": 0.009, "level_time": 0.08, "late_time": 0.005},
    {
        "sole_joint": [4, 9], "sole_axis": [1.0, -1.0], "sole_lowest": [-2.0, -2.0],
        "sole_highest": [2.0, 2.0],
    },
    {
        "flew": True, "flown_time": 0.998, "flown_position": DRAW(10), "flown_velocity": DRAW(10),
        "flown_acceleration": DRAW(10),
    },
)  # fmt: skip
FALLING = records(
    {
        "com": [0.1, 0.0, 0.5], "com_velocity": [0.1, 0.0, -0.9], "angular_momentum": [0.0, 0.9, 0.0],
        "base_rotation": np.eye(3), "centroidal_matrix": NORMAL((6, 16)),
    },
    {
        "phase": 3, "touchdown_time": 1.35, "toes_first": True, "com": [0.1, 0.0, 0.5],
        "com_velocity": [0.1, 0.0, -0.9], "orientation": [0.0, 0.1, 0.0, 0.99],
    },
    {"late": 0.001, "before": 0.0, "spin": 1.01},
    {"toes_gain": 5.0},
    {"gain": 50.0, "early": 0.04, "late": 0.005, "aim": -0.04, "period": 0.002},
)  # fmt: skip
ROTATION = FlightRotation(
    np.array([1.0, 1.1, 1.25, 1.35]), np.array([10.0, 20.0, 20.0, 11.0]),
    np.array([6.0, 4.5, 1.5, 0.0]), np.array([1.08, 1.29, 20.0, 1.0]),
)  # fmt: skip
MODEL = records(
    {"base_position": NORMAL(3), "base_rotation": np.eye(3), "velocity": NORMAL(16)},
    {"position": 0.3 * NORMAL(10)},
)
FRAME = frames.Frame(NORMAL(3), np.eye(3), NORMAL(6), NORMAL((6, 16)), NORMAL(6))
POINT = records({"position": NORMAL(3), "velocity": NORMAL(3), "acceleration": NORMAL(3)})
TREE = body_tree(find_robot("bruce"))
TERRAIN = Terrain(
    -0.2,
    (Ground((0.0, 0.0, -0.1), (1.0, 1.0, 0.1), (0.2, -0.1)),),
    (HeightField((-1.0, -1.0), (0.0, 0.0), ((0.0, 0.1, 0.05), (0.02, 0.0, 0.07))),),
).surface
CHAIN_STARTS, CHAIN_ROWS = np.array([0, 1, 3, 5, 6]), np.array([0, 0, 1, 1, 2, 2])
"""The non-zeros of a matrix (3, 4) by columns: each row touches two neighbours."""
AT_TWO = GivenMotion(
    np.hstack([NORMAL((2, 3)), [[0.1, 0.3, -0.2, 0.9], [0.0, 0.6, 0.0, 0.8]], 0.3 * NORMAL((2, 10))]),
    NORMAL((2, 16)), NORMAL((2, 10)), 20.0 * NORMAL((2, 4, 3)),
)  # fmt: skip
SOLES_OF_TREE = FixedPoints(np.array([5, 5, 10, 10]), 0.05 * NORMAL((4, 3)), np.zeros(4))
EVALUATED = MotionTerms(
    *np.zeros((3, 2, 3)), np.tile([1.0, 1.2, 0.9, 0.1, -0.2, 0.05], (2, 1)), *NORMAL((3, 2, 4, 3)),
    np.zeros((2, 6)), np.zeros((2, 10)),
)  # fmt: skip
IN_MOTION = motion_memory(10)
set_poses_and_velocities(TREE, AT_TWO.position[1], AT_TWO.velocity[1], AT_TWO.bend[1], IN_MOTION)
composite_inertias(TREE, IN_MOTION.motion, IN_MOTION.composite)
SEEN = SeenMotion(
    *0.1 * NORMAL((3, 5, 3)), np.tile([1.0, 1.2, 0.9, 0.1, -0.2, 0.05], (5, 1)), np.tile(np.eye(3), (5, 1, 1)), NORMAL((5, 4, 3)),
)  # fmt: skip
PUSHED_TWICE = Stretches(
    np.array([0.01, 0.02]), np.array([0.01, 0.03]), np.array([0, 2]),
    np.array([[0.1, 0.2, 0.3, 0.1, 0.3, -0.2, 0.9]]), NORMAL((1, 6)), NORMAL((1, 4, 3)), *NORMAL((2, 1, 3)),
)  # fmt: skip
TURNING = PushedTurns(0.1 * NORMAL((5, 3)), NORMAL((5, 3, 3)), np.zeros((2, 4)), np.zeros((2, 3)))
CAPSULES = NORMAL((2, 3, 3)), NORMAL((2, 3, 3)), np.array([0.05, 0.1])
UNUSED = {
    "aloft.mathematics.segment_distances.bounded": (1.5,),
    "aloft.mathematics.segment_distances.segment_gap": tuple(NORMAL((4, 3))),
    "aloft.mathematics.segment_distances.capsule_gaps": (*CAPSULES, *CAPSULES, np.zeros((4, 3))),
    "aloft.mathematics.elementary.hypot": (0.3, -0.4),
    "aloft.mathematics.interpolation.cubic_motion": (
        *NORMAL((2, 4, 3)), np.array([0.0, 0.1, 0.1, 0.3]), np.array([0, 1, 2]), np.array([0.05, 0.0, 0.1]), *np.zeros((3, 3, 3)),
    ),
    "aloft.mathematics.euler_motion.euler_matrix": (*NORMAL((2, 3)), np.zeros((3, 3))),
    "aloft.mathematics.euler_motion.turn_ahead": (NORMAL((3, 3)), NORMAL(6), np.zeros(3)),
    "aloft.mathematics.euler_motion.turn_back": (NORMAL((3, 3)), NORMAL(6), np.zeros(3)),
    "aloft.mathematics.euler_motion.motions_in_body": (
        *NORMAL((2, 4, 3)), *NORMAL((2, 4, 9)), np.zeros((3, 3)), *np.zeros((2, 4, 9)),
    ),
    "aloft.mathematics.euler_motion.motions_in_world": (
        *NORMAL((2, 4, 3)), NORMAL((4, 9)), np.zeros((3, 3)), np.zeros((4, 9)),
    ),
    "aloft.mathematics.linear_algebra.weighted_sum": (np.array([0.3, 0.0, -0.2]), NORMAL((3, 9)), np.ones(9)),
    "aloft.mathematics.linear_algebra.pairwise_sum": (NORMAL(21),),
    "aloft.mathematics.linear_algebra.add_multiple": (NORMAL(9), 0.3, NORMAL(9)),
    "aloft.mathematics.banded_system.assemble_normal": (
        CHAIN_STARTS, CHAIN_ROWS, NORMAL(6), np.array([1.0, 0.5, 2.0, 1.5]), np.arange(3), 3,
        np.zeros((3, 8)), *np.zeros((2, 3), dtype=np.int64), np.zeros(3),
    ),
    "aloft.mathematics.banded_system.factorise_band": (
        12, 1e-3, np.array([np.roll([3.0, 0.5, -0.2, *[0.0] * 13], j % 8) for j in range(12)]),
        np.minimum(np.arange(12) + 2, 11),
    ),
    "aloft.mathematics.banded_system.solve_band": (
        3, np.array([[3.0, 0.5, 0.0], [0.0, 4.0, -0.7], [0.0, 0.0, 2.0]]), np.array([1, 2, 2]), NORMAL(3),
    ),
    "aloft.mathematics.banded_system.whole_blocks": (13,),
    "aloft.mathematics.banded_system.fill_zeros": (NORMAL(3),),
    "aloft.mathematics.banded_system.divide": (NORMAL(3), 1.7),
    "aloft.mathematics.banded_system.subtract_product": (NORMAL(3), 0.3, NORMAL(3)),
    "aloft.mathematics.banded_system.subtract_products": (
        NORMAL(21), *(each for factor in (0.3, -0.2, 0.0, 1.4, 0.7, -1.1, 0.9, 0.1) for each in (factor, NORMAL(21))),
    ),
    "aloft.mathematics.banded_system.without_products": (0.7, NORMAL(3), NORMAL(3)),
    "aloft.mathematics.banded_system.smallest_correction": (
        CHAIN_STARTS, CHAIN_ROWS, NORMAL(6), np.array([1.0, 0.5, 2.0, 1.5]), np.arange(3),
        np.array([3]), 1e-12, np.zeros((3, 8)), np.array([1, 2, 2]), np.zeros(3, dtype=np.int64), NORMAL(3),
        np.zeros(4), np.zeros(1, dtype=np.bool_), np.zeros(1, dtype=np.bool_),
    ),
    "aloft.mathematics.banded_system.keep_bounds": (
        NORMAL(9), np.full(9, -0.5), np.full(9, 0.5), np.ones(9), np.zeros(1, dtype=np.bool_),
    ),
    "aloft.mathematics.banded_system.hold_violated": (
        NORMAL(9), np.full(9, -0.5), np.full(9, 0.5), 1e-9, np.arange(9) % 3 == 0,
        np.zeros(9, dtype=np.int64), np.zeros(1, dtype=np.int64), NORMAL(9), np.zeros(1),
        np.zeros(1, dtype=np.bool_),
    ),
    "aloft.mathematics.ground_surface.height_of_slope": (
        TERRAIN.slopes[0], 0.3, 0.4, np.zeros(3),
    ),
    "aloft.mathematics.ground_surface.height_of_field": (
        TERRAIN.fields[0], TERRAIN.heights, -0.3, -0.6, np.zeros(3),
    ),
    "aloft.blocks.control.whole_body_controller.hold_torque": (
        np.ones(1, np.int64),
        as_record(PhaseState.allocate(find_robot("bruce").dimensions)),
        RigidBodyTerms(np.zeros((16, 16)), np.linspace(-1.0, 1.0, 16), np.ones((4, 3, 16))),
        as_record(WholeBodyCommand.allocate(find_robot("bruce").dimensions)),
        as_record(SolverMemory.allocate(find_robot("bruce").dimensions)),
        HoldSettings(np.zeros(1, np.int64), np.full(1, 0.9), np.full(1, 50.0)),
    ),
    "aloft.blocks.control.frames.move_model": (*MODEL, TREE, body_motion(10)),
    "aloft.blocks.control.frames.update_frame": (
        MODEL[0], TREE, body_motion(10), 5, np.array([0.1, -0.2, 0.3]), FRAME,
    ),
    "aloft.mathematics.whole_body_motion.evaluate_motion": (
        TREE, SOLES_OF_TREE, AT_TWO, motion_memory(10), EVALUATED,
    ),
    "aloft.mathematics.whole_body_motion.velocities_at_points": (
        NORMAL((2, 10, 6)), np.arange(30).reshape(3, 10) % 3 > 0, NORMAL((2, 3, 3)), NORMAL((2, 10)),
        np.zeros((6, 10)), np.zeros((2, 3, 6)),
    ),
    "aloft.mathematics.whole_body_motion.place_points": (
        NORMAL((4, 3, 3)), NORMAL((4, 3, 9)), np.array([2, 0]), NORMAL((2, 3)), np.zeros((2, 4, 3)),
    ),
    "aloft.mathematics.whole_body_motion.set_poses_at_instants": (
        TREE, AT_TWO.position, body_motion(10), np.zeros((2, 11, 3)), np.zeros((2, 11, 9)),
    ),
    "aloft.mathematics.whole_body_motion.set_poses_and_velocities": (
        TREE, AT_TWO.position[0], AT_TWO.velocity[0], AT_TWO.bend[0], motion_memory(10),
    ),
    "aloft.mathematics.whole_body_motion.momentum_terms": (
        AT_TWO.velocity[1, 6:], IN_MOTION, *np.zeros((3, 3)), np.zeros(6),
    ),
    "aloft.mathematics.body_dynamics.add_carried_inertias": (TREE, IN_MOTION.composite),
    "aloft.mathematics.pushed_motion.see_motion": (
        TREE, SOLES_OF_TREE, 0.3 * NORMAL((5, 10)), NORMAL((5, 10)), motion_memory(10), SEEN,
    ),
    "aloft.mathematics.whole_body_motion.point_terms": (
        SOLES_OF_TREE, AT_TWO.position[0], 0, body_motion(10), EVALUATED,
    ),
    "aloft.mathematics.whole_body_motion.solve_inertia": (
        EVALUATED.inertia[0], NORMAL(3), np.zeros(3),
    ),
    "aloft.mathematics.whole_body_motion.base_acceleration": (
        AT_TWO, 1, IN_MOTION, EVALUATED,
    ),
    "aloft.mathematics.whole_body_motion.joint_torques": (
        TREE, SOLES_OF_TREE, AT_TWO, 1, IN_MOTION, EVALUATED,
    ),
    "aloft.mathematics.pushed_motion.turn_rate": (
        np.eye(3), NORMAL(3), NORMAL(3), NORMAL((3, 3)), NORMAL(7), turn_memory(), np.zeros(7),
    ),
    "aloft.mathematics.pushed_motion.set_pushes": (SEEN, PUSHED_TWICE, 0, TURNING),
    "aloft.mathematics.pushed_motion.follow_turns": (SEEN, PUSHED_TWICE, 0, turn_memory(), TURNING),
    "aloft.mathematics.pushed_motion.follow_stretches": (
        SEEN, PUSHED_TWICE, turn_memory(), TURNING, np.zeros((2, 3)), np.zeros((2, 6)),
    ),
    "aloft.mathematics.body_dynamics.rotation_jacobian": (
        TREE, body_motion(10), 5, np.zeros((3, 16)),
    ),
    "aloft.blocks.control.tasks.frame_position.FramePosition.error": (
        FRAME, *POINT, TaskError(*np.zeros((3, 3))),
    ),
    "aloft.blocks.control.tasks.frame_position.FramePosition.jacobian": (
        FRAME, TaskJacobian(np.zeros((3, 16)), np.zeros(3)),
    ),
    "aloft.blocks.control.circle_target.CircleTarget.step": (
        *POINT,
        *records(
            {
                "centre": POSE[0], "radius": 0.05, "axis": 1, "turn_time": 2.0, "start": 0.5,
                "growth": 1.0,
            },
        ),
        record_type("Clock", ("tick", "base_period"))(np.array(400), 0.002),
    ),
    "aloft.blocks.jumping.plan_progress.follow_fall": (1.23, *FALLING),
    "aloft.blocks.jumping.plan_progress.time_to_fall": (0.35, -0.8),
    "aloft.blocks.jumping.plan_progress.follow_turn": (
        1.23, *FALLING[:2], ROTATION, FALLING[2], FALLING[4],
    ),
    "aloft.blocks.jumping.plan_progress.value_at": (*ROTATION[:2], 1.23),
    "aloft.blocks.jumping.plan_progress.turned_beyond": (np.eye(3), np.array([0.0, 0.1, 0.0, 0.99])),
    "aloft.blocks.control.safety_monitor.first_bad_switch": records({"fault": [0, 0, 2, 0]}),
    "aloft.blocks.control.leg_inverse_kinematics.follow_plan": FOLLOWED,
    "aloft.blocks.control.leg_inverse_kinematics.continue_flight": (*FOLLOWED[1:4], FOLLOWED[5]),
    "aloft.blocks.control.leg_inverse_kinematics.extrapolate": (*DRAW((3, 10)), 0.01, FOLLOWED[2]),
    "aloft.blocks.control.leg_inverse_kinematics.keeps_acceleration": (
        FOLLOWED[1], FOLLOWED[3], FOLLOWED[5],
    ),
    "aloft.blocks.control.leg_inverse_kinematics.lead_share": FOLLOWED[1:2],
    "aloft.blocks.control.leg_inverse_kinematics.excess_pitch": (np.eye(3), 0.1),
    "aloft.blocks.control.leg_inverse_kinematics.level_sole": (1, *FOLLOWED[:5], 0.1),
    "aloft.blocks.control.balance_target.correct_position": PLACE,
    "aloft.blocks.jumping.capture_step.best_foot": (*STEPPING, STEP_SCRATCH, 5.7),
    "aloft.blocks.jumping.capture_step.aim_step": (*STEPPING, STEP_SCRATCH, 1, 5.7, 0.05),
    "aloft.blocks.jumping.capture_step.swing_foot": (
        STEP_PHASE, *STEPPING, STEP_PHASE, STEP_SCRATCH, 5.7,
    ),
    "aloft.blocks.jumping.capture_step.leave_hovering": (
        SOLES + np.tile([[0.0], [0.002]], (2, 3)), np.array([0, 0, 1, 1]), 0.0005,
        np.array([True, True, False, True]), np.zeros(4, bool),
    ),
    "aloft.mathematics.capture_step.nearest_in_foot": (
        SOLES, np.array([0, 0, 1, 1]), 1, np.array([0.1, 0.02]), np.zeros(2),
    ),
    "aloft.mathematics.capture_step.farthest_foot": (
        SOLES, np.array([0, 0, 1, 1]), 2, np.array([0.1, 0.02]), np.zeros(2),
    ),
    "aloft.blocks.jumping.capture_step.choose_foothold": (
        *STEPPING[:3], STEP_SCRATCH, 1, 6.0, 0.1, np.zeros(3),
    ),
    "aloft.blocks.jumping.capture_step.swing_points": (*STEPPING, STEP_PHASE, 1),
    "aloft.mathematics.capture_step.limit_foothold": (
        np.array([0.1, -0.08, 0.0]), 0.3, 1.0, 0.2, 0.09, 0.27, np.array([-0.3, 0.02, 0.0]),
    ),
    "aloft.blocks.scoring.estimator_score.record_landing": (as_record(EstimatorRecord.allocate()),),
    "aloft.blocks.scoring.footing.add_roll": (
        Footing(quadruped()).ball_feet(), 0.2 * DRAW(12), np.array([0.1, 0.2, 0.0, 0.97]), DRAW((4, 3, 3)),
        DRAW((4, 2)),
    ),
    "aloft.blocks.scoring.jump_score.record_row": (
        BASE, *ROW, *records({"rest_time": 0.5}, {"planned": True}, {"ending": 0, "landed": 0.0}),
    ),
    "aloft.blocks.scoring.jump_score.record_jump": (*ROW, *records({"ground_tolerance": 0.005}), True),
    "aloft.blocks.scoring.jump_score.compare_landing_position": ROW,
    "aloft.blocks.scoring.jump_score.keep_position": (ROW[1],),
    "aloft.blocks.scoring.jump_score.keep_worst": (np.array(0.1), np.array(1), 0.2, 2),
    "aloft.hal.simulated.base.report_fixed": (BASE,),
    "aloft.hal.simulated.base.report_planar": (POSE[0], POSE[3], BASE),
    "aloft.hal.simulated.base.read_pitch_rate": (POSE[0], np.zeros(3)),
    "aloft.hal.simulated.external_forces.apply_push": (
        np.array([3.0, -2.0, 1.0]), np.array(1),
        external_forces.PushPoints(
            np.array([2, 0]), np.array([1, 1]), DRAW((3, 3)), DRAW((2, 3)), np.zeros((2, 6)),
            np.zeros(1, np.bool_),
        ),
    ),
    "aloft.mathematics.capture_step.approach": (0.1, -0.3, 0.2, 0.05),
    "aloft.mathematics.landing_law.map_flight": (
        np.vstack([NORMAL((3, 16)), np.hstack([REGULAR, NORMAL((3, 13))])]), NORMAL((4, 3, 16)),
        np.eye(3), 4.8, 0.5, flight_map(10, 4),
    ),
    "aloft.mathematics.landing_law.predict_tilt": (
        FLIGHT, np.array([0.1, -0.05, 0.02]), np.array([0.02, 0.03, -0.01]), NORMAL(12), 0.2,
        0.7, np.array([1.0, 1.0, -1.0, -1.0]), np.zeros(2), np.zeros((2, 4)),
    ),
    "aloft.mathematics.landing_law.choose_shift": (
        np.array([0.1, -0.05]), NORMAL((2, 4)), LANDING, np.zeros((4, 4)), np.zeros(4),
    ),
    "aloft.mathematics.landing_law.invert": (REGULAR, np.zeros((3, 3))),
    "aloft.mathematics.linear_algebra.solve_rows": (
        REGULAR + REGULAR.T, np.array([[0.3, -0.2, 0.5], [1.0, 0.4, -0.7]]),
    ),
    "aloft.mathematics.rotations.pattern_turn": (
        POSE, POSE[0], TARGET, np.array([0.01, 0.02, 0.0]),
    ),
    "aloft.mathematics.landing_law.landing_position": (
        POSE[0], 1.0, POSE[1], POSE[2], np.array([0.1, 0.2, 0.3]), np.array([0.3, 0.2, 0.1]), 0.05,
        np.array([0.1, 0.2]), POSE[3], np.zeros(3),
    ),
    "aloft.mathematics.landing_law.turn_places": (POSE, 0.3, np.zeros((4, 3))),
    "aloft.robots.limb.set_limb_pose": (
        LIMB.links, LIMB.tip, MIDDLE, np.zeros((5, 6)), np.zeros((4, 3)),
    ),
    "aloft.robots.limb.limb_jacobian": (LIMB.links, np.ones((5, 6)), POSE, np.zeros((6, 5))),
    "aloft.robots.limb.aim": (POSE[0], POSE[1:], np.zeros((4, 3))),
    "aloft.robots.limb.foot_error": (
        LIMB.tip, POSE, TARGET, np.array([1.0, 0.9, 0.3]), np.zeros(6),
    ),
    "aloft.robots.limb.weigh_rows": (
        LIMB.tip, POSE, TARGET, np.array([1.0, 0.9, 0.3]), np.ones((6, 5)),
    ),
    "aloft.robots.limb_inverse.approach": (*CHAIN, 3, limb_scratch(5), MIDDLE),
    "aloft.robots.limb_inverse.reach": (
        *CHAIN, np.tile([*MIDDLE, 0.0], (3, 1)), 3, 3, limb_scratch(5), np.zeros(5),
    ),
    "aloft.robots.limb_inverse.limb_velocity": (
        *CHAIN, MIDDLE, np.ones(6), 3e-4, limb_scratch(5), np.zeros(5),
    ),
    "aloft.blocks.control.leg_tracking.watch_foot": (
        LIMB_GEOMETRY, 1, *LIMB_TICK[:2], True, 0.002, LIMB_TICK[3], limb_memory(5),
    ),
    "aloft.blocks.control.leg_tracking.follow_limb": (
        LIMB_GEOMETRY, 0, LIMB_TICK[0], *LIMB_TICK[2:4], LEG_SETTINGS, LIMB_SCRATCH, LIMB_TICK[4],
    ),
    "aloft.robots.limb.turning": (LIMB.tip, POSE, TARGET, 0.002, 10.0, np.zeros(3)),
    "aloft.robots.limb_inverse._stuck": (LIMB.limits, 1, 0.3, 1.0),
    "aloft.robots.limb._along": (POSE, LIMB.tip),
    "aloft.mathematics.rotations.unit": (0.1, 0.2, 0.3, 1.0, 0.0, 0.0),
    "aloft.robots.five_joint_leg.slide": (
        LEG, np.add(LEG.hip, [0.25, 0.02, -0.3]), np.eye(3), 0.005,
        0.1, 0.05, np.zeros(3), np.zeros(5),
    ),
    "aloft.mathematics.rotations.skew": (np.ones(3), np.zeros((3, 3))),
    "aloft.robots.five_joint_leg.pitched_line": (np.eye(3), 0.4, np.zeros(3)),
    "aloft.mathematics.rotations.yaw": (np.array([0.1, 0.2, 0.3, 0.9]),),
    "aloft.mathematics.rotations.pitch_angle": (np.array([0.1, 0.2, 0.3, 0.9]),),
    "aloft.mathematics.interpolation.lengthen": (
        np.array([0.01, -0.04, 0.0]), 0.7, 0.02, 0.25, 0.2, 0.6, *(np.ones(3) for _ in range(3)),
    ),
    "aloft.blocks.control.dynamics.lowest_point": (
        np.array([0.01, 0.0, -0.2]), 0.022, np.eye(3), np.zeros(3),
    ),
    "aloft.blocks.control.dynamics.rolling_drift": (MOVING, 1, POSE[0], POSE[1], np.zeros(3)),
    "aloft.robots.contact_kinematics.pattern_direction": (POSE[1:3], REGULAR, *np.ones((3, 3))),
    "aloft.blocks.control.joint_pd.add_friction": (
        *records(
            {"velocity": POSE[0]}, {"torque": np.ones(3)}, {"friction_speed": 0.3},
            {"friction": np.ones(3), "viscous_friction": POSE[1]},
        ),
    ),
    "aloft.blocks.control.joint_pd.add_soft_stops": (
        *records(
            {"position": [-1.02, 0.2, 0.99]},
            {name: np.ones(3) for name in ("stiffness", "position", "damping", "velocity")},
            {"stop_margin": 0.05, "stop_gain": 2.0},
            {
                "limits": np.tile([-1.0, 1.0], (3, 1)), "flight_stiffness": np.ones(3),
                "flight_damping": np.ones(3),
            },
        ),
    ),
    "aloft.robots.five_joint_leg.within_limits": (LEG, np.array([0.0, 0.1, -0.6, 1.2, -0.5])),
    "aloft.robots.five_joint_leg.keep_along": (
        np.array([0.0, 0.6, 0.8]), np.array([0.1, 0.2, 0.3]),
    ),
    "aloft.mathematics.inertial_filter.correct_tilt_from_gravity": (
        np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.3, 0.2, 9.8]), 0.01, np.zeros(3),
    ),
    "aloft.mathematics.invariant_filter.remove_contact": (1, np.full((37, 37), 0.5)),
    "aloft.mathematics.extended_pose.exponential": (
        np.linspace(-0.5, 0.6, 12), np.zeros(4), np.zeros((3, 3)),
    ),
    "aloft.mathematics.extended_pose.inv_left_jacobian_so3": (
        np.array([0.1, -0.4, 0.3]), np.array([0.5, 0.2, -0.3]), np.zeros(3),
    ),
    "aloft.mathematics.extended_pose.logarithm": (
        np.array([0.1, 0.2, 0.3, 0.92]), np.ones((3, 3)), np.zeros(12),
    ),
    "aloft.mathematics.extended_pose.divide": (
        np.array([0.1, 0.2, 0.3, 0.92]), np.ones((3, 3)), np.array([0.6, 0.0, 0.0, 0.8]),
        np.ones((3, 3)), np.zeros(4), np.zeros((3, 3)), np.zeros(4),
    ),
    "aloft.blocks.control.balance_target.add_quadratic_growth": (np.ones(3), 0.6, 0.25, np.zeros(3), np.zeros(3)),
    "aloft.mathematics.ticks.in_ticks": (0.5, 0.002),
    "aloft.mathematics.ticks.first_tick": (0.5, 0.002),
    "aloft.mathematics.ticks.since_begin": (1001.0, 3.0, 333.25),
    "aloft.mathematics.rotations.between": (
        np.array([0.0, 0.0, 0.6, 0.8]), np.array([0.0, 0.6, 0.0, -0.8]), 0.3, np.zeros(4),
    ),
    "aloft.mathematics.linear_algebra.add_product": (POSE, POSE[0], np.ones(4)),
    "aloft.mathematics.linear_algebra.multiply_matrices": (POSE, TARGET[1:], np.zeros((4, 3))),
    "aloft.mathematics.linear_systems.matrix_exponential": (
        4.0 * POSE[1:], np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)),
    ),
    "aloft.mathematics.linear_systems.first_order": (20.0, 0.002, True, np.zeros(5)),
    "aloft.mathematics.linear_systems.second_order": (20.0, 0.7, 0.002, False, np.zeros(5)),
    "aloft.mathematics.linear_systems.band_stop": (20.0, 2.0, 0.002, np.zeros(5)),
    "aloft.mathematics.linear_systems.settle": (COEFFICIENTS, POSE[0], np.ones((3, 2))),
    "aloft.mathematics.linear_systems.advance": (
        COEFFICIENTS, POSE[0], np.ones((3, 2)), np.zeros(3),
    ),
    "aloft.mathematics.interpolation.interval": (np.linspace(-1.0, 1.0, 9), 0, 9, 0.3),
    "aloft.mathematics.interpolation.interpolate": (np.linspace(-1.0, 1.0, 4), POSE[:, 2], 0.3, True),
    "aloft.mathematics.interpolation.interpolate_grid": (
        np.array([0.0, 1.0, 2.0, 4.0]), np.array([2, 2]), POSE[:, 1], np.array([0.3, 5.0]), False,
        np.zeros(2, np.int64), np.zeros(2),
    ),
    "aloft.mathematics.linear_systems.advance_transfer_function": (
        POSE[1:], POSE[0], TARGET[0], 0.5, POSE[:, 0], TARGET, np.zeros(3), np.zeros(4),
    ),
    "aloft.mathematics.rotations.from_euler": (POSE[1], np.zeros(4)),
    "aloft.mathematics.rotations.to_euler": (np.array([0.1, 0.2, 0.3, 0.92]), np.zeros(3)),
}  # fmt: skip
"""Arguments of kernels that ``graphs/jump.yaml`` does not call with either estimator."""
UNUSED |= {
    f"{each.__module__}.{each.__name__}": tuple([0.4, 0.7, 0.9][: len(arguments_of(each))])
    for each in vars(numpy_numbers).values()
    if is_kernel(each) and each.__module__ == numpy_numbers.__name__
}
UNUSED["aloft.runtime.running.finite.find_not_finite"] = (
    np.array([0.1, 5.0, -2.0]), np.zeros(1, np.int64),
)  # fmt: skip
UNUSED["aloft.hal.simulated.physics_step.begin_flight_step"] = (
    np.zeros(1), JointResistance(np.array([0.1, 0.2]), np.array([0.3, 0.4])),
    JointResistance(np.zeros(2), np.zeros(2)), np.zeros(1, np.int64), np.ones(1, np.int64),
)  # fmt: skip
UNUSED |= {
    f"{each.__module__}.{each.__name__}": tuple(
        0.7 if each.__annotations__[name] == "float" else NORMAL(4) for name in arguments_of(each)
    )
    for each in vars(elementwise).values()
    if is_kernel(each) and each.__module__ == elementwise.__name__
}
UNUSED["aloft.blocks.jumping.landing_heuristic.early_touchdown_offset"] = (
    *records(
        {"lift_off_time": 1.0, "touchdown_time": 1.3, "time": 1.27},
        {"foot_position": NORMAL((2, 3)), "contact_position": NORMAL((4, 3))},
    ), 0.02, *records({"lift_off_time": 1.0, "early": 0.001}, {"fall_speed": 1.2}),
)  # fmt: skip
UNUSED["aloft.blocks.general.user_code._write_time"] = np.array([7]), 0.002, np.zeros(3)

SENT = {"active": 1, "pending": 2, "due": np.arange(5), "mode": np.array([1, 1, 1, 0, 2])}
UNUSED |= {
    "aloft.hal.simulated.thrusters.send_thrust": records(
        {"thrust": NORMAL(4)}, SENT, {"thrust": NORMAL((5, 4))}
    ),
    "aloft.hal.simulated.thrusters.give_thrust": (
        *records(SENT, {"thrust": 3.0 * NORMAL((5, 4))}), np.full(4, 2.0), np.zeros(4),
    ),
    "aloft.hal.simulated.thrusters.read_thrust": (
        NORMAL(3), NORMAL(2), np.array([0, -1, 1]), *records({"thrust": np.zeros(3)}),
    ),
}  # fmt: skip
