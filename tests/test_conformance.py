"""Every block of ours keeps the promises of all blocks, with BRUCE and with a robot of every kind."""

from collections.abc import Sequence

import pytest

from aloft.runtime.language.errors import AloftError, BlockError
from aloft.runtime.language.registry import find_block, known_names
from aloft.runtime.testing.bench import BlockBench
from aloft.runtime.testing.conformance import check_block, conformance_cases, unmet_messages

OTHERS = (
    "go2",  # four legs, with points for feet
    "g1",  # soles and arms
    "bolt",  # two points, on which it cannot stand
    "simple_humanoid",  # motors that are too weak
)
"""One robot of each kind besides BRUCE; tests/robots and graphs/test_robots.py have every one."""
OF_ROBOTS = [name for name in known_names() if find_block(name).needs]
"""The blocks that behave differently with another robot."""
NOT_FOR_BRUCE = {
    "blocks.GravityCompensation": "for a fixed base; checked with an arm in its own test",
}
NEEDS_DRIVES = {
    "hal.BearRobot": "needs drives on serial ports; hal.TwinRobot is the same driver without them",
}
NEEDS_TERMINAL = {"hopping.Keyboard": "needs a terminal; checked with one in its own test"}
NEEDS_LIBRARY = {"export.CLibrary": "needs an exported library; checked with some in its own test"}
BEYOND = {
    ("go2", "hopping.SpeedPlan"): "no row of jumps of 0 m can be planned",
    ("bolt", "hal.MujocoRobot"): "its centre of mass is .* outside its contact points",
    ("bolt", "hal.TwinRobot"): "its centre of mass is .* outside its contact points",
    ("simple_humanoid", "hal.MujocoRobot"): "motor WAIST_P has 30 N m and would need",
}
"""What a robot cannot do although it fits, and how the error says so."""
ROWS_OF_BRUCE = {
    "hopping.SpeedPlan": "its example's rows of jumps are BRUCE's; Go2 shows how they are refused"
}
"""What takes others a minute of planning, to find that the example is not for them."""

LONG = {
    "hopping.OnlinePlanner": (
        "outputs written",
        "bounds",
        "inputs kept",
        "deterministic",
        "restored",
        "live parameters",
        "array allocations",
        "life",
    ),
    "blocks.WholeBodyController": ("live parameters",),
    "hal.MujocoRobot": ("array allocations",),
    "hal.TwinRobot": (
        "bounds",
        "machine",
        "deterministic",
        "restored",
        "array allocations",
        "life",
    ),
}
"""The checks that make several plans, controllers for every parameter or several twins, which takes
seconds. ``hal.MujocoRobot`` has most of the twin's among the fast ones."""


@pytest.mark.parametrize("name", known_names())
def test_conformance(name: str) -> None:
    conforms(name, [case for case in conformance_cases() if case not in LONG.get(name, ())])


@pytest.mark.long
@pytest.mark.parametrize("name", LONG)
def test_conformance_that_takes_seconds(name: str) -> None:
    conforms(name, LONG[name])


def conforms(name: str, cases: Sequence[str]) -> None:
    if name in NOT_FOR_BRUCE:
        assert unmet_messages(find_block(name), robot="bruce")
        pytest.skip(NOT_FOR_BRUCE[name])
    if name in NEEDS_DRIVES:
        assert not unmet_messages(find_block(name), robot="bruce")
        with pytest.raises(AloftError, match=r"the serial port .* cannot be opened"):
            BlockBench(find_block(name), find_block(name).example_parameters(), robot="bruce")
        pytest.skip(NEEDS_DRIVES[name])
    if name in NEEDS_TERMINAL:
        with pytest.raises(AloftError, match="standard input is no terminal"):
            BlockBench(find_block(name), robot="bruce")
        pytest.skip(NEEDS_TERMINAL[name])
    if name in NEEDS_LIBRARY:
        with pytest.raises(AloftError, match="there is no folder controller; write it with aloft"):
            BlockBench(find_block(name), find_block(name).example_parameters(), robot="bruce")
        pytest.skip(NEEDS_LIBRARY[name])
    check_block(find_block(name), robot="bruce", cases=cases)


@pytest.mark.long
@pytest.mark.parametrize("robot", OTHERS)
@pytest.mark.parametrize("name", OF_ROBOTS)
def test_conformance_with_other_robots(name: str, robot: str) -> None:
    block = find_block(name)
    reasons = unmet_messages(block, robot=robot)
    if reasons:
        pytest.skip("; ".join(reasons))
    if name in ROWS_OF_BRUCE and robot != "go2":
        pytest.skip(ROWS_OF_BRUCE[name])
    if (robot, name) in BEYOND:
        with pytest.raises(BlockError, match=BEYOND[robot, name]):
            BlockBench(block, block.example_parameters(), robot=robot)
        return
    try:
        check_block(block, robot=robot)
    except BlockError as error:
        if "ask for less" not in str(error):  # the example's jump is beyond this robot's motors
            raise
        pytest.skip(str(error))
