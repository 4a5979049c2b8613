"""``export.CoSimulation``: FMUs of FMI 2.0 and 3.0 as blocks, their units, state, log and hash."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.needed import needs

import aloft
from aloft.extensions.export.fmi.co_simulation import CoSimulation
from aloft.extensions.export.fmi.description import describe
from aloft.logs.file.reader import read
from aloft.logs.recording.recorder import Recorder
from aloft.runtime.language.errors import BlockError, RunError
from aloft.runtime.loading import LoadError
from aloft.runtime.testing import BlockBench

needs("fmpy", "pythonfmu3")

GRAPH = """\
rate: 100 Hz
duration: 0.5 s
blocks:
  wave: {use: blocks.SineWave, with: {amplitude: 3 N, frequency: 2 Hz}}
  spring: {use: export.CoSimulation, with: {file: spring.fmu, start: {mass: 1.5}}, in: {force: wave.y}}
  where: {use: blocks.Gain, with: {gain: 2 1/m}, in: {u: spring.position}}
"""

SLAVE_2 = '''\
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Integer, Real


class Rows(Fmi2Slave):
    """y = 2 u of a row of two, a count, and whether u[1] is above u[2]."""

    def __init__(self, **given):
        super().__init__(**given)
        self.u1 = self.u2 = self.y1 = self.y2 = 0.0
        self.n = 0
        self.above = False
        inward, outward = Fmi2Causality.input, Fmi2Causality.output
        for kind, name, causality, attribute in (
            (Real, "u[1]", inward, "u1"), (Real, "u[2]", inward, "u2"),
            (Real, "body.y[1]", outward, "y1"), (Real, "body.y[2]", outward, "y2"),
            (Integer, "n", outward, "n"), (Boolean, "above", outward, "above"),
        ):
            self.register_variable(kind(
                name, causality=causality,
                getter=lambda a=attribute: getattr(self, a),
                setter=lambda v, a=attribute: setattr(self, a, v),
            ))

    def do_step(self, time, period):
        self.y1, self.y2 = 2.0 * self.u1, 2.0 * self.u2
        self.n += 1
        self.above = self.u1 > self.u2
        return True
'''


def by_hand(ticks: int) -> list[float]:
    """The positions of the example's mass, with its own arithmetic."""
    position, speed, found = 0.1, 0.0, []
    for tick in range(ticks):
        force = 3.0 * np.sin(2.0 * np.pi * 2.0 * tick / 100.0)
        found.append(position)
        for _ in range(10):
            pull = force - 50.0 * position - 0.5 * speed
            speed += 0.01 / 10 * pull / 1.5
            position += 0.01 / 10 * speed
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    from aloft.extensions.export.fmi.example import example_fmu

    (tmp_path / "spring.fmu").write_bytes(example_fmu().read_bytes())
    (tmp_path / "graph.yaml").write_text(GRAPH)
    return tmp_path


def test_an_fmu_in_a_graph_gives_its_own_numbers(folder: Path) -> None:
    result = aloft.load(folder / "graph.yaml").run()
    result.raise_if_failed()
    found = result.signal("spring.position.value")[:, 0]
    assert found == pytest.approx(by_hand(50), abs=1e-12)
    assert np.ptp(found) > 0.1
    again = aloft.load(folder / "graph.yaml").run()
    assert again.run_hash == result.run_hash


def test_units_of_the_model_description_are_checked(folder: Path) -> None:
    text = GRAPH.replace("gain: 2 1/m", "gain: 2").replace("3 N", "3 m")
    with pytest.raises(LoadError) as error:
        aloft.load(text, path=folder / "graph.yaml")
    report = str(error.value)
    assert "spring.force" in report and "N" in report and "graph.yaml:5" in report


def test_a_snapshot_has_the_state_of_the_fmu(folder: Path) -> None:
    with aloft.load(folder / "graph.yaml").open() as run:
        run.step(20)
        kept = run.snapshot()
        first = [run["spring.position.value"] for _ in range(15) if run.step()]
        run.restore(kept)
        second = [run["spring.position.value"] for _ in range(15) if run.step()]
        run.reset()
        run.step()
        assert run["spring.position.value"].tolist() == [0.1]
    assert np.array_equal(first, second)
    with aloft.load(folder / "graph.yaml").open() as other:
        other.restore(kept)
        third = [other["spring.position.value"] for _ in range(15) if other.step()]
    assert np.array_equal(first, third)


def test_what_cannot_be_saved_is_said_and_only_the_start_can_be_restored(folder: Path) -> None:
    without = forgetful(folder)
    graph = aloft.load(without, path=folder / "graph.yaml")
    with graph.open() as run:
        run.step(3)
        kept = run.snapshot()
        run.step(3)
        with pytest.raises(BlockError, match=r"cannot be restored to what it was after 3 steps"):
            run.restore(kept)
        run.reset()
        run.step()
        assert run["spring.position.value"].tolist() == [0.1]
    result = graph.run()
    assert any("cannot save its state" in each for each in result.block_warnings)


