"""Virtual traffic as a process of a drive: it goes on beside the car, and into its futures."""

from __future__ import annotations

from pathlib import Path

from tests.system.foretwin_command import foretwin

COVERS = ("foretwin.sim_worker.virtual_traffic.__main__",)
SHORT = ("--speed", "max", "--futures", "2", "--rate", "0.5", "--end", "6")


def test_in_lock_step_it_is_the_same_traffic_each_time(tmp_path: Path) -> None:
    drives = [
        foretwin(tmp_path / f"runs{number}", *SHORT, "--virtual-traffic", "model")
        for number in range(2)
    ]
    assert [drive.code for drive in drives] == [0, 0], drives[0].screen + drives[1].screen
    first, second = (drive.record() for drive in drives)
    assert first["virtual_traffic"] == second["virtual_traffic"]
    assert first["virtual_traffic"]["rate_hz"] == 20.0
    assert first["virtual_traffic"]["most_users"] > 0
    assert first["futures"]["sha256"] == second["futures"]["sha256"]
    known = drives[0].rows("virtual_road_users")
    assert known == drives[1].rows("virtual_road_users")
    in_futures = {row["name"] for row in drives[0].rows("road_users")}
    assert any(name.startswith("seen virtual-") for name in in_futures)
