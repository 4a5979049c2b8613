"""What keeps ``aloft check`` quick: modules that it does not import, and garbage it does not look for."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
CODE = """
import gc, json, sys
found = []
sys.argv = ["aloft", "check", "--json", GRAPH]
from aloft.cli import run_arguments
gc.callbacks.append(lambda phase, about: found.append(phase))
try:
    run_arguments()
except SystemExit as left:
    print(json.dumps({"code": left.code, "modules": sorted(sys.modules), "collections": len(found)}))
"""
NOT_FOR_A_CHECK = (
    "mujoco", "pinocchio", "llvmlite", "scipy", "qpsolvers", "daqp", "clarabel", "rerun", "pyarrow",
    "matplotlib", "PIL", "zenoh", "rich", "multiprocessing", "asyncio", "numpy.random", "numpy.ma",
    "numpy.polynomial", "numpy.fft", "numpy.testing", "aloft.logs", "aloft.studies", "aloft.cli.run",
    "aloft.planner.solving", "aloft.planner.problem", "aloft.runtime.running", "aloft.runtime.links",
    "aloft.hal.simulated.plant", "aloft.hal.simulated.drives", "aloft.hal.simulated.drive_effects",
    "aloft.hal.simulated.imu_effects", "aloft.hal.simulated.switch_effects", "aloft.hal.simulated.gears",
    "aloft.hal.simulated.stribeck", "aloft.hal.simulated.gantry",
    "aloft.hal.simulated.sensors", "aloft.hal.simulated.mujoco_model",
)  # fmt: skip
"""Modules, with all that lies in them, which only a run needs, or a picture, or a report."""


@pytest.fixture(scope="module")
def start() -> dict[str, Any]:
    code = CODE.replace("GRAPH", repr(str(ROOT / "graphs" / "jump.yaml")))
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, check=True, timeout=240,
        env={name: value for name, value in os.environ.items() if not name.startswith("COV")},
    )  # fmt: skip
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    assert found["code"] == 0
    return found


@pytest.mark.parametrize("module", NOT_FOR_A_CHECK)
def test_a_check_imports_nothing_that_only_a_run_needs(start: dict[str, Any], module: str) -> None:
    imported = [m for m in start["modules"] if m == module or m.startswith(f"{module}.")]
    assert imported == []


def test_the_names_are_those_of_modules() -> None:
    own = [name for name in NOT_FOR_A_CHECK if name.startswith("aloft.")]
    for name in own:
        path = ROOT.joinpath(*name.split(".")[1:])
        assert path.is_dir() or path.with_suffix(".py").is_file(), name


def test_a_check_does_not_look_for_garbage(start: dict[str, Any]) -> None:
    assert start["collections"] == 0
