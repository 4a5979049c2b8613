#!/bin/sh
# adafruit-circuitpython-lsm6ds 4.6.3 and adafruit-circuitpython-icm20x 2.1.10 (drivers of the IMUs LSM6DSOX, LSM6DSO32, ISM330DHCX, ICM20948, ICM20649): the table from range code to scale (`AccelRange.lsb`, `GyroRange.lsb`) belongs
# to the module, not to the sensor, and every constructor overwrites it. The models give the same code to different ranges, so a sensor that is open already is read with the scale of the model that was opened last.
# Expected: an IMU at rest reads 9.81 m/s^2 whatever else is opened. Seen: an LSM6DSOX (4 g) reads 9.80, and 19.60 once an LSM6DSO32 is opened beside it (a common pair: fine range and 32 g for shocks); an ICM20948 reads
# 9.81 m/s^2 and 1.001 rad/s, and 19.61 and 1.998 once an ICM20649 is. The registers of the first are not touched, its `accelerometer_range` says the same as before, and a test with one sensor passes. (Two of one model are right.)
# The bus here is simulated: each chip answers with the counts that its own range register gives for 1 g and 1 rad/s. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check adafruit-circuitpython-lsm6ds==4.6.3 adafruit-circuitpython-icm20x==2.1.10 2>"$folder/log" || { cat "$folder/log"; exit 1; }
"$folder/env/bin/python" - <<'CODE'
import math
import struct
import sys

import adafruit_icm20x
from adafruit_lsm6ds.lsm6dso32 import LSM6DSO32
from adafruit_lsm6ds.lsm6dsox import LSM6DSOX


class Chip:
    """Registers in banks; z feels 1 g and 1 rad/s, in counts of the full scale that the chip's own registers choose."""

    def __init__(self, identity, bank, accel, gyro, out, order):
        self.registers, self.bank_register = {(0, identity[0]): identity[1]}, bank
        self.accel, self.gyro, self.out, self.order = accel, gyro, out, order

    def bank(self):
        return self.registers.get((0, self.bank_register), 0) >> 4 if self.bank_register is not None else 0

    def write(self, register, value):
        bank = 0 if register == self.bank_register else self.bank()
        if (bank, register) in ((0, 0x12), (0, 0x06)):  # control and power registers: a reset is done at once
            value &= 0x7E
        self.registers[bank, register] = value

    def full_scale(self, field):
        bank, register, shift, scales = field
        return scales[self.registers.get((bank, register), 0) >> shift & 3]

    def read(self, register):
        value = {}
        for start, unit, field in ((self.out[0], 1.0, self.accel), (self.out[1], math.degrees(1.0), self.gyro)):
            counts = round(unit / self.full_scale(field) * 32768)
            value |= dict(enumerate(struct.pack(self.order + "hhh", 0, 0, counts), start))
        if self.bank() == 0 and register in value:
            return value[register]
        if (self.bank(), register) == (0, 0x17):  # the ICM's transfers to its magnetometer are done
            return 0x40
        return self.registers.get((0 if register == self.bank_register else self.bank(), register), 0)


class Bus:
    def __init__(self, chips):
        self.chips, self.at = chips, {}

    def try_lock(self):
        return True

    def unlock(self):
        pass

    def writeto(self, address, buffer, *, start=0, end=None):
        data = bytes(buffer[start:end])
        if data:
            self.at[address] = data[0]
        for k, value in enumerate(data[1:]):
            self.chips[address].write(data[0] + k, value)

    def readfrom_into(self, address, buffer, *, start=0, end=None):
        for k in range(start, len(buffer) if end is None else end):
            buffer[k] = self.chips[address].read(self.at[address] + k - start)

    def writeto_then_readfrom(self, address, out, into, *, out_start=0, out_end=None, in_start=0, in_end=None):
        self.writeto(address, out, start=out_start, end=out_end)
        self.readfrom_into(address, into, start=in_start, end=in_end)


def lsm(*scales):
    return Chip((0x0F, 0x6C), None, (0, 0x10, 2, scales), (0, 0x11, 2, (286.72, 573.44, 1146.88, 2293.76)), (0x28, 0x22), "<")


def icm(identity, scales, rates):
    return Chip((0x00, identity), 0x7F, (2, 0x14, 1, scales), (2, 0x01, 1, rates), (0x2D, 0x33), ">")


bus = Bus({0x6A: lsm(2, 16, 4, 8), 0x6B: lsm(4, 32, 8, 16), 0x69: icm(0xEA, (2, 4, 8, 16), (250, 500, 1000, 2000)), 0x68: icm(0xE1, (4, 8, 16, 32), (500, 1000, 2000, 4000))})
right = True
for first, second in ((lambda: LSM6DSOX(bus, 0x6A), lambda: LSM6DSO32(bus, 0x6B)), (lambda: adafruit_icm20x.ICM20948(bus, 0x69), lambda: adafruit_icm20x.ICM20649(bus, 0x68))):
    imu = first()
    alone = imu.acceleration[2], imu.gyro[2], imu.accelerometer_range
    other = second()
    beside = imu.acceleration[2], imu.gyro[2], imu.accelerometer_range
    names = type(imu).__name__, type(other).__name__
    print(f"{names[0]} at rest, turned with 1 rad/s: alone {alone[0]:.2f} m/s^2, {alone[1]:.3f} rad/s; once an {names[1]} is open {beside[0]:.2f} m/s^2, {beside[1]:.3f} rad/s (range code {alone[2]}, {beside[2]}); the {names[1]} itself {other.acceleration[2]:.2f}, {other.gyro[2]:.3f}")
    right &= abs(alone[0] - 9.81) < 0.03 and abs(alone[1] - 1.0) < 0.01 and abs(other.acceleration[2] - 9.81) < 0.03 and abs(other.gyro[2] - 1.0) < 0.01
    right &= abs(beside[0] - 2 * 9.81) < 0.05 and alone[2] == beside[2] and abs(beside[1] - (2.0 if "ICM" in names[0] else 1.0)) < 0.01
sys.exit(0 if right else 1)
CODE
