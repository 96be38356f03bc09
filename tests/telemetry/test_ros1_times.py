"""Times in bags of ROS 1, which knows no time 0, and of recorders with clocks of their own."""

from __future__ import annotations

from pathlib import Path

from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1

from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.convert import convert


def test_a_ros1_bag_has_no_time_zero_which_ros_does_not_play(tmp_path: Path) -> None:
    path = tmp_path / "zero.txt"
    path.write_text("".join(f"point3 {t} 3784144.3 901246.3 5037714.1\n" for t in (0.0, 0.5)))
    convert(path, tmp_path / "zero.bag")

    with Reader1(tmp_path / "zero.bag") as reader:
        assert min(stamp_ns for _, stamp_ns, _ in reader.messages()) == 1
    log = open_log(tmp_path / "zero.bag")
    assert [message.stamp_ns for _, message in log.samples()] == [0, 500_000_000]  # type: ignore[attr-defined]
    assert log.info.end_stamp_ns == 500_000_000


def test_the_end_is_the_vehicles_where_another_recorder_stamped_by_its_own_clock(
    tmp_path: Path,
) -> None:
    path = tmp_path / "zero.txt"
    path.write_text("".join(f"point3 {t} 3784144.3 901246.3 5037714.1\n" for t in (0.0, 0.5)))
    convert(path, tmp_path / "own.bag")
    with Reader1(tmp_path / "own.bag") as reader, Writer1(tmp_path / "again.bag") as writer:
        again = {
            one.topic: writer.add_connection(
                one.topic, one.msgtype, msgdef=one.msgdef.data, md5sum=one.digest
            )
            for one in reader.connections
        }
        for one, stamp_ns, data in reader.messages():
            writer.write(again[one.topic], stamp_ns + 1_772_366_400 * 10**9, data)
    assert open_log(tmp_path / "again.bag").info.end_stamp_ns == 500_000_000
