"""The finite check: silent on every finite number, exact about the first that is not."""

import subprocess
import sys

import numpy as np
import pytest

import aloft
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.runtime.language.layout import Layout, PortLayout
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.running.finite import FiniteCheck, NotFiniteError
from aloft.runtime.running.region import Region


class Many(Signal):
    scalar = Field(text="one")
    vector = Field(20_000, text="more than one piece")
    count = Field(dtype="int64", text="not checked")


def region() -> Region:
    return Region(Layout.of([PortLayout("a/b.y", Many, {})]))


def compiled_finds(check: FiniteCheck) -> bool:
    """Whether the machine code finds a value that is not finite, as plain Python does."""
    found = []
    for compiled in (False, True):
        if compiled:
            assert compile_calls(check.calls) == "" and check.compiled
        check.found[0] = 0
        for call in check.calls:
            call.run()
        found.append(bool(check.found[0]))
    assert found[0] == found[1]
    return found[1]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("field", "index", "place"),
    [("scalar", (), "a/b.y.scalar"), ("vector", 19_999, "a/b.y.vector[19999]")],
)
def test_it_names_the_element(bad: float, field: str, index: object, place: str) -> None:
    memory = region()
    check = FiniteCheck(memory)
    check.check()
    assert not compiled_finds(check)
    memory.field(f"a/b.y.{field}")[index] = bad
    assert compiled_finds(check)
    with pytest.raises(NotFiniteError) as caught:
        check.check()
    assert str(caught.value) == f"{place} is {bad}"
    assert not check.found[0]


def test_the_first_of_several_is_named() -> None:
    memory = region()
    memory.field("a/b.y.vector")[[5, 17]] = np.nan
    with pytest.raises(NotFiniteError, match=r"vector\[5\] is nan"):
        FiniteCheck(memory).check()


@pytest.mark.parametrize("size", [1e-308, 1.0, 1e300, 1.7e308])
def test_finite_numbers_of_any_size_pass(size: float) -> None:
    memory = region()
    memory.field("a/b.y.vector").fill(size)
    FiniteCheck(memory).check()
    assert not compiled_finds(FiniteCheck(memory))


def test_a_region_without_floats_passes() -> None:
    check = FiniteCheck(Region(Layout.of([])))
    check.check()
    assert not check.compiled


def test_numpy_does_not_warn_of_what_is_found() -> None:
    text = """if True:
    import numpy as np
    from aloft.runtime.language.layout import Layout, PortLayout
    from aloft.runtime.language.signals import Field, Signal
    from aloft.runtime.running.finite import FiniteCheck, NotFiniteError
    from aloft.runtime.running.region import Region

    class Two(Signal):
        value = Field(2, text="both infinities")

    memory = Region(Layout.of([PortLayout("a.y", Two, {})]))
    memory.field("a.y.value")[:] = np.inf, -np.inf
    try:
        FiniteCheck(memory).check()
    except NotFiniteError as error:
        print(error)
    """
    command = [sys.executable, "-W", "always", "-c", text]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert (done.stdout, done.stderr) == ("a.y.value[0] is inf\n", "")


def layout_of(*sizes: int) -> Layout:
    """Blocks ``a``, ``b``, ... with a vector each."""
    ports = []
    for name, size in zip("abcdef", sizes, strict=False):
        kind = type("Vector", (Signal,), {"v": Field(size, text="numbers")})
        ports.append(PortLayout(f"{name}.y", kind, {}))
    return Layout.of(ports)


@pytest.mark.parametrize("sizes", [(3, 5000, 2), (5000, 3, 6000), (20_000, 20_000), (2000,)])
@pytest.mark.parametrize("slow", [{"a"}, {"b"}, {"a", "c"}, {"a", "b", "c"}, set()])
def test_what_blocks_write_that_run_is_checked_and_long_signals_of_others_are_not(
    sizes: tuple[int, ...], slow: set[str]
) -> None:
    layout = layout_of(*sizes)
    for name, slot in layout.slots.items():
        for place in (0, slot.size // 2, slot.size - 1):
            memory = Region(layout)
            memory.field(name)[place] = np.nan
            check = FiniteCheck(memory, slow)
            if name[0] in slow and slot.size > 1024:
                check.check()
            elif name[0] not in slow:
                with pytest.raises(NotFiniteError, match=f"{name}.{place}. is nan"):
                    check.check()


def test_a_slow_signal_is_checked_in_the_ticks_of_its_block() -> None:
    text = """
rate: 100 Hz
blocks:
  one: {use: blocks.Constant, with: {value: [VALUES]}}
  slow: {use: blocks.Integrator, in: {u: one.y}, rate: 10 Hz}
""".replace("VALUES", ", ".join(["1.0"] * 3000))
    with aloft.load(text).open() as run:
        run.step(1)
        run._bound.memory.state.field("slow.x.value")[7] = np.nan
        run.step(9)
        wrong = r"'slow' wrote a value that is not finite at .* slow.y.value\[7\] is nan"
        with pytest.raises(aloft.AloftError, match=wrong):
            run.step(1)
