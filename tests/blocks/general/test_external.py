"""``blocks.External``: it holds what was set last; stepping is tested in ``tests/runtime``."""

from aloft.blocks.general.external import External
from aloft.runtime.testing import BlockBench


def test_it_holds_its_initial_value_until_it_is_set() -> None:
    bench = BlockBench(External, {"n": 2, "initial": [1.0, 2.0], "unit": "m"})
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, 2.0]
    bench.block.x.value[:] = [3.0, 4.0]  # type: ignore[attr-defined]
    bench.step()
    assert bench.get("y").value.tolist() == [3.0, 4.0]
