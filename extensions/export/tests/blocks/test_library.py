"""``export.CLibrary``: an exported library in the place of the blocks that it was made of."""

import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.extensions.export.blocks.library import CLibrary
from aloft.extensions.export.clib import remote_library
from aloft.extensions.export.clib.write import write_library
from aloft.files.problems import LoadError
from aloft.logs.recording.recorder import Recorder
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import replay
from aloft.runtime.language.errors import AloftError, BlockError
from aloft.runtime.testing.bench import BlockBench
from aloft.runtime.testing.conformance import check_block, conformance_cases

needs_compiler = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler (cc)")
CONTROLLER = """\
inputs: {wish: , measured: }
outputs: {force: bound.y, long_ago: slow.y}
blocks:
  pid: {use: blocks.PID, with: {kp: 20, ki: 5, kd: 3, unit: N/m}, in: {setpoint: inputs.wish, measured: inputs.measured}}
  gain: {use: blocks.Gain, with: {gain: 1}, in: {u: pid.u}}
  bound: {use: blocks.Saturation, with: {lower: -5, upper: 5}, in: {u: gain.y}}
  slow: {use: blocks.MovingAverage, rate: 100 Hz, with: {samples: 3}, in: {u: {from: bound.y, delay: 2}}}
"""
PLANT = """\
inputs: {force: }
outputs: {place: place.y}
blocks:
  mass: {use: blocks.Gain, with: {gain: 0.5 1/kg}, in: {u: inputs.force}}
  speed: {use: blocks.Integrator, in: {u: mass.y}}
  place: {use: blocks.Integrator, in: {u: speed.y}}
"""
RAIL = """\
rate: 500 Hz
duration: 0.4 s
blocks:
  wish: {use: blocks.Step, with: {at: 0.1 s, after: 1 m}}
  controller: {use: controller.yaml, in: {wish: wish.y, measured: plant.place}}
  plant: {use: plant.yaml, in: {force: controller.force}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A graph, and both halves of its loop as libraries."""
    made = tmp_path_factory.mktemp("library")
    for name, text in (("controller", CONTROLLER), ("plant", PLANT), ("rail", RAIL)):
        (made / f"{name}.yaml").write_text(text)
    for part in ("controller", "plant"):
        write_library(str(made / "rail.yaml"), made / part, part)
    return made


def with_library(*parts: str, more: str = "") -> str:
    text = RAIL
    for part in parts:
        text = text.replace(
            f"use: {part}.yaml", f"use: export.CLibrary, with: {{folder: {part}{more}}}"
        )
    return text


@needs_compiler
@pytest.mark.parametrize("parts", [("controller",), ("plant",), ("controller", "plant")])
def test_a_library_in_its_place_gives_the_same_bytes(folder: Path, parts: tuple[str, ...]) -> None:
    wanted = aloft.load(folder / "rail.yaml").run()
    result = aloft.load(with_library(*parts), path=folder / "sil.yaml").run()
    result.raise_if_failed()
    names = {
        "controller": ("controller.force", "controller/bound.y"),
        "plant": ("plant.place", "plant/place.y"),
    }
    for part, (port, source) in names.items():
        found = result.signal(f"{port if part in parts else source}.value")
        assert found.tobytes() == wanted.signal(f"{source}.value").tobytes()
        assert np.ptp(found) > 0.1


@needs_compiler
def test_units_are_checked_and_the_plant_breaks_the_loop(folder: Path) -> None:
    with pytest.raises(
        LoadError, match=r"plant.force does not fit wish.y: field 'value' is another quantity"
    ):
        aloft.load(
            with_library("plant").replace("controller.force", "wish.y"), path=folder / "g.yaml"
        )


@pytest.mark.long
@needs_compiler
def test_a_snapshot_and_a_replay_have_the_library(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "controller", tmp_path / "controller")
    for name in ("plant", "controller"):
        shutil.copy(folder / f"{name}.yaml", tmp_path)
    (tmp_path / "sil.yaml").write_text(with_library("controller"))
    with aloft.load(tmp_path / "sil.yaml").open() as run:
        run.step(70)
        kept = run.snapshot()
        first = [run["plant/place.y.value"].tolist() for _ in range(20) if run.step()]
        run.restore(kept)
        assert [run["plant/place.y.value"].tolist() for _ in range(20) if run.step()] == first
    aloft.load(tmp_path / "sil.yaml").run(sinks=[Recorder(tmp_path / "sil.rrd")]).raise_if_failed()
    shutil.rmtree(tmp_path / "controller")
    opened = OpenedRun.of(tmp_path / "sil.rrd")
    assert replay(opened).identical
    assert opened.restored.overrides.keys() == {"controller.folder"}


