"""BRUCE with further sensors, as a user's own description would mount them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from aloft.blocks.signals import CommandMode
from aloft.robots.description import RobotDescription, find_robot
from aloft.runtime.testing.bench import BlockBench

BRUCE = Path(__file__).parents[3] / "robots/bruce/bruce.yaml"


def bruce_with(**sensors: Mapping[str, Any]) -> RobotDescription:
    """BRUCE, with these sensors mounted."""
    with TemporaryDirectory() as folder:
        return find_robot(write_bruce_with(Path(folder), **sensors).name, Path(folder))


def write_bruce_with(folder: Path, **sensors: Mapping[str, Any]) -> Path:
    """The file ``sensing.yaml`` of BRUCE with these sensors."""
    data = yaml.safe_load(BRUCE.read_text(encoding="utf-8"))
    data["sensors"] = {**data.get("sensors", {}), **sensors}
    path = folder / "sensing.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return path


def hold(bench: BlockBench[Any], stiffness: float = 300.0, damping: float = 1.5) -> None:
    """Command the robot to hold the pose it is in."""
    bench.block.emit()
    joints = bench.get("joints")
    bench.set(
        "command", mode=CommandMode.ACTIVE, torque=joints.torque.copy(),
        position=joints.position.copy(), velocity=0.0, stiffness=stiffness, damping=damping,
    )  # fmt: skip
