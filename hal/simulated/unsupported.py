"""Parts of a robot's description that the simulator cannot do: rotors that couple joints of two branches, and feet that
cannot stand on level ground. A check of a graph looks at it without the simulator."""

from __future__ import annotations

import numpy as np

from ...robots.description import RobotDescription
from ...robots.kinematics import joints_above, standing_heights

UNEVEN = 0.002
"""The largest difference in height of contact points in the standing pose [m]."""


def unsupported_motor(robot: RobotDescription) -> str:
    """Return a text that names the motor whose rotor cannot be simulated, and the reason; empty if all can."""
    names = [joint.name for joint in robot.joints]
    above = [joints_above(robot, joint.child) for joint in robot.joints]
    for motor in shared_motors(robot):
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


def shared_motors(robot: RobotDescription) -> list[int]:
    """Return the motors that need a tendon: those geared to several joints, unless the couplings of all motors that
    have joints in common cancel, as in a differential of two equal motors."""
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


def uneven_contacts(robot: RobotDescription) -> str:
    """Return a text that names the contact points above the lowest one in the standing pose, with which the robot
    cannot stand on level ground; empty if there are none."""
    heights = standing_heights(robot)
    above = heights - heights.min(initial=np.inf)
    if float(above.max(initial=0.0)) <= UNEVEN:
        return ""
    found = [
        f"{contact.name} by {1e3 * height:.0f} mm"
        for contact, height in zip(robot.contacts, above.tolist(), strict=True)
        if height > UNEVEN
    ]
    return (
        f"{robot.name} cannot stand on level ground: in its standing pose these contact points are "
        f"above the lowest one: {', '.join(found)}"
    )
