"""`python -m tests.telemetry.reader_table`: each reader, the recording it is proved on, and how.

Units, signs and times by what positions did meanwhile (motion_proof.py), and what is said of a copy
in which bytes were blanked and whose end is missing. What is not here is named, and left out.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.telemetry.logs import LogError, open_log
from foretwin.telemetry.logs.convert import convert
from tests.telemetry.motion_proof import MotionProof, Proof

_OWN = Path(__file__).parents[1] / "data" / "comma"
_DATA, _DRIVES = "FORETWIN_DATA", "FORETWIN_DRIVES"
_ON_FOOT_MPS, _IN_CAR_MPS = 0.5, 3.0
_BLANKED_AT, _BLANKED = 0.3, 200
"""Where in a file bytes are blanked, as a share of it, and how many."""
_KEPT = 0.6
_LEAST_MOVING = 80
"""So many tenths of a second in which somebody moves prove something."""


class Reader(NamedTuple):
    """A reader, the recording that it is proved on, below the folder that a variable names, and the
    file of it that is damaged where it is a folder; slower than `slowest_mps` tells no course."""

    name: str
    variable: str
    recording: str
    victim: str = ""
    slowest_mps: float = _IN_CAR_MPS
    declared: str = ""


READERS = (
    Reader("u-blox UBX", _DRIVES, "boulder-walk-ubx/gnss_1730.ubx", slowest_mps=_ON_FOOT_MPS),
    Reader("KITTI oxts", _DRIVES, "kitti-oxts", "oxts/timestamps.txt"),
    Reader("nuScenes CAN", _DRIVES, "nuscenes/can_bus", "scene-0103_pose.json"),
    Reader("GnssLogger", _DRIVES, "gnsslogger-phones/gnss_log_2026_02_25_23_25_37.txt",
           slowest_mps=_ON_FOOT_MPS, declared='forward = "y"\nup = "z"\n'),
    Reader("GnssLogger, in a car", _DRIVES,
           "gnsslogger-drive/gnss_log_2024_04_13_19_53_33.txt"),
    Reader("openpilot, written here", "", "circle--rlog.bz2"),
    Reader("openpilot, one straight minute", _DRIVES, "openpilot-demo/qlog.bz2"),
    Reader("smartLoc", _DATA, "drive-berlin-potsdamer-platz", "Berlin_Potsdamer_Platz_GT.txt"),
    Reader("NMEA, RMC and GGA", _DRIVES,
           "mountain-view-nmea/MTV.Local1.ublox-F9K.20200206-181434.nmea"),
    Reader("NMEA, a telephone's", _DRIVES, "pixel4/2020-05-29-US-MTV-1_Pixel4_chipset.nmea"),
    Reader("ROS 1 bag, of ROS", _DRIVES, "robot-localization-bags/test1.bag",
           slowest_mps=_ON_FOOT_MPS),
    Reader("ROS 1 bag, by convert", _DATA, "drive-berlin-potsdamer-platz"),
)  # fmt: skip


def main() -> int:
    """Print the table."""
    print("| reader | recording | samples | speed against distance | heading against course"
          " | yaw rate against v κ | damaged copy |")  # fmt: skip
    print("|---|---|---|---|---|---|---|")
    for reader in READERS:
        path = path_of(reader)
        if path is None:
            print(f"{reader.name}: {reader.recording} is not in {reader.variable}", file=sys.stderr)
            continue
        with tempfile.TemporaryDirectory() as folder:
            if "by convert" in reader.name:
                convert(path, Path(folder) / "drive.bag")
                path = Path(folder) / "drive.bag"
            print(
                f"| {reader.name} | {' | '.join(proved(reader, path))} | {damage(reader, path)} |"
            )
    return 0


def path_of(reader: Reader) -> Path | None:
    """Return where a recording is, None where it is not here."""
    folder = os.environ.get(reader.variable) if reader.variable else str(_OWN)
    path = Path(folder or "nowhere") / reader.recording
    return path if path.exists() else None


def proved(reader: Reader, path: Path) -> list[str]:
    """Return the cells that say what of a recording goes with its positions."""
    with tempfile.TemporaryDirectory() as folder:
        declaration = None
        if reader.declared:
            declaration = Path(folder) / "declared.toml"
            declaration.write_text(reader.declared, encoding="utf-8")
        log = open_log(path, declaration=declaration)
        shown = MotionProof(log, slowest_mps=reader.slowest_mps)
    found = shown.found
    counts = ", ".join(f"{len(said)} {name}" for name, said in found.items())
    counts += "".join(f"; {count} {reason}" for reason, count in sorted(log.skipped.items()))
    heading = "none told"
    if "heading" in found:
        heading = f"{cell(shown.of_heading())}, {shown.heading_offset_deg():+.2f}° off"
    moved = np.isfinite(shown.course.values).sum() > _LEAST_MOVING
    rate = next((channel for channel in ("imu", "heading") if tells_rate(shown, channel)), None)
    return [
        reader.recording,
        counts,
        *([cell(shown.of_speed()) if "speed" in found else "none told", heading] if moved else []),
        *(["none told" if rate is None else cell(shown.of_yaw_rate(rate))] if moved else []),
        *([] if moved else ["nobody moved"] * 3),
    ]


def tells_rate(shown: MotionProof, channel: str) -> bool:
    """Tell whether a channel has the yaw rate."""
    said = shown.found.get(channel, [])
    return bool(said) and (channel == "imu" or said[0].yaw_rate_radps is not None)


def cell(proof: Proof) -> str:
    """Return a proof in words."""
    return (
        f"r = {proof.correlation:.4f}, slope {proof.slope:.3f}, {proof.lag_s:+.2f} s late,"
        f" {proof.seconds:.0f} s"
    )


def damage(reader: Reader, path: Path) -> str:
    """Return what is said of a copy whose middle is blanked and whose end is missing."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        if path.is_dir():
            shutil.copytree(path, copy)
            for tables in path.parent.glob("v1.0-*"):
                shutil.copytree(tables, Path(folder) / tables.name)
        else:
            shutil.copy(path, copy)
        victim = copy / reader.victim if copy.is_dir() else copy
        data = bytearray(victim.read_bytes())
        middle = round(_BLANKED_AT * len(data))
        data[middle : middle + _BLANKED] = bytes(_BLANKED)
        victim.write_bytes(data[: round(_KEPT * len(data))])
        try:
            log = open_log(copy)
            read = sum(1 for _ in log.samples())
        except LogError as error:
            return "refused: " + str(error).replace(f"{folder}/", "")
        left = ", ".join(f"{count} {reason}" for reason, count in sorted(log.skipped.items()))
        return f"{read} samples read; left out: {left or 'nothing'}"


if __name__ == "__main__":
    sys.exit(main())
