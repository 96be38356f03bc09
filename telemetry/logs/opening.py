"""Choosing the reader of a recorded drive by what the file is."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.drive import RoadUsers
from foretwin.contracts.segments import DRIVE_FILE, segments_of
from foretwin.telemetry.logs.comma2k19 import is_comma2k19, open_comma2k19
from foretwin.telemetry.logs.comma_log import is_comma_log, open_comma_log
from foretwin.telemetry.logs.geojson import open_geojson
from foretwin.telemetry.logs.gnss_logger import is_gnss_logger, open_gnss_logger
from foretwin.telemetry.logs.gpx import open_gpx
from foretwin.telemetry.logs.kitti_oxts import is_kitti_oxts, open_kitti_oxts
from foretwin.telemetry.logs.log import Log, LogError, check_undeclared
from foretwin.telemetry.logs.mcity import is_mcity, read_mcity
from foretwin.telemetry.logs.nmea import is_nmea, open_nmea
from foretwin.telemetry.logs.nuscenes_can import is_nuscenes_can, open_nuscenes_can, scenes_in
from foretwin.telemetry.logs.road_users import (
    LONGEST_GAP_S,
    RoadUserLog,
    detections_of,
    log_of_detections,
)
from foretwin.telemetry.logs.smartloc import is_smartloc, open_smartloc, smartloc_texts
from foretwin.telemetry.logs.ubx import is_ubx, open_ubx

TABLES = (".csv", ".tsv", ".parquet")
"""Their columns mean what a declaration says."""
BAG_MAGIC, SQLITE_MAGIC, ZIP_MAGIC = b"#ROSBAG V", b"SQLite format 3\0", b"PK\x03\x04"

KINDS = (
    "MCAP with ROS messages (.mcap), ROS 1 bag (.bag), ROS 2 bag (folder or .db3), "
    "NMEA-0183 (.nmea), u-blox UBX (.ubx), CSV, TSV or Parquet with a declaration, "
    "GPX (.gpx), GeoJSON lines (.geojson, .json), KITTI oxts folder or zip, GnssLogger text, "
    "nuScenes CAN bus JSON (scene-0001_pose.json), "
    "smartLoc text or folder (point3, odom3), comma2k19 segment folder, "
    "openpilot rlog or qlog (plain, .bz2, .zst)"
)


def open_log(path: Path, *, declaration: Path | None = None) -> Log:
    """Open a recorded drive, choosing the reader by content, then by name.

    `declaration` is the TOML that declares a CSV's columns, or what a recording with ROS messages
    does not say of itself; without it `NAME.toml` beside the file. Raises FileNotFoundError for a
    missing file and LogError for one that is no log, or that has no use for a declaration.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if declaration is not None and not declaration.exists():
        raise FileNotFoundError(f"declaration {declaration}: no such file")
    if path.is_dir():
        if is_comma2k19(path):
            check_undeclared(path, declaration, "a comma2k19 segment")
            return open_comma2k19(path)
        if (path / "metadata.yaml").is_file():
            from foretwin.telemetry.logs.ros_log import open_bag

            return open_bag(path, declaration=declaration)
        if is_kitti_oxts(path):
            check_undeclared(path, declaration, "KITTI's oxts")
            return open_kitti_oxts(path)
        if scenes_in(path):
            return open_nuscenes_can(path, declaration=declaration)
        if smartloc_texts(path):
            check_undeclared(path, declaration, "a smartLoc drive")
            return open_smartloc(path)
        if recorded := segments_of(path / DRIVE_FILE):
            raise LogError(f"{path}: the folder of a run; its recorded drive is {recorded[0]}")
        raise LogError(
            f"{path}: a folder that is no comma2k19 segment, no drive of KITTI, nuScenes or"
            f" smartLoc and no ROS 2 bag (it has no metadata.yaml); known logs: {KINDS}"
        )
    head = _head(path)
    if not head:
        raise LogError(f"{path}: the file is empty")
    suffix = path.suffix.lower()
    if is_comma_log(path):
        check_undeclared(path, declaration, "openpilot's log")
        return open_comma_log(path)
    if head.startswith(b"\x89MCAP0") or suffix == ".mcap":
        from foretwin.telemetry.logs.ros_log import open_mcap

        return open_mcap(path, declaration=declaration)
    if suffix == ".bag" and not head.startswith(BAG_MAGIC):
        raise LogError(f"{path}: no ROS 1 bag: it does not begin with {BAG_MAGIC.decode()}")
    if head.startswith((BAG_MAGIC, SQLITE_MAGIC)) or suffix in (".bag", ".db3"):
        from foretwin.telemetry.logs.ros_log import open_bag

        return open_bag(path, declaration=declaration)
    if head.startswith(ZIP_MAGIC):
        return _open_zip(path, declaration)
    if suffix == ".ubx" or is_ubx(head):
        return _open_receiver(path, declaration)
    text = head.decode("utf-8", errors="replace").lstrip("\ufeff \t\r\n")
    if suffix != ".csv" and is_nmea(text):
        return open_nmea(path, declaration=declaration)
    if is_smartloc(text):
        check_undeclared(path, declaration, "smartLoc's text")
        return open_smartloc(path)
    if is_gnss_logger(text):
        return open_gnss_logger(path, declaration=declaration)
    if is_nuscenes_can(path):
        return open_nuscenes_can(path, declaration=declaration)
    if suffix == ".gpx" or (text.startswith("<") and "<gpx" in text):
        check_undeclared(path, declaration, "a GPX file")
        return open_gpx(path)
    if suffix in (".geojson", ".json") or text.startswith("{"):
        check_undeclared(path, declaration, "a GeoJSON file")
        return open_geojson(path)
    if suffix in TABLES or declaration is not None or path.with_name(path.name + ".toml").is_file():
        from foretwin.telemetry.logs.csv_table import open_csv

        return open_csv(path, declaration=declaration)
    raise LogError(f"{path}: no known log; known are {KINDS}")


def _open_receiver(path: Path, declaration: Path | None) -> Log:
    """Open a log of u-blox's, which may hold NMEA beside UBX, or for positions alone."""
    try:
        log = open_ubx(path)
    except LogError as no_positions:
        try:
            return open_nmea(path, declaration=declaration)
        except LogError:
            raise no_positions from None
    check_undeclared(path, declaration, "a UBX file")
    return log


def _open_zip(path: Path, declaration: Path | None) -> Log:
    if not is_kitti_oxts(path):
        raise LogError(f"{path}: a zip without a folder oxts (KITTI's); unpack other recordings")
    check_undeclared(path, declaration, "KITTI's oxts")
    return open_kitti_oxts(path)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(4096)


def open_road_users(path: Path, *, longest_gap_s: float = LONGEST_GAP_S) -> RoadUserLog:
    """Read the road users of a log: Mcity's JSON, or what the car of any other log detected.

    Raises FileNotFoundError for a missing file and LogError for one without road users.
    """
    path = Path(path)
    if path.is_file() and is_mcity(_head(path).decode("utf-8", errors="replace")):
        found = log_of_detections(read_mcity(path), longest_gap_s=longest_gap_s)
    else:
        log = open_log(path)
        found = log_of_detections(
            (detections_of(said) for _, said in log.samples() if isinstance(said, RoadUsers)),
            longest_gap_s=longest_gap_s,
        )
    if not found.tracks:
        raise LogError(f"{path}: no road users in it (a car's own drive is no such log)")
    return found
