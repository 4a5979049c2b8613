"""The joints that belong to a leg, and the one among them that a foot rolls with."""

from __future__ import annotations

from ....robots.description import RobotDescription


def leg_joints(robot: RobotDescription, foot: int) -> tuple[int, ...]:
    """The joints between the base and a foot, from the base outwards."""
    carrier = {joint.child: index for index, joint in enumerate(robot.joints)}
    chain: list[int] = []
    link = robot.feet[foot].link
    while link in carrier:
        chain.append(carrier[link])
        link = robot.joints[chain[-1]].parent
    return tuple(reversed(chain))


def rolling_joint(robot: RobotDescription, foot: int) -> int | None:
    """The joint that turns a foot about its lateral axis while the foot rolls over its toes.

    It is the leg's last hinge whose axis is nearly across the robot (within 45 degrees of y, at the
    zero pose). A point foot has none: it does not roll, and its leg's last hinge is the knee.
    """
    name = robot.feet[foot].name
    if sum(contact.foot == name for contact in robot.contacts) < 2:
        return None
    for index in reversed(leg_joints(robot, foot)):
        joint = robot.joints[index]
        x, y, z = joint.axis
        if joint.kind == "hinge" and y * y > x * x + z * z:
            return index
    return None
