"""``blocks.Ramp``: exact values."""

from aloft.blocks.general.ramp import Ramp
from aloft.runtime.testing import BlockBench


def run(**params: object) -> list[list[float]]:
    bench = BlockBench(Ramp, params, rate=2.0)
    values = []
    for _ in range(6):
        bench.step()
        values.append(bench.get("y").value.tolist())
    return values


def test_ramp_grows_from_its_start() -> None:
    assert run(start="1 s", slope=2.0, offset=3.0) == [[3], [3], [3], [4], [5], [6]]


def test_ramp_stops_after_its_duration() -> None:
    found = run(n=2, duration="1 s", slope=[2.0, -1.0])
    assert found == [[0, 0], [1, -0.5], [2, -1], [2, -1], [2, -1], [2, -1]]
