"""``aloft export fmu``: the FMU gives the numbers of the graph, in FMPy and as a block."""

import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.needed import needs

import aloft
from aloft.extensions.export.fmi.exporting.slave import RunningGraph
from aloft.extensions.export.fmi.exporting.write import export
from aloft.runtime.language.errors import AloftError

fmpy = pytest.importorskip("fmpy")
needs("pythonfmu3")

CONTROLLER = """\
inputs:
  setpoint:
  measured:
outputs:
  force: bound.y
  wound: i.y
blocks:
  error: {use: blocks.Sum, with: {weights: [1, -1]}, in: {a: inputs.setpoint, b: inputs.measured}}
  p: {use: blocks.Gain, with: {gain: 20 N/m}, in: {u: error.y}}
  i: {use: blocks.Integrator, in: {u: error.y}}
  ki: {use: blocks.Gain, with: {gain: 10 N/(m s)}, in: {u: i.y}}
  sum: {use: blocks.Sum, in: {a: p.y, b: ki.y}}
  bound: {use: blocks.Saturation, with: {lower: -5, upper: 5}, in: {u: sum.y}}
"""
RAIL = """\
rate: 100 Hz
duration: 1 s
blocks:
  setpoint: {use: blocks.SineWave, with: {amplitude: 1 m, frequency: 1 Hz}}
  controller: {use: controller.yaml, in: {setpoint: setpoint.y, measured: plant.place}}
  plant: {use: plant.yaml, in: {force: controller.force}}
"""
PLANT = """\
inputs: {force: }
outputs: {place: place.y, speed: speed.y}
blocks:
  mass: {use: blocks.Gain, with: {gain: 0.5 1/kg}, in: {u: inputs.force}}
  speed: {use: blocks.Integrator, in: {u: mass.y}}
  place: {use: blocks.Integrator, in: {u: speed.y}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("controller", CONTROLLER), ("rail", RAIL), ("plant", PLANT)):
        (tmp_path / f"{name}.yaml").write_text(text)
    return tmp_path


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a computer without one, where FMUs run in Python."""
    monkeypatch.setattr("aloft.extensions.export.fmi.exporting.write.compiler", lambda: "")


@pytest.fixture(params=["c", "python"])
def kind(request: pytest.FixtureRequest) -> str:
    """Both kinds of FMU: of the library of C, and in Python."""
    if request.param == "python":
        request.getfixturevalue("no_compiler")
    elif not shutil.which("cc"):
        pytest.skip("there is no C compiler (cc)")
    return str(request.param)


@pytest.fixture
def reference(folder: Path) -> aloft.RunResult:
    result = aloft.load(folder / "rail.yaml").run()
    result.raise_if_failed()
    return result


def master(file: Path, inputs: dict[str, np.ndarray], outputs: list[str], ticks: int) -> Any:
    """Run an FMU with FMPy, one call after another: set the inputs, get the outputs, step."""
    from fmpy.fmi3 import FMU3Slave

    described = fmpy.read_model_description(str(file))
    references = {v.name: v.valueReference for v in described.modelVariables}
    fmu = FMU3Slave(
        guid=described.guid,
        unzipDirectory=str(fmpy.extract(str(file), str(file.with_suffix("")))),
        modelIdentifier=described.coSimulation.modelIdentifier,
    )
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    found = []
    for tick in range(ticks):
        for name, values in inputs.items():
            fmu.setFloat64([references[name]], np.atleast_1d(values[tick]).tolist())
        found.append(fmu.getFloat64([references[name] for name in outputs]))
        fmu.doStep(tick * 0.01, 0.01)
    fmu.terminate()
    fmu.freeInstance()
    return np.array(found)


def test_a_sub_graph_gives_in_fmpy_the_numbers_of_the_graph(
    folder: Path, reference: aloft.RunResult, kind: str
) -> None:
    made = export(str(folder / "rail.yaml"), folder / "controller.fmu", "controller")
    assert made.python == (() if kind == "c" else ("there is no C compiler (cc)",))
    assert made.problems == ()
    assert [(t.name, t.unit) for t in made.inputs] == [("setpoint", "m"), ("measured", "m")]
    assert [(t.name, t.unit) for t in made.outputs] == [("force", "N"), ("wound", "m s")]
    inputs = {
        "setpoint": reference.signal("setpoint.y.value")[:, 0],
        "measured": reference.signal("plant/place.y.value")[:, 0],
    }
    found = master(made.file, inputs, ["force", "wound"], 100)
    assert np.array_equal(found[:, 0], reference.signal("controller/bound.y.value")[:, 0])
    assert np.array_equal(found[:, 1], reference.signal("controller/i.y.value")[:, 0])
    assert np.ptp(found[:, 0]) > 5.0


