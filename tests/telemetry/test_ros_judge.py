"""ROS 1 itself as the judge of bags: its rosbag reads, checks and plays what `convert` writes, and
foretwin reads, and drives on, what its recorder wrote."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import signal
import socket
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.drive import GnssFix
from foretwin.telemetry.logs import LogError, open_log
from foretwin.telemetry.logs.convert import convert
from foretwin.telemetry.logs.write_mcap import create
from tests.contracts.bus_sides import DEADLINE_S
from tests.system.foretwin_command import foretwin
from tests.telemetry.drive_messages import INFO
from tests.telemetry.whole_logs import drive_samples

PYTHON, TOOLS = "/usr/bin/python3", Path("/usr/lib/rosbag")
SIDE = Path(__file__).with_name("rosbag_side.py")
BERLIN = "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt"


def _ros_is_here() -> bool:
    modules = "import rosbag, rospy, sensor_msgs, geometry_msgs, tf2_msgs"
    if not (TOOLS / "play").exists() or not Path(PYTHON).exists():
        return False
    return subprocess.run([PYTHON, "-c", modules], capture_output=True, check=False).returncode == 0


pytestmark = [pytest.mark.judge, pytest.mark.timeout(900)]


@pytest.fixture(scope="module", autouse=True)
def _ros() -> None:
    if not _ros_is_here():
        pytest.skip(
            "no ROS 1 here: apt-get install ros-core python3-rosbag python3-rospy"
            " python3-sensor-msgs python3-geometry-msgs python3-nav-msgs python3-tf2-msgs"
        )


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Two seconds of a drive on every channel, as `convert` writes them."""
    writer = create(tmp_path / "own.mcap", info=INFO)
    for channel, message in drive_samples():
        writer.add(channel, message)
    writer.finish()
    convert(tmp_path / "own.mcap", tmp_path / "own.bag")
    return tmp_path / "own.bag"


def ros(*command: str | Path, check: bool = True) -> str:
    """Run a program of ROS; return what it said."""
    # Its Python must not find ours.
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL"))}
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, timeout=DEADLINE_S,
        env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0 or not check, done.stdout + done.stderr
    return done.stdout + done.stderr


