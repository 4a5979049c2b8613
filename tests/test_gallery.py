"""The gallery: every graph runs and does what its page says, and every file and picture is shown."""

import re
import runpy
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from aloft import RunResult, load
from aloft.extensions.export.fmi.exporting.write import export
from aloft.runtime.loading import checked_file

ROOT = Path(__file__).parent.parent
GALLERY = ROOT / "docs" / "gallery"
TEXT = (ROOT / "docs" / "gallery.md").read_text()


def run(graph: str, *settings: str) -> RunResult:
    return load(ROOT / "docs" / graph, list(settings)).run()


def test_thirteen_examples_each_with_a_picture_a_file_and_commands() -> None:
    sections = TEXT.split("\n## ")[1:]
    assert len(sections) == 13
    for section in sections:
        assert section.count("![") == 1 and "<!-- from: " in section and "```sh" in section
    shown = set(re.findall(r"\]\(gallery/(\S+)\)", TEXT))
    assert shown == {path.name for path in GALLERY.glob("*.[ps][nv]g")}


def test_the_mass_arrives_with_a_bounded_force() -> None:
    result = run("gallery/mass.yaml")
    assert abs(result.signal("place.y.value")[-1] - 1.0) < 1e-3
    assert result.signal("pid.u.value").max() == 5.0


@pytest.mark.long
@pytest.mark.parametrize("gain", [1.5, 3.0])
def test_the_pole_swings_up_and_stays(gain: float) -> None:
    result = run("projects/cart_pole/swing_up.yaml", f"swing.gain={gain}")
    place, angle = result.signal("robot.joints.position").T
    assert abs(angle[0] - 3.0) < 1e-6
    assert np.abs(np.sin(0.5 * angle[-500:])).max() < 0.05 and np.abs(place).max() < 1.5


@pytest.mark.long
def test_the_leg_hops_until_the_end() -> None:
    result = run("gallery/hop.yaml")
    height = result.signal("robot.joints.position")[:, 0]
    phase = result.signal("phase.state.index")
    lift_offs = np.flatnonzero((phase[1:] == 0) & (phase[:-1] == 2))
    apexes = [height[a:b].max() for a, b in pairwise(lift_offs)]
    assert len(apexes) >= 7 and abs(apexes[-1] - 0.43) < 0.01
    assert all(later > before for before, later in pairwise(apexes))


def test_the_ball_is_caught_unless_it_is_seen_badly() -> None:
    assert all(run("gallery/ball.yaml", f"seen.seed={seed}").success for seed in range(5))
    assert not all(
        run("gallery/ball.yaml", f"seen.seed={seed}", "seen.std=0.3").success for seed in range(5)
    )


def test_the_mass_is_the_same_on_two_machines() -> None:
    two = checked_file(GALLERY / "mass_two.yaml")
    one = {block.path: block for block in checked_file(GALLERY / "mass.yaml").blocks}
    assert {block.path: block.machine for block in two.blocks} == {
        path: "desk" if path in ("setpoint", "pid") else "rail" for path in one
    }


@pytest.mark.long
def test_the_mass_runs_as_two_processes(tmp_path: Path) -> None:
    command = ["run", str(GALLERY / "mass_two.yaml"), "--local", "--no-record"]
    done = subprocess.run(
        [sys.executable, "-m", "aloft", *command, "--set", "duration=0.5 s"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "pid@desk -> rail" in done.stdout


def test_the_policy_learns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(GALLERY)
    found = runpy.run_path("policy.py")
    assert found["most"] > -20.0 > found["total"](np.zeros(2))


@pytest.mark.long
def test_the_graph_with_a_topic_runs_without_a_router() -> None:
    result = run("gallery/ros2.yaml", "states.router=tcp/127.0.0.1:1")
    assert result.success and result.metrics["not_sent"] == 600


def test_the_controller_moves_the_mass_and_becomes_an_fmu(tmp_path: Path) -> None:
    result = run("gallery/fmu.yaml")
    assert abs(result.signal("place.y.value")[-1] - 1.0) < 1e-3
    export(str(GALLERY / "fmu.yaml"), tmp_path / "controller.fmu", "controller")
    assert (tmp_path / "controller.fmu").stat().st_size > 10_000


def test_the_links_of_the_urdf_reach_their_target() -> None:
    assert run("projects/arm/urdf.yaml").metrics["target_error_rad"] < 1e-3