def test_simulate_fmu_gives_the_same(folder: Path, reference: aloft.RunResult) -> None:
    made = export(str(folder / "rail.yaml"), folder / "plant.fmu", "plant")
    force = reference.signal("controller/bound.y.value")[:, 0]
    times = np.arange(100) * 0.01
    rows = np.array(list(zip(times, force, strict=True)), [("time", float), ("force", float)])
    found = fmpy.simulate_fmu(
        str(made.file), stop_time=0.99, step_size=0.01, output_interval=0.01, input=rows
    )
    assert found["place"] == pytest.approx(reference.signal("plant/place.y.value")[:, 0], abs=1e-12)
    assert np.ptp(found["place"]) > 0.1


@pytest.mark.parametrize("part", ["controller", "plant"])
def test_the_fmu_as_a_block_in_its_place_gives_the_same_numbers(
    folder: Path, reference: aloft.RunResult, part: str, kind: str
) -> None:
    export(str(folder / "rail.yaml"), folder / f"{part}.fmu", part)
    text = RAIL.replace(
        f"use: {part}.yaml", f"use: export.CoSimulation, with: {{file: {part}.fmu}}"
    )
    result = aloft.load(text, path=folder / "rail.yaml").run()  # the loop: the plant breaks it
    result.raise_if_failed()
    pairs = {
        "controller": ("controller.force.value", "controller/bound.y.value"),
        "plant": ("plant.place.value", "plant/place.y.value"),
    }
    one, other = pairs[part]
    assert np.array_equal(result.signal(one), reference.signal(other))


def test_a_snapshot_goes_through_the_fmu(folder: Path, kind: str) -> None:
    export(str(folder / "rail.yaml"), folder / "plant.fmu", "plant")
    text = RAIL.replace("use: plant.yaml", "use: export.CoSimulation, with: {file: plant.fmu}")
    with aloft.load(text, path=folder / "rail.yaml").open() as run:
        run.step(30)
        kept = run.snapshot()
        first = [run["plant.place.value"] for _ in range(20) if run.step()]
        run.restore(kept)
        second = [run["plant.place.value"] for _ in range(20) if run.step()]
    assert np.array_equal(first, second)
    assert np.ptp(first) > 0.0


def test_a_state_that_is_not_its_own_is_refused(
    folder: Path, tmp_path: Path, no_compiler: None
) -> None:
    export(str(folder / "rail.yaml"), folder / "plant.fmu", "plant")
    with zipfile.ZipFile(folder / "plant.fmu") as file:
        file.extractall(tmp_path / "plant")
    running = RunningGraph(tmp_path / "plant" / "resources" / "graph")
    kept = running.state()
    shifted = kept[:8] + kept[16:24] + kept[8:16] + kept[24:]  # as long, of other parts
    for wrong in (b"", kept[:-1], kept + b" ", bytes(32), shifted):
        with pytest.raises(ValueError, match="this is no state of this FMU"):
            running.restore(wrong)
    running.restore(kept)
    assert running.state() == kept
    running.close()


def test_a_whole_graph_has_its_external_blocks_as_inputs_and_vectors(folder: Path) -> None:
    text = """\
rate: 100 Hz
blocks:
  action: {use: blocks.External, with: {n: 3, initial: [1, 2, 3], unit: N}}
  twice: {use: blocks.Gain, with: {n: 3, gain: 2}, in: {u: action.y}}
"""
    (folder / "whole.yaml").write_text(text)
    made = export(str(folder / "whole.yaml"), folder / "whole.fmu")
    assert [(t.name, t.shape, t.start) for t in made.inputs] == [("action", (3,), [1.0, 2.0, 3.0])]
    block = "rate: 100 Hz\nduration: 0.02 s\nblocks:\n  unit: {use: export.CoSimulation, with: {file: whole.fmu}"
    alone = aloft.load(block + "}\n", path=folder / "g.yaml").run()
    assert alone.signal("unit.twice.y").tolist() == [[2.0, 4.0, 6.0]] * 2
    wired = block + ", in: {action: {value: {value: [5 N, 6 N, 7 N]}}}}\n"
    wired = wired.replace("{value: {value: [5 N, 6 N, 7 N]}}", "source.y")
    wired += "  source: {use: blocks.Constant, with: {value: [5 N, 6 N, 7 N]}}\n"
    result = aloft.load(wired, path=folder / "g.yaml").run()
    assert result.signal("unit.twice.y").tolist() == [[10.0, 12.0, 14.0]] * 2


