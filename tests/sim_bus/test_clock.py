import pytest

from drivers.clock import Clock
from sim_bus.clock import SimClock


def test_time_stands_still_until_told() -> None:
    clock: Clock = SimClock(start_ns=5)
    assert [clock.now_ns(), clock.now_ns()] == [5, 5]
    clock.sleep_until_ns(3)
    assert clock.now_ns() == 5
    clock.sleep_until_ns(9)
    assert clock.now_ns() == 9


def test_listeners_hear_every_move_in_order() -> None:
    clock = SimClock()
    heard: list[tuple[str, int]] = []
    clock.on_advance(lambda t_ns: heard.append(("first", t_ns)))
    clock.on_advance(lambda t_ns: heard.append(("second", t_ns)))
    clock.advance(4)
    clock.advance_to(6)
    assert heard == [("first", 4), ("second", 4), ("first", 6), ("second", 6)]


def test_time_never_goes_back_nor_moves_itself() -> None:
    clock = SimClock(start_ns=10)
    with pytest.raises(ValueError, match="cannot go back"):
        clock.advance_to(9)
    clock.on_advance(lambda t_ns: clock.advance_to(t_ns + 1))
    with pytest.raises(RuntimeError, match="must not move"):
        clock.advance(1)
