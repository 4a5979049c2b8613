"""Bytes of the drives' bus behind a pseudo-terminal: whole instructions, however they arrive."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from aloft.hal.bear.bulk import BulkExchange
from aloft.hal.bear.bus import BearBus, open_port
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.measurement import READ
from aloft.hal.bear.protocol import FrameReader, Instruction, frame_bytes
from aloft.hal.bear.sense_board import SenseBoard
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.twin.server import PseudoTerminal, TwinServer
from aloft.hal.twin.twin import standing_twin
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


@pytest.fixture(scope="module")
def server() -> Iterator[TwinServer]:
    hardware = Hardware.for_twin(ROBOT)
    twin = standing_twin(ROBOT, SimulatorParameters(timestep=0.001), hardware)
    with TwinServer(twin, virtual=True, period=0.001) as served:
        yield served


def test_pieces_and_garbage(server: TwinServer) -> None:
    bus = os.open(server.bus_path, os.O_RDWR | os.O_NOCTTY)
    ping = frame_bytes(2, Instruction.PING)
    reader, answers = FrameReader(), []
    for piece in (b"\x00garb\xff", b"\xff\xff\xff\x00\x00", ping[:3], ping[3:] + ping, ping[:1]):
        os.write(bus, piece)
    os.write(bus, ping[1:])
    while len(answers) < 3:
        answers += reader.feed(os.read(bus, 256))
    assert {answer.device for answer in answers} == {2}
    os.close(bus)


def test_the_packet_of_an_exchange_is_there_before_its_answers(server: TwinServer) -> None:
    port = open_port(server.bus_path)
    board = SenseBoard(open_port(server.board_path))
    bulk = BulkExchange(BearBus(port, reply_time=5.0), range(1, 11), READ, ())
    board.poll()
    for _ in range(50):
        before, exchanges = board.packets, server.twin.exchanges
        assert bulk.exchange() == 10
        assert board.poll() == 1 and board.packets == before + 1
        assert server.twin.exchanges == exchanges + 1
    np.testing.assert_allclose(board.specific_force[2], 9.81, atol=0.3)
    port.close()
    board.port.close()


def test_the_device_answers_and_a_pulled_cable_fails():
    with PseudoTerminal(lambda sent: sent.upper()) as cable:
        port = os.open(cable.path, os.O_RDWR | os.O_NOCTTY)
        os.write(port, b"hello")
        assert os.read(port, 16) == b"HELLO"
    with pytest.raises(OSError):
        os.write(port, b"hello")
    os.close(port)


def test_many_threads_may_close_it_at_once():
    """The twin's clock and a fault of a device both pull the cable."""
    cable = PseudoTerminal(lambda sent: time.sleep(0.1) or b"")
    port = os.open(cable.path, os.O_RDWR | os.O_NOCTTY)
    os.write(port, b"hello")  # keeps the serving thread alive until all others are there
    gate, errors = threading.Barrier(8), []

    def pull():
        gate.wait()
        try:
            cable.close()
        except OSError as error:
            errors.append(error)

    threads = [threading.Thread(target=pull) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    os.close(port)
    assert errors == []


def test_it_can_be_closed_while_nobody_reads() -> None:
    # the terminal's buffer is full, and the clock's thread waits until somebody makes room
    cable = PseudoTerminal(lambda sent: b"")
    sending = threading.Thread(target=cable.send, args=(bytes(1_000_000),), daemon=True)
    sending.start()
    sending.join(0.2)
    assert sending.is_alive()
    cable.close()
    sending.join(60.0)
    assert not sending.is_alive()


def test_a_server_ends_while_its_packets_are_not_read() -> None:
    twin = standing_twin(ROBOT, SimulatorParameters(timestep=0.001), Hardware.for_twin(ROBOT))
    server = TwinServer(twin, virtual=False, period=0.002)
    filling = threading.Thread(target=server._board.send, args=(bytes(1_000_000),), daemon=True)
    filling.start()
    time.sleep(0.3)  # by now the clock's thread waits to send as well
    closing = threading.Thread(target=server.close, daemon=True)
    closing.start()
    closing.join(60.0)
    assert not closing.is_alive()


def test_it_can_be_stopped_after_it_was_closed() -> None:
    cable = PseudoTerminal(lambda sent: b"")
    cable.close()
    cable.stop()
