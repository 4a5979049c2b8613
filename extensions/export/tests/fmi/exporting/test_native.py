"""FMUs without Python: the bytes of the graph in FMI 3.0 and 2.0, from the binary and from the sources."""

import shutil
import subprocess
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.extensions.export.fmi.exporting.write import export
from aloft.runtime.language.errors import AloftError

fmpy = pytest.importorskip("fmpy")
pytestmark = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler (cc)")

CONTROLLER = """\
inputs: {wish: , measured: }
outputs: {force: bound.y, above: above.y}
blocks:
  pid: {use: blocks.PID, with: {n: 2, kp: 20, ki: 5, kd: 3, unit: N/m}, in: {setpoint: inputs.wish, measured: inputs.measured}}
  gain: {use: blocks.Gain, with: {n: 2, gain: [1, 0.75]}, in: {u: pid.u}}
  bound: {use: blocks.Saturation, with: {n: 2, lower: -5, upper: 5}, in: {u: gain.y}}
  above: {use: blocks.Compare, with: {n: 2}, in: {a: bound.y, b: two.y}}
  two: {use: blocks.Constant, with: {value: [2 N, 0 N]}}
"""
RAIL = """\
rate: 500 Hz
duration: 0.4 s
blocks:
  wish: {use: blocks.SineWave, with: {n: 2, amplitude: 1 m, frequency: 3 Hz}}
  controller: {use: controller.yaml, in: {wish: wish.y, measured: place.y}}
  mass: {use: blocks.Gain, with: {n: 2, gain: 0.5 1/kg}, in: {u: controller.force}}
  speed: {use: blocks.Integrator, with: {n: 2}, in: {u: mass.y}}
  place: {use: blocks.Integrator, with: {n: 2}, in: {u: speed.y}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("native")
    (made / "controller.yaml").write_text(CONTROLLER)
    (made / "rail.yaml").write_text(RAIL)
    for version in ("3.0", "2.0"):
        file = made / f"pd{version[0]}.fmu"
        exported = export(str(made / "rail.yaml"), file, "controller", version=version)
        assert (exported.problems, exported.python) == ((), ())
    return made


@pytest.fixture(scope="module")
def reference(folder: Path) -> aloft.RunResult:
    result = aloft.load(folder / "rail.yaml").run()
    result.raise_if_failed()
    return result


class Unit:
    """An FMU of either version, called function by function: arrays by the names of FMI 3.0."""

    def __init__(self, file: Path, folder: Path | None = None) -> None:
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        described = fmpy.read_model_description(str(file if folder is None else folder))
        self.references: dict[str, list[int]] = {}
        self.sizes: dict[str, int] = {}
        for each in described.modelVariables:
            base = each.name.partition("[")[0] if each.causality != "parameter" else each.name
            self.references.setdefault(base, []).append(each.valueReference)
            self.sizes[base] = int(np.prod(each.shape or (1,)))
        self.new = described.fmiVersion == "3.0"
        self.fmu: Any = (FMU3Slave if self.new else FMU2Slave)(
            guid=described.guid,
            unzipDirectory=str(
                folder or fmpy.extract(str(file), tempfile.mkdtemp(dir=file.parent))
            ),
            modelIdentifier=described.coSimulation.modelIdentifier,
        )
        self.fmu.instantiate()
        if not self.new:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def set(self, name: str, values: Any) -> None:
        function = self.fmu.setFloat64 if self.new else self.fmu.setReal
        function(self.references[name], np.ravel(values).tolist())

    def get(self, name: str, kind: str = "") -> list[Any]:
        function = getattr(self.fmu, f"get{kind or ('Float64' if self.new else 'Real')}")
        further = {"nValues": self.sizes[name]} if self.new else {}
        return list(function(self.references[name], **further))

    def run(self, result: aloft.RunResult, ticks: range) -> list[bytes]:
        found = []
        for tick in ticks:
            self.set("wish", result.signal("wish.y.value")[tick])
            self.set("measured", result.signal("place.y.value")[tick])
            above = np.array(self.get("above", "Boolean"), bool)
            found.append(np.array(self.get("force")).tobytes() + above.tobytes())
            self.fmu.doStep(tick * 0.002, 0.002)
        return found

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


def bytes_of(result: aloft.RunResult) -> list[bytes]:
    force, above = (result.signal(f"controller/{n}") for n in ("bound.y.value", "above.y.value"))
    assert np.ptp(force) > 9.0
    assert 0 < above.sum() < above.size
    return [f.tobytes() + a.tobytes() for f, a in zip(force, above, strict=True)]


@pytest.mark.parametrize("file", ["pd3.fmu", "pd2.fmu"])
def test_every_byte_of_the_outputs_is_that_of_the_graph(
    folder: Path, reference: aloft.RunResult, file: str
) -> None:
    unit = Unit(folder / file)
    assert unit.run(reference, range(200)) == bytes_of(reference)
    unit.close()


@pytest.mark.parametrize("file", ["pd3.fmu", "pd2.fmu"])
def test_the_state_goes_out_as_bytes_and_comes_back(
    folder: Path, reference: aloft.RunResult, file: str
) -> None:
    unit, wanted = Unit(folder / file), bytes_of(reference)
    unit.run(reference, range(50))
    unit.set("controller.gain.gain[2]", [0.5])
    state = unit.fmu.getFMUState()
    data = unit.fmu.serializeFMUState(state)
    unit.fmu.freeFMUState(state)
    unit.set("controller.gain.gain[2]", [0.75])
    assert unit.run(reference, range(50, 80)) == wanted[50:80]
    unit.fmu.setFMUState(unit.fmu.deserializeFMUState(data))
    assert unit.get("controller.gain.gain[2]") == [0.5], "parameters are a part of it"
    unit.set("controller.gain.gain[2]", [0.75])
    assert unit.run(reference, range(50, 90)) == wanted[50:90]
    with pytest.raises(Exception, match=r"(?i)deserialize"):
        unit.fmu.deserializeFMUState(data[:-1])
    unit.fmu.reset()
    unit.fmu.enterInitializationMode()
    unit.fmu.exitInitializationMode()
    assert unit.run(reference, range(20)) == wanted[:20]
    unit.close()


def test_parameters_are_tuned_within_their_bounds(folder: Path) -> None:
    unit = Unit(folder / "pd3.fmu")
    unit.set("wish", [1e-6, 1e-6])
    first, second = unit.get("force")
    assert second == 0.75 * first > 0.0
    unit.set("controller.gain.gain[2]", [2.0])
    assert unit.get("force") == [first, 2.0 * first], "in the same tick"
    with pytest.raises(Exception, match="fmi3SetFloat64"):
        unit.set("controller.gain.gain[2]", [np.nan])
    with pytest.raises(Exception, match="fmi3SetFloat64"):
        unit.set("force", [1.0, 1.0])
    unit.set("wish", [np.nan, 1.0])
    with pytest.raises(Exception, match="fmi3GetFloat64"):
        unit.get("force")
    unit.close()


@pytest.mark.long
@pytest.mark.parametrize("file", ["pd3.fmu", "pd2.fmu"])
def test_its_sources_make_the_same_binary_by_another_tool(
    folder: Path, reference: aloft.RunResult, file: str, tmp_path: Path
) -> None:
    if not shutil.which("cmake"):
        pytest.skip("there is no CMake, with which FMPy compiles")
    from fmpy.build import build_platform_binary

    fmpy.extract(str(folder / file), str(tmp_path / "unit"))
    shutil.rmtree(tmp_path / "unit" / "binaries")
    build_platform_binary(tmp_path / "unit", all_warnings=True)
    unit = Unit(folder / file, tmp_path / "unit")
    assert unit.run(reference, range(200)) == bytes_of(reference)
    unit.close()


CALLER = """\
#include <stdio.h>
#include "fmi3Functions.h"

