from __future__ import annotations

from foretwin.telemetry.ros2.cadence import Cadence


def test_what_is_due_is_due_once_in_its_time():
    now_ns = [100]
    cadence = Cadence(lambda: now_ns[0])
    assert cadence.due("a", 50)
    assert not cadence.due("a", 50)
    assert cadence.due("b", 50)
    now_ns[0] = 149
    assert not cadence.due("a", 50)
    now_ns[0] = 150
    assert cadence.due("a", 50)
