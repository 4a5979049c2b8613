"""Checks of ``aloft doctor``: whether the machine lets a control loop keep its deadlines, and
whether the compiled libraries that a run needs can be loaded."""

from __future__ import annotations

import os
import re
import resource
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from .real_time import RealTimeError, RealTimeOptions

SYSTEM = Path("/")


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at: its ``name``, whether it is ``good``, what was ``found``, and what
    to ``change``; empty where nothing need change."""

    name: str
    good: bool
    found: str
    change: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the finding as plain data."""
        return asdict(self)


def examine_machine(system: Path = SYSTEM) -> list[Finding]:
    """Look at everything that decides on how late a tick may be.

    Args:
        system: where the folders ``proc`` and ``sys`` of the kernel are.
    """
    checks: tuple[Callable[[Path], Finding], ...] = (
        _kernel, _processors, _isolated, _governor, _priority, _throttling, _memory, _swap,
    )  # fmt: skip
    return [check(system) for check in checks]


def _kernel(system: Path) -> Finding:
    realtime = _read(system / "sys/kernel/realtime") == "1"
    version = _read(system / "proc/version")
    if realtime or "PREEMPT_RT" in version:
        return Finding("kernel", True, "a real-time kernel (PREEMPT_RT)")
    return Finding(
        "kernel", False, "no real-time kernel: other work may delay a tick by milliseconds",
        "install a kernel with PREEMPT_RT, e.g. `apt install linux-image-rt-amd64`",
    )  # fmt: skip


def _processors(system: Path) -> Finding:
    allowed = len(os.sched_getaffinity(0))
    if allowed > 1:
        return Finding(
            "processors", True, f"{allowed} for this process: --cpu pins the loop to one"
        )
    return Finding(
        "processors", False, "one for this process: recorder and loop share it",
        "give the process another processor, e.g. `taskset -c 0-3 aloft run ...`",
    )  # fmt: skip


def _isolated(system: Path) -> Finding:
    isolated = _read(system / "sys/devices/system/cpu/isolated")
    if isolated:
        first = isolated.replace("-", ",").split(",")[0]
        return Finding("isolated processors", True, f"{isolated}: run with --cpu {first}")
    last = (os.cpu_count() or 1) - 1
    return Finding(
        "isolated processors", False, "none: the scheduler puts other work beside the loop",
        f"add isolcpus={last} nohz_full={last} to the kernel's command line, and run with --cpu {last}",
    )  # fmt: skip


def _governor(system: Path) -> Finding:
    folder = system / "sys/devices/system/cpu"
    found = sorted({_read(path) for path in folder.glob("cpu*/cpufreq/scaling_governor")})
    if not found:
        return Finding("clock frequency", True, "not changed by this system")
    if found == ["performance"]:
        return Finding("clock frequency", True, "the governor is performance")
    return Finding(
        "clock frequency", False, f"the governor is {', '.join(found)}: the clock slows down in pauses",
        "`cpupower frequency-set --governor performance`",
    )  # fmt: skip


def _priority(system: Path) -> Finding:
    try:
        RealTimeOptions(priority=1).check()
    except RealTimeError:
        return Finding(
            "real-time priority", False, "this user may not use SCHED_FIFO",
            "add `@realtime - rtprio 90` to /etc/security/limits.d/realtime.conf, put the user into "
            "the group realtime, and log in again",
        )  # fmt: skip
    return Finding("real-time priority", True, "allowed: --priority 50 uses SCHED_FIFO")


def _throttling(system: Path) -> Finding:
    runtime = _read(system / "proc/sys/kernel/sched_rt_runtime_us")
    period = _read(system / "proc/sys/kernel/sched_rt_period_us")
    if not runtime or not period or int(runtime) < 0 or int(runtime) >= int(period):
        return Finding("throttling", True, "real-time threads are not paused")
    pause = (int(period) - int(runtime)) / 1e3
    return Finding(
        "throttling", False,
        f"a real-time thread that never sleeps is paused for {pause:g} ms every {int(period) / 1e6:g} s",
        "`sysctl kernel.sched_rt_runtime_us=-1`; a paced loop sleeps and is not concerned",
    )  # fmt: skip


def _memory(system: Path) -> Finding:
    try:
        RealTimeOptions(lock_memory=True).check()
    except RealTimeError:
        soft = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
        return Finding(
            "locked memory", False, f"this user may lock {soft / 1024:.0f} KiB only",
            "add `@realtime - memlock unlimited` to /etc/security/limits.d/realtime.conf, put the "
            "user into the group realtime, and log in again",
        )  # fmt: skip
    return Finding("locked memory", True, "allowed: --lock-memory keeps the process in memory")


def _swap(system: Path) -> Finding:
    lines = _read(system / "proc/swaps").splitlines()[1:]
    if not lines:
        return Finding("swap", True, "none")
    return Finding(
        "swap", False, f"{len(lines)} in use: memory that is not locked may be moved out",
        "run with --lock-memory, or `swapoff -a`",
    )  # fmt: skip


def _read(path: Path) -> str:
    """Read one of the kernel's files; empty where there is none."""
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError:
        return ""


LIBRARIES = {
    "numpy": "numpy",
    "pydantic": "pydantic",
    "llvmlite": "llvmlite",
    "pin": "pinocchio",
    "mujoco-core": "mujoco",
    "casadi": "casadi",
    "daqp": "daqp",
    "pyarrow": "pyarrow",
    "rerun-sdk": "rerun",
    "eclipse-zenoh": "zenoh",
}
"""The packages of a run that hold machine code, and the names they are imported by."""

IN_EXTRAS = frozenset({"casadi"})
"""Packages that only extras bring, so that they may be missing."""

SYSTEM_PACKAGES = {"libgomp.so.1": "libgomp1", "libstdc++.so.6": "libstdc++6"}
"""Debian's packages of the shared libraries that the wheels expect of the system."""


def examine_libraries(load: Callable[[str], object] = import_module) -> Finding:
    """Load every library of ``LIBRARIES``, and say which of them fail and why.

    Args:
        load: imports a module by name, and raises ImportError or OSError where it cannot.
    """
    faults, changes, loaded = [], [], 0
    for package, module in LIBRARIES.items():
        try:
            load(module)
            loaded += 1
        except (ImportError, OSError) as error:
            if package in IN_EXTRAS and isinstance(error, ModuleNotFoundError):
                continue
            faults.append(f"{module} cannot be loaded: {error}")
            changes.append(_change(package, str(error)))
    version = ".".join(map(str, sys.version_info[:3]))
    if not faults:
        return Finding("libraries", True, f"all {loaded} load with Python {version}")
    found = f"with Python {version} " + "; ".join(faults)
    return Finding("libraries", False, found, ", ".join(dict.fromkeys(changes)))


def _change(package: str, error: str) -> str:
    missing = re.match(r"(lib[\w.+-]+\.so[.\d]*): cannot open shared object", error)
    if missing and missing[1] in SYSTEM_PACKAGES:
        return f"`apt install {SYSTEM_PACKAGES[missing[1]]}`"
    return f"`pip install --force-reinstall {package}`"