@needs_compiler
@pytest.mark.parametrize("part", ["controller", "plant"])
@pytest.mark.parametrize("case", conformance_cases())
def test_conformance(folder: Path, part: str, case: str) -> None:
    params = {"folder": str(folder / part)}
    check_block(CLibrary, params=params, rate=500.0, cases=[case])


@needs_compiler
def test_live_parameters_are_set_and_their_names_checked(folder: Path) -> None:
    more = ", live: {'controller/gain.gain[0]': 0.05}"
    text = with_library("controller", more=more)
    changed = aloft.load(text, path=folder / "g.yaml").run().signal("controller.force.value")
    overrides = ["controller/gain.gain=0.05"]
    wanted = aloft.load(folder / "rail.yaml", overrides).run().signal("controller/bound.y.value")
    assert changed.tobytes() == wanted.tobytes()
    plain = aloft.load(folder / "rail.yaml").run().signal("controller/bound.y.value")
    assert not np.array_equal(plain, wanted)
    with pytest.raises(LoadError, match=r"no live parameter 'gain'"):
        aloft.load(with_library("controller", more=", live: {gain: 1}"), path=folder / "g.yaml")


@needs_compiler
def test_a_step_that_fails_ends_the_run_with_its_code(folder: Path) -> None:
    with (
        BlockBench(CLibrary, {"folder": str(folder / "controller")}, rate=500.0) as bench,
        pytest.raises(BlockError, match="a step of controller returns NOT_FINITE: a signal is NaN"),
    ):
        bench.set("wish", value=[1e308])
        bench.set("measured", value=[-1e308])
        bench.step()


def wrong(folder: Path, change: str) -> str:
    """What loading says of a library with a fault."""
    description = folder / "controller.json"
    about: dict[str, Any] = json.loads(description.read_text())
    if change == "library":
        (folder / "libcontroller.so").write_bytes(b"not the one")
    elif change == "no library":
        (folder / "libcontroller.so").unlink()
    elif change == "processor":
        description.write_text(json.dumps({**about, "target": "wasm"}))
    elif change == "text":
        description.write_text("{")
    elif change == "other":
        description.write_text("[1]")
    elif change == "two":
        shutil.copy(description, folder / "other.json")
    with pytest.raises(LoadError) as caught:
        text = with_library("controller")
        if change == "rate":
            text = text.replace("rate: 500 Hz", "rate: 1 kHz")
        name = "nowhere" if change == "nowhere" else "controller"
        text = text.replace("folder: controller", f"folder: {name}")
        aloft.load(text, path=folder.parent / "g.yaml")
    assert str(caught.value).count("g.yaml:5") == 1, "one error"
    return str(caught.value)


@needs_compiler
@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("library", "is not the library that controller.json describes: its SHA-256 begins with"),
        ("no library", "libcontroller.so is missing: without a C compiler no shared library"),
        ("processor", "is for wasm, and this computer is x86_64; export it with --target x86_64"),
        ("text", "controller.json cannot be read: Expecting property name"),
        ("other", "controller.json describes no library; aloft export c writes such files"),
        (
            "two",
            "one description NAME.json, as aloft export c writes it; there is controller.json, other.json",
        ),
        ("nowhere", "there is no folder"),
        ("rate", "a step of controller is a tick of 0.002 s, and the block runs every 0.001 s"),
    ],
)
def test_wrong_files_give_one_clear_error(
    folder: Path, tmp_path: Path, change: str, text: str
) -> None:
    for name in ("controller", "plant"):
        shutil.copy(folder / f"{name}.yaml", tmp_path)
    shutil.copytree(folder / "controller", tmp_path / "controller")
    assert text in wrong(tmp_path / "controller", change)


JUMP = """\
rate: 500 Hz
duration: 4 s
robot: bruce
include: [trials/standard.yaml]
blocks:
  robot:
    use: hal.MujocoRobot
    with: {ground: {scene: flat}, seed: 0, actuators: {bus_period: 1 ms}}
    in: {command: controller.safety_command, push: push.push}
  push: {use: hal.Push, with: {force: 0 N}, in: {truth: robot.truth}}
  controller:
    use: export.CLibrary
    with: {folder: jumper}
    in: {robot_contacts: robot.contacts, robot_imu: robot.imu, robot_joints: robot.joints, robot_health: robot.health}
"""


@pytest.fixture(scope="module")
def jumper(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, aloft.RunResult]:
    """The controller of the jump as a library, and the jump of the graph in Python."""
    library = tmp_path_factory.mktemp("jump") / "jumper"
    write_library("aloft:jump.yaml", library)
    wanted = aloft.load("aloft:jump.yaml").run()
    wanted.raise_if_failed()
    assert wanted.ticks > 1000
    return library, wanted