def forgetful(folder: Path) -> str:
    """The graph with an FMU that says that it cannot save its state."""
    import zipfile

    with (
        zipfile.ZipFile(folder / "spring.fmu") as old,
        zipfile.ZipFile(folder / "forgetful.fmu", "w") as new,
    ):
        for name in old.namelist():
            data = old.read(name)
            if name == "modelDescription.xml":
                data = data.replace(b'canSerializeFMUState="true"', b'canSerializeFMUState="false"')
            new.writestr(name, data)
    return GRAPH.replace("spring.fmu", "forgetful.fmu")


def test_an_error_has_the_lines_of_the_fmus_log(folder: Path) -> None:
    result = aloft.load(folder / "graph.yaml", {"spring.start.mass": -1.0}).run()
    assert not result.success
    assert "spring.fmu could not be stepped from 0 s by 0.01 s" in result.reason
    assert "[error] the mass is -1.0 kg" in result.reason
    with pytest.raises(RunError, match="spring"):
        result.raise_if_failed()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"spring.file": "other.fmu"}, r"cannot read other.fmu: No such file"),
        ({"spring.file": "graph.yaml"}, r"cannot read graph.yaml as an FMU: "),
        ({"spring.outputs": ["positon"]}, r"has no number 'positon'; the nearest is 'position'"),
        ({"spring.start": {"mas": 1.0}}, r"no variable 'mas' .* the nearest is 'mass'"),
    ],
)
def test_what_does_not_fit_is_reported_at_load(
    folder: Path, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(LoadError, match=message):
        aloft.load(folder / "graph.yaml", change)


@pytest.mark.parametrize(
    ("kinds", "found"),
    [
        (["ScheduledExecution"], "for scheduled execution only"),
        (
            ["ModelExchange", "ScheduledExecution"],
            "for model exchange and scheduled execution only",
        ),
    ],
)
def test_an_fmu_of_another_kind_is_refused_by_its_kind(
    tmp_path: Path, kinds: list[str], found: str
) -> None:
    import zipfile

    interfaces = "".join(f'<{kind} modelIdentifier="clocks"/>' for kind in kinds)
    with zipfile.ZipFile(tmp_path / "clocks.fmu", "w") as file:
        file.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="3.0" modelName="clocks" instantiationToken="{1}">'
            f"{interfaces}<ModelVariables>"
            '<Clock name="tick" valueReference="1" causality="input" intervalVariability="constant" '
            'intervalDecimal="1.0"/>'
            "</ModelVariables><ModelStructure/></fmiModelDescription>",
        )
    with pytest.raises(BlockError, match=f"clocks.fmu is {found}; an FMU for co-simulation"):
        describe("clocks.fmu", tmp_path)


def test_the_file_travels_in_the_recording_with_its_hash(folder: Path) -> None:
    graph = aloft.load(folder / "graph.yaml")
    path = folder / "run.rrd"
    graph.run(0.05, sinks=[Recorder(path)]).raise_if_failed()
    header = read(path).header
    digest = hashlib.sha256((folder / "spring.fmu").read_bytes()).hexdigest()
    assert header.files["spring.file: spring.fmu"] == digest
    assert digest in header.contents


def test_an_fmu_without_feedthrough_breaks_a_loop(folder: Path) -> None:
    text = """\
rate: 100 Hz
duration: 0.2 s
blocks:
  spring:
    use: export.CoSimulation
    with: {file: spring.fmu, feedthrough: false}
    in: {force: pull.y}
  pull: {use: blocks.Gain, with: {gain: -20 N/m}, in: {u: spring.position}}
"""
    result = aloft.load(text, path=folder / "graph.yaml").run()
    result.raise_if_failed()
    pull = result.signal("pull.y.value")[:, 0]
    assert pull == pytest.approx(-20.0 * result.signal("spring.position.value")[:, 0])
    with pytest.raises(LoadError, match="spring"):
        aloft.load(text.replace("false", "true"), path=folder / "graph.yaml")


def test_an_fmu_of_fmi_2_with_rows_integers_and_booleans(tmp_path: Path) -> None:
    builder = pytest.importorskip("pythonfmu.builder")
    script = tmp_path / "aloft_test_rows.py"
    script.write_text(SLAVE_2)
    file = builder.FmuBuilder.build_FMU(script, tmp_path)
    with BlockBench(CoSimulation, {"file": file.name}, folder=tmp_path, rate=100.0) as bench:
        bench.set("u", value=[1.0, -3.0])
        bench.step()
        bench.step()
        assert bench.get("body").y.tolist() == [2.0, -6.0]
        assert bench.get("n").value.tolist() == [1]
        assert bench.get("n").value.dtype == np.int64
        assert bench.get("above").value.tolist() == [True]
