"""What every robot is to a graph, simulated or real."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal

from ..blocks.signals import ContactSwitches, ImuReading, JointCommand, JointState
from ..runtime.language.block import Block, Input, Output


class Robot(Block, ABC):
    """The base of everything that drives a robot: the same ports, so that graphs do not care.

    A robot is a Moore block. In a tick ``n`` of the control clock it first publishes the sensors
    sampled at ``t_n`` (``emit``); the controller runs; then it takes the command and lives on to
    ``t_{n+1}`` (``update``). A driver implements four methods, each called once a tick by the
    control thread, none of which may allocate arrays, block without a time-out or raise on a
    single bad packet:

    * ``read``: write the latest sensor sample into ``imu``, ``joints`` and ``contacts``;
    * ``write``: send ``command`` to the drives;
    * ``advance``: let the time to the next tick pass: a simulator computes it; a robot that drives
      the clock waits for its bus's next cycle; one that is paced by the runtime returns at once;
    * ``damp``: one cycle of coming to rest: put all drives into damping, whatever was commanded,
      and let one period pass. It is called at least five times at the end of every run, also
      after an exception, a signal or a lost machine, so it must not depend on what failed.

    Life: ``setup`` builds models and buffers and touches no hardware; ``open`` connects, verifies
    identities, voltages and limits, brings the drives into a safe holding state and returns when
    the first sensor sample is there, or raises; then ticks; then ``damp`` cycles; then ``close``,
    which disables the drives and frees the link, and may be called without ``open`` having
    succeeded.

    Errors: ``open`` raises what the link raises, naming the device. Losing the link during a run
    is the driver's to report by ``request_stop`` after its time-out.
    """

    outside: ClassVar[Literal["no", "simulated", "real"]] = "real"

    imu = Output(ImuReading, text="inertial measurement unit, at the start of the tick")
    joints = Output(JointState, text="joint encoders and motor currents, at the same instant")
    contacts = Output(ContactSwitches, text="tactile switches, at the same instant")
    command = Input(JointCommand, text="what the drives are to do")

    def emit(self) -> None:
        """Publish the sensors."""
        self.read()

    def update(self) -> None:
        """Take the command and live on to the next tick."""
        self.write()
        self.advance()

    def start(self) -> None:
        """Open the robot."""
        self.open()

    def stop_cycle(self) -> None:
        """Come to rest."""
        self.damp()

    @abstractmethod
    def open(self) -> None:
        """Connect and come to a safe holding state with a first sensor sample at hand."""

    @abstractmethod
    def read(self) -> None:
        """Write the sensor sample of this tick's start to the outputs."""

    @abstractmethod
    def write(self) -> None:
        """Send the command to the drives."""

    @abstractmethod
    def advance(self) -> None:
        """Let the time to the next tick pass."""

    @abstractmethod
    def damp(self) -> None:
        """One cycle with all drives in damping."""
