"""What the kernel says of a machine becomes findings with what to change."""

from __future__ import annotations

import platform
from pathlib import Path

from aloft.runtime.running.machine_check import (
    LIBRARIES,
    Finding,
    examine_libraries,
    examine_machine,
)


def system(folder: Path, **files: str) -> dict[str, Finding]:
    for name, text in files.items():
        place = folder / name.replace("__", "/")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="utf-8")
    return {finding.name: finding for finding in examine_machine(folder)}


def test_a_machine_made_for_it_needs_no_change(tmp_path: Path) -> None:
    found = system(
        tmp_path, sys__kernel__realtime="1\n", sys__devices__system__cpu__isolated="2-3\n",
        sys__devices__system__cpu__cpu0__cpufreq__scaling_governor="performance\n",
        proc__sys__kernel__sched_rt_runtime_us="-1\n", proc__sys__kernel__sched_rt_period_us="1000000\n",
        proc__swaps="Filename Type Size Used Priority\n",
    )  # fmt: skip
    for name in ("kernel", "isolated processors", "clock frequency", "throttling", "swap"):
        assert found[name].good and not found[name].change, found[name]
    assert "--cpu 2" in found["isolated processors"].found


def test_an_ordinary_machine_is_told_what_to_change(tmp_path: Path) -> None:
    found = system(
        tmp_path, proc__version="Linux version 6.1.0 SMP PREEMPT_DYNAMIC\n",
        sys__devices__system__cpu__cpu0__cpufreq__scaling_governor="powersave\n",
        proc__sys__kernel__sched_rt_runtime_us="950000\n",
        proc__sys__kernel__sched_rt_period_us="1000000\n",
        proc__swaps="Filename Type Size Used Priority\n/swap file 1 0 -2\n",
    )  # fmt: skip
    for name in ("kernel", "isolated processors", "clock frequency", "throttling", "swap"):
        assert not found[name].good and found[name].change, found[name]
    assert "paused for 50 ms every 1 s" in found["throttling"].found
    assert "powersave" in found["clock frequency"].found


def test_all_load() -> None:
    finding = examine_libraries()
    assert finding.good and not finding.change
    assert finding.found == f"all {len(LIBRARIES)} load with Python {platform.python_version()}"


def test_what_the_system_lacks_is_said_with_its_package() -> None:
    def load(name: str) -> None:
        if name == "pinocchio":
            raise ImportError("libgomp.so.1: cannot open shared object file: No such file")
        if name in ("daqp", "casadi"):
            raise ModuleNotFoundError(f"No module named '{name}'")

    finding = examine_libraries(load)
    assert not finding.good
    assert "pinocchio cannot be loaded: libgomp.so.1: cannot open shared object" in finding.found
    assert "daqp cannot be loaded: No module named 'daqp'" in finding.found
    assert "casadi" not in finding.found, "an extra may be missing"
    assert finding.change == "`apt install libgomp1`, `pip install --force-reinstall daqp`"
