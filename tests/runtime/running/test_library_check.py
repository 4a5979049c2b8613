"""Libraries that cannot be loaded are named with the reason and what to install."""

import platform

from aloft.runtime.running.library_check import LIBRARIES, examine_libraries


def test_all_load() -> None:
    finding = examine_libraries()
    assert finding.good and not finding.change
    assert finding.found == f"all {len(LIBRARIES)} load with Python {platform.python_version()}"


def test_what_the_system_lacks_is_said_with_its_package() -> None:
    def load(name: str) -> None:
        if name == "pinocchio":
            raise ImportError("libgomp.so.1: cannot open shared object file: No such file")
        if name == "zenoh":
            raise ModuleNotFoundError("No module named 'zenoh'")

    finding = examine_libraries(load)
    assert not finding.good
    assert "pinocchio cannot be loaded: libgomp.so.1: cannot open shared object" in finding.found
    assert "zenoh cannot be loaded: No module named 'zenoh'" in finding.found
    assert finding.change == "`apt install libgomp1`, `pip install --force-reinstall eclipse-zenoh`"