def compare_jumps(folder: str, wanted: aloft.RunResult) -> None:
    """Every byte of what the simulated robot senses and gets is that of the graph in Python."""
    text = JUMP.replace("folder: jumper", f"folder: {folder}")
    graphs = Path(aloft.__file__).parent / "graphs"
    result = aloft.load(text, path=graphs / "sil.yaml").run(wanted.ticks / 500)
    fields = ("mode", "torque", "position", "velocity", "stiffness", "damping")
    pairs = {f"controller.safety_command.{f}": f"safety.command.{f}" for f in fields}
    sensed = ("imu.angular_velocity", "imu.specific_force", "joints.position", "contacts.closed")
    pairs |= {f"robot.{name}": f"robot.{name}" for name in sensed}
    for own, name in pairs.items():
        assert result.signal(own).tobytes() == wanted.signal(name).tobytes(), name
    assert np.ptp(wanted.signal("safety.command.torque")) > 5.0


@needs_compiler
@pytest.mark.long
def test_a_jump_with_its_controller_as_a_library(jumper: tuple[Path, aloft.RunResult]) -> None:
    library, wanted = jumper
    compare_jumps(str(library), wanted)


@contextmanager
def process(library: Path, memory: Path, *options: str) -> Iterator[list[str]]:
    """The exported program ``main`` as a process; what it has said is in the list at its end."""
    program, said = library / "main_program", []
    if not program.exists():
        command = [
            "cc",
            "-std=c11",
            "-O2",
            "-Wall",
            "-Wextra",
            "-Werror",
            "main.c",
            f"lib{library.name}.a",
        ]
        subprocess.run([*command, "-lm", "-pthread", "-o", program], cwd=library, check=True)
    started = subprocess.Popen([program, memory, *options], stderr=subprocess.PIPE, text=True)
    try:
        for _ in range(500):
            if memory.exists() and memory.stat().st_size and memory.read_bytes()[:4] == b"ART1":
                break
            time.sleep(0.01)
        yield said
    finally:
        started.terminate()
        said += (started.communicate(timeout=10)[1] or "").splitlines()
        assert started.returncode == 0, said


@needs_compiler
def test_a_process_in_lockstep_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    wanted = aloft.load(folder / "rail.yaml").run().signal("controller/bound.y.value")
    memory = tmp_path / "memory"
    text = with_library("controller", more=f", memory: {memory}")
    with process(folder / "controller", memory, "--lockstep") as said:
        result = aloft.load(text, path=folder / "g.yaml").run()
        result.raise_if_failed()
        found = result.signal("controller.force.value")
        other = (
            "rate: 500 Hz\nduration: 0.1 s\nblocks:\n  force: {use: blocks.Constant, with: {value: [1 N]}}\n"
            f"  plant: {{use: export.CLibrary, with: {{folder: plant, memory: {memory}}}, in: {{force: force.y}}}}\n"
        )
        with pytest.raises(AloftError, match=r"runs another library than plant"):
            aloft.load(other, path=folder / "g.yaml").run()
    assert found.tobytes() == wanted.tobytes()
    assert said[-1].startswith("200 ticks, 0 deadlines missed")
    assert not memory.exists()
    with pytest.raises(AloftError, match="start the program main of the library first"):
        aloft.load(text, path=folder / "g.yaml").run()


@needs_compiler
@pytest.mark.parametrize("shift", [-86400.0, 86400.0])
def test_a_wall_clock_that_is_set_ends_no_wait_for_a_process(
    shift: float, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory = tmp_path / "memory"
    text = with_library("controller", more=f", memory: {memory}")
    read = time.time
    monkeypatch.setattr(remote_library.time, "time", lambda: read() + shift)
    with process(folder / "controller", memory, "--lockstep"):
        result = aloft.load(text, path=folder / "g.yaml").run()
        result.raise_if_failed()
        assert result.ticks == 200


@needs_compiler
@pytest.mark.long
def test_a_process_in_real_time_answers_and_counts_its_deadlines(
    folder: Path, tmp_path: Path
) -> None:
    memory = tmp_path / "memory"
    text = with_library("controller", more=f", memory: {memory}").replace(
        "rate:", "clock: {kind: paced}\nrate:"
    )
    with process(folder / "controller", memory) as said:
        result = aloft.load(text, path=folder / "g.yaml").run()
        result.raise_if_failed()
        assert result.signal("controller.force.value").max() == 5.0, "the step of the wish"
    assert any("deadlines missed, longest" in line for line in said)
    ticks = int(said[-1].split()[0])
    assert ticks >= 100, "0.4 s at 500 Hz, on a machine that does other things, too"


@needs_compiler
@pytest.mark.long
def test_a_jump_with_its_controller_in_a_process(
    jumper: tuple[Path, aloft.RunResult], tmp_path: Path
) -> None:
    library, wanted = jumper
    memory = tmp_path / "memory"
    with process(library, memory, "--lockstep"):
        compare_jumps(f"{library}, memory: {memory}", wanted)
