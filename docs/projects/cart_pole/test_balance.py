"""``python -m pytest`` in this folder."""

from pathlib import Path

import numpy as np
import pytest
from balance import Balance

import aloft
from aloft.robots.description import find_robot
from aloft.runtime.testing.bench import BlockBench
from aloft.runtime.testing.conformance import check_block, conformance_cases

HERE = Path(__file__).parent
CART_POLE = find_robot("cart_pole.xml", HERE)


def test_linear_model_is_the_textbooks():
    a, b = BlockBench(Balance, robot=CART_POLE).block.linear_model()
    cart, pole, length = 1.0, 0.2, 0.5
    inertia = CART_POLE.link("pole").inertia[1] + pole * length**2
    scale = (cart + pole) * inertia - (pole * length) ** 2
    dt = 0.002
    assert b[2:, 0] / dt == pytest.approx([inertia / scale, -pole * length / scale], rel=2e-3)
    assert a[3, 1] / dt == pytest.approx((cart + pole) * pole * 9.81 * length / scale, rel=2e-3)


def test_gains_are_stable_and_only_the_cart_is_driven():
    bench = BlockBench(Balance, robot=CART_POLE)
    a, b = bench.block.linear_model()
    assert np.abs(np.linalg.eigvals(a - b @ bench.block.gains)).max() < 0.9999
    bench.set("joints", position=[0.0, 0.1])
    bench.step()
    force, torque = bench.get("command").torque
    assert force > 1.0 and torque == 0.0  # the cart goes where the pole falls


@pytest.mark.parametrize("case", conformance_cases())
def test_keeps_every_blocks_promises(case):
    check_block(Balance, robot=CART_POLE, cases=[case])


@pytest.mark.parametrize("seed", [0, 1])
def test_the_pole_stays_up(seed):
    result = aloft.load(HERE / "balance.yaml", [f"robot.seed={seed}"]).run()
    assert result.success
    assert result.metrics["largest_position"] < 0.05
