"""Children that crash, hang, ignore signals or lose their parent: each ends, and it is said why."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from aloft.processes.child_process import ChildError, ChildProcess

from ..waiting import is_gone

SECONDS = 30.0
"""No wait of a test lasts longer."""
PROGRAMS = """
import builtins, os, signal, sys, time
from aloft.processes.child import report_ready

def fail(kind, text):
    raise getattr(builtins, kind)(text)

def leave(code):
    print("first line", file=sys.stderr)
    print("last line", file=sys.stderr)
    sys.exit(int(code))

def echo():
    report_ready()
    for line in sys.stdin.buffer:
        sys.stdout.buffer.write(line)
        sys.stdout.flush()

def hang():
    time.sleep(600)

def spin():
    report_ready()
    while True:
        pass

def stubborn():
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    report_ready()
    while True:
        time.sleep(1)

def polite():
    signal.signal(signal.SIGTERM, lambda *_: os._exit(7))
    report_ready()
    while True:
        time.sleep(1)

def forward(where):
    report_ready()
    sys.stdin.read()
    open(where, "w").close()
"""
Start = Callable[..., ChildProcess]


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Start:
    """Starts a function of ``PROGRAMS``."""
    (tmp_path / "child_programs.py").write_text(PROGRAMS)
    monkeypatch.syspath_prepend(tmp_path)

    def begin(function: str, *arguments: str, **options: object) -> ChildProcess:
        target = f"child_programs:{function}"
        return ChildProcess("the helper", target, arguments, **options)  # type: ignore[arg-type]

    return begin


def test_bytes_go_there_and_back(start: Start) -> None:
    with start("echo", stdout=True) as child:
        child.wait_until_ready(SECONDS)
        child.stdin.write(b"hello\n")
        child.stdin.flush()
        assert child.stdout is not None and child.stdout.readline() == b"hello\n"
        assert child.stop(asked=SECONDS) == 0
    assert not child.is_alive() and not Path(f"/proc/{child.pid}").exists()


@pytest.mark.parametrize("kind", ["ValueError", "RuntimeError", "ImportError"])
def test_an_exception_comes_back_with_its_type_and_text(start: Start, kind: str) -> None:
    said = f"the helper failed with {kind}: no such\nthing"
    with start("fail", kind, "no such\nthing") as child, pytest.raises(ChildError) as found:
        child.wait_until_ready(SECONDS)
    assert str(found.value) == said


def test_a_missing_function_is_named(start: Start) -> None:
    with start("no_such_function") as child, pytest.raises(ChildError, match="no_such_function"):
        child.wait_until_ready(SECONDS)


@pytest.mark.parametrize(("quiet", "shown"), [(False, "first line\nlast line\n"), (True, "")])
def test_what_a_child_prints_that_leaves_is_shown(
    start: Start, capfd: pytest.CaptureFixture[str], quiet: bool, shown: str
) -> None:
    with start("leave", "3", quiet=quiet) as child, pytest.raises(ChildError) as found:
        child.wait_until_ready(SECONDS)
    assert str(found.value) == "the helper ended with exit code 3"
    assert capfd.readouterr().err == shown


def test_a_child_that_hangs_at_its_start_is_ended(start: Start) -> None:
    said = r"the helper was not ready within 0\.3 s"
    with start("hang") as child, pytest.raises(ChildError, match=said):
        child.wait_until_ready(0.3)
    assert not Path(f"/proc/{child.pid}").exists()


def test_a_death_in_the_middle_is_noticed_at_once(start: Start) -> None:
    with start("spin") as child:
        child.wait_until_ready(SECONDS)
        begun = time.monotonic()
        threading.Timer(0.2, os.kill, (child.pid, signal.SIGKILL)).start()
        assert str(child.failure()) == "the helper was killed by SIGKILL"
        assert time.monotonic() - begun < 5.0


def test_one_that_ignores_sigterm_is_killed(start: Start) -> None:
    child = start("stubborn")
    child.wait_until_ready(SECONDS)
    child.send_signal(signal.SIGTERM)
    assert child.stop(asked=0.1) == -signal.SIGKILL
    assert not Path(f"/proc/{child.pid}").exists()


def test_one_that_obeys_sigterm_ends_by_itself(start: Start) -> None:
    child = start("polite")
    child.wait_until_ready(SECONDS)
    child.send_signal(signal.SIGTERM)
    assert child.stop(asked=SECONDS) == 7
    child.send_signal(signal.SIGTERM)
    assert child.stop() == 7  # once more changes nothing


def test_an_exception_here_leaves_no_child(start: Start) -> None:
    with pytest.raises(KeyboardInterrupt), start("spin") as child:
        raise KeyboardInterrupt
    assert not Path(f"/proc/{child.pid}").exists()


@pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)
def test_a_child_that_nobody_keeps_ends(start: Start) -> None:
    child = start("spin")
    child.wait_until_ready(SECONDS)
    pid = child.pid
    del child
    assert is_gone(pid)


PARENT = """
import sys, time
from aloft.processes.child_process import ChildProcess
sys.path.insert(0, {folder!r})
child = ChildProcess("the helper", "child_programs:" + {function!r}, {arguments!r}, parent_death={death})
child.wait_until_ready({seconds})
print(child.pid, flush=True)
time.sleep(600)
"""


def killed_parent(folder: Path, function: str, arguments: list[str], death: str) -> int:
    """The child of a parent that was killed with SIGKILL."""
    code = PARENT.format(
        folder=str(folder), function=function, arguments=arguments, death=death, seconds=SECONDS
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        parent.kill()
    return pid


@pytest.mark.usefixtures("start")
@pytest.mark.parametrize("function", ["spin", "stubborn"])
def test_an_orphan_ends_whatever_it_does(tmp_path: Path, function: str) -> None:
    assert is_gone(killed_parent(tmp_path, function, [], "9"), 5.0)


@pytest.mark.usefixtures("start")
def test_an_orphan_may_finish_its_work(tmp_path: Path) -> None:
    done = tmp_path / "done"
    assert is_gone(killed_parent(tmp_path, "forward", [str(done)], "None"))
    assert done.exists()


def test_a_child_outlives_the_thread_that_started_it(start: Start) -> None:
    found: list[ChildProcess] = []
    thread = threading.Thread(target=lambda: found.append(start("spin")))
    thread.start()
    thread.join()
    with found[0] as child:
        child.wait_until_ready(SECONDS)
        assert child.wait(0.2) is None


def test_a_program_by_itself(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text("import os, sys; os.write(int(sys.argv[1]), b'ready\\n'); os.read(0, 1)")
    with ChildProcess("the program", program) as child:
        child.wait_until_ready(SECONDS)
        assert child.stop(asked=SECONDS) == 0


def open_files() -> set[str]:
    """What this process has open, each by a name that is its own: a count would change when what
    an earlier test has left is closed."""
    found = set()
    for descriptor in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # that of the listing
            found.add(os.readlink(descriptor))
    return found


def test_a_program_that_cannot_be_started(monkeypatch: pytest.MonkeyPatch) -> None:
    before = open_files()
    monkeypatch.setattr(sys, "executable", "/no/such/python")
    with pytest.raises(FileNotFoundError):
        ChildProcess("the program", Path("program.py"))
    assert open_files() <= before
