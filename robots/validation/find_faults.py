"""All checks of a description, one after the other."""

from __future__ import annotations

from typing import Any

from ..robot_description import RobotDescription
from .actuation import check_actuation
from .bodies import check_bodies
from .draft import Draft
from .faults import RobotFault
from .joints import check_joints
from .looks import check_looks
from .names import check_names
from .stance import check_feet, check_poses
from .tree import check_tree
from .types import check_types


def find_faults(data: Any) -> tuple[RobotFault, ...]:
    """Every fault of a description, given as plain data: mappings, lists, numbers and text.

    A value of a wrong type is reported and otherwise passed over, so that it hides nothing else.
    Data without a fault can be read by ``RobotDescription.model_validate``.
    """
    if not isinstance(data, dict):
        found = "nothing" if data is None else f"a {type(data).__name__}"
        expected = "keys such as name, base, links and joints"
        return (RobotFault((), "this describes no robot", expected, found),)
    draft = Draft(data)
    check_types(draft, RobotDescription)
    check_names(draft)
    check_bodies(draft)
    check_joints(draft)
    check_tree(draft)
    check_actuation(draft)
    check_feet(draft)
    check_poses(draft)
    check_looks(draft)
    return tuple(draft.faults)
