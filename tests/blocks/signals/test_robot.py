"""What an error byte says."""

from aloft.blocks.signals.robot import describe_conditions, is_critical


def test_healthy() -> None:
    assert describe_conditions(0x80) == "" and not is_critical(0x80)


def test_warnings_and_errors() -> None:
    assert describe_conditions(0x82) == "its winding is hotter than temp_limit_low"
    assert not is_critical(0x83)
    assert describe_conditions(0x88 | 0x20) == (
        "its watchdog ran out, or the emergency stop is pressed; "
        "its supply voltage is out of range, or its gate driver failed"
    )
    assert is_critical(0x88)


def test_no_error_byte() -> None:
    assert is_critical(0x00)
    assert describe_conditions(0x02) == "its error byte is 0x02, whose highest bit should be set"
