"""Real drives on which the twin's trust in itself is measured, and what each is for.

The given ones lie in the folder named by FORETWIN_DATA, further public ones in the one named by
FORETWIN_DRIVES, under the names of `_MORE`; those that are not there are left out. Nobody looks at
those that are held out while a number is chosen.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

from foretwin.telemetry.logs import Log, open_log
from tests.trust import other_receivers

Split = Literal["tuning", "held_out"]
DECLARATIONS = Path(__file__).parents[1] / "data" / "declarations"


class RealDrive(NamedTuple):
    """A drive: what the car sends, and the log whose positions are the reference for it.

    `position_std_m` is the reference's white noise, for the smoother. With `true_heading` its
    heading was measured with its positions, and is the truth instead of the course, with
    `gyro_heading` its turning was.
    """

    name: str
    split: Split
    log: Callable[[], Log]
    reference: Callable[[], Log]
    position_std_m: float = 0.02
    true_heading: bool = False
    gyro_heading: bool = False


class _Public(NamedTuple):
    """A public drive: where it lies in its folder, and what its positions are good for."""

    path: str
    split: Split
    position_std_m: float = 0.02
    true_heading: bool = False
    reference: str | None = None


_KITTI_RAW: tuple[tuple[str, str, Split], ...] = (
    ("hill-0086", "2011_09_26_drive_0086", "tuning"),
    ("hill-0064", "2011_09_26_drive_0064", "tuning"),
    ("hill-0034", "2011_09_30_drive_0034", "tuning"),
    ("hill-0033", "2011_09_30_drive_0033", "held_out"),
    ("hill-0087", "2011_09_26_drive_0087", "held_out"),
    ("motorway-0042", "2011_10_03_drive_0042", "tuning"),
    ("flat-0027", "2011_09_30_drive_0027", "held_out"),
)
"""Names of folders whose `oxts` is a drive with inertia, up and down the hills or not."""

_MORE = {
    "chemnitz": _Public("chemnitz-city/Chemnitz_GT.txt", "tuning"),
    "boulder": _Public("boulder-rtk/boulder.csv", "tuning"),
    "boulder-no-std": _Public("boulder-rtk/boulder_no_std.csv", "tuning"),
    "kitti-00": _Public("kitti-00/kitti00.csv", "tuning"),
    "kitti-05": _Public("kitti-05/kitti05.csv", "tuning"),
    **{
        f"kitti-{number}": _Public(f"kitti-{number}/kitti{number}.csv", "held_out")
        for number in ("02", "06", "07", "08", "09", "10")
    },
    "main-tower": _Public("frankfurt-main-tower/Frankfurt_Main_Tower_GT.txt", "held_out"),
    "boreas-september": _Public(
        "boreas-2021-09-02/lidar_poses.csv", "held_out", 0.01, true_heading=True
    ),
    "wuhan": _Public("wuhan-gins/wuhan.csv", "held_out"),
    "austin-phone": _Public(
        "austin-bmw/austin.csv", "held_out", 1.0, reference="austin-bmw/austin_car_gps.csv"
    ),
    "austin-car": _Public("austin-bmw/austin_car_gps.csv", "held_out", 1.0),
    **{
        f"kitti-{drive}": _Public(f"kitti-raw/{folder}", split, true_heading=True)
        for drive, folder, split in _KITTI_RAW
    },
}
"""libRSF's Chemnitz City and smartLoc, rtklibexplorer's drive_0708 in Boulder,
KITTI's odometry poses and its OXTS recordings, Boreas, i2Nav's awesome-gins-datasets,
smartphone_driving_dataset of Austin."""


_ONCE_A_SECOND = ("chemnitz", "boulder", "boulder-no-std")
"""Drives that stand in the list once more, as a receiver of one fix a second had sent them."""


def all_drives(split: Split | None = None) -> list[RealDrive]:
    """Return the drives of both folders that are there, or those of one split."""
    found: list[RealDrive] = []
    if "FORETWIN_DATA" in os.environ:
        found += given_drives(Path(os.environ["FORETWIN_DATA"]))
    if "FORETWIN_DRIVES" in os.environ:
        found += further_drives(Path(os.environ["FORETWIN_DRIVES"]))
    return [drive for drive in found if split in (None, drive.split)]


def given_drives(data: Path) -> list[RealDrive]:
    """Return the drives in the folder of real data, and others that its recordings hold."""
    return list(_given(data))


def _given(data: Path) -> Iterator[RealDrive]:
    smartloc = {
        "gendarmenmarkt": "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt",
        "potsdamer-platz": "drive-berlin-potsdamer-platz/Berlin_Potsdamer_Platz_GT.txt",
        "westend": "drive-frankfurt-westend/Frankfurt_Westend_Tower_GT.txt",
    }
    for name, path in smartloc.items():
        yield _alone(name, partial(open_log, data / path))
    truth = partial(open_log, data / smartloc["potsdamer-platz"])
    potsdamer = data / "drive-berlin-potsdamer-platz"
    odometry = partial(open_log, potsdamer)
    yield RealDrive("potsdamer-platz-odometry", "tuning", odometry, truth)
    measured = partial(
        other_receivers.with_pseudoranges,
        odometry,
        potsdamer / "Berlin_Potsdamer_Platz_Input.txt.gz",
    )
    yield RealDrive("potsdamer-platz-pseudoranges", "tuning", measured, truth)
    boreas = partial(
        open_log,
        next((data / "drive-boreas-toronto").glob("*.csv")),
        declaration=DECLARATIONS / "boreas.csv.toml",
    )
    yield RealDrive("boreas", "tuning", boreas, boreas, 0.01, true_heading=True)
    positions = partial(other_receivers.positions_alone, boreas)
    yield RealDrive("boreas-positions", "tuning", positions, boreas, 0.01)
    yield RealDrive(
        "boreas-1hz", "tuning", partial(other_receivers.once_a_second, boreas), boreas, 0.01
    )
    segment = data / "drive-comma2k19-sf" / "segment40"
    pose = partial(open_log, segment)
    yield _alone("comma2k19", pose, position_std_m=0.05)
    ublox = partial(other_receivers.with_ublox, pose, segment)
    yield RealDrive("comma2k19-ublox", "tuning", ublox, pose, 0.05)
    for name, file in (
        ("dresden-1", "2014-03-26-000-Data.csv"),
        ("dresden-2", "2014-02-14-002-Data.csv"),
    ):
        dresden = partial(
            open_log,
            data / "drive-dresden-imu" / file,
            declaration=DECLARATIONS / "dresden.csv.toml",
        )
        yield RealDrive(name, "tuning", dresden, dresden, 1.0, gyro_heading=True)
        even = partial(
            other_receivers.by_receivers_clock, dresden, data / "drive-dresden-imu" / file
        )
        yield RealDrive(f"{name}-own-clock", "tuning", even, even, 1.0, gyro_heading=True)
    for trial in ("3", "4", "5", "13_c", "14_c", "15_c"):
        file_of = data / "traffic-mcity-rtk" / "gts" / f"gps_data_{trial}.json"
        yield _alone(f"mcity-{trial}", partial(other_receivers.mcity_car, file_of))


def further_drives(folder: Path) -> list[RealDrive]:
    """Return the further public drives that lie in the folder."""
    found = []
    for name, one in _MORE.items():
        if (folder / one.path).exists():
            log = partial(open_log, folder / one.path)
            reference = partial(open_log, folder / (one.reference or one.path))
            found.append(
                RealDrive(name, one.split, log, reference, one.position_std_m, one.true_heading)
            )
            if name in _ONCE_A_SECOND:
                slow = partial(other_receivers.once_a_second, log)
                found.append(
                    RealDrive(f"{name}-1hz", one.split, slow, reference, one.position_std_m)
                )
            if one.path.startswith("kitti-raw/"):
                seldom = partial(other_receivers.once_a_second, log, beside=("imu",))
                found.append(
                    RealDrive(f"{name}-1hz-imu", one.split, seldom, reference, true_heading=True)
                )
    return found


def _alone(name: str, log: Callable[[], Log], *, position_std_m: float = 0.02) -> RealDrive:
    return RealDrive(name, "tuning", log, log, position_std_m)
