#!/bin/sh
# ftservo-python-sdk 2.0.1 (FEETECH's own, for STS and SMS servos): these servos hold signed numbers as magnitude and sign (bit 15). `ReadPos`, `ReadSpeed` and the speed of `WriteSpec` know it, the position (and the speed)
# of `WritePosEx`, `SyncWritePosEx` and `RegWritePosEx` go out in two's complement.
# Expected: a position that is written is read again, below zero, too, as servos over several turns and those with a shifted centre have it. Seen: WritePosEx of -100 steps puts 0xFF9C into the goal register, which the
# servo, and the library's own way to read, takes for -32668 steps: eight turns. Nothing is raised, the servo says "no error"; positions from zero on are right.
# The servo here is a memory that answers the protocol's READ and WRITE; its registers are read with the library. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check ftservo-python-sdk==2.0.1 pyserial==3.5
"$folder/env/bin/python" - <<'CODE'
import sys

from scservo_sdk import PortHandler, sms_sts

GOAL_POSITION, GOAL_SPEED, READ, WRITE = 42, 46, 2, 3


class Servo(PortHandler):
    """A port with one servo: its registers, and its answers to READ and WRITE."""

    def __init__(self):
        super().__init__("none")
        self.registers, self.answer = bytearray(128), b""

    def clearPort(self):
        self.answer = b""

    def writePort(self, packet):
        number, length, instruction, first = packet[2:6]
        data = bytes(packet[6 : 3 + length])
        if instruction == WRITE:
            self.registers[first : first + len(data)] = data
        given = bytes(self.registers[first : first + data[0]]) if instruction == READ else b""
        body = bytes([number, len(given) + 2, 0]) + given
        self.answer = b"\xff\xff" + body + bytes([~sum(body) & 0xFF])
        return len(packet)

    def readPort(self, length):
        given, self.answer = self.answer[:length], self.answer[length:]
        return given


def written(position, speed):
    bus = sms_sts(Servo())
    result, error = bus.WritePosEx(1, position, speed, 50)
    goal, speed_held = (bus.scs_tohost(bus.read2ByteTxRx(1, register)[0], 15) for register in (GOAL_POSITION, GOAL_SPEED))
    assert result == error == 0
    return goal, speed_held


def speed_alone(speed):
    bus = sms_sts(Servo())
    bus.WriteSpec(1, speed, 50)
    return bus.scs_tohost(bus.read2ByteTxRx(1, GOAL_SPEED)[0], 15)


found = {position: written(position, 1000)[0] for position in (0, 100, 4095, -1, -100, -4095)}
for position, goal in found.items():
    print(f"ftservo-python-sdk 2.0.1: WritePosEx of {position} steps; the goal register, read as ReadPos does: {goal}")
print(f"speed -500: by WriteSpec {speed_alone(-500)}, by WritePosEx {written(0, -500)[1]}")
wrong = {position: -(position & 0x7FFF) for position in (-1, -100, -4095)}
right = {position: position for position in (0, 100, 4095)}
sys.exit(0 if found == right | wrong and found[-100] == -32668 and speed_alone(-500) == -500 != written(0, -500)[1] else 1)
CODE
