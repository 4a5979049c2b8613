"""The sensors that a robot has without mounting any: encoders in its joints, switches in its contact points."""

from __future__ import annotations

import numpy as np

from ...blocks.signals import ContactSwitches, JointState
from ...mathematics.arrays import Array, Array1D, Counts, Flags, Flags1D, Indices0D, Indices1D
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...runtime.language.random_stream import uniform_call
from .sensor import RosMessage, Sensor


class JointSensors(Sensor):
    """Encoders and current sensors in all drives of a robot. Who simulates the drives knows the true
    values, and their bus carries the readings, so there is nothing to mount."""

    kind = "joints"
    signal = JointState
    averaged = ("torque",)
    ros2 = RosMessage(
        "sensor_msgs/msg/JointState",
        {"position": "position", "velocity": "velocity", "torque": "effort"},
    )


@kernel
def count_bouncing(step: Indices0D, bounce_end: Indices1D, count: Indices1D) -> None:
    """Count the switches that chatter in a physics step: ``step`` without a dimension, ``count`` (1,)."""
    count[0] = 0
    for point in range(bounce_end.shape[0]):
        if step[()] < bounce_end[point]:
            count[0] += 1


@kernel
def sample_switches(
    present: bool,
    step: Indices0D,
    pressed: Flags1D,
    bounce_end: Indices1D,
    draws: Array1D,
    closed: Flags1D,
) -> None:
    """Take a sample of the switches that the robot may have (``present``).

    Args:
        step, bounce_end: as for ``count_bouncing``.
        pressed: the switches before bounce, (n_contacts,).
        draws: a random number between zero and one for each switch that chatters, in their order.
        closed: what the switches read, (n_contacts,).
    """
    drawn = 0
    for point in range(closed.shape[0]):
        closed[point] = present and bool(pressed[point])
        if present and step[()] < bounce_end[point]:
            closed[point] = draws[drawn] < 0.5
            drawn += 1


class SwitchSensors(Sensor):
    """A switch in every contact point of the robot, or none at all. A switch has no numbers, so its
    errors are the spread of the force that closes it and how long it bounces."""

    kind = "switches"
    signal = ContactSwitches

    @staticmethod
    def draw_thresholds(limits: list[float], count: int, draws: np.random.Generator) -> Array:
        """Draw the force that closes every switch [N], (count,), between the two ``limits``."""
        low, high = limits
        return low + (high - low) * draws.random(count)

    @staticmethod
    def calls(
        present: bool, bounces: bool, step: Counts, pressed: Flags, bounce_end: Counts,
        noise: np.random.Generator, closed: Flags,
    ) -> list[Call]:  # fmt: skip
        """Write a sample of the switches, (n_contacts,): a switch that has just changed reads either way
        at random. Arguments as for ``sample_switches``; ``bounces``: whether any switch ever does."""
        draws = np.zeros(len(closed))
        drawing, count = uniform_call(noise, draws)
        return [
            KernelCall(count_bouncing, step, bounce_end, count),
            *([drawing] if bounces else []),
            KernelCall(sample_switches, present, step, pressed, bounce_end, draws, closed),
        ]
