"""Arguments for the kernels of steered jumps, which a jump does not call, for ``test_kernels_compile``."""

import numpy as np
from tests.kernel_samples import NORMAL, records

from aloft.planner.library.jump_table import TableRows, fed_forward

HOPPING = "aloft.extensions.hopping.blocks."
STEERED = {
    "goal": [0.1, 0.02], "goal_heading": 0.1, "level": 0.0, "before": [0.0, 0.01],
    "before_heading": 0.0, "before_level": 0.0, "heading": 0.2, "asked": [0.1, 0.01, 0.1, 0.0],
    "taken": 3, "changed": 0, "nearest": 0,
}  # fmt: skip
STEERED_JUMP = {
    "time": 1.2, "lift_off_time": 1.0, "touchdown_time": 1.3, "com": [0.1, 0.0, 0.4],
    "com_velocity": [0.3, 0.0, 0.1], "com_acceleration": [0.0, 0.0, -9.8],
    "foot_position": NORMAL((2, 3)), "foot_velocity": NORMAL((2, 3)), "foot_yaw": [0.1, -0.1], "phase": 3,
    "orientation": [0.0, 0.1, 0.0, 0.99], "angular_velocity": NORMAL(3), "angular_acceleration": NORMAL(3),
    "angular_momentum": NORMAL(3), "angular_momentum_rate": NORMAL(3),
}  # fmt: skip
MOVED = {
    "moves": 1, "landing": [0.04, -0.01, 0.02, 0.1], "thrown": [0.04, -0.01, 0.02, 0.1],
    "thrust_began": [0.8, 0.8, 0.8, 0.8], "place": 0.01 * NORMAL(4), "rate": 0.1 * NORMAL(4),
    "acceleration": NORMAL(4), "final_rate": NORMAL(4), "swing_began": 1.0,
    "swing": 0.01 * NORMAL(4), "swing_rate": 0.1 * NORMAL(4),
}  # fmt: skip
RETARGETED = {
    "retarget_time": 0.1, "retarget_window": 0.2, "retarget_acceleration": 3.0, "retarget_limit": 0.05,
    "retarget_braking": 1.0, "retarget_spin": 20.0, "retarget_height": 0.03, "retarget_turn": 0.3,
    "foothold_time": 0.05, "foothold_limit": 0.03, "foothold_turn": 0.2,
}  # fmt: skip
TURNED_ROBOT = {"centroidal_matrix": NORMAL((6, 16)), "base_rotation": np.eye(3)}
MOTION_ROOM = {
    "quaternion": np.zeros(4), "axis": np.zeros(3), "spin": np.zeros(3), "middle": np.zeros(3),
    "middle_rate": np.zeros(3),
}  # fmt: skip
SAMPLES = {}
SAMPLES[HOPPING + "moved_landing.move_landing"] = (
    *records(STEERED_JUMP, TURNED_ROBOT, MOVED, MOTION_ROOM),
)
SAMPLES[HOPPING + "moved_landing.turn_body"] = (
    0.1, 0.5, 2.0, *records(STEERED_JUMP, TURNED_ROBOT, MOTION_ROOM),
)  # fmt: skip
SAMPLES[HOPPING + "moved_landing.turn_feet"] = (*records(STEERED_JUMP, MOVED, MOTION_ROOM),)
SAMPLES[HOPPING + "moved_landing.thrust_motion"] = (
    *records(MOVED),
    1,
    1.0,
    0.95,
)
SAMPLES[HOPPING + "moved_landing.fastest_change"] = 0.5, 3.0, 0.15
SAMPLES[HOPPING + "moved_landing.add_velocity_change"] = (
    *records(MOVED), 0, 0.04, *records({**STEERED_JUMP, "time": 0.85}, RETARGETED), 0.05,
)  # fmt: skip
SAMPLES[HOPPING + "moved_landing.move_footholds"] = (
    *records(MOVED),
    1,
    0.05,
    0.03,
)
SAMPLES[HOPPING + "moved_landing.begin_swing"] = records(MOVED, STEERED_JUMP)
SAMPLES[HOPPING + "moved_landing.swing_motion"] = (
    *records(MOVED), 2, *records(STEERED_JUMP), 1.0,
)  # fmt: skip
SAMPLES[HOPPING + "steered_plan.retarget"] = (
    *records(
        {"placed": False, "ahead": 0.12, "aside": -0.01, "turn": 0.1, "up": 0.0, "number": 4},
        {"phase": 3}, STEERED_JUMP, RETARGETED,
        {"ahead": 0.32, "back": 0.1, "aside": 0.3, "turn": 0.8},
        {"outcome": 0}, STEERED, MOVED,
    ),
)  # fmt: skip
STANDING = {"foot_position": NORMAL((2, 3)), "com": np.array([0.1, 0.0, 0.4])}
SAMPLES[HOPPING + "steered_plan.has_moved"] = (
    np.array([0.11, 0.02, 0.0]), 0.3, 0.05, *records({"asked_from": np.zeros(3), "asked_heading": 0.1}),
)  # fmt: skip
SAMPLES[HOPPING + "steered_plan.is_at_rest"] = (
    *records({**STANDING, "com_velocity": NORMAL(3)}, STANDING), 0.05,
    *records({"middle": np.zeros(3), "middle_rate": np.zeros(3), "vector": np.zeros(3)}),
)  # fmt: skip
WIDTH = len(fed_forward(2, 10))
ROWS_OF_SPEEDS = TableRows(
    np.concatenate([np.linspace(0.0, 3.2, 9), np.linspace(8.0, 11.2, 9)]), NORMAL((18, WIDTH)),
    NORMAL((18, WIDTH)), fed_forward(2, 10), np.array([0.4, 2.8]),
    np.array([[0.8, 1.05, 1.31], [1.44, 1.56, 1.82], [1.95, 2.07, 2.34], [2.46, 2.59, 2.85]]),
    np.array([1.31, 1.82, 2.34, 2.85]), np.zeros(4, np.bool_), np.ones((18, 4), np.bool_), np.zeros(WIDTH),
)  # fmt: skip
SPEED_JUMP = {
    "jump": 2, "landed": 3, "skipped": 0.5, "place": 0.3, "before": 0.05, "way": 0.1, "goal": 0.4, "begun": 4,
}  # fmt: skip
SAMPLES[HOPPING + "speed_plan.tell_goal"] = records(
    SPEED_JUMP, {"position": np.zeros(2), "heading": 0.0, "height": 0.0, "number": 0, "outcome": 0}
)
SAMPLES[HOPPING + "speed_plan.triangle_weight"] = (
    np.array([0.0, 0.1, 0.2]),
    1,
    0.07,
)
SAMPLES[HOPPING + "speed_plan.begin_next_jump"] = (
    0.12, 0.05, 30, ROWS_OF_SPEEDS, *records(SPEED_JUMP),
)  # fmt: skip
SAMPLES[HOPPING + "speed_plan.mix_rows"] = (
    1.9, 0.002, 0.002, ROWS_OF_SPEEDS, np.array([0.0, 8.0]), np.array([0.0, 0.1]),
    *records(
        SPEED_JUMP,
        {
            "com": np.zeros(3), "com_velocity": np.zeros(3), "com_acceleration": np.zeros(3),
            "orientation": np.zeros(4), "angular_velocity": np.zeros(3), "angular_acceleration": np.zeros(3),
            "angular_momentum": np.zeros(3), "angular_momentum_rate": np.zeros(3),
            "foot_position": np.zeros((2, 3)), "foot_velocity": np.zeros((2, 3)), "foot_yaw": np.zeros(2),
            "foot_pitch": np.zeros(2), "joint_position": np.zeros(10), "joint_velocity": np.zeros(10),
            "joint_acceleration": np.zeros(10), "joint_torque": np.zeros(10),
        },
        {"mixed": np.zeros(WIDTH), "added": np.zeros(2), "raised": np.zeros(2)},
    ),
)  # fmt: skip
