"""When a round's futures are shown no longer: none follows them, or the car is on open ground."""

from __future__ import annotations

from msgspec.structs import replace

from foretwin.contracts.simulation import ActiveWorld
from foretwin.viewer.danger import ROUND_FOR_S
from tests.viewer import scene
from tests.viewer.shown import Shown, monitor_of, text_of


def test_a_round_that_no_other_follows_is_taken_away() -> None:
    monitor = monitor_of()
    monitor.handle("round", scene.round_at(1.0))
    kept = Shown(monitor.handle("state", scene.state_at(1.0 + ROUND_FOR_S)))
    assert "world/futures" not in kept.paths
    gone = Shown(monitor.handle("state", scene.state_at(1.1 + ROUND_FOR_S)))
    assert gone["world/futures"].is_recursive.as_arrow_array().to_pylist() == [True]
    assert text_of(gone["scenarios/table"]) == "no round for 3 s"
    once = Shown(monitor.handle("state", scene.state_at(1.2 + ROUND_FOR_S)))
    assert "world/futures" not in once.paths
    monitor.handle("round", scene.round_at(5.0))
    monitor.handle("active_world", ActiveWorld(stamp_ns=scene.START_NS, world_id=None))
    assert "world/futures" not in Shown(monitor.handle("state", scene.state_at(9.0))).paths


def test_what_is_said_of_a_late_round_stays_until_the_next() -> None:
    monitor = monitor_of()
    monitor.handle("round", scene.round_at(1.0))
    monitor.handle("round", replace(scene.round_at(1.5), late=True))
    later = Shown(monitor.handle("state", scene.state_at(9.0)))
    assert not {"world/futures", "scenarios/table"} & set(later.paths)


def test_states_that_overtake_rounds_in_a_burst_take_none_away() -> None:
    now_s = [50.0]
    monitor = monitor_of(mono_s=lambda: now_s[0])
    monitor.handle("round", scene.round_at(1.0))
    now_s[0] += ROUND_FOR_S
    ahead = Shown(monitor.handle("state", scene.state_at(9.0)))
    assert "world/futures" not in ahead.paths
    now_s[0] += 0.1
    assert "world/futures" in Shown(monitor.handle("state", scene.state_at(9.1))).paths