def read_by_ros(bag: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(ros(PYTHON, SIDE, "read", bag).splitlines()[-1])
    return found


def fixes_of(path: Path) -> list[list[float]]:
    return [
        [said.stamp_ns, said.position.lat_deg, said.position.lon_deg]
        for _, said in open_log(path).samples()
        if isinstance(said, GnssFix)
    ]


def test_rosbag_reads_and_checks_every_channel(own: Path) -> None:
    read = read_by_ros(own)

    assert all(read["sums"].values()), read["sums"]
    assert read["ordered"]
    counts = {topic: said["count"] for topic, said in read["topics"].items()}
    asked = Counter(channel for channel, _ in drive_samples())
    assert {f"/foretwin/{channel}" for channel in asked} <= set(counts)
    assert counts["/foretwin/gnss"] == asked["gnss"]
    fixes = hashlib.sha256(json.dumps(fixes_of(own)).encode()).hexdigest()
    assert read["topics"]["/foretwin/gnss"]["fixes"] == fixes
    said = ros("rosbag", "info", own)
    assert "version:     2.0" in said


@pytest.mark.real_data
def test_rosbag_check_knows_the_types_of_ros_as_its_own(data_dir: Path, tmp_path: Path) -> None:
    """It wants no rule: the checksums are ROS's, what differs is comments in the definitions."""
    convert(data_dir / "drive-comma2k19-sf" / "segment40", tmp_path / "comma.bag")
    said = ros("rosbag", "check", tmp_path / "comma.bag")

    assert "missing" not in said
    assert "All rules defined" in said or "No migration needed" in said
    pairs = [
        line.split(":", 1)[1].strip()
        for line in said.splitlines()
        if "From:" in line or "To:" in line
    ]
    assert pairs[0::2] == pairs[1::2]


@contextlib.contextmanager
def roscore(folder: Path) -> Iterator[dict[str, str]]:
    """A ROS master on a free port of this machine alone; gives the environment of its nodes."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL"))}
    environment |= {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(folder / "ros"),
    }  # fmt: skip
    with running(["roscore", "-p", str(port)], environment, folder / "roscore.txt") as master:
        wait_for(["rosnode", "list"], environment, master)
        yield environment


@contextlib.contextmanager
def running(
    command: list[str], environment: dict[str, str], screen: Path
) -> Iterator[subprocess.Popen[bytes]]:
    """A program that is asked to end afterwards, and ended where it does not."""
    with screen.open("wb") as said:
        process = subprocess.Popen(command, env=environment, stdout=said, stderr=said)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(DEADLINE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def wait_for(
    command: list[str], environment: dict[str, str], beside: subprocess.Popen[bytes]
) -> None:
    """Ask again and again until a program succeeds; each asking takes its time."""
    for _ in range(200):
        assert beside.poll() is None
        if (
            subprocess.run(command, env=environment, capture_output=True, check=False).returncode
            == 0
        ):
            return
    raise AssertionError(f"{command} never succeeded")


def played_and_recorded(bag: Path, target: Path, *, flags: list[str], rate: float) -> None:
    """Let ROS play a bag and record what comes, on a master of its own."""
    topics = sorted(read_by_ros(bag)["topics"])
    with roscore(target.parent) as environment:
        record = [str(TOOLS / "record"), "-O", str(target), "-b", "0", *flags, *topics]
        with running(record, environment, target.parent / "record.txt") as recorder:
            wait_for(["sh", "-c", "rosnode list | grep -q record"], environment, recorder)
            play = [
                str(TOOLS / "play"),
                "-q",
                "-d",
                "2",
                "-r",
                str(rate),
                "--wait-for-subscribers",
                str(bag),
            ]
            done = subprocess.run(
                play, env=environment, capture_output=True, timeout=DEADLINE_S, check=False
            )
            assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("compression", ["--lz4", "--bz2"])
def test_what_ros_plays_and_records_is_the_same_drive(
    own: Path, tmp_path: Path, compression: str
) -> None:
    recorded = tmp_path / "recorded.bag"
    played_and_recorded(own, recorded, flags=[compression], rate=0.5)

    assert fixes_of(recorded) == fixes_of(own)
    assert Counter(c for c, _ in open_log(recorded).samples()) == Counter(
        c for c, _ in open_log(own).samples()
    )
    assert open_log(recorded).info.vehicle_id == INFO.vehicle_id


@pytest.mark.real_data
def test_a_drive_goes_on_a_bag_that_ros_recorded(data_dir: Path, tmp_path: Path) -> None:
    bag, recorded = tmp_path / "berlin.bag", tmp_path / "recorded.bag"
    convert(data_dir / BERLIN, bag)
    played_and_recorded(bag, recorded, flags=["--lz4"], rate=25.0)
    assert fixes_of(recorded) == fixes_of(bag)
    assert open_log(recorded).info.end_stamp_ns == open_log(bag).info.end_stamp_ns

    done = foretwin(
        tmp_path / "runs", "--log", str(recorded), "--start", "20", "--end", "40", "--speed", "max",
        "--map", str(data_dir / "osm-berlin-mitte" / "berlin-mitte.osm"), "--futures", "24",
        "--rate", "0.5",
    )  # fmt: skip
    assert done.code == 0, done.screen
    assert done.record()["futures"]["count"] > 0


@pytest.mark.parametrize("compression", ["none", "lz4", "bz2"])
def test_a_robots_bag_is_read_with_its_transforms(tmp_path: Path, compression: str) -> None:
    bag = tmp_path / "robot.bag"
    ros(PYTHON, SIDE, "foreign", bag, compression)
    log = open_log(bag)
    counts = Counter(channel for channel, _ in log.samples())

    assert counts == {"gnss": 200, "imu": 200}
    assert not log.skipped
    assert log.info.body_from_antenna_m == pytest.approx((1.5, 0.0, 1.6))
    assert log.info.start_stamp_ns == 1_772_366_400 * 10**9


def test_a_bag_that_was_cut_off_is_refused_and_read_once_ros_has_mended_it(tmp_path: Path) -> None:
    bag = tmp_path / "robot.bag"
    ros(PYTHON, SIDE, "foreign", bag, "lz4")
    data = bag.read_bytes()
    bag.write_bytes(data[: len(data) * 6 // 10])
    with pytest.raises(
        LogError, match=r"robot\.bag: unreadable bag: .*`rosbag reindex` may mend it"
    ):
        open_log(bag)

    ros("rosbag", "reindex", bag)
    counts = Counter(channel for channel, _ in open_log(bag).samples())
    topics = read_by_ros(bag)["topics"]
    assert 20 < counts["gnss"] < 190
    assert counts["gnss"] == topics["/gps/fix"]["count"]
    assert counts["imu"] == topics["/imu/data"]["count"]
