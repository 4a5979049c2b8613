"""Calls of kernels become machine code that computes the same bits, from a cache that is robust."""

import importlib.util
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from aloft.mathematics.compiling import compile_calls as module
from aloft.mathematics.compiling import store
from aloft.mathematics.compiling.arguments import pack
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.mathematics.compiling.kernel_call import KernelCall, collect_calls
from aloft.mathematics.compiling.translate import Translator

HERE = Path(__file__).parent
spec = importlib.util.spec_from_file_location("kernels_for_tests", HERE / "kernels_for_tests.py")
assert spec is not None and spec.loader is not None
ours = importlib.util.module_from_spec(spec)
sys.modules["kernels_for_tests"] = ours
spec.loader.exec_module(ours)


pytestmark = pytest.mark.usefixtures("own_cache")


def arguments(order):
    random = np.random.default_rng(3)
    matrix = np.array(random.standard_normal((4, 6)), order=order)
    if order == "A":
        matrix = random.standard_normal((8, 12))[::2, 1::2]
    return matrix, ours.Pair(random.standard_normal(6), 1.0 / 3.0), 4, True, np.zeros(4)


@pytest.mark.parametrize("order", ["C", "F", "A"])
def test_machine_code_computes_the_same_bits(order):
    call = KernelCall(ours.mix, *arguments(order))
    assert compile_calls([call]) == ""
    assert call.compiled is not None
    call.run()
    expected = arguments(order)
    ours.mix(*expected)
    np.testing.assert_array_equal(call.arguments[-1], expected[-1])
    # What is in the arrays counts, not what was in them when the call was made.
    call.arguments[0][:] *= 2.0
    call.run()
    np.testing.assert_array_equal(call.arguments[-1], 2.0 * expected[-1])


def test_threads_that_compile_at_the_same_time_wait_for_each_other(monkeypatch):
    inside, most, translate = [], [], Translator.module

    def watched(translator, kernel, signature):
        inside.append(kernel)
        most.append(len(inside))
        code = translate(translator, kernel, signature)
        inside.remove(kernel)
        return code

    monkeypatch.setattr(Translator, "module", watched)
    calls = [KernelCall(ours.mix, *arguments(order)) for order in ("C", "F", "A", "C")]
    said: list[str] = []
    threads = [
        threading.Thread(target=lambda call=call: said.append(compile_calls([call])))
        for call in calls
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert said == [""] * 4
    assert most == [1] * 3  # the fourth found what the first had made
    assert all(call.compiled is not None for call in calls)


pack(())  # makes the function that reports errors, so that it is in no test's cache


def test_the_second_process_finds_the_machine_code_in_the_cache(monkeypatch):
    compile_calls([KernelCall(ours.mix, *arguments("C"))])
    files = list(store.cache_folder().rglob("*.o"))
    assert len(files) == 1
    monkeypatch.setattr(module, "_loaded", {})
    monkeypatch.setattr(Translator, "module", None)  # would fail if something were compiled
    call = KernelCall(ours.mix, *arguments("C"))
    assert compile_calls([call]) == "" and call.compiled is not None


def test_a_damaged_file_is_compiled_again(monkeypatch):
    compile_calls([KernelCall(ours.mix, *arguments("C"))])
    (file,) = store.cache_folder().rglob("*.o")
    whole = file.read_bytes()
    file.write_bytes(whole[:-50] + bytes(50))
    monkeypatch.setattr(module, "_loaded", {})
    call = KernelCall(ours.mix, *arguments("C"))
    assert compile_calls([call]) == "" and call.compiled is not None
    assert file.read_bytes() != whole[:-50] + bytes(50)


def test_a_folder_that_cannot_be_written_costs_the_cache_only(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    call = KernelCall(ours.mix, *arguments("C"))
    assert compile_calls([call]) == "" and call.compiled is not None


def test_watchers_hear_of_what_is_compiled():
    heard = []
    module.watchers.append(lambda done, total: heard.append((done, total)))
    try:
        compile_calls([KernelCall(ours.mix, *arguments("C"))])
        compile_calls([KernelCall(ours.mix, *arguments("C"))])
    finally:
        module.watchers.pop()
    assert heard == [(0, 1), (1, 1)]


def test_a_division_by_zero_is_pythons_error():
    call = KernelCall(ours.divide, np.array([0.0, 1.0, 0.0]))
    assert compile_calls([call]) == ""
    with pytest.raises(ZeroDivisionError, match=r"kernels_for_tests\.divide divided by zero"):
        call.run()
    call.arguments[0][2] = 2.0
    call.run()
    assert call.arguments[0][0] == 0.5


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_kernel_that_allocates_stays_plain_python():
    good, bad = KernelCall(ours.mix, *arguments("C")), KernelCall(ours.allocates, np.ones(3))
    reason = compile_calls([good, bad])
    assert reason.startswith("kernel kernels_for_tests.allocates does not compile: ")
    assert "np.sort is no kernel, and nothing that kernels may call" in reason
    assert reason.endswith("put it into an @numba.njit function and call that")
    assert f"{ours.__file__}:" in reason
    assert good.compiled is not None and bad.compiled is None
    bad.run()
    assert bad.arguments[0].tolist() == [1.0] * 3


def test_a_function_that_is_no_kernel_is_named():
    call = KernelCall(ours.unmarked, np.zeros(3))
    assert compile_calls([call]) == "kernels_for_tests.unmarked is not marked with @kernel"
    call.run()
    assert call.arguments[0][0] == 1.0


def test_without_a_compiler_the_reason_is_said(monkeypatch):
    def no_llvm():
        raise ModuleNotFoundError("No module named 'llvmlite'")

    monkeypatch.setattr(module, "tools", no_llvm)
    call = KernelCall(ours.mix, *arguments("C"))
    assert compile_calls([call]) == "No module named 'llvmlite'"
    call.run()


def test_what_a_kernel_cannot_take_is_named():
    reason = compile_calls([KernelCall(ours.divide, [1.0, 2.0])])
    assert reason.endswith("named tuples of these, and not a list")


def test_calls_are_collected_in_their_order():
    with collect_calls() as calls:
        first = KernelCall(ours.divide, np.ones(3))
        with collect_calls() as inner:
            second = KernelCall(ours.divide, np.ones(3))
    KernelCall(ours.divide, np.ones(3))
    assert calls == [first, second] and inner == [second]


def test_two_processes_may_compile_at_once(tmp_path):
    code = (
        "import sys\n"
        f"sys.path.insert(0, {str(HERE)!r})\n"
        "import numpy as np\n"
        "import kernels_for_tests as ours\n"
        "from aloft.mathematics.compiling.compile_calls import compile_calls\n"
        "from aloft.mathematics.compiling.kernel_call import KernelCall\n"
        "call = KernelCall(ours.divide, np.array([0.0, 1.0, 4.0]))\n"
        "assert compile_calls([call]) == ''\n"
        "call.run()\n"
        "assert call.arguments[0][0] == 0.25\n"
    )
    both = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(2)]
    assert [process.wait(timeout=120) for process in both] == [0, 0]
    # one file for the kernel, and one for the function that reports errors
    assert len(list(store.cache_folder().rglob("*.o"))) == 2
    assert not list(store.cache_folder().rglob("*.part"))