def test_modules_and_files_travel_in_the_fmu(folder: Path, tmp_path_factory: Any) -> None:
    (folder / "helper.py").write_text("FACTOR = 3.0\n")
    (folder / "tripler.py").write_text(
        "from helper import FACTOR\n"
        "from aloft.blocks.general.arithmetic import Gain\n\n\n"
        "class Tripler(Gain):\n"
        '    """Three times the input."""\n\n'
        "    def step(self):\n"
        "        self.y.value[...] = FACTOR * self.u.value\n"
    )
    (folder / "own.yaml").write_text(
        "rate: 100 Hz\nblocks:\n"
        "  source: {use: blocks.External, with: {initial: [2]}}\n"
        '  own: {use: "tripler:Tripler", in: {u: source.y}}\n'
    )
    made = export(str(folder / "own.yaml"), folder / "own.fmu")
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    script = (
        "import sys, json, fmpy\n"
        "r = fmpy.simulate_fmu(sys.argv[1], stop_time=0.02, step_size=0.01, output_interval=0.01)\n"
        "print(json.dumps(r['own.y'].tolist()))\n"
    )
    moved = made.file.rename(elsewhere / "own.fmu")
    for name in ("helper.py", "tripler.py", "own.yaml"):
        (folder / name).unlink()
    done = subprocess.run(
        [sys.executable, "-c", script, str(moved)],
        check=False,
        cwd=elsewhere,
        capture_output=True,
        text=True,
    )
    assert json.loads(done.stdout.splitlines()[-1]) == [6.0, 6.0, 6.0], done.stderr


def test_a_step_that_is_no_whole_number_of_ticks_is_refused(folder: Path) -> None:
    export(str(folder / "rail.yaml"), folder / "plant.fmu", "plant")
    text = "rate: 300 Hz\nduration: 0.1 s\nblocks:\n  p: {use: export.CoSimulation, with: {file: plant.fmu}}\n"
    result = aloft.load(text, path=folder / "g.yaml").run()
    assert "is no whole number of the graph's ticks of 0.01 s" in result.reason


@pytest.mark.parametrize(
    ("part", "to", "outputs", "message"),
    [
        ("controler", "c.fmu", (), "no sub-graph 'controler'; the nearest is controller"),
        ("controller", "c.zip", (), "cannot be the name of an FMU; write it as my_controller.fmu"),
        ("controller", "c.fmu", ("controller/i.z",), "no output 'controller/i.z' inside; the near"),
        ("", "c.fmu", (), "every output of the graph is read by a block; name some with --output"),
    ],
)
def test_what_cannot_be_exported_is_said(
    folder: Path, part: str, to: str, outputs: tuple[str, ...], message: str
) -> None:
    if not part:
        (folder / "rail.yaml").write_text(
            "rate: 10 Hz\nblocks:\n  a: {use: blocks.Integrator, in: {u: b.y}}\n"
            "  b: {use: blocks.Gain, with: {gain: 1 1/s}, in: {u: a.y}}\n"
        )
    with pytest.raises(AloftError, match=message):
        export(str(folder / "rail.yaml"), folder / to, part, (), outputs)


@pytest.mark.long
def test_the_estimator_of_a_jump_as_an_fmu_beside_itself(tmp_path: Path) -> None:
    """Fields of robots: quaternions, switches as booleans, and files and robots that are shipped."""
    export("aloft:jump", tmp_path / "estimator.fmu", "estimator")
    (tmp_path / "both.yaml").write_text(
        "include: [jump.yaml]\nblocks:\n  unit:\n    use: export.CoSimulation\n"
        f"    with: {{file: {tmp_path / 'estimator.fmu'}}}\n"
        "    in: {robot_imu: robot.imu, robot_joints: robot.joints, contacts_state: contacts.state}\n"
    )
    text = (tmp_path / "both.yaml").read_text()
    graphs = Path(aloft.__file__).parent / "graphs"
    result = aloft.load(text, path=graphs / "both.yaml").run(0.3)
    for field in ("position", "orientation", "linear_velocity", "angular_velocity"):
        own = result.signal(f"estimator.base.{field}")
        assert np.array_equal(result.signal(f"unit.base.{field}"), own)
        assert np.ptp(own) > 0.0


@pytest.mark.long
def test_a_robot_without_feet_has_no_variable_for_its_switches(tmp_path: Path) -> None:
    project = Path(__file__).parents[5] / "docs" / "projects" / "cart_pole" / "balance.yaml"
    whole = export(str(project), tmp_path / "balance.fmu", outputs=["robot.contacts", "robot.imu"])
    assert whole.problems == ()
    assert [t.name for t in whole.outputs] == [
        "robot.imu.angular_velocity", "robot.imu.specific_force",
    ]  # fmt: skip
    found = fmpy.simulate_fmu(str(whole.file), stop_time=0.02, output_interval=0.002)
    assert len(found) == 11
