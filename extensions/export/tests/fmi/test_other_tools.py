"""FMUs that OpenModelica and PythonFMU3 have made, as blocks, beside FMPy's simulation of them.

They are in the wheel of gemseo-fmu (``pip install --no-deps gemseo-fmu``), which nothing else here needs.
"""

import importlib.util
import platform
import sys
from pathlib import Path

import numpy as np
import pytest

import aloft

STEPS = 500
RATE = 500.0
INPUTS = {
    "Mass_Damper": {"f": "2.5 N"},
    "add": {"u1": "1.25", "u2": "-3.0"},
    "ramp": {},
    "MassSpringSystem": {},
    "MassSpringSubSystem1": {"x2": "0.5"},
    "MassSpringSubSystem2": {"x1": "-0.25"},
    "FMU3Model": {},
}
"""The FMUs, and constant inputs other than what they start from."""
OUTPUTS = {
    "Mass_Damper": ["y"],
    "add": ["y"],
    "ramp": ["out"],
    "MassSpringSystem": ["v1", "v2", "x1", "x2"],
    "MassSpringSubSystem1": ["v1", "x1"],
    "MassSpringSubSystem2": ["v2", "x2"],
    "FMU3Model": ["output"],
}
MOVING = {
    "FMU3Model",
    "Mass_Damper",
    "ramp",
    "MassSpringSystem",
    "MassSpringSubSystem1",
    "MassSpringSubSystem2",
}


@pytest.fixture
def folder() -> Path:
    """Where the FMUs are."""
    pytest.importorskip("fmpy")
    if sys.platform != "linux" or platform.machine() != "x86_64":
        pytest.skip("the FMUs are for Linux on x86-64")
    found = importlib.util.find_spec("gemseo_fmu")
    if found is None or not found.submodule_search_locations:
        pytest.skip("FMUs of OpenModelica are not here: pip install --no-deps gemseo-fmu")
    return Path(next(iter(found.submodule_search_locations))) / "problems" / "fmu_files" / "linux"


@pytest.mark.parametrize("name", INPUTS)
def test_an_fmu_of_another_tool_gives_what_fmpy_gives(folder: Path, name: str) -> None:
    import fmpy

    file, inputs = folder / f"{name}.fmu", INPUTS[name]
    constants = "".join(
        f"  {key}: {{use: blocks.Constant, with: {{value: [{value}]}}}}\n"
        for key, value in inputs.items()
    )
    wires = ", ".join(f"{key}: {key}.y" for key in inputs)
    text = (
        f"rate: {RATE:g} Hz\nduration: {STEPS / RATE} s\nblocks:\n{constants}"
        f"  unit: {{use: export.CoSimulation, with: {{file: {file}}}, in: {{{wires}}}}}\n"
    )
    result = aloft.load(text).run()
    assert result.success, result.reason
    start = {key: float(value.removesuffix(" N")) for key, value in inputs.items()}
    expected = fmpy.simulate_fmu(
        str(file), start_values=start, stop_time=(STEPS - 1) / RATE, step_size=1.0 / RATE,
        output_interval=1.0 / RATE, output=OUTPUTS[name], fmi_type="CoSimulation",
    )  # fmt: skip
    assert len(expected) == STEPS
    for output in OUTPUTS[name]:
        ours = result.signal(f"unit.{output}.value").reshape(STEPS)
        # the times of communication differ in their last bits: k times the period, and its sum
        assert np.allclose(ours, expected[output], rtol=0.0, atol=1e-11), output
    assert (np.ptp(expected[OUTPUTS[name][0]]) > 1e-3) == (name in MOVING)
