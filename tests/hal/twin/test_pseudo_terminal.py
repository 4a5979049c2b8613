"""The cable between a real driver and an emulated device."""

from __future__ import annotations

import os
import threading
import time

import pytest

from aloft.hal.twin.pseudo_terminal import PseudoTerminal


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
