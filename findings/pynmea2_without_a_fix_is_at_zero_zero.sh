#!/bin/sh
# pynmea2 1.19.0: a receiver that has no position sends a GGA or RMC whose fields for it are empty. `latitude` and `longitude` of such a message are 0.0 and 0.0, a point in the Gulf of Guinea, and no exception;
# the other empty numbers of the message, such as `altitude`, are None.
# Expected: None (or NaN, or an error), as for the altitude beside it, and as pynmeagps 1.1.8, which leaves the text empty. Seen: 0.0; a mean of four fixes and one gap is 9.4 degrees off, and a jump
# to 0, 0 in the middle of a log looks like a measurement. `gps_qual` is 0 and `status` "V". Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pynmea2==1.19.0 pynmeagps==1.1.8
"$folder/env/bin/python" - <<'CODE'
import sys
from functools import reduce

import pynmea2
from pynmeagps import NMEAReader


def sentence(body):
    return f"${body}*{reduce(lambda total, letter: total ^ ord(letter), body, 0):02X}\r\n"


FIX = sentence("GPGGA,120000.00,4724.0000,N,00833.0000,E,1,08,1.0,488.0,M,48.0,M,,")
NONE = sentence("GPGGA,120001.00,,,,,0,00,99.99,,,,,,")
VOID = sentence("GPRMC,120002.00,V,,,,,,,291126,,,N")
found = {}
for name, text in {"GGA with a fix": FIX, "GGA without": NONE, "RMC without": VOID}.items():
    message, other = pynmea2.parse(text), NMEAReader.parse(text)
    found[name] = (message.latitude, message.longitude), (other.lat, other.lon)
    print(f"{name}: pynmea2 1.19.0 {found[name][0]}, altitude {getattr(message, 'altitude', '-')}; pynmeagps 1.1.8 {found[name][1]}")
track = [pynmea2.parse(text).latitude for text in (FIX, FIX, NONE, FIX, FIX)]
print(f"mean latitude of four fixes and one gap: {sum(track) / 5:.2f} deg in place of {track[0]:.2f}")
nothing = all(found[name] == ((0.0, 0.0), ("", "")) for name in ("GGA without", "RMC without"))
sys.exit(0 if nothing and found["GGA with a fix"][0] == (47.4, 8.55) and pynmea2.parse(NONE).altitude is None else 1)
CODE
