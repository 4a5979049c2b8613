#!/bin/sh
# mpu6050-raspberrypi 1.2 (`pip install mpu6050-raspberrypi`, the common driver of the MPU-6050 on a Raspberry Pi): each 16-bit value is read as two transactions of one byte, high and low; the chip holds a sample still only
# within one burst. When a sample comes between the two, the high byte is of the old value, the low one of the new. Near zero, where a gyro at rest lives, the high byte flips between 0x00 and 0xFF with the sign.
# Expected: a gyro at rest reads its noise, here 0.05 deg/s (datasheet: 0.05 deg/s rms). Seen: 2,000 readings at 400 kHz I2C, 1 kHz samples: 5 % are off by 256 counts, +1.95 or -1.95 deg/s (0.15 m/s^2 on a level axis); the rms is
# 0.4 deg/s, 8 times the chip's noise; at 100 kHz 21 % and 0.9. No error, no range passed, a mean near zero: it looks like a bad sensor. The same simulated chip read in one burst gives 0.05.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check --no-deps mpu6050-raspberrypi==1.2
"$folder/env/bin/python" - <<'CODE'
import random
import statistics
import struct
import sys
import types


class SMBus:
    """An MPU-6050 behind a bus of `clock` Hz: a new sample each millisecond, gyro x at rest with noise of 0.05 deg/s."""

    clock = 400e3

    def __init__(self, number):
        self.time, self.registers, self.sample, self.count = 0.0, {}, 0, -1
        self.random = random.Random(1)

    def measure(self):
        count = int(self.time / 1e-3)
        if count != self.count:
            self.count, self.sample = count, round(self.random.gauss(0.0, 0.05) * 131)
        return struct.pack(">h", self.sample)

    def write_byte_data(self, address, register, value):
        self.registers[register] = value

    def read_byte_data(self, address, register):
        self.time += 39 / self.clock  # start, address, register, start, address, byte, stop
        word = self.measure()
        return word[register - 0x43] if register in (0x43, 0x44) else self.registers.get(register, 0)

    def burst(self):
        self.time += 48 / self.clock
        return struct.unpack(">h", self.measure())[0]


sys.modules["smbus"] = types.SimpleNamespace(SMBus=SMBus)
from mpu6050 import mpu6050

found = {}
for clock in (400e3, 100e3):
    SMBus.clock = clock
    sensor = mpu6050(0x68)
    singly, burst = [], []
    for k in range(2000):
        sensor.bus.time = 0.0102347 * (k + 1)  # a loop of about 100 Hz
        singly.append(sensor.get_gyro_data()["x"])
        burst.append(sensor.bus.burst() / 131)
    rms = [statistics.fmean(value**2 for value in values) ** 0.5 for values in (singly, burst)]
    spikes = sum(abs(value) > 1.0 for value in singly) / len(singly)
    found[clock] = *rms, spikes, max(map(abs, singly)), max(map(abs, burst))
    print(f"{clock / 1e3:.0f} kHz: rms of a gyro at rest {rms[0]:.2f} deg/s, {spikes:.1%} of the readings above 1 deg/s, up to {max(map(abs, singly)):.2f}; in one burst {rms[1]:.3f}, up to {max(map(abs, burst)):.2f}")
sys.exit(0 if all(0.04 < b < 0.06 and a > 5 * b and share > 0.02 and top > 1.9 and least < 0.3 for a, b, share, top, least in found.values()) else 1)
CODE
