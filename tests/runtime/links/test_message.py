"""Messages of links: what is sent arrives as it was, and what is not whole is refused."""

from pathlib import Path

import numpy as np
import pytest

from aloft.runtime.language.layout import Layout
from aloft.runtime.links.message import (
    HEADER,
    DamagedMessageError,
    MessageReader,
    MessageWriter,
    schema_of,
    spans_of,
)
from aloft.runtime.loading import checked_file
from aloft.runtime.placement.placed import MachineLink, PlacedGraph, split_over_machines
from aloft.runtime.running.memory import Memory

RUN = b"12345678"


@pytest.fixture(scope="module")
def placed() -> PlacedGraph:
    return split_over_machines(
        checked_file(Path(__file__).parents[3] / "graphs" / "machines" / "jump_two.yaml")
    )


@pytest.fixture(scope="module")
def layout(placed: PlacedGraph) -> Layout:
    return Memory(placed.graph.blocks, placed.graph.robot).bus.layout


def ends(
    link: MachineLink, layout: Layout
) -> tuple[MessageWriter, MessageReader, np.ndarray, np.ndarray]:
    here = np.random.default_rng(1).integers(0, 256, layout.size).astype(np.uint8)
    there = np.zeros(layout.size, np.uint8)
    reader = MessageReader(link, layout, there.data)
    reader.run = RUN
    return MessageWriter(link, layout, here.data, RUN), reader, here, there


def test_exactly_the_fields_of_each_link_arrive(placed: PlacedGraph, layout: Layout) -> None:
    for link in placed.links:
        writer, reader, here, there = ends(link, layout)
        message = reader.read(writer.write(tick=812, time=99))
        assert (message.sequence, message.tick, message.time) == (0, 812, 99)
        reader.write_outputs(message.payload)
        expected = np.zeros(layout.size, np.uint8)
        for field in link.fields:
            first, last = layout.byte_range(field.name)
            expected[first:last] = here[first:last]
        np.testing.assert_array_equal(there, expected)


def test_messages_are_counted(placed: PlacedGraph, layout: Layout) -> None:
    writer, reader, *_ = ends(placed.links[0], layout)
    assert [reader.read(writer.write(k, 0)).sequence for k in range(3)] == [0, 1, 2]


def test_a_whole_port_is_one_copy_for_each_type_of_its_fields(
    placed: PlacedGraph, layout: Layout
) -> None:
    copies = {link.source: len(spans_of(link, layout)) for link in placed.links}
    types = {link.source: len({field.dtype for field in link.fields}) for link in placed.links}
    for link in placed.links:
        sent = sum(span.size for span in spans_of(link, layout))
        assert sent == link.payload
    assert copies["wbc"] == types["wbc"]


@pytest.mark.parametrize("place_", range(0, HEADER + 4, 3))
def test_one_changed_byte_is_found(placed: PlacedGraph, layout: Layout, place_: int) -> None:
    writer, reader, *_ = ends(placed.links[0], layout)
    data = bytearray(writer.write(1, 1))
    data[place_] ^= 0x10
    with pytest.raises(DamagedMessageError, match="its checksum is wrong"):
        reader.read(bytes(data))


def test_cut_foreign_and_old_messages_are_refused(placed: PlacedGraph, layout: Layout) -> None:
    link, other = placed.links[0], placed.links[1]
    writer, reader, *_ = ends(link, layout)
    data = writer.write(1, 1)
    with pytest.raises(DamagedMessageError, match=f"it has 10 bytes, expected {len(data)}"):
        reader.read(data[:10])
    with pytest.raises(DamagedMessageError, match="bytes, expected"):
        reader.read(ends(other, layout)[0].write(1, 1))
    reader.run = b"another!"
    with pytest.raises(DamagedMessageError, match="it is of run 3132333435363738, expected"):
        reader.read(data)


def test_another_schema_is_refused(placed: PlacedGraph, layout: Layout) -> None:
    link = placed.links[0]
    field = link.fields[0]
    renamed = type(field)(field.name, field.dtype, field.shape, "rad", field.frame)
    other = type(link)(link.source, link.sender, link.receiver, (renamed, *link.fields[1:]),
                       link.readers, link.rate_hz)  # fmt: skip
    assert schema_of(other) != schema_of(link)
    _, reader, *_ = ends(link, layout)
    with pytest.raises(DamagedMessageError, match="its schema is"):
        reader.read(ends(other, layout)[0].write(1, 1))


def test_random_bytes_never_pass_and_raise_nothing_else(
    placed: PlacedGraph, layout: Layout
) -> None:
    writer, reader, *_ = ends(placed.links[0], layout)
    rng = np.random.default_rng(3)
    length = len(writer.write(0, 0))
    for _ in range(2000):
        size = int(rng.integers(0, 2 * length)) if rng.random() < 0.5 else length
        with pytest.raises(DamagedMessageError):
            reader.read(rng.bytes(size))
