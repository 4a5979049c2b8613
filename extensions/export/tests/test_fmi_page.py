"""extensions/export/fmi.md: its graphs, its command lines, and the equality that it promises."""

import re
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.needed import needs

import aloft

fmpy = pytest.importorskip("fmpy")
needs("pythonfmu3")
PAGE = (Path(__file__).parents[3] / "extensions" / "export" / "fmi.md").read_text(encoding="utf-8")


@pytest.mark.long
def test_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = dict(re.findall(r"```(?:yaml|sh|python) (\w+)\n(.*?)```", PAGE, re.DOTALL))
    assert set(found) == {"controller", "rail", "export", "rail_with_fmu", "by_calls"}
    for name, text in found.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    reference = aloft.load(tmp_path / "rail.yaml").run()
    for line in found["export"].splitlines():
        program, *arguments = line.split()
        module = {"aloft": "aloft", "fmpy": "fmpy"}[program]
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments],
            check=False, cwd=tmp_path, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, (line, done.stdout, done.stderr)
    rows = (tmp_path / "result.csv").read_text().splitlines()
    assert rows[0].replace('"', "") == "time,force"
    assert len(rows) == 52
    result = aloft.load(tmp_path / "rail_with_fmu.yaml").run()
    result.raise_if_failed()
    force = reference.signal("controller/bound.y.value")
    assert np.array_equal(result.signal("controller.force.value"), force)
    assert np.array_equal(result.signal("place.y.value"), reference.signal("place.y.value"))
    assert np.ptp(force) > 5.0
    # as the page says: set, get and step give the graph's numbers, and simulate_fmu comes a step late
    inputs = {"setpoint": reference.signal("setpoint.y.value")[:, 0],
              "measured": reference.signal("place.y.value")[:, 0]}  # fmt: skip
    monkeypatch.chdir(tmp_path)
    page = runpy.run_path("by_calls.yaml")
    by_calls = page["forces"](inputs["setpoint"].tolist(), inputs["measured"].tolist())
    assert np.array_equal(by_calls, force[:, 0])
    times = np.arange(len(force)) * 0.002
    rows_of = np.array(
        list(zip(times, *inputs.values(), strict=True)),
        [("time", float), *((n, float) for n in inputs)],
    )
    late = fmpy.simulate_fmu(
        "controller.fmu", stop_time=times[-1], step_size=0.002, output_interval=0.002, input=rows_of
    )
    assert np.abs(late["force"] - force[:, 0]).max() > 1.0
