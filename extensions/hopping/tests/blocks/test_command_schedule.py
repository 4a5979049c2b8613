"""``CommandSchedule`` gives each command at its time, when the one before has been taken."""

from aloft.extensions.hopping.blocks.command_schedule import CommandSchedule
from aloft.runtime.loading import checked_file
from aloft.runtime.loading.reading.files import graph_path
from aloft.runtime.testing import BlockBench


def test_a_command_waits_for_its_time_and_for_the_one_before() -> None:
    commands = [{"ahead": 0.1}, {"aside": -0.05, "turn": 1.5, "at": 0.04}]
    bench = BlockBench(CommandSchedule, {"commands": commands}, rate=100.0)
    seen = []
    for tick in range(10):
        bench.set("taken", command=1 if tick >= 6 else 0)
        bench.step()
        command = bench.get("command")
        seen.append((int(command.number), float(command.ahead), float(command.aside)))
    assert seen[0] == (1, 0.1, 0.0)
    assert seen[5] == (1, 0.1, 0.0), "its time has come, but the first has not been taken"
    assert seen[6] == (2, 0.0, -0.05)
    assert seen[9] == seen[6]


def test_a_command_that_is_not_due_waits_though_the_one_before_is_taken() -> None:
    bench = BlockBench(CommandSchedule, {"commands": [{"at": 0.03, "ahead": 0.2}]}, rate=100.0)
    numbers = []
    for _ in range(5):
        bench.step()
        numbers.append(int(bench.get("command").number))
    assert numbers == [0, 0, 0, 1, 1]


def test_the_graph_knows_how_many_there_are() -> None:
    checked = checked_file(
        graph_path("aloft:hopping/steer"), ["commands.commands=[{ahead: 10 cm}]"]
    )
    assert {b.path: b for b in checked.blocks}["score"].params.jumps == 1
