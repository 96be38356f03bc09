"""What became of what came, in a file that outlives its writer."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.tally import Tally, read_tally, tally_file, write_tally


def test_who_goes_on_takes_what_waited_and_nothing_twice() -> None:
    tally = Tally()
    names = {seq: tally.numbers.take("imu", seq, sender=7) for seq in (0, 1, 2, 5, 6, 7, 8)}
    for _ in (0, 1, 6):
        tally.settle("recorded", "imu")
    waiting = [seq for seq in names if seq not in (0, 1, 6)]
    left = tally.without({str(names[0]): waiting, "another": [3]})

    assert left.numbers.missing["imu"] == 2 + len(waiting)
    assert tally.numbers.missing["imu"] == 2, "as it was"
    again = [left.numbers.take("imu", seq, sender=7) is not None for seq in range(10)]
    assert again == [False, False, True, True, True, True, False, True, True, True]


def test_a_tally_survives_and_takes_the_room_that_it_has(tmp_path: Path) -> None:
    path = tally_file(tmp_path / "drive.mcap")
    assert read_tally(path) is None
    tally = Tally()
    for seq in (0, 3, 4):
        tally.numbers.take("imu", seq, sender=7)
    assert [tally.settle("recorded", "imu") for _ in range(2)] == [1, 2]
    tally.settle("unwritten", "imu")
    write_tally(tally, path)
    assert path.name == "drive.tally.json"
    assert path.stat().st_size == 16_384
    assert path.stat().st_mode & 0o111 == 0
    assert read_tally(path) == tally
    write_tally(Tally(), path)
    assert read_tally(path) == Tally()
    path.write_bytes(b"{")
    assert read_tally(path) is None
