#!/bin/sh
# cyclonedds 11.0.1 (Python): `reader.take()` and `reader.read()` give one sample, the oldest that is there: their argument N is 1 unless it is given. In C++, and in the words of the standard, take without a limit
# gives all. The loop that is usual there, `for sample in reader.take(): newest = sample` once a tick, so falls behind a faster publisher for ever, without a loss that anybody counts.
# Expected: after a tick the newest sample. Seen: five samples of 2 ms each tick of 10 ms, 100 ticks: the newest that the loop has is number 99 of 499, 800 ms old; with N=1000 it is 499. With the reader's default
# history (keep the last one) the other way round: of each five four are dropped, so a log of all samples has a fifth of them. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check cyclonedds==11.0.1
export CYCLONEDDS_URI='<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces></General></Domain></CycloneDDS>'
"$folder/env/bin/python" - <<'CODE'
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import int32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Joint(IdlStruct, typename="Joint"):
    number: int32


TICKS, EACH = 100, 5
participant = DomainParticipant(7)
topic = Topic(participant, "joint", Joint)
all_kept = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepAll)
writer = DataWriter(participant, topic, qos=all_kept)
readers = {"take()": DataReader(participant, topic, qos=all_kept), "take(N=1000)": DataReader(participant, topic, qos=all_kept), "default history": DataReader(participant, topic)}
limits = {"take()": {}, "take(N=1000)": {"N": 1000}, "default history": {"N": 1000}}
time.sleep(0.5)  # until they know each other
newest, heard = dict.fromkeys(readers, -1), dict.fromkeys(readers, 0)
for tick in range(TICKS):
    for k in range(EACH):
        writer.write(Joint(EACH * tick + k))
    for name, reader in readers.items():
        for sample in reader.take(**limits[name]):
            newest[name], heard[name] = sample.number, heard[name] + 1
for name in readers:
    print(f"cyclonedds 11.0.1, {name}: after {TICKS * EACH} samples in {TICKS} ticks the newest is number {newest[name]}, {heard[name]} heard")
right = newest == {"take()": TICKS - 1, "take(N=1000)": TICKS * EACH - 1, "default history": TICKS * EACH - 1}
sys.exit(0 if right and heard == {"take()": TICKS, "take(N=1000)": TICKS * EACH, "default history": TICKS} else 1)
CODE
