#!/bin/sh
# feetech-servo-sdk 1.0.0: `PacketHandler(0)` is for STS and SMS servos (low byte first), `PacketHandler(1)` for SCS servos (high byte first). The order is not kept in the handler but once for the
# whole module, so the handler that was made last decides for all of them.
# Expected: each handler has its own order, as they are separate objects and every call names handler and port. Seen: after a gripper's PacketHandler(1) is made, the arm's handler
# sends 2048 steps (its centre) as 0x0008, 8 steps, and reads 2048 as 8; 1000 becomes 59395. Checksums are right and nothing is raised: an arm of mixed servos runs into its stops.
# ftservo-python-sdk 2.0.1 of the same maker keeps the order in each handler. The servo here is a memory that answers the protocol's READ and WRITE. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check feetech-servo-sdk==1.0.0 pyserial==3.5
"$folder/env/bin/python" - <<'CODE'
import sys

from scservo_sdk import PacketHandler, PortHandler

GOAL, PRESENT, READ, WRITE = 42, 56, 2, 3


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


def goal_and_present(handler, steps):
    """What an STS servo, which has its low byte first, holds as its goal, and what is read of it while it stands there."""
    port = Servo()
    result, error = handler.write2ByteTxRx(port, 1, GOAL, steps)
    assert result == error == 0
    port.registers[PRESENT : PRESENT + 2] = steps.to_bytes(2, "little")
    return int.from_bytes(port.registers[GOAL : GOAL + 2], "little"), handler.read2ByteTxRx(port, 1, PRESENT)[0]


arm = PacketHandler(0)
before = {steps: goal_and_present(arm, steps) for steps in (2048, 1000)}
gripper = PacketHandler(1)
after = {steps: goal_and_present(arm, steps) for steps in (2048, 1000)}
for steps in before:
    print(f"feetech-servo-sdk 1.0.0: {steps} steps by the arm's handler, (goal, read): {before[steps]}; after the gripper's handler was made: {after[steps]}")
sys.exit(0 if before == {2048: (2048, 2048), 1000: (1000, 1000)} and after == {2048: (8, 8), 1000: (59395, 59395)} else 1)
CODE
