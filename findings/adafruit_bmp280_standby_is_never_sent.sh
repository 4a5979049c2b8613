#!/bin/sh
# adafruit-circuitpython-bmp280 3.3.12 (barometer of many altimeters): `standby_period` is kept in Python and never reaches the chip. It is put into the register only while the mode is NORMAL, and to write that register the driver
# first sets the mode to SLEEP; so the bits are 0 (0.5 ms) in every order of calls. Getters give the value that was set.
# Expected: standby 500 ms with the IIR filter x16 (a slow, quiet altitude) samples each 0.54 s; standby 62.5 ms each 0.11 s. Seen: the register has 0.5 ms in all 8 standby times, set before or after the mode: a sample each 44 ms. The
# filter counts samples, so its time constant is 0.7 s where 8.4 s was asked, and noise that was to be averaged over 12 times as long passes. (And a sensor for a battery of months measures all the time.)
# The bus is simulated: a register file with the chip's identity. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check adafruit-circuitpython-bmp280==3.3.12 2>"$folder/log" || { cat "$folder/log"; exit 1; }
"$folder/env/bin/python" - <<'CODE'
import math
import sys

import adafruit_bmp280 as driver

STANDBY = (0.5, 62.5, 125, 250, 500, 1000, 2000, 4000)  # ms, by the three highest bits of register 0xF5


class Bus:
    def __init__(self):
        self.registers, self.at = {0xD0: 0x58}, 0

    def try_lock(self):
        return True

    def unlock(self):
        pass

    def writeto(self, address, buffer, *, start=0, end=None):
        data = bytes(buffer[start:end])
        if data:
            self.at = data[0]
        for register, value in zip(data[::2], data[1::2]):
            if register != 0xF5 or self.registers.get(0xF4, 0) & 3 != 3:  # the chip may ignore this one in normal mode
                self.registers[register] = value

    def readfrom_into(self, address, buffer, *, start=0, end=None):
        for k in range(start, len(buffer) if end is None else end):
            buffer[k] = self.registers.get(self.at + k - start, 0)


found, told = set(), set()
for code in range(8):
    for order in (("mode", "standby_period", "iir_filter"), ("standby_period", "iir_filter", "mode"), ("standby_period", "mode", "iir_filter")):
        bus = Bus()
        sensor = driver.Adafruit_BMP280_I2C(bus)
        values = {"mode": driver.MODE_NORMAL, "standby_period": code, "iir_filter": driver.IIR_FILTER_X16}
        for name in order:
            setattr(sensor, name, values[name])
        assert sensor.mode == driver.MODE_NORMAL == bus.registers[0xF4] & 3 and bus.registers[0xF5] >> 2 & 7 == driver.IIR_FILTER_X16
        found.add(bus.registers[0xF5] >> 5)
        told.add((code, sensor.standby_period))
measuring = sensor.measurement_time_max
print(f"asked: {', '.join(map(str, STANDBY))} ms; the driver says {'the same' if all(a == b for a, b in told) else told}; the chip has {', '.join(str(STANDBY[code]) for code in sorted(found))} ms")
for asked in (62.5, 500):
    cycle, real = measuring + asked, measuring + STANDBY[max(found)]
    decay = -1.0 / math.log(15 / 16)  # samples of the filter's time constant
    print(f"standby {asked} ms: a sample each {cycle / 1e3:.2f} s asked, {real / 1e3:.3f} s real; time constant of the filter x16 {decay * cycle / 1e3:.1f} s asked, {decay * real / 1e3:.2f} s real")
sys.exit(0 if found == {0} and all(a == b for a, b in told) else 1)
CODE
