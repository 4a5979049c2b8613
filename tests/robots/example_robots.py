"""The shipped robots whose URDFs are in the package example-robot-data, and where that is."""

from pathlib import Path

import pytest

from aloft.robots.importing.package_files import find_file

PACKAGE = "package://example-robot-data/robots/"
URDF = {
    "a1": "a1_description/urdf/a1.urdf",
    "alexander": "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
    "bolt": "bolt_description/robots/bolt.urdf",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "go2": "go2_description/urdf/go2.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "simple_humanoid": "simple_humanoid_description/urdf/simple_humanoid.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
}
INSTALLED = find_file(PACKAGE + URDF["go2"], Path("/")) is not None
needs_robots = pytest.mark.skipif(
    not INSTALLED, reason="the package example-robot-data is not installed (pip install it)"
)


def urdf(name: str) -> Path:
    """The URDF of a shipped robot."""
    path = find_file(PACKAGE + URDF[name], Path("/"))
    assert path is not None
    return path
