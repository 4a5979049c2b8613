"""The benchmark of the driver measures cycles of a driver that drives, beside bare bytes on the same ports."""

import pytest

from aloft.blocks.signals import DrivePhase
from aloft.hal.bear.driver import Driver
from aloft.hal.bear.protocol import BROADCAST, FrameReader, Instruction
from aloft.lab.benchmarks.driver import BARE, RECORDED, Talk, driver, recorded


@pytest.fixture(scope="module")
def driven() -> tuple[Driver, Talk]:
    return recorded()


def test_what_is_said_and_heard_is_the_protocol_of_ten_drives(driven: tuple[Driver, Talk]) -> None:
    made, talk = driven
    assert made.loop.phase is DrivePhase.DRIVING and not made.loop.fault
    (request,) = FrameReader().feed(talk.request)
    assert (request.device, request.code) == (BROADCAST, Instruction.BULK)
    assert len(talk.answers) == len(talk.packets) == RECORDED
    for answer, packet in zip(talk.answers, talk.packets, strict=True):
        frames = FrameReader().feed(answer)
        assert [frame.device for frame in frames] == list(range(1, 11))
        assert all(len(frame.data) == 20 for frame in frames) and len(packet) == 29
    assert len(set(talk.packets)) > RECORDED // 2, "an IMU whose numbers never change is frozen"


def test_the_goals_are_made_by_machine_code(driven: tuple[Driver, Talk]) -> None:
    made, _ = driven
    assert made.loop.goals._make.compiled is not None


def test_rows() -> None:
    cycle, exchange, cost = driver(rounds=3, repetitions=10)
    assert [row.name for row in (cycle, exchange, cost)] == [
        "driver's cycle for ten motors", "its exchange alone", "processor time of a cycle",
    ]  # fmt: skip
    for row in (cycle, exchange):
        assert row.peer == BARE and row.unit == "us" and row.ratio is not None and row.ratio > 0.5
        assert row.note == "146 B there, 260 and 29 B back"
    assert cost.value is not None and cost.value > 1.0 and cost.goal is not None
