#!/bin/sh
# adafruit-circuitpython-ms8607 1.1.8 (barometer of TE, 24-bit converter): of the three bytes of each conversion the driver reads two (`in_start=1, in_end=3` excludes the last) and puts 0 in place of the third, so pressure and
# temperature are those of a 16-bit converter and always rounded down. The oversampling that it sets (8192, the finest) is lost, at no gain in time.
# Expected: the datasheet's example (D1 6465444, D2 8077636) gives 20.00 degC, 1100.02 hPa, and a climb of 3 m at sea level the smooth fall of pressure, to 0.01 hPa (the datasheet's resolution: 0.016 hPa, 0.13 m).
# Seen: 1099.95 hPa; the climb is a staircase of 5 values, 0.9 to 1.0 m apart, on the mean 0.5 m too high. Values are right to 0.01 %, so a look at the weather shows nothing; a multirotor that holds its height by it wanders by a metre.
# The bus is simulated: a chip with the calibration of the datasheet's example; the same bytes through the datasheet's first-order formula are the judge. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check adafruit-circuitpython-ms8607==1.1.8 2>"$folder/log" || { cat "$folder/log"; exit 1; }
"$folder/env/bin/python" - <<'CODE'
import sys
import time

from adafruit_ms8607 import MS8607

CALIBRATION = (46372, 43981, 29059, 27842, 31553, 28165)  # of the datasheet's example
time.sleep = lambda seconds: None


class Bus:
    """An MS8607: 0x76 answers with calibration and conversions of 24 bits, 0x40 is its hygrometer."""

    def __init__(self, crc):
        self.words, self.command, self.conversion = (crc << 12, *CALIBRATION), 0, 0
        self.pressure, self.temperature = 6465444, 8077636

    def try_lock(self):
        return True

    def unlock(self):
        pass

    def writeto(self, address, buffer, *, start=0, end=None):
        data = bytes(buffer[start:end])
        if address == 0x76 and data:
            self.command = data[0]
            if self.command >> 4 in (4, 5):
                self.conversion = self.pressure if self.command >> 4 == 4 else self.temperature

    def readfrom_into(self, address, buffer, *, start=0, end=None):
        end = len(buffer) if end is None else end
        answer = bytes(end - start)
        if address == 0x76 and self.command >> 4 == 0xA:
            answer = self.words[(self.command & 0xF) // 2].to_bytes(2, "big")
        elif address == 0x76 and self.command == 0:
            answer = self.conversion.to_bytes(3, "big")
        buffer[start:end] = answer[: end - start]

    def writeto_then_readfrom(self, address, out, into, *, out_start=0, out_end=None, in_start=0, in_end=None):
        self.writeto(address, out, start=out_start, end=out_end)
        self.readfrom_into(address, into, start=in_start, end=in_end)


def opened():
    for crc in range(16):  # one of them fits the calibration
        try:
            bus = Bus(crc)
            return bus, MS8607(bus)
        except RuntimeError:
            pass
    sys.exit("no checksum fits")


def formula(d1, d2):
    """Temperature (degC) and pressure (hPa) in real numbers; at 20 degC the second order is nothing."""
    sens1, off1, tcs, tco, reference, tempsens = CALIBRATION
    dt = d2 - reference * 2**8
    off, sens = off1 * 2**17 + tco * dt / 2**6, sens1 * 2**16 + tcs * dt / 2**7
    return 20.0 + dt * tempsens / 2**23 / 100, (d1 * sens / 2**21 - off) / 2**15 / 100


bus, sensor = opened()
example, right = sensor.pressure, formula(bus.pressure, bus.temperature)
print(f"example of the datasheet: {example:.2f} hPa, {sensor.temperature:.2f} degC; with all three bytes {right[1]:.2f} hPa, {right[0]:.2f} degC")

counts_of_hpa = 1 / (formula(6465445, 8077636)[1] - right[1])
seen, true = [], []
for k in range(301):  # a climb of 3 m, 8.3 m for a hectopascal
    bus.pressure = round(6465444 + (1013.25 - k * 0.01 / 8.3 - right[1]) * counts_of_hpa)
    seen.append(sensor.pressure)
    true.append(formula(bus.pressure, bus.temperature)[1])
levels = sorted(set(seen), reverse=True)
steps = [(a - b) * 8.3 for a, b in zip(levels, levels[1:])]
bias = sum(b - a for a, b in zip(seen, true)) / len(seen) * 8.3
print(f"a climb of 3 m in steps of 1 cm: {len(set(round(value, 2) for value in true))} pressures of 0.01 hPa, the driver gives {len(levels)}: {levels}; {max(steps):.2f} m apart, on the mean {bias:.2f} m too high")
sys.exit(0 if abs(right[1] - 1100.02) < 0.01 and abs(right[0] - 20.0) < 0.005 and right[1] - example > 0.02 and len(levels) <= 6 and max(steps) > 0.5 and bias > 0.2 else 1)
CODE
