#!/bin/sh
# adafruit-circuitpython-ina228 2.0.5 (monitor of current and battery): `shunt_voltage_overlimit` and `shunt_voltage_underlimit` (V) take the threshold registers for registers of 312.5 uV a count. They are the 16 high bits of the
# converter: +-163.84 mV over 2^16 counts are 5 uV (1.25 uV in the fine range), 62.5 times less. The getter uses the same factor, so what was set is read back. (312.5 nV is the 20-bit reading's count; bus and power limits are right.)
# Expected: a limit of 8 A on the board's own shunt of 15 mOhm (0.12 V) trips above 8 A. Seen: it trips at 0.13 A (2 A in the fine range: 0.03 A), so the alert that is to stop a motor when it stalls stops it when it starts.
# The bus is simulated: a chip that compares the high 16 bits of its converter, as the datasheet says; from the same counts the driver reads the right shunt voltage. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check adafruit-circuitpython-ina228==2.0.5 2>"$folder/log" || { cat "$folder/log"; exit 1; }
"$folder/env/bin/python" - <<'CODE'
import sys

from adafruit_ina228 import INA228

SHUNT = 0.015  # ohm


class Bus:
    """An INA228 with a shunt of 15 mOhm through which `current` (A) flows."""

    def __init__(self):
        self.registers, self.current = {0x3E: 0x5449, 0x3F: 0x2281, 0x0C: 0x7FFF, 0x0D: 0x8000}, 0.0

    def try_lock(self):
        return True

    def unlock(self):
        pass

    def counts(self):
        """The shunt voltage in the 20 bits of the converter, of +-163.84 mV or +-40.96 mV."""
        full_scale = 0.04096 if self.registers.get(0, 0) & 0x10 else 0.16384
        return max(-(2**19), min(2**19 - 1, round(self.current * SHUNT / full_scale * 2**19)))

    def word(self, register):
        signed = lambda value: value - 2**16 if value & 2**15 else value
        if register == 0x04:
            return ((self.counts() & 0xFFFFF) << 4).to_bytes(3, "big")
        value = self.registers.get(register, 0)
        if register == 0x0B:
            high, low = signed(self.registers[0x0C]), signed(self.registers[0x0D])
            value |= (self.counts() >> 4 > high) << 6 | (self.counts() >> 4 < low) << 5
        return value.to_bytes(2, "big")

    def writeto(self, address, buffer, *, start=0, end=None):
        data = bytes(buffer[start:end])
        if len(data) == 3:
            self.registers[data[0]] = int.from_bytes(data[1:], "big") & (0x3FFF if data[0] == 0 else 0xFFFF)  # resets are done at once
        elif data:
            self.at = data[0]

    def readfrom_into(self, address, buffer, *, start=0, end=None):
        end = len(buffer) if end is None else end
        buffer[start:end] = self.word(self.at)[: end - start]

    def writeto_then_readfrom(self, address, out, into, *, out_start=0, out_end=None, in_start=0, in_end=None):
        self.writeto(address, out, start=out_start, end=out_end)
        self.readfrom_into(address, into, start=in_start, end=in_end)


bus = Bus()
sensor = INA228(bus)
sensor.set_calibration(SHUNT, 10.0)
right = True
for fine, limit in ((0, 8.0), (1, 2.0)):
    sensor.adc_range = fine
    sensor.shunt_voltage_overlimit = limit * SHUNT
    trip = None
    for milliamperes in range(0, 10000, 1):
        bus.current = milliamperes / 1000
        if sensor.alert_flags["SHNTOL"]:
            trip = bus.current
            break
    bus.current = limit
    print(f"range {fine}: limit set {limit} A ({limit * SHUNT * 1e3:.0f} mV), read back {sensor.shunt_voltage_overlimit / SHUNT:.2f} A, trips at {trip} A, {limit / trip:.1f} times too early; the shunt voltage itself at {limit} A: {sensor.shunt_voltage * 1e3:.2f} mV")
    right &= abs(trip * 62.5 / limit - 1) < 0.05 and abs(sensor.shunt_voltage_overlimit / SHUNT - limit) < 0.03 and abs(sensor.shunt_voltage / SHUNT - limit) < 1e-3
sys.exit(0 if right else 1)
CODE