int main(void)
{
    fmi3ValueReference in[] = {%(inputs)s}, out = %(output)s;
    fmi3Boolean event, end, early;
    fmi3Float64 last, given[4], found[2];
    fmi3Instance unit = fmi3InstantiateCoSimulation(
        "one", "%(token)s", "", fmi3False, fmi3False, fmi3False, fmi3False, NULL, 0, NULL, NULL, NULL);
    if (!unit || fmi3EnterInitializationMode(unit, fmi3False, 0.0, 0.0, fmi3False, 0.0) ||
        fmi3ExitInitializationMode(unit))
        return 1;
    for (int k = 0; k < 200; ++k) {
        for (int j = 0; j < 4; ++j)
            given[j] = (k * (j + 3) %% 17 + k) / 65536.0;
        if (fmi3SetFloat64(unit, in, 2, given, 4) ||
            fmi3DoStep(unit, k / 500.0, 1 / 500.0, fmi3True, &event, &end, &early, &last) ||
            fmi3GetFloat64(unit, &out, 1, found, 2))
            return 2;
        printf("%%a %%a\\n", found[0], found[1]);
    }
    fmi3FreeInstance(unit);
    return 0;
}
"""


def test_its_sources_compute_the_same_bytes_on_aarch64(folder: Path, tmp_path: Path) -> None:
    linker, emulator = "aarch64-linux-gnu-gcc", ("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu")
    for each in (linker, emulator[0]):
        if not shutil.which(each):
            pytest.skip(f"there is no {each}")
    fmpy.extract(str(folder / "pd3.fmu"), str(tmp_path))
    described = fmpy.read_model_description(str(tmp_path))
    numbers = {each.name: each.valueReference for each in described.modelVariables}
    names = {
        "inputs": f"{numbers['wish']}, {numbers['measured']}",
        "output": numbers["force"],
        "token": described.instantiationToken,
    }
    sources = tmp_path / "sources"
    (sources / "caller.c").write_text(CALLER % names)
    files = [each.name for each in sources.glob("*.c")]
    said = []
    for compiler, runner in (("cc", ()), (linker, emulator)):
        made = tmp_path / compiler
        command = [
            compiler,
            "-O2",
            "-std=gnu11",
            "-ffp-contract=off",
            *files,
            "-lm",
            "-o",
            str(made),
        ]
        subprocess.run(command, cwd=sources, check=True)
        done = subprocess.run([*runner, str(made)], check=True, capture_output=True, text=True)
        said.append(done.stdout.splitlines())
    assert said[0] == said[1] and len(said[0]) == 200
    assert len(set(said[0])) > 100  # no constant, and not always at the bound


def test_nothing_is_missing_of_the_standard(folder: Path, tmp_path: Path) -> None:
    """Every function that the headers of the standard declare for an FMU is in its binary."""
    headers = Path(fmpy.__file__).parent / "c-code"
    for version in "32":
        root = tmp_path / version
        fmpy.extract(str(folder / f"pd{version}.fmu"), str(root))
        (binary,) = root.glob("binaries/*/*.so")
        listed = subprocess.run(
            ["nm", "-D", "--defined-only", binary], capture_output=True, text=True, check=True
        )
        known = {line.split()[-1] for line in listed.stdout.splitlines()}
        text = (headers / f"fmi{version}Functions.h").read_text()
        if version == "2":  # what follows is of model exchange
            text = text.partition("Functions for FMI2 for Model Exchange")[0]
        wanted = {
            line.split()[1]
            for line in text.splitlines()
            if "fmi" in line and "FullName(fmi" in line
        }
        assert len(wanted) > 20
        assert wanted - known == set()


@pytest.mark.long
def test_the_same_graph_is_the_same_file(folder: Path, tmp_path: Path) -> None:
    export(str(folder / "rail.yaml"), tmp_path / "pd3.fmu", "controller")
    assert (tmp_path / "pd3.fmu").read_bytes() == (folder / "pd3.fmu").read_bytes()


def test_what_needs_python_is_named_and_runs_in_python(tmp_path: Path) -> None:
    pytest.importorskip("pythonfmu3")
    (tmp_path / "noisy.yaml").write_text(
        "rate: 100 Hz\nblocks:\n  given: {use: blocks.External}\n"
        "  noise: {use: blocks.WhiteNoise}\n"
        "  sum: {use: blocks.Sum, in: {a: given.y, b: noise.y}}\n"
    )
    made = export(str(tmp_path / "noisy.yaml"), tmp_path / "noisy.fmu")
    reason = f"{tmp_path / 'noisy.yaml'}:4:3: block 'noise' (WhiteNoise) has a step in plain Python"
    assert made.python == (reason,)
    with zipfile.ZipFile(made.file) as file:
        assert "resources/graph/graph.yaml" in file.namelist()
    with pytest.raises(AloftError) as caught:
        export(str(tmp_path / "noisy.yaml"), tmp_path / "noisy.fmu", version="2.0")
    assert str(caught.value).splitlines() == [
        "the FMU needs Python, and such are of FMI 3.0:", f"  {reason}",
    ]  # fmt: skip
    with pytest.raises(AloftError, match=r"there is no FMI '1.0' here; there is 3.0, 2.0"):
        export(str(tmp_path / "noisy.yaml"), tmp_path / "noisy.fmu", version="1.0")
