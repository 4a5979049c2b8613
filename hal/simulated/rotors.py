"""The rotors of a simulated robot, and the inertia that they add to its joints.

With ``A`` the transmission's ``joint_to_motor`` and ``I_m`` the motors' rotor inertias at the
gearbox output, the rotors add ``A^T diag(I_m) A`` to the joint-space inertia. MuJoCo can express
that in two ways: by the armature of a joint, which is a term on the diagonal, and by the armature
of a fixed tendon whose length is a weighted sum of joint positions, which is a term of rank one. A
motor's row of ``A`` is such a weighted sum, so one tendon for each motor that is geared to several
joints is exact for any transmission, as long as each of these joints carries the next: the
simulator's inertia matrix has no entries for other pairs of joints.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.kinematics import joints_above

if TYPE_CHECKING:
    from mujoco import MjSpec


def joint_armature(robot: RobotDescription) -> Array:
    """The armature [kg m^2] (n_joints,) of the joints, from all motors without a tendon."""
    armature, shared = np.zeros(len(robot.joints)), _shared_motors(robot)
    for motor, inertia in enumerate(robot.motors.rotor_inertia.tolist()):
        if motor not in shared:
            armature += inertia * robot.joint_to_motor[motor] ** 2
    return armature


def add_rotors(spec: MjSpec, robot: RobotDescription) -> None:
    """Add a fixed tendon for every motor whose rotor couples joints.

    Raises:
        ValueError: a motor couples two joints neither of which carries the other.
    """
    complaint = unfit_motor(robot)
    if complaint:
        raise ValueError(f"{robot.name}: {complaint}")
    for motor in _shared_motors(robot):
        tendon = spec.add_tendon(
            name=f"rotor/{robot.transmission.motors[motor]}",
            armature=float(robot.motors.rotor_inertia[motor]),
        )
        for joint, weight in zip(robot.joints, robot.joint_to_motor[motor].tolist(), strict=True):
            if weight:
                tendon.wrap_joint(joint.name, weight)


def unfit_motor(robot: RobotDescription) -> str:
    """A text that says which motor's rotor cannot be simulated, and why; empty if all can."""
    names = [joint.name for joint in robot.joints]
    above = [joints_above(robot, joint.child) for joint in robot.joints]
    for motor in _shared_motors(robot):
        geared = np.flatnonzero(robot.joint_to_motor[motor]).tolist()
        for first in geared:
            for second in geared:
                if first < second and not (above[second][first] or above[first][second]):
                    return (
                        f"motor {robot.transmission.motors[motor]} is geared to {names[first]} and "
                        f"{names[second]}, and neither joint carries the other; the simulator "
                        "cannot express the inertia of such a rotor"
                    )
    return ""


def _shared_motors(robot: RobotDescription) -> list[int]:
    """The motors that need a tendon: those geared to several joints, unless the couplings of all
    motors that have joints in common cancel, as in a differential of two equal motors."""
    geared, inertia = robot.joint_to_motor != 0.0, robot.motors.rotor_inertia
    coupling = np.abs(robot.rotor_matrix - np.diag(np.diag(robot.rotor_matrix)))
    small = 1e-12 * float(np.abs(robot.rotor_matrix).max(initial=0.0))
    found = []
    for motor in range(len(inertia)):
        joints = geared[motor]
        for _ in range(len(inertia)):  # all joints that are geared to these over any motor
            joints = geared[(geared & joints).any(axis=1)].any(axis=0)
        joined = coupling[np.ix_(joints, joints)].max(initial=0.0) > small
        if inertia[motor] and geared[motor].sum() > 1 and joined:
            found.append(motor)
    return found
