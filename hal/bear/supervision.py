"""Decides from what the drives and the board report whether the robot may go on driving."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals.drive_conditions import describe, is_critical
from .bulk import BulkExchange
from .configuration import Hardware
from .measurement import Measurement
from .sense_board import SenseBoard

_MOVING = 1.0
"""A motor that is faster moves [rad/s]."""


FOREIGN = 3
"""So many instructions of somebody else mean a second writer: one may be damage that looks so."""


class Supervision:
    """Judges every exchange. The first fault is what counts; its text names the drive or board.

    Faults, with how long they may last, in exchanges (``Hardware`` sets the numbers):

    * a drive does not answer: ``bus.lost_cycles``; it reports an error: none;
    * its voltage or winding temperature is out of range: ``drives.bad_cycles``;
    * its encoder is stuck: ``drives.stuck_cycles`` equal positions in a row, each under a current
      of ``stuck_current``, while another motor moved at 1 rad/s or faster;
    * the board sends nothing: ``board.lost_cycles``; the IMU repeats itself:
      ``board.frozen_packets``; its gyroscope is at its range: ``board.saturated_packets``;
    * another program or adapter sends instructions on the bus: ``FOREIGN`` of them.

    Args:
        hardware: the drives and limits.
        names: the motors, in the order of the exchange.

    Attributes:
        imu_silent: exchanges since the last packet of the board.
        low, hot, still, last, moved, numbers, frozen, saturated: counts and last readings.
        imu_valid: the board streams, and the IMU is neither frozen nor saturated.
    """

    def __init__(self, hardware: Hardware, names: tuple[str, ...]) -> None:
        n = len(names)
        self._hardware = hardware
        self._who = [f"drive {name} (address {hardware.motors[name].id})" for name in names]
        self.low, self.hot = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        self.still = np.zeros(n, dtype=np.int64)
        self.last = np.full(n, np.nan)
        self.moved = 0
        self.numbers = np.full(6, np.nan)
        self.frozen = self.saturated = 0
        self.imu_silent = 0
        self.imu_valid = False

    def judge_drives(self, measured: Measurement, bulk: BulkExchange, driving: bool) -> str:
        """The first fault of the drives after an exchange; empty where there is none.

        ``driving`` says whether the drives are on: errors, voltages and stuck encoders of drives
        that are off hurt nobody.
        """
        settings, ages = self._hardware.drives, bulk.ages.tolist()
        for k, age in enumerate(ages):
            if age >= self._hardware.bus.lost_cycles:
                return f"{self._who[k]} has not answered for {age} exchanges"
        if bulk.bus.counts.foreign >= FOREIGN:
            return (
                "another program or adapter sends instructions on the bus of the drives: stop it, "
                "and start again"
            )
        if not driving:
            return ""
        for k, condition in enumerate(bulk.error_bytes.tolist()):
            if is_critical(condition):
                return f"{self._who[k]}: {describe(condition)}"
        voltage = _first_lasting(
            measured.voltage, settings.lowest_voltage, self.low, settings.bad_cycles, -1.0
        )
        if voltage >= 0:
            return (
                f"{self._who[voltage]}: {measured.voltage.item(voltage):.1f} V is below the lowest "
                f"voltage of {settings.lowest_voltage:g} V"
            )
        hot = _first_lasting(
            measured.temperature, settings.highest_temperature, self.hot, settings.bad_cycles, 1.0
        )
        if hot >= 0:
            return (
                f"{self._who[hot]}: its winding has {measured.temperature.item(hot):.0f} deg C, "
                f"and {settings.highest_temperature:g} are allowed"
            )
        return self._judge_encoders(measured, ages)

    def _judge_encoders(self, measured: Measurement, ages: list[int]) -> str:
        settings, still = self._hardware.drives, self.still
        moving = [abs(speed) > _MOVING for speed in measured.velocity.tolist()]
        self.moved = 0 if any(moving) else self.moved + 1
        for k, position in enumerate(measured.position.tolist()):
            equal = position == self.last.item(k) and ages[k] == 0
            pushed = abs(measured.current.item(k)) > settings.stuck_current
            still[k] = int(still[k]) + 1 if equal and pushed else 0
            if ages[k] == 0:
                self.last[k] = position
            if still[k] >= settings.stuck_cycles and self.moved < settings.stuck_cycles:
                return (
                    f"{self._who[k]}: its encoder has not changed in {still[k]} exchanges, under "
                    f"{measured.current.item(k):.1f} A and while others moved: it is stuck"
                )
        return ""

    def judge_board(self, board: SenseBoard, fresh: int) -> str:
        """The first fault of the board, of which ``fresh`` packets came with this exchange."""
        settings = self._hardware.board
        self.imu_silent = 0 if fresh else self.imu_silent + 1
        if fresh:
            equal = bool((self.numbers[:3] == board.specific_force).all())
            equal = equal and bool((self.numbers[3:] == board.angular_velocity).all())
            self.frozen = self.frozen + fresh if equal else 0
            self.numbers[:3] = board.specific_force
            self.numbers[3:] = board.angular_velocity
            fastest = max(abs(rate) for rate in board.angular_velocity.tolist())
            at_range = fastest >= 0.995 * settings.gyro_range
            self.saturated = self.saturated + fresh if at_range else 0
        self.imu_valid = not (self.imu_silent or self.frozen or self.saturated)
        if self.imu_silent >= settings.lost_cycles:
            return f"the sensor board has sent nothing for {self.imu_silent} exchanges"
        if self.frozen >= settings.frozen_packets:
            return (
                f"the IMU has sent the same numbers {self.frozen + 1} times in a row: it is frozen"
            )
        if self.saturated >= settings.saturated_packets:
            return (
                f"the gyroscope has been at its range of {settings.gyro_range:g} rad/s for "
                f"{self.saturated} packets"
            )
        return ""


def _first_lasting(
    values: NDArray[np.float64], limit: float, counts: NDArray[np.int64], most: int, sign: float
) -> int:
    """The first value that has been beyond the limit (above for sign 1, below for -1) so many
    times in a row; -1 where there is none."""
    found = -1
    for k, value in enumerate(values.tolist()):
        counts[k] = count = int(counts[k]) + 1 if sign * value > sign * limit else 0
        if count >= most and found < 0:
            found = k
    return found
