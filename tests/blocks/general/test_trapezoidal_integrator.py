"""``blocks.TrapezoidalIntegrator``: exact on a ramp, and its reset."""

from aloft.blocks.general.trapezoidal_integrator import TrapezoidalIntegrator
from aloft.runtime.testing import BlockBench


def test_it_is_exact_on_a_ramp() -> None:
    bench = BlockBench(TrapezoidalIntegrator, {"initial": 1.0}, rate=4.0)
    for k in range(9):
        bench.set("u", value=k / 4.0)
        bench.step()
        assert bench.get("y").value[0] == 1.0 + 0.5 * (k / 4.0) ** 2


def test_a_reset_starts_anew() -> None:
    bench = BlockBench(TrapezoidalIntegrator, {"n": 2, "initial": [1.0, -1.0]}, rate=1.0)
    found = []
    for reset in (False, False, True, False):
        bench.set("u", value=2.0)
        bench.set("reset", value=reset)
        bench.step()
        found.append(bench.get("y").value.tolist())
    assert found == [[1, -1], [3, 1], [1, -1], [3, 1]]
