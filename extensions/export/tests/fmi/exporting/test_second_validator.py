"""Exported FMUs keep the standard by a second validator, which is not FMPy's.

FMU Manipulation Toolbox checks the model description against the standard's XML schema, and the rules
of FMI 3.0.2, section 2.4, that a schema cannot express.
"""

import logging
import shutil
import zipfile
from pathlib import Path

import pytest
from tests.needed import needs

from aloft.extensions.export.fmi.exporting.write import export

needs("fmu_manipulation_toolbox", "fmpy", "pythonfmu3")

PART = """\
inputs: {setpoint: }
outputs: {force: gain.y, wound: sum.y}
blocks:
  gain: {use: blocks.Gain, with: {n: 3, gain: 20 N/m}, in: {u: inputs.setpoint}}
  sum: {use: blocks.Integrator, with: {n: 3}, in: {u: gain.y}}
"""
RAIL = """\
rate: 100 Hz
duration: 1 s
blocks:
  setpoint: {use: blocks.SineWave, with: {n: 3, amplitude: 1 m, frequency: 1 Hz}}
  part: {use: part.yaml, in: {setpoint: setpoint.y}}
"""


def remarks(file: Path, caplog: pytest.LogCaptureFixture) -> list[str]:
    """What both checks of the toolbox have to say against an FMU."""
    from fmu_manipulation_toolbox import checker
    from fmu_manipulation_toolbox.operations import FMU

    caplog.clear()
    with caplog.at_level(logging.WARNING, "fmu_manipulation_toolbox"), FMU(str(file)) as fmu:
        fmu.apply_operation(checker.OperationGenericCheck())
        fmu.apply_operation(checker.OperationSemanticCheck())
    return [record.getMessage() for record in caplog.records]


@pytest.fixture(scope="module", params=["3.0", "2.0", "3.0 in Python"])
def exported(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    version, _, python = str(request.param).partition(" ")
    if not python and not shutil.which("cc"):
        pytest.skip("there is no C compiler (cc)")
    (folder / "part.yaml").write_text(PART)
    (folder / "rail.yaml").write_text(RAIL)
    with pytest.MonkeyPatch.context() as patch:
        if python:
            patch.setattr("aloft.extensions.export.fmi.exporting.write.compiler", lambda: "")
        export(str(folder / "rail.yaml"), folder / "part.fmu", "part", version=version)
    return folder / "part.fmu"


def changed(file: Path, old: str, new: str) -> Path:
    """A copy of an FMU with another text in its model description."""
    copy = file.with_name("changed.fmu")
    with zipfile.ZipFile(file) as source, zipfile.ZipFile(copy, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            if name == "modelDescription.xml":
                assert old.encode() in data
                data = data.replace(old.encode(), new.encode())
            target.writestr(name, data)
    return copy


def test_it_has_no_remark(exported: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert remarks(exported, caplog) == []


def test_it_would_have_some(exported: Path, caplog: pytest.LogCaptureFixture) -> None:
    wrong = changed(exported, 'causality="output"', 'causality="out"')
    assert any("does not validate with FMI standard" in each for each in remarks(wrong, caplog))
    wrong = changed(exported, 'name="force', 'name="wound')
    assert any("wound" in each for each in remarks(wrong, caplog))
