#!/bin/sh
# damiao-motor 1.0.6 (MIT mode of the DaMiao drives, whose frames have 12 bits for velocity and torque, 16 for position): the range from -max to max is cut into an odd number of steps, so zero lies between two of them, and the package
# cuts off in place of rounding: what is sent for 0 is the step below it, as the package itself reads it back (`uint_to_float`).
# Expected: velocity 0, torque 0 and position 0 are sent as zero. Seen: a 4310 that is to damp (kp 0, kd 1, velocity 0) is told -0.0073 rad/s, so an unloaded axis creeps by 25 degrees a minute, a 6006 by 38; the feed-forward
# torque "0" is -0.0024 N m for a 4310, -0.049 for a 10010. Every value is half a step too low on the mean, and 5,016 of the 65,536 positions that a drive reports go one step down when
# they are sent again: a loop that holds where it stands walks. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check damiao-motor==1.0.6 python-can==4.6.1
"$folder/env/bin/python" - <<'CODE'
import math
import sys

import can
from damiao_motor.core.motor import MOTOR_TYPE_PRESETS, DaMiaoMotor, float_to_uint, uint_to_float


def sent(kind, **command):
    """Position (rad), velocity (rad/s) and torque (N m) that a drive reads from the frame of a command."""
    limits = MOTOR_TYPE_PRESETS[kind]
    with can.Bus(interface="virtual", channel="none") as bus:
        values = dict.fromkeys(("pos", "vel", "torq", "kp", "kd"), 0.0) | command
        frame = int.from_bytes(bytes(DaMiaoMotor(1, 17, bus, motor_type=kind).encode_cmd_msg(**values)), "big")
    fields = {"p": (frame >> 48, 16), "v": (frame >> 36 & 0xFFF, 12), "t": (frame & 0xFFF, 12)}
    return tuple(uint_to_float(number, limits[f"{name}_min"], limits[f"{name}_max"], bits) for name, (number, bits) in fields.items())


zeros = {kind: sent(kind, kd=1.0) for kind in ("4310", "6006", "10010")}
for kind, (position, velocity, torque) in zeros.items():
    print(f"damiao-motor 1.0.6, {kind}, all zero: {position:.6f} rad, {velocity:.4f} rad/s ({math.degrees(velocity) * 60:.0f} deg a minute), {torque:.4f} N m")
values = [0.001 * k for k in range(-9000, 9001)]
bias = sum(uint_to_float(float_to_uint(value, -10, 10, 12), -10, 10, 12) - value for value in values) / len(values)
fallen = sum(float_to_uint(uint_to_float(n, -12.5, 12.5, 16), -12.5, 12.5, 16) == n - 1 for n in range(2**16))
print(f"mean error of torques of -9 to 9 N m: {bias:.5f} N m, a step is {20 / 4095:.5f}; {fallen} of {2**16} positions fall by a step when they are sent again")
right = abs(zeros["4310"][1] + 0.00733) < 1e-4 and abs(zeros["6006"][1] + 0.01099) < 1e-4 and abs(zeros["10010"][2] + 0.0488) < 1e-3
sys.exit(0 if right and all(value < 0 for row in zeros.values() for value in row) and abs(bias + 10 / 4095) < 1e-4 and fallen == 5016 else 1)
CODE
